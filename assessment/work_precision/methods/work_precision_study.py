r"""What a work-precision study consists of: points of error and cost, orders of convergence, and advice.

An order p of a method is the exponent of error(parameter), by least squares in the logarithms.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, TypeVar

import numpy as np
from threadpoolctl import threadpool_limits

from ....analysis.responses.power_law import fit_power_law
from ....pywrap import Engine, Equilibrium, Scene, equilibrate
from ...timing import Progress, in_turns

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

WORDS = tomllib.loads(Path(__file__).with_name("words.toml").read_text(encoding="utf-8"))
"""The texts of each study."""

COMPENSATED_SUFFIX = ", compensated"
"""Ends the name of a method in compensated arithmetic."""

T = TypeVar("T")

Run = tuple[str, float | None, Callable[[], tuple[T, int | None]]]
"""A method, its parameter, and what it computes: a result, and the evaluations that it took."""


@dataclass(frozen=True)
class Settings:
    """The settings of a study.

    Attributes
    ----------
    scene : Scene
        Scene of the ramp, with a section [ramp].
    ramp : tuple of Equilibrium
        Its equilibria by increasing F_x, from 0 to beyond the onset.
    quick : bool
        Whether fewer points and shorter runs have to do.
    repeats : int
        Runs of which the median of the times is taken.
    progress : callable
        Wraps the list of runs of a study, to show how far it is.
    """

    scene: Scene
    ramp: tuple[Equilibrium, ...]
    quick: bool = False
    repeats: int = 3
    progress: Progress = iter

    def at(self, fx: float) -> Equilibrium:
        """The equilibrium of the ramp nearest to a load."""
        return min(self.ramp, key=lambda each: abs(each.fx - fx))


@dataclass(frozen=True)
class Point:
    """One run of one method.

    Attributes
    ----------
    method : str
        Which.
    parameter : float or None
        The parameter that sets the method's accuracy; None if there is none.
    error : float
        Difference from the study's reference.
    seconds : float
        Wall time, the median of several.
    evaluations : int or None
        Work that does not depend on the machine; None if there is nothing to count.
    """

    method: str
    parameter: float | None
    error: float
    seconds: float
    evaluations: int | None


@dataclass(frozen=True)
class Order:
    """The order of convergence of a method.

    Attributes
    ----------
    method : str
        Which.
    order : float
        Slope of log error over log parameter.
    error : float
        Standard error of the slope.
    expected : float
        The order that theory predicts.
    points : int
        How many points were fitted.
    """

    method: str
    order: float
    error: float
    expected: float
    points: int


@dataclass(frozen=True)
class Theory:
    """A theoretical error, drawn as a line in the figure.

    Attributes
    ----------
    label : str
        Label of the line.
    error : tuple of float
        One value, a floor for all; or values at `parameter`.
    parameter : tuple of float
        Where a curve goes through `error`; empty for a floor.
    """

    label: str
    error: tuple[float, ...]
    parameter: tuple[float, ...] = ()


@dataclass(frozen=True)
class StatedError:
    """The stated and the true error of an onset.

    Attributes
    ----------
    arithmetic : str
        Which.
    increment : float
        Of the ramp, force.
    true, stated : float
        Force.
    """

    arithmetic: str
    increment: float
    true: float
    stated: float

    @property
    def holds(self) -> bool:
        """Whether the stated error covers the true one."""
        return self.true <= self.stated


@dataclass(frozen=True)
class Study:
    """Error against cost for several methods that give one result.

    Attributes
    ----------
    name : str
        Of the study.
    question : str
        A sentence or two that say what is computed.
    error, parameter, evaluations : str
        What the numbers of the points are, with their units.
    abscissa : {"evaluations", "parameter"}
        What the second panel of the figure has on its x axis.
    reference : str
        The reference from which errors are differences.
    reference_error : float
        The reference's own error, in the unit of `error`.
    points : tuple of Point
        By method.
    advice : tuple of str
        Two sentences that say when to use which method.
    orders : tuple of Order
        Those that theory predicts.
    theory : tuple of Theory
        Floors and curves to compare with.
    remarks : tuple of str
        Further remarks for the reader, one sentence each.
    covered : tuple of StatedError
        Stated and true errors, if the result has a stated error.
    """

    name: str
    question: str
    error: str
    parameter: str
    evaluations: str
    abscissa: Literal["evaluations", "parameter"]
    reference: str
    reference_error: float
    points: tuple[Point, ...]
    advice: tuple[str, str]
    orders: tuple[Order, ...] = ()
    theory: tuple[Theory, ...] = ()
    remarks: tuple[str, ...] = ()
    covered: tuple[StatedError, ...] = ()

    def of(self, method: str) -> list[Point]:
        """The points of one method."""
        return [point for point in self.points if point.method == method]

    @property
    def methods(self) -> list[str]:
        """Names of the methods, in the order of the points."""
        return list(dict.fromkeys(point.method for point in self.points))


def best_of(points: Iterable[Point]) -> dict[str, Point]:
    """The point of least error of each method."""
    return {point.method: point for point in sorted(points, key=lambda each: each.error)[::-1]}


def compensate(equilibrium: Equilibrium) -> Equilibrium:
    """The same equilibrium in compensated arithmetic: coordinates with low parts, and forces balanced to its rounding
    floor."""
    packing = replace(equilibrium.packing, position_low=np.zeros_like(equilibrium.packing.position))
    with Engine(packing) as engine:
        return equilibrate(engine, replace(equilibrium, packing=packing), packing.fx)


def study_of(
    *sections: str,
    points: tuple[Point, ...],
    numbers: Mapping[str, Any],
    orders: tuple[Order, ...] = (),
    **results: Any,
) -> Study:
    """Make a study from its results and from the texts of words.toml.

    Parameters
    ----------
    *sections : str
        Of words.toml: the study's own, and one that it shares with others.
    points, orders, **results
        As of `Study`.
    numbers : mapping
        Numbers that the texts use; the texts also have `orders` and the `best` of the points.
    """
    known = {"orders": orders, "best": best_of(points), **numbers}
    words = {name: text for section in sections for name, text in WORDS[section].items()}
    said: dict[str, Any] = {
        name: text.format(**known) if isinstance(text, str) else tuple(line.format(**known) for line in text)
        for name, text in words.items()
    }
    return Study(**said, points=points, orders=orders, **results)


def time_jobs(jobs: Sequence[Callable[[], T]], settings: Settings) -> tuple[list[T], list[float]]:
    """Results of jobs that are run in turn, in one thread, and the median of the seconds of each."""
    with threadpool_limits(1):
        results, seconds = in_turns(jobs, settings.repeats, progress=settings.progress)
    return results, np.median(seconds, axis=0).tolist()


def timed_points(runs: Sequence[Run[T]], settings: Settings, error: Callable[[T], float]) -> tuple[Point, ...]:
    """The points of runs, each with the error of its result."""
    results = zip(runs, *time_jobs([run for *_, run in runs], settings), strict=True)
    return tuple(
        Point(method, parameter, error(found), seconds, evaluations)
        for (method, parameter, _), (found, evaluations), seconds in results
    )


def fit_order(points: Iterable[Point], method: str, expected: float, least: float = 0.0, most: float = np.inf) -> Order:
    """The order of a method from its points with errors between two bounds.

    Errors below `least` are those of the floor or of the reference, errors above `most` are not yet asymptotic. If
    fewer than three points are left, the error is a ValueError.
    """
    chosen = [p for p in points if p.method == method and p.parameter and least < p.error < most]
    if len(chosen) < 3:
        raise ValueError(f"{len(chosen)} points of {method} are between {least:.1e} and {most:.1e}: an order needs 3")
    law = fit_power_law([point.parameter or np.nan for point in chosen], [point.error for point in chosen])
    return Order(method, law.exponent, law.error, expected, len(chosen))
