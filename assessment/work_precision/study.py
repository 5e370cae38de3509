r"""What a work-precision study consists of: points of error and cost, orders of convergence, and advice.

An order p of a method is the exponent of error(parameter), by least squares in the logarithms.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from threadpoolctl import threadpool_limits

from ...analysis.responses.growth import fit_power_law
from ...pywrap import Engine, Equilibrium, Scene, equilibrate

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

WORDS = tomllib.loads(Path(__file__).with_name("words.toml").read_text(encoding="utf-8"))
"""The texts of each study."""

COMPENSATED_SUFFIX = ", compensated"
"""Ends the name of a method in compensated arithmetic."""

Run = tuple[str, float | None, Callable[[], tuple[Any, int | None]]]
"""A method, the parameter that sets its accuracy, and what it computes: a result, and the work that it took, counted in
what does not depend on the machine."""

Study = dict[str, Any]
"""What report.json has of a study, see `study_of`."""


@dataclass(frozen=True)
class Settings:
    """What all studies have: a scene with a ramp, and its equilibria by increasing F_x, from 0 to beyond the onset;
    whether fewer points and shorter runs have to do; the number of runs of which the median of the times is taken; and
    what wraps the list of runs of a study, to show how far it is."""

    scene: Scene
    ramp: tuple[Equilibrium, ...]
    quick: bool = False
    repeats: int = 3
    progress: Callable[[Sequence[Any]], Iterable[Any]] = iter

    def at(self, fx: float) -> Equilibrium:
        """The equilibrium of the ramp nearest to a load."""
        return min(self.ramp, key=lambda each: abs(each.fx - fx))


class Point(NamedTuple):
    """A run of a method: its error is the difference from the study's reference, its time the median of several, s."""

    method: str
    parameter: float | None
    error: float
    seconds: float
    evaluations: int | None


def timed(runs: Sequence[Run], settings: Settings, error: Callable[[Any], float]) -> tuple[list[Point], list[Any]]:
    """Points of runs, and their results. Runs are made in one thread, several times.

    The runs take turns, so that other load of the machine affects all of them alike. Every other turn begins with the
    last run.
    """
    places, found = range(len(runs)), dict[int, Any]()
    seconds = np.empty((settings.repeats, len(runs)))
    order = [(turn, k) for turn in range(settings.repeats) for k in (places[::-1] if turn % 2 else places)]
    with threadpool_limits(1):
        for turn, k in settings.progress(order):
            begin = time.perf_counter()
            found[k] = runs[k][2]()
            seconds[turn, k] = time.perf_counter() - begin
    spent = np.median(seconds, axis=0).tolist()
    points = [Point(*runs[k][:2], error(found[k][0]), spent[k], found[k][1]) for k in places]
    return points, [found[k][0] for k in places]


def study_of(section: str, points: list[Point], reference_error: float, numbers: dict[str, Any], **more: Any) -> Study:
    """Make a study from its results and from a section of words.toml, whose texts use the numbers.

    The texts also have `points`, by method the point of least error, `best`, and what else is given: `orders`, those
    that theory predicts, of `fit_order`. The reference's own error is in the unit of the errors.
    """
    best = {point.method: point for point in sorted(points, key=lambda each: -each.error)}
    known = {"points": points, "best": best, **numbers, **more}
    said = {
        name: text.format(**known) if isinstance(text, str) else [line.format(**known) for line in text]
        for name, text in WORDS[section].items()
    }
    rows = [point._asdict() for point in points]
    return said | {"orders": [], "reference_error": reference_error, "points": rows} | more


def compensate(equilibrium: Equilibrium) -> Equilibrium:
    """The same equilibrium with low parts of coordinates, its forces balanced to the rounding floor of these."""
    packing = replace(equilibrium.packing, position_low=np.zeros_like(equilibrium.packing.position))
    with Engine(packing) as engine:
        return equilibrate(engine, replace(equilibrium, packing=packing), packing.fx)


def fit_order(
    points: Iterable[Point], method: str, expected: float, least: float = 0.0, most: float = np.inf
) -> dict[str, Any]:
    """The order of a method from its points with errors between two bounds, with its standard error.

    Errors below `least` are those of the floor or of the reference, errors above `most` are not yet asymptotic. If
    fewer than three points are left, the error is a ValueError.
    """
    chosen = [p for p in points if p.method == method and least < p.error < most]
    law = fit_power_law([point.parameter or np.nan for point in chosen], [point.error for point in chosen])
    known = {"method": method, "expected": expected, "points": len(chosen)}
    return known | {"order": law.exponent, "error": law.error}
