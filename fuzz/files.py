"""Damaged run.h5: flipped bytes, truncations, zeroed blocks.

A damaged file is refused in one sentence, for reading and for appending, or nothing has changed. Each is opened in a
process of its own, so that a crash or a hang is seen.
"""

import random
from collections.abc import Callable, Iterator
from multiprocessing import get_context
from pathlib import Path
from typing import Literal

import numpy as np

from faultgouge.analysis import Contacts, MindlinLaw, Packing, PackingFileError, RunFile

LONGEST = 20.0
"""Seconds that opening a file may take."""

FORKED = get_context("fork")


def sound_file(path: Path) -> None:
    """A run of some disks with a few equilibria, a series and a checkpoint."""
    rng = np.random.default_rng(0)
    disks = 40
    with RunFile.create(path, _packing(rng, disks, 0), {"scene": "{}", "seed": 7}) as run:
        for frame in range(6):
            run.append(_packing(np.random.default_rng(0), disks, frame), floor=1e-11, evaluations=frame)
        run.append_series("undamped", time=np.arange(300.0), msd=rng.random(300))
        run.put_checkpoint(step=np.int64(3), x=rng.random((disks, 3)))


def _packing(rng: np.random.Generator, disks: int, frame: int) -> Packing:
    position = np.column_stack([1.01 * np.arange(disks) + 0.001 * frame, np.full(disks, 0.4999)])
    floor = Contacts(np.arange(disks), np.full(disks, -1), rng.normal(0, 1e-6, disks))
    return Packing(
        position=position,
        radius=np.full(disks, 0.5),
        contacts=floor,
        law=MindlinLaw(2e5, 1e5, 1.0),
        box_length=1.01 * disks,
        fx=1e-3 * frame,
        fy=3.0,
    )


def content(path: Path) -> list[bytes]:
    """All numbers of a file, as bytes."""
    found = []
    with RunFile(path) as run:
        for frame in range(len(run)):
            packing = run.packing(frame)
            arrays = (packing.position, packing.angle, packing.radius, packing.mass, packing.top)
            contacts = packing.contacts
            found += [array.tobytes() for array in (*arrays, contacts.i, contacts.j, contacts.slip)]
            found.append(repr((packing.law, packing.fx, packing.fy, packing.box_length)).encode())
        for name in run.names_of_series:
            found += [column.tobytes() for column in run.series(name).values()]
        found += [np.asarray(value).tobytes() for value in run.checkpoint.values()]
        found.append(repr(run.attributes).encode())
    return found


def run(count: int, folder: Path, seed: int = 0) -> Iterator[tuple[str, str]]:
    """Damage files at random; yield for each the damage, and the fault that was found."""
    chance = random.Random(seed)
    sound, damaged = folder / "sound.h5", folder / "damaged.h5"
    sound_file(sound)
    expected = content(sound)
    for turn in range(count):
        what = DAMAGES[turn % len(DAMAGES)](sound.read_bytes(), chance, damaged)
        yield what, _outcome(damaged, expected if damaged.read_bytes().startswith(b"fault") else None)


def _outcome(path: Path, expected: list[bytes] | None) -> str:
    """What is wrong with how a file is opened, in a process of its own; empty if nothing is."""
    receiver, sender = FORKED.Pipe(duplex=False)
    child = FORKED.Process(target=lambda: sender.send(_open_file(path, expected)[:4000]))
    child.start()
    child.join(LONGEST)
    if child.is_alive():
        child.kill()
        child.join()
        return f"hangs for {LONGEST:g} s"
    return f"ends with status {child.exitcode}" if child.exitcode else str(receiver.recv())


def _open_file(path: Path, expected: list[bytes] | None) -> str:
    before = path.read_bytes()
    modes: tuple[Literal["r", "a"], ...] = ("r", "a")
    for mode in modes:
        try:
            with RunFile(path, mode):
                found = content(path)
        except PackingFileError as error:
            if path.name not in str(error) or "\n" in str(error):
                return f"a sentence that does not name the file, or several: {error}"
        except Exception as error:
            return f"{type(error).__name__} reaches the caller: {error}"
        else:
            if expected is not None and found != expected:
                return "another result, quietly"
        if path.read_bytes() != before:
            return f"changed by opening it ({mode})"
    return ""


def _flip_bits(data: bytes, chance: random.Random, damaged: Path) -> str:
    places = [chance.randrange(len(data)) for _ in range(chance.choice([1, 1, 1, 20]))]
    changed = bytearray(data)
    for place in places:
        changed[place] ^= 1 << chance.randrange(8)
    damaged.write_bytes(changed)
    return f"bits flipped in the bytes {places}"


def _truncate(data: bytes, chance: random.Random, damaged: Path) -> str:
    size = chance.randrange(len(data))
    damaged.write_bytes(data[:size])
    return f"cut to {size} bytes"


def _zero_bytes(data: bytes, chance: random.Random, damaged: Path) -> str:
    place, size = chance.randrange(len(data)), chance.choice([16, 512, 4096])
    damaged.write_bytes(data[:place] + bytes(len(data[place : place + size])) + data[place + size :])
    return f"{size} bytes zeroed from {place}"


DAMAGES: tuple[Callable[[bytes, random.Random, Path], str], ...] = (
    _flip_bits,
    _flip_bits,
    _truncate,
    _zero_bytes,
)
