"""Damaged run.h5: flipped bytes, truncations, zeroed blocks, and edits of datasets and attributes through HDF5.

A damaged file is refused in one sentence, for reading and for appending, or nothing has changed. Each is opened in a
process of its own, so that a crash or a hang is seen.
"""

import random
from collections.abc import Callable, Iterator
from multiprocessing import get_context
from pathlib import Path
from typing import Literal

import h5py
import numpy as np

from faultgouge.analysis import Contacts, MindlinLaw, Packing, PackingFileError, RunFile

LONGEST = 20.0
"""Seconds that opening a file may take."""

FORKED = get_context("fork")

Edit = Callable[[h5py.File, str, random.Random], None]


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


def _edit(data: bytes, chance: random.Random, damaged: Path) -> str:
    damaged.write_bytes(data)
    with h5py.File(damaged, "r+") as file:
        names: list[str] = []
        file.visit(names.append)
        name = chance.choice(names)
        kind = chance.choice([*EDITS])
        EDITS[kind](file, name, chance)
    return f"{kind}: {name}"


def _delete(file: h5py.File, name: str, chance: random.Random) -> None:
    del file[name]


def _replace(value: object) -> Edit:
    def edit(file: h5py.File, name: str, chance: random.Random) -> None:
        del file[name]
        file[name] = value

    return edit


def _retype(file: h5py.File, name: str, chance: random.Random) -> None:
    if isinstance(file[name], h5py.Dataset):
        value = file[name][()]
        del file[name]
        file[name] = np.asarray(value).astype(chance.choice(["f4", "i2", "S8", "c16", "?"]))


def _reshape(file: h5py.File, name: str, chance: random.Random) -> None:
    if isinstance(file[name], h5py.Dataset):
        value = np.asarray(file[name][()])
        del file[name]
        file[name] = chance.choice([value.ravel(), value[..., None], value.ravel()[: value.size // 2], value.T])


def _put(number: float) -> Edit:
    def edit(file: h5py.File, name: str, chance: random.Random) -> None:
        item = file[name]
        if isinstance(item, h5py.Dataset) and item.size and item.dtype.kind == "f":
            item[tuple(chance.randrange(extent) for extent in item.shape)] = number

    return edit


def _huge(file: h5py.File, name: str, chance: random.Random) -> None:
    if isinstance(file[name], h5py.Dataset):
        shape = tuple(10 ** chance.choice([7, 12]) for _ in file[name].shape) or (10**12,)
        del file[name]
        file.create_dataset(name, shape[:1], "f8", chunks=(1000,))


def _attributes(file: h5py.File, name: str, chance: random.Random) -> None:
    item = file[name] if len(file[name].attrs) else file
    for key in list(item.attrs):
        item.attrs[key] = chance.choice([np.nan, "other", np.arange(5), 1e300])


def _link(file: h5py.File, name: str, chance: random.Random) -> None:
    del file[name]
    file[name] = h5py.SoftLink(chance.choice(["/", "/nowhere", f"/{name}"]))


EDITS: dict[str, Edit] = {
    "deleted": _delete,
    "made a number": _replace(1.0),
    "made a text": _replace("text"),
    "made empty": _replace(h5py.Empty("f8")),
    "another type": _retype,
    "another shape": _reshape,
    "a nan": _put(np.nan),
    "an infinite number": _put(np.inf),
    "a huge number": _put(1e300),
    "a huge shape": _huge,
    "other attributes": _attributes,
    "a link": _link,
}

DAMAGES: tuple[Callable[[bytes, random.Random, Path], str], ...] = (
    _flip_bits,
    _flip_bits,
    _truncate,
    _zero_bytes,
    _edit,
)
