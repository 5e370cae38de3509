"""Intervals of what resampled packings give, for the pages of research."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from faultgouge.analysis import Floats, Indices
from faultgouge.studies.statistics import Bools, median, quartiles, share

Values = TypeVar("Values", Indices, Floats)


def interval(value: Sequence[float | None] | None, digits: str = ".2g", beyond: str = "none") -> str:
    """A number with its interval, "0.15 (0.14 to 0.18)"; "-" where nothing is known, `beyond` for no bound."""
    if value is None or (value[0] is not None and np.isnan(value[0])):
        return "-"
    middle, low, high = (beyond if each is None or np.isinf(each) else format(each, digits) for each in value)
    return f"{middle} ({low} to {high})"


def count_of(share: Mapping[str, Any]) -> str:
    """A count of so many with the interval of its share, "5 of 20 (11 to 47 %)"; "-" of none."""
    if share["share"] is None:
        return "-"
    return f"{share['count']} of {share['of']} ({100 * share['low']:.0f} to {100 * share['high']:.0f} %)"


def middle(values: ArrayLike) -> list[float] | None:
    """Median with its 95 % interval, from resampling; None of fewer than two numbers."""
    found = np.asarray(values, dtype=float)
    return median(found) if len(found) > 1 else None


DRAWS = 2000
"""Resampled sets of runs for an interval."""


def _ends_over_runs(runs: Sequence[Floats], of: Callable[[Floats], float]) -> tuple[float, float]:
    """The 95 % interval of a number of all values, from resampled runs: values of one run may depend on each other."""
    known = [run for run in runs if len(run)]
    chosen = np.random.default_rng(0).integers(len(known), size=(DRAWS, len(known)))
    drawn = [of(np.concatenate([known[each] for each in draw])) for draw in chosen]
    low, high = np.quantile(drawn, [0.025, 0.975])
    return float(low), float(high)


def share_over_runs(runs: Sequence[Sequence[bool]]) -> dict[str, Any]:
    """A share of what several runs have, as `share`, whose interval is the wider of two.

    One is that of resampled runs, and the other takes all values as independent: few runs, or runs that are all alike,
    make the first one too narrow.
    """
    values = [np.asarray(run, dtype=float) for run in runs]
    found = share(int(sum(run.sum() for run in values)), sum(map(len, values)))
    if found["of"]:
        low, high = _ends_over_runs(values, np.mean)
        found |= {"low": min(low, found["low"]), "high": max(high, found["high"])}
    return found


def median_over_runs(runs: Sequence[Sequence[float]]) -> list[float] | None:
    """A median of what several runs have, as `middle`, whose interval is the wider of the same two."""
    values = [np.asarray(run, dtype=float) for run in runs]
    found = middle(np.concatenate(values)) if values else None
    if found is None:
        return None
    low, high = _ends_over_runs(values, np.median)
    return [found[0], min(low, found[1]), max(high, found[2])]


def resample(groups: Sequence[Values], draws: int) -> Iterator[list[Values]]:
    """Each group drawn again, with replacement, so many times."""
    generator = np.random.default_rng(0)
    return ([generator.choice(group, len(group)) for group in groups] for _ in range(draws))


def bootstrap_interval(value: float, draws: Sequence[float] | Floats) -> dict[str, float]:
    """A number with the 95 % interval of what resampled packings give in its place: {"value", "low", "high"}."""
    low, high = np.quantile(draws, [0.025, 0.975])
    return {"value": float(value), "low": float(low), "high": float(high)}


def exponent(
    sizes: Sequence[float] | Floats, samples: Sequence[Floats], middle: Callable[[Floats], float], draws: int
) -> dict[str, float]:
    """The exponent of a power law over the size, with its interval; of each sample `middle` gives the logarithm."""
    logs = np.log(sizes)

    def fit_slope(groups: Sequence[Floats]) -> float:
        return float(np.polyfit(logs, [middle(each) for each in groups], 1)[0])

    return bootstrap_interval(fit_slope(samples), [fit_slope(each) for each in resample(samples, draws)])


def median_interval(reach: ArrayLike, found: ArrayLike, draws: int = DRAWS, seed: int = 0) -> list[float | None]:
    """Median of F_x^c with lower and upper end of its 95 % interval from resampled packings.

    None stands for what lies beyond what the ramps reached.
    """
    reach, found = np.asarray(reach, dtype=float), np.asarray(found, dtype=bool)
    ends: list[float | None] = [None, None]
    if len(reach):
        chosen = np.random.default_rng(seed).integers(len(reach), size=(draws, len(reach)))
        known = np.sort(_medians(reach[chosen], found[chosen]))
        low, high = known[int(0.025 * draws)], known[int(0.975 * draws)]
        ends = [float(end) if np.isfinite(end) else None for end in (low, high)]
    return [quartiles(reach, found)[1] if len(reach) else None, *ends]


def _medians(reach: Floats, found: Bools) -> Floats:
    """Kaplan and Meier's median of each row, as in `quartiles`; inf where it lies beyond the values reached."""
    order = np.lexsort((~found, reach), axis=1)  # of equal ones, onsets before packings that are lost there
    reach, found = np.take_along_axis(reach, order, axis=1), np.take_along_axis(found, order, axis=1)
    left = np.arange(reach.shape[1], 0, -1)
    surviving = np.cumprod(1 - found / left, axis=1)
    half = surviving <= 0.5 + 1e-12
    return np.where(half.any(axis=1), np.take_along_axis(reach, half.argmax(axis=1)[:, None], axis=1)[:, 0], np.inf)
