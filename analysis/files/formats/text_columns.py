"""Read text of numbers: lines, words, columns by name, and the selected frame."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np

from ...arrays import Floats
from ...errors import PackingFileError
from ..plain_file import open_text

NUMBER_WORDS = {"true": 1.0, "false": 0.0, "t": 1.0, "f": 0.0}
"""Words that stand for numbers."""


def lines_of(path: Path) -> list[str]:
    """The lines of a text file."""
    try:
        with open_text(path) as stream:
            return stream.read().splitlines()
    except (OSError, EOFError, zlib.error) as error:
        raise PackingFileError(f"{path} cannot be read: {getattr(error, 'strerror', None) or error}.") from error
    except UnicodeDecodeError as error:
        raise PackingFileError(f"{path} is no text: {error}.") from error


def number_of(word: str, where: object) -> float:
    """A word as a number."""
    try:
        return float(word)
    except ValueError:
        if word.strip().lower() in NUMBER_WORDS:
            return NUMBER_WORDS[word.strip().lower()]
        raise PackingFileError(f"{where}: {word.strip()!r} is no number.") from None


def numbers_in(text: str, where: object) -> list[float]:
    """The numbers of a text, with blanks between them."""
    return [number_of(word, where) for word in text.split()]


def strip_comments(lines: Iterable[str], first: int) -> Iterator[tuple[int, list[str]]]:
    """Lines by number, as the words before a #; lines without a word are left out."""
    for number, line in enumerate(lines, first):
        words = line.partition("#")[0].split()
        if words:
            yield number, words


def columns_of(
    path: Path, lines: Iterable[tuple[int, list[str]]], names: Sequence[str | None], wanted: str, *, more: bool = True
) -> dict[str, Floats]:
    """The columns of some lines by name.

    Parameters
    ----------
    lines : iterable of (int, list of str)
        Number and words of each line.
    names : sequence of str or None
        Names of the columns; None for one that is skipped.
    wanted : str
        What was wanted, for a line of another length.
    more : bool
        Whether a line may have more columns than there are names.
    """
    rows = []
    for number, words in lines:
        if len(words) < len(names) or not (more or len(words) == len(names)):
            raise PackingFileError(f"{path}, line {number}: it has {len(words)} columns, and {wanted}.")
        named = (word for word, name in zip(words, names, strict=False) if name is not None)
        rows.append([number_of(word, f"{path}, line {number}") for word in named])
    found = [name for name in names if name is not None]
    return dict(zip(found, np.array(rows).reshape(-1, len(found)).T, strict=True))


def choose_frame(path: Path, counts: Sequence[int], frame: int | None) -> int:
    """The number of the chosen frame, from 0; by default the last frame, if all frames have as many disks."""
    if frame is None and len(set(counts)) > 1:
        raise PackingFileError(
            f"{path} has frames with {min(counts)} and {max(counts)} disks: choose one with --frame."
        )
    wanted = -1 if frame is None else frame
    if not -len(counts) <= wanted < len(counts):
        raise PackingFileError(f"{path} has {len(counts)} frames; there is no --frame {wanted}.")
    return wanted % len(counts)


def block_of_frame(
    path: Path, lines: list[str], head: int, count_at: Callable[[int], int], frame: int | None, format_: str
) -> tuple[int, int]:
    """First line of a frame and its number of disks, in a file of consecutive frames.

    Parameters
    ----------
    head : int
        Lines before the disks of each frame.
    count_at : callable
        Number of disks of the frame that begins at a line, counted from 0.
    frame : int, optional
        As of `choose_frame`.
    format_ : str
        What such files are called.
    """
    end = max((number for number, line in enumerate(lines, 1) if line.strip()), default=0)
    counts: dict[int, int] = {}
    at = 0
    while at < end:
        counts[at] = count_at(at)
        at += head + counts[at]
    if not counts or at > len(lines):
        raise PackingFileError(f"{path} is no complete {format_} file: it breaks off.")
    begin = list(counts)[choose_frame(path, list(counts.values()), frame)]
    return begin, counts[begin]
