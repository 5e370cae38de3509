"""The pair of eigenvalues that the page of `faultgouge view` follows, and the text about the pair.

The pair is the first of the ramp to become complex. If none becomes complex, it is the two real modes of the last
equilibrium that are closest to merging. The time to compute all modes grows as the cube of the size. For a large
packing they are computed at the last load alone: the pairs that are complex there are followed back, and the pair that
is complex from the smallest load on is chosen. A pair that is complex only at earlier loads is then not found.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse.linalg import eigs

from faultgouge.analysis import Configuration, Eigenpairs, Packing, closest_to_meeting, eigenvalues, growth_rate
from faultgouge.analysis.onset.eigenvalue_pair import Pair, continue_pair
from faultgouge.analysis.onset.modes import Modes, force_bearing, full_operator

from .mode import Complexes, ModeError, displacement

Progress = Callable[[Sequence[Packing | Configuration]], Iterable[Packing | Configuration]]

LARGE = 300
"""Disks up to which the page has all eigenvalues of every load; 60 loads of so many take some 15 s."""

NEAREST = 60
"""Eigenvalues at each load of a larger packing: those closest to the pair, by the shifted and inverted operator."""

CANDIDATES = 20
"""Complex pairs of a larger packing's last load that are followed back, fastest growing first."""


@dataclass(frozen=True, eq=False)
class RampEigenvalues:
    """Eigenvalues of a ramp, and one pair of them.

    Attributes
    ----------
    values : list of ndarray of complex, shape (E,)
        All eigenvalues at each load, or those `NEAREST` to the pair, 1 / time^2.
    pair : ndarray of complex, shape (S, 2)
        The two that are followed; nan where they are not recognised.
    modes : ndarray of complex, shape (S, 2, 3, N)
        Their displacements along x and y, and R theta; the longest displacement in the plane is one.
    """

    values: list[Complexes]
    pair: Complexes
    modes: Complexes


def follow_eigenvalues(
    packings: Sequence[Packing | Configuration], progress: Progress = iter, everything: bool | None = None
) -> RampEigenvalues:
    """Eigenvalues of equilibria in order of their load.

    Parameters
    ----------
    packings : sequence of Packing or Configuration
        The equilibria, all with the same disks.
    progress : callable
        Wraps the packings while their eigenvalues are computed.
    everything : bool, optional
        Whether all eigenvalues of every load are computed; by default up to `LARGE` disks.

    Raises
    ------
    ModeError
        If the last packing has fewer than two modes.
    """
    if everything is None:
        everything = len(packings[0]) <= LARGE
    if not everything:
        pairs = _earliest(packings)
        values = [_nearest(packing, pairs, k) for k, packing in enumerate(progress(packings))]
    else:
        values = [eigenvalues(force_bearing(packing)) for packing in progress(packings)]
        start, pair = _first(packings, values)
        pairs = _back(packings, start, pair) | _way(packings, range(start + 1, len(packings)), pair)
    found = np.full((len(packings), 2), np.nan, dtype=np.complex128)
    modes = np.zeros((len(packings), 2, 3, len(packings[0])), dtype=np.complex128)
    for k, each in pairs.items():
        own, vectors = np.linalg.eig(each.entries)
        order = np.lexsort((-own.imag, own.real))
        found[k] = own[order]
        for member, number in enumerate(order):
            modes[k, member] = displacement(packings[k], each.right @ vectors[:, number])
    return RampEigenvalues(values, found, modes)


def seconds(packings: Sequence[Packing | Configuration]) -> float:
    """Seconds of `follow_eigenvalues` on one core: all modes of 1,000 disks take 18 s, their eigenvalues 8 s."""
    thousands = len(packings[0]) / 1000
    if len(packings[0]) > LARGE:
        return 18 * thousands**3 + 0.25 * thousands * len(packings)
    return 8 * thousands**3 * len(packings)


def _first(packings: Sequence[Packing | Configuration], values: Sequence[Complexes]) -> tuple[int, Pair]:
    """The first load with a complex pair, and the pair; without one the last load, and two real modes."""
    for k, packing in enumerate(packings):
        if np.any(values[k].imag > 0):
            modes = Modes.of(packing.fx, full_operator(packing))
            if modes.complex_pairs:
                return k, modes.pair(max(modes.complex_pairs, key=lambda each: growth_rate(modes.values[each[0]])))
    return len(packings) - 1, _closest(packings[-1], Modes.of(packings[-1].fx, full_operator(packings[-1])))


def _closest(packing: Packing | Configuration, modes: Modes) -> Pair:
    """The two real modes that are closest to meeting."""
    try:
        first, second, _ = closest_to_meeting(Eigenpairs(modes.values, modes.right, modes.left, 0))
    except ValueError as error:
        words = f"the packing at F_x = {packing.fx:g} has fewer than two modes, so that no two can meet"
        raise ModeError(words) from error
    return modes.pair((first, second))


def _earliest(packings: Sequence[Packing | Configuration]) -> dict[int, Pair]:
    """Of the pairs that are complex at the last load, the one that became complex first, at each load."""
    last = len(packings) - 1
    modes = Modes.of(packings[last].fx, full_operator(packings[last]))
    growing = sorted(modes.complex_pairs, key=lambda each: -growth_rate(modes.values[each[0]]))[:CANDIDATES]
    pairs = [modes.pair(each) for each in growing] or [_closest(packings[last], modes)]
    ways = [_back(packings, last, pair) for pair in pairs]
    return min(ways, key=_complex_from)


def _complex_from(way: dict[int, Pair]) -> int:
    """The first load from which on a pair is complex up to the last."""
    first = max(way)
    while first in way and way[first].discriminant < 0:
        first -= 1
    return first


def _back(packings: Sequence[Packing | Configuration], start: int, pair: Pair) -> dict[int, Pair]:
    """A pair at one load, and at all before where it is recognised."""
    return {start: pair} | _way(packings, range(start - 1, -1, -1), pair)


def _way(packings: Sequence[Packing | Configuration], loads: range, pair: Pair) -> dict[int, Pair]:
    """A pair at loads one after the other, up to where it is not recognised."""
    way: dict[int, Pair] = {}
    for k in loads:
        image = _next(pair, packings[k])
        if image is None:
            break
        way[k] = pair = image
    return way


def _next(pair: Pair, packing: Packing | Configuration) -> Pair | None:
    """The pair in a neighbouring equilibrium; None if it is not recognised."""
    matrix = full_operator(packing)
    image = continue_pair(pair, packing.fx, matrix)
    if image is None and len(packing) <= LARGE:
        modes = Modes.of(packing.fx, matrix)
        image = modes.pair(modes.nearest(pair))
    return image if image is not None and image.same_planes(pair) else None


def _nearest(packing: Packing | Configuration, pairs: dict[int, Pair], k: int) -> Complexes:
    """The eigenvalues closest to the pair of this load, or of the closest one at which the pair is recognised."""
    pair = pairs[min(pairs, key=lambda known: abs(known - k))]
    # off the mean, which at a coalescence is an eigenvalue itself
    shift = pair.mean + max(pair.spread, 1e-6 * abs(pair.mean))
    matrix = full_operator(packing)
    start = np.ones(matrix.shape[0])  # ARPACK's own is random
    return np.asarray(eigs(matrix.tocsc(), NEAREST, sigma=shift, v0=start, return_eigenvectors=False))
