"""Scenes with one key each replaced by an odd value, checked, and run for real where they are accepted.

A scene is refused in one sentence, or its command ends with a result or a sentence. No traceback, no abort, no mistake
of the program, and nothing that takes long without saying so: a run has 20 s of processor time, which do not depend on
what else the machine does, and is ended then; by that time it has to have said what it is at.
"""

import json
import os
import random
import resource
import signal
import sys
from collections.abc import Iterator
from copy import deepcopy
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from faultgouge.pywrap import Scene, SceneError

LONGEST = 20
"""Seconds of processor time of a run."""

FORKED = get_context("forkserver")
"""Commands are forked from a process that has imported what most of them need: a second less for each."""
FORKED.set_forkserver_preload(["faultgouge.analysis", "faultgouge.commands"])

SCENE: dict[str, dict[str, Any]] = {
    "packing": {"disks": 30, "radii": [0.5, 0.7], "top": 6, "width": 6.5, "seed": 3, "periodic": True},
    "law": {"kn": 2e5, "kt": "2/7 kn", "mu": 1.0},
    "load": {"fy": 3.0},
    "relax": {"damping": 1.0, "time_step": 1e-5},
    "ramp": {"step": 1e-3, "until": 3e-3, "method": "newton", "force_tolerance": 1e-8},
    "perturb": {
        "fx": 2e-3,
        "time": 0.5,
        "amplitude": 1e-9,
        "omega": 0.1,
        "target": "top",
        "time_step": 1e-4,
        "inertia_factor": 1.0,
    },
    "friction": {"B": 0.2, "w": 0.4, "mu_ss": 0.8, "v0": "calibrated", "v_ss": "10 v0"},
    "output": {"trajectory": False, "dumps": False},
}
"""What takes a second or two, with every key in it."""

TASKS = {"ramp": ("ramp", "onset"), "relax": ("ramp",), "perturb": ("perturb",), "friction": ("perturb",)}
"""Commands by the section in which a key is odd; of others any of `ANY`."""

ANY = ("settle", "ramp", "perturb", "onset")

NUMBERS = [
    *(0, -1, 1, 2, 3, 7, 29, 30, 31, 100, 1000, 10**6, 2**31, 2**53, 2**63, 2**64, 10**400, -(10**400), 0.0, -0.0),
    *(5e-324, 1e-320, 1e-300, 1e-200, 1e-100, 1e-50, 1e-30, 1e-20, 1e-16, 1e-12, 1e-10, 1e-9, 1e-8, 1e-7, 1e-6),
    *(1e-5, 1e-4, 1e-3, 0.01, 0.05, 0.1, 0.3, 0.5, 0.9, 1.1, 1.5, 2.5, 3.3, 10.0, 30.0, 100.0, 1e3, 1e4, 1e5, 1e6),
    *(1e7, 1e8, 1e9, 1e10, 1e12, 1e15, 1e20, 1e30, 1e50, 1e100, 1e150, 1e200, 1e300, 1.7e308, -1e-300, -1e300),
    *(float("inf"), float("-inf"), float("nan")),
]
WORDS = [
    *(
        "",
        " ",
        "x",
        "kn",
        "0 kn",
        "1/0 kn",
        "2/7 kn",
        "1e3 kn",
        "1" * 400 + " kn",
        "v0",
        "0 v0",
        "1e400 v0",
        "1e300 v0",
    ),
    *("10 v0", "1e-3 v0", "top", "all", "newton", "overdamped", "calibrated", "double", "nan", "é" * 99, "/dev/null"),
]
OTHERS = [
    *(True, False, [], [[]], [0.5], [5e-324], [1e300], [0.5] * 50, [0.5, 1e-9], [1e-3, 1e3], [0, 1], [29], [30], [-1]),
    *([2**64], [1.0, 1.0], [1.0, 0.8], ["x"], {}, {"x": 1}),
]


def run(count: int, folder: Path, seed: int, longest: int = LONGEST) -> Iterator[tuple[str, str]]:
    """Try so many scenes, each for `longest` seconds of processor time: the odd keys, and the fault or ""."""
    chance = random.Random(seed)
    for number in range(count):
        scene, section, key = deepcopy(SCENE), *chance.choice([(s, k) for s in SCENE for k in SCENE[s]])
        value = chance.choice(NUMBERS if chance.random() < 0.75 else WORDS + OTHERS)
        scene[section][key] = value
        if key == "method" and value == "overdamped":
            del scene["relax"]["time_step"]
        if section == "relax":
            scene["ramp"] |= {"method": "overdamped", "until": 1e-3}
        what = f"{section}.{key} = {str(value)[:60]}"
        task = chance.choice(TASKS.get(section, ANY))
        try:
            Scene.from_mapping(scene, folder)
        except SceneError as error:
            says = "" if str(error).count("\n") == 0 else f"not one sentence: {error}"
        except Exception as error:  # whatever the check lets through is a fault of its own
            says = f"{type(error).__name__}: {error}"
        else:
            what, says = f"{task}, {what}", _try_command(task, toml(scene), folder / str(number), longest)
        yield what, says


def toml(scene: dict[str, dict[str, Any]]) -> str:
    """The scene as TOML."""
    lines = [
        [f"[{name}]", *(f"{key} = {_literal(value)}" for key, value in keys.items())] for name, keys in scene.items()
    ]
    return "\n".join(line for section in lines for line in section) + "\n"


def _literal(value: object) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key} = {_literal(each)}" for key, each in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(_literal(each) for each in value) + "]"
    return json.dumps(value) if isinstance(value, (bool, str)) else repr(value)


def _try_command(task: str, scene: str, folder: Path, longest: int) -> str:
    """What goes wrong in one run of a command."""
    folder.mkdir()
    (folder / "scene.toml").write_text(scene)
    (folder / "says").touch()
    process = FORKED.Process(target=_command, args=(task, folder, longest))
    process.start()
    process.join()
    return _fault(process.exitcode or 0, (folder / "says").read_text())


def _command(task: str, folder: Path, longest: int) -> None:
    """Do the work of the command in this process, in a folder, where its errors go to the file `says`."""
    resource.setrlimit(resource.RLIMIT_CPU, (longest, longest + 5))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    os.chdir(folder)
    for file, number in ((os.devnull, 1), ("says", 2)):
        os.dup2(os.open(file, os.O_WRONLY), number)
    sys.argv = ["faultgouge", task, "scene.toml", "-o", "run.json" if task == "onset" else "run.h5"]
    from faultgouge.cli import main
    from faultgouge.commands import terminal

    terminal.SECONDS_BETWEEN_LINES = longest / 4  # a run that says what it is at once a minute has no minute here
    main()


def _fault(code: int, says: str) -> str:
    """What is wrong with how a command ended; empty if nothing is."""
    last = says.strip()[-300:]
    if "Traceback" in says or "should not have happened" in says or "terminate called" in says:
        return last
    if code in (-signal.SIGXCPU, -signal.SIGKILL):
        return "" if says.strip() else "its processor time without a word"
    if code not in (0, 1, 2):
        return f"exit code {code}: {last}"
    return "" if code == 0 or says.strip() else f"exit code {code} and no word"
