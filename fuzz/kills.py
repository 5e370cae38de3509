"""Runs that are killed or interrupted at random moments, and the same command again.

A command that was interrupted says so in one sentence and exits with 130 or 143 within `SOON`; the same command again
leaves the results of an uninterrupted run, dataset by dataset to the bit.
"""

import json
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np

BIN = Path(sys.executable).parent
PACKING = Path(__file__).parents[1] / "tests" / "reference" / "packing7.json"

SOON = 2.0
"""Seconds after a signal within which a command has ended."""

SIGNALS = {signal.SIGKILL: -9, signal.SIGINT: 130, signal.SIGTERM: 143}

SCENE = f"""
[packing]
file = "{PACKING}"
[law]
kn = 2e5
[load]
fy = 3.0
"""
SEEDED = """
[packing]
disks = 30
seed = 4
[law]
kn = 2e5
mu = [1.0, 0.8]
[load]
fy = 3.0
[ramp]
step = 2e-3
until = 0.05
"""
FINE = "[ramp]\nstep = 1e-4\nuntil = 0.02\n[output]\ndumps = true\n"
PAIRED = "[ramp]\nstep = 2e-4\nuntil = 0.02\n"
COARSE = "[ramp]\nstep = 1e-3\nuntil = 0.022\n"
PUSHED = "[ramp]\nstep = 1e-3\nuntil = 2e-3\n[perturb]\nfx = 1.5e-3\namplitude = 1e-9\nomega = 1.0\n"
LONG = 'time = 30.0\n[friction]\nv_ss = "10 v0"\n[output]\ntrajectory = true\n'
COMPENSATED = 'precision = "compensated"\n'


@dataclass(frozen=True)
class CommandToKill:
    """A command that is to be killed.

    Attributes
    ----------
    command : str
        What follows ``faultgouge``.
    scene : str
        TOML.
    ranks : int
        With mpiexec beyond one.
    """

    command: str
    scene: str
    ranks: int = 1


RUN = "scene.toml -o out/run.h5"
WORKS = {
    "settle": CommandToKill(f"settle {RUN}", SEEDED),
    "ramp": CommandToKill(f"ramp {RUN}", SCENE + FINE),
    "ramp on two ranks": CommandToKill(f"ramp {RUN}", SCENE + PAIRED, 2),
    "ramp, compensated": CommandToKill(f"ramp {RUN}", COMPENSATED + SCENE + COARSE),
    "perturb": CommandToKill(f"perturb {RUN}", SCENE + PUSHED + LONG),
    "perturb, compensated, on two ranks": CommandToKill(
        f"perturb {RUN}", COMPENSATED + SCENE + PUSHED + "time = 0.5\n", 2
    ),
    "onset": CommandToKill("onset scene.toml -o out/onset.json", SCENE + COARSE),
    "reproduce": CommandToKill("reproduce scene.toml -o out", SEEDED),
}
"""By their names in the report; each leaves its results in the folder out."""


def start_command(work: CommandToKill, folder: Path) -> subprocess.Popen[str]:
    """The command, under way in a folder."""
    (folder / "out").mkdir(parents=True, exist_ok=True)
    (folder / "scene.toml").write_text(work.scene)
    command = [str(BIN / "faultgouge"), *work.command.split()]
    if work.ranks > 1:
        command = [str(BIN / "mpiexec"), "-n", str(work.ranks), *command]
    return subprocess.Popen(
        command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )


def finish_command(work: CommandToKill, folder: Path, timeout: float = 600.0) -> tuple[float, str]:
    """Run the command to its end; the seconds, and the fault, if there is one."""
    begin = time.monotonic()
    running = start_command(work, folder)
    _, errors = running.communicate(timeout=timeout)
    says = "" if running.returncode == 0 else f"exit code {running.returncode}: {errors.strip()[-300:]}"
    return time.monotonic() - begin, says


def kill_command(work: CommandToKill, folder: Path, number: int, after: float) -> str:
    """Kill the command after so many seconds; the fault of its end, if there is one."""
    running = start_command(work, folder)
    try:
        running.communicate(timeout=after)
        return ""  # it was faster
    except subprocess.TimeoutExpired:
        begin = time.monotonic()
    running.send_signal(number)
    _, errors = running.communicate(timeout=60)
    seconds = time.monotonic() - begin
    if running.returncode == 0:
        return ""  # it ended at that very moment
    if number != signal.SIGKILL and running.returncode != SIGNALS[signal.Signals(number)]:
        return f"exit code {running.returncode} after signal {number}: {errors.strip()[-300:]}"
    spoken = [line for line in errors.splitlines() if line.startswith("Error:")]
    if number != signal.SIGKILL and len(spoken) != 1:
        return f"{len(spoken)} sentences after signal {number}: {errors.strip()[-300:]}"
    if seconds > SOON + 1:  # a busy machine takes its time to start a process
        return f"ended {seconds:.1f} s after signal {number}"
    return "traceback" if "Traceback" in errors else ""


def results(folder: Path) -> dict[str, tuple[object, ...]]:
    """Every dataset, number and text in the results of a folder, to the bit, by name."""
    found: dict[str, tuple[object, ...]] = {}

    def take(name: str, item: object) -> None:
        if isinstance(item, h5py.Dataset):
            value = np.asarray(item[()])
            content = value.tolist() if value.dtype.hasobject else value.tobytes()
            found[name] = value.dtype, value.shape, content

    for path in sorted(folder.rglob("*")):
        name = str(path.relative_to(folder))
        if path.name.startswith("."):
            continue  # what SIGKILL left of a new file
        if path.suffix == ".h5":
            with h5py.File(path) as file:
                found[f"{name} complete"] = (bool(file.attrs["complete"]),)
                file.visititems(lambda key, item, name=name: take(f"{name} {key}", item))
        elif path.suffix == ".json":
            found[name] = (json.loads(path.read_text()),)
        elif path.suffix in (".disks", ".contacts", ".params", ".md"):
            found[name] = (path.read_text(),)
    return found


def difference(one: dict[str, tuple[object, ...]], other: dict[str, tuple[object, ...]]) -> str:
    """The first name in which two results differ."""
    return next(
        (f"{name} differs" for name in sorted(one.keys() | other.keys()) if one.get(name) != other.get(name)), ""
    )


def run(kills: int, folder: Path, seed: int = 0, only: str = "") -> Iterator[tuple[str, str]]:
    """Kill commands at random moments; yield for each the moment, and the fault that was found."""
    random_moment = random.Random(seed)
    works = {name: work for name, work in WORKS.items() if only in ("", name)}
    for place, (name, work) in enumerate(works.items()):
        whole = folder / f"{place}" / "whole"
        seconds, says = finish_command(work, whole)
        yield f"{name}, undisturbed, {seconds:.1f} s", says
        expected = results(whole / "out")
        for turn in range(-(-kills // len(works))):
            number = random_moment.choice(list(SIGNALS))
            after = random_moment.uniform(0.2, 1.0) * seconds
            again = folder / f"{place}" / f"{turn}"
            says = kill_command(work, again, number, after)
            if not says:
                _, says = finish_command(work, again)
            if not says:
                says = difference(expected, results(again / "out"))
            yield f"{name}, signal {int(number)} after {after:.1f} s", says
            shutil.rmtree(again)
