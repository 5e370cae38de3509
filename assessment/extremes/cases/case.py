"""A stiff or extreme case: an input and the outcome."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import isfinite
from typing import Any, Literal

Status = Literal["holds", "refused", "fails"]


@dataclass(frozen=True)
class Outcome:
    """The outcome of a case.

    Attributes
    ----------
    status : {"holds", "refused", "fails"}
        It met its criterion; it was refused in one sentence, as it should be; or neither.
    figure : float or None
        What was measured; None for a refusal.
    bound : float or None
        What the figure must not exceed.
    says : str
        The criterion and its reason, or the sentence of the refusal.
    """

    status: Status
    figure: float | None
    bound: float | None
    says: str


@dataclass(frozen=True)
class Case:
    """Something to try.

    Attributes
    ----------
    group : str
        The kind of trouble.
    name : str
        What is tried.
    run : callable
        Tries it; collective over the ranks, with the same outcome on each.
    quick : bool
        Whether it belongs to the small part of the suite.
    """

    group: str
    name: str
    run: Callable[[], Outcome]
    quick: bool = False

    def outcome(self) -> Outcome:
        """Run the case. Any error is a failure of this case alone, unless the ranks have lost each other."""
        try:
            return self.run()
        except Exception as error:
            if getattr(error, "one_rank", False):
                raise
            lines = str(error).strip().splitlines()
            return failed_outcome(f"{type(error).__name__}: {lines[0] if lines else 'no reason given'}")


def failed_outcome(says: str) -> Outcome:
    """The outcome of something that went wrong otherwise than by its figure."""
    return Outcome("fails", None, None, says)


def measured_outcome(figure: float, bound: float, says: str) -> Outcome:
    """The outcome of a measurement: it holds if the figure is a number within its bound."""
    figure = float(figure)
    if not isfinite(figure):
        return Outcome("fails", None, float(bound), f"not a number; {says}")
    return Outcome("holds" if figure <= bound else "fails", figure, float(bound), says)


def refusal(sentence: str, words: str) -> Outcome:
    """The outcome of something that must not be done: refused if the sentence is one line and says the words."""
    sentence = sentence.strip()
    if words in sentence and "\n" not in sentence and "Traceback" not in sentence:
        return Outcome("refused", None, None, sentence)
    return failed_outcome(sentence or f"nothing was said, expected: {words}")


def refused_outcome(attempt: Callable[[], Any], words: str, error: type[Exception] = ValueError) -> Outcome:
    """The outcome of an attempt that must raise an error of this type."""
    try:
        attempt()
    except error as reason:
        return refusal(str(reason), words)
    return failed_outcome(f"it was not refused, expected: {words}")
