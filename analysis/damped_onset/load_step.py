r"""Two neighbouring loads with dissipation: which mode is which, and where a narrow window may hide.

Two modes that nearly meet may begin to grow, and end to, between two loads at which neither grows. Half the sum m of
two eigenvalues and :math:`D = (s_1 - s_2)^2` are smooth functions of the load even where both coalesce, so that
:math:`m \pm \tfrac12\sqrt D` of the cubics through their values and slopes at both ends tells what the modes do in
between.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..onset.modes import neighbours
from ..packing.packing import Floats, Indices
from .modes import DampedModes

ALIKE = 0.1
"""Two modes count as alike if the products with each other's successors are this share of those with their own."""

PLACES = np.linspace(0, 1, 41)[1:-1]
"""Where in an increment the cubics are looked at."""


@dataclass(frozen=True, eq=False)
class GrowthStep:
    """Two neighbouring loads, which mode is which, and the modes' slopes."""

    here: DampedModes
    there: DampedModes
    forward: Indices

    @classmethod
    def of(cls, here: DampedModes, there: DampedModes) -> "GrowthStep":
        forward = here.assign_to(there)
        grows = np.isin(np.arange(len(there)), there.grows)
        ends = [k for k in here.grows if forward[k] >= 0 and not grows[forward[k]]]
        begins = [k for k in np.flatnonzero(forward >= 0) if grows[forward[k]] and k not in here.grows]
        for a in ends:
            for b in begins:
                # shapes of two modes that nearly coalesce are alike: what goes on growing is then the same mode
                if grows[forward[b]] and not grows[forward[a]] and _same_modes(here, there, forward, int(a), int(b)):
                    forward[[a, b]] = forward[[b, a]]
        return cls(here, there, forward)

    @property
    def edges(self) -> list[tuple[int, int]]:
        """Modes that grow at one end alone."""
        before = np.isin(np.arange(len(self.here)), self.here.grows)
        known = np.flatnonzero(self.forward >= 0)
        after = np.isin(self.forward[known], self.there.grows)
        return [(int(k), int(self.forward[k])) for k in known[before[known] != after]]

    @property
    def loses_growing_mode(self) -> bool:
        """Whether a growing mode at one end is none of the modes at the other."""
        unknown = np.setdiff1d(self.there.grows, self.forward)
        return bool(len(unknown) or np.any(self.forward[self.here.grows] < 0))

    def suspects(self, narrowest: float) -> list[tuple[int, int]]:
        """Pairs of modes, by their numbers here, of which others may grow in between than at the ends."""
        known = np.flatnonzero(self.forward >= 0)
        a, b = self.here.rates[known], self.there.rates[self.forward[known]]
        slope_a = self.here.changes(self.there.pencil)[known]
        slope_b = -self.there.changes(self.here.pencil)[self.forward[known]]
        finite = np.isfinite(slope_a) & np.isfinite(slope_b)
        known = known[finite]
        a, b, slope_a, slope_b = (each[finite] for each in (a, b, slope_a, slope_b))
        p, q = neighbours(a.imag, b.imag, 2)
        width, _ = excursion(*((each[p], each[q]) for each in (a, slope_a, b, slope_b)))
        wide = np.flatnonzero(width * (self.there.fx - self.here.fx) > narrowest)
        return [(int(known[p[k]]), int(known[q[k]])) for k in wide]


def excursion(
    a: Sequence[Any], slope_a: Sequence[Any], b: Sequence[Any], slope_b: Sequence[Any]
) -> tuple[Floats, Floats]:
    """Where pairs of modes have another sign of Re s in 0 < t < 1 than at both ends.

    Parameters
    ----------
    a, slope_a, b, slope_b : two ndarrays of complex, shape (P,)
        Eigenvalues of the two modes at t = 0, their slopes, and those at t = 1.

    Returns
    -------
    width : ndarray, shape (P,)
        Share of the increment; zero where there is no such place.
    at : ndarray, shape (P,)
        The place at which Re s is farthest on the other side.
    """
    mean = _cubic(*(0.5 * (each[0] + each[1]) for each in (a, slope_a, b, slope_b)))
    gap_a, gap_b = a[0] - a[1], b[0] - b[1]
    drift_a, drift_b = 2 * gap_a * (slope_a[0] - slope_a[1]), 2 * gap_b * (slope_b[0] - slope_b[1])
    root = 0.5 * np.sqrt(_cubic(gap_a**2, drift_a, gap_b**2, drift_b).astype(complex)).real
    between = np.array([mean.real + root, mean.real - root])
    before, after = (np.sort(np.array(each).real, axis=0)[::-1, ..., None] for each in (a, b))
    other = ((between > 0) != (before > 0)) & ((before > 0) == (after > 0))
    depth = np.where(other, np.abs(between), 0.0).max(axis=0)
    return other.any(axis=0).sum(axis=-1) / (len(PLACES) + 1), PLACES[np.argmax(depth, axis=-1)]


def _same_modes(here: DampedModes, there: DampedModes, forward: Indices, a: int, b: int) -> bool:
    """Whether two modes may as well have become each other's successor."""

    def weight(k: int, image: int) -> float:
        shapes = np.vdot(here.right[:, k], there.right[:, image]), np.vdot(here.left[:, k], there.left[:, image])
        return float(abs(shapes[0]) * abs(shapes[1]))

    crossed = weight(a, forward[b]) * weight(b, forward[a])
    return crossed > ALIKE * weight(a, forward[a]) * weight(b, forward[b])


def _cubic(a: Any, slope_a: Any, b: Any, slope_b: Any) -> Any:
    """Cubics through values and slopes at the ends of 0 < t < 1, at `PLACES`; shape (..., P)."""
    t = PLACES
    parts = ((a, (1 + 2 * t) * (1 - t) ** 2), (slope_a, t * (1 - t) ** 2), (b, t**2 * (3 - 2 * t)))
    return sum(np.multiply.outer(each, shape) for each, shape in parts) - np.multiply.outer(slope_b, t**2 * (1 - t))
