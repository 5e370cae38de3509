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


@dataclass(frozen=True)
class Work:
    """A command that is to be killed.

    Attributes
    ----------
    name : str
        For the report.
    scene : str
        TOML.
    command : tuple of str
        Arguments after ``faultgouge``.
    result : str
        The file or folder that it leaves.
    ranks : int
        With mpiexec beyond one.
    """

    name: str
    scene: str
    command: tuple[str, ...]
    result: str
    ranks: int = 1


WORKS = (
    Work("settle", SEEDED, ("settle", "scene.toml", "-o", "out/run.h5"), "out"),
    Work(
        "ramp",
        SCENE + "[ramp]\nstep = 1e-4\nuntil = 0.02\n[output]\ndumps = true\n",
        ("ramp", "scene.toml", "-o", "out/run.h5"),
        "out",
    ),
    Work(
        "ramp on two ranks",
        SCENE + "[ramp]\nstep = 2e-4\nuntil = 0.02\n",
        ("ramp", "scene.toml", "-o", "out/run.h5"),
        "out",
        2,
    ),
    Work(
        "ramp, compensated",
        'precision = "compensated"\n' + SCENE + "[ramp]\nstep = 1e-3\nuntil = 0.02\n",
        ("ramp", "scene.toml", "-o", "out/run.h5"),
        "out",
    ),
    Work(
        "perturb",
        SCENE
        + "[ramp]\nstep = 1e-3\nuntil = 2e-3\n[perturb]\nfx = 1.5e-3\ntime = 30.0\namplitude = 1e-9\nomega = 1.0\n"
        + '[friction]\nv_ss = "10 v0"\n[output]\ntrajectory = true\n',
        ("perturb", "scene.toml", "-o", "out/run.h5"),
        "out",
    ),
    Work(
        "perturb, compensated, on two ranks",
        'precision = "compensated"\n'
        + SCENE
        + "[ramp]\nstep = 1e-3\nuntil = 2e-3\n[perturb]\nfx = 1.5e-3\ntime = 0.5\namplitude = 1e-9\nomega = 1.0\n",
        ("perturb", "scene.toml", "-o", "out/run.h5"),
        "out",
        2,
    ),
    Work(
        "onset",
        SCENE + "[ramp]\nstep = 1e-3\nuntil = 0.022\n",
        ("onset", "scene.toml", "-o", "out/onset.json"),
        "out",
    ),
    Work("reproduce", SEEDED, ("reproduce", "scene.toml", "-o", "out"), "out"),
    Work("ensemble", SEEDED, ("reproduce", "scene.toml", "--ensemble", "4", "-o", "out"), "out"),
)


def started(work: Work, folder: Path) -> subprocess.Popen[str]:
    """The command, under way in a folder."""
    (folder / "out").mkdir(parents=True, exist_ok=True)
    (folder / "scene.toml").write_text(work.scene)
    command = [str(BIN / "faultgouge"), *work.command]
    if work.ranks > 1:
        command = [str(BIN / "mpiexec"), "-n", str(work.ranks), *command]
    return subprocess.Popen(
        command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )


def finished(work: Work, folder: Path, timeout: float = 600.0) -> tuple[float, str]:
    """Run the command to its end; the seconds, and what is wrong, if something is."""
    begin = time.monotonic()
    running = started(work, folder)
    _, errors = running.communicate(timeout=timeout)
    says = "" if running.returncode == 0 else f"exit code {running.returncode}: {errors.strip()[-300:]}"
    return time.monotonic() - begin, says


def killed(work: Work, folder: Path, number: int, after: float) -> str:
    """Kill the command after so many seconds; what is wrong with how it ends."""
    running = started(work, folder)
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


def results(folder: Path) -> dict[str, object]:
    """Every dataset and every number in the results of a folder, by name."""
    found: dict[str, object] = {}
    for path in sorted(folder.rglob("*")):
        name = str(path.relative_to(folder))
        if path.suffix == ".h5":
            with h5py.File(path) as file:
                found[f"{name} complete"] = bool(file.attrs["complete"])
                file.visititems(
                    lambda key, item, name=name: (
                        found.update({f"{name} {key}": item[()]}) if isinstance(item, h5py.Dataset) else None
                    )
                )
        elif path.suffix == ".json":
            found[name] = json.loads(path.read_text())
        elif path.suffix in (".disks", ".contacts", ".params", ".md"):
            found[name] = path.read_text()
    return found


def difference(one: dict[str, object], other: dict[str, object]) -> str:
    """The first name in which two results differ."""
    for name in sorted(one.keys() | other.keys()):
        if name not in one or name not in other:
            return f"{name} is in one alone"
        a, b = one[name], other[name]
        if isinstance(a, np.ndarray) and isinstance(b, np.ndarray):
            if a.dtype != b.dtype or a.shape != b.shape or a.tobytes() != b.tobytes():
                return f"{name} differs"
        elif isinstance(a, np.generic) and isinstance(b, np.generic) and a.tobytes() == b.tobytes():
            continue  # nan is nan
        elif a != b:
            return f"{name} differs"
    return ""


def run(kills: int, folder: Path, seed: int = 0, only: str = "") -> Iterator[tuple[str, str]]:
    """Kill commands at random moments; what was done, and what is wrong, for each."""
    random_moment = random.Random(seed)
    works = [work for work in WORKS if only in ("", work.name)]
    for place, work in enumerate(works):
        whole = folder / f"{place}" / "whole"
        seconds, says = finished(work, whole)
        yield f"{work.name}, undisturbed, {seconds:.1f} s", says
        expected = results(whole / work.result)
        for turn in range(-(-kills // len(works))):
            number = random_moment.choice(list(SIGNALS))
            after = random_moment.uniform(0.2, 1.0) * seconds
            again = folder / f"{place}" / f"{turn}"
            says = killed(work, again, number, after)
            if not says:
                _, says = finished(work, again)
            if not says:
                says = difference(expected, results(again / work.result))
            yield f"{work.name}, signal {int(number)} after {after:.1f} s", says
            shutil.rmtree(again)
