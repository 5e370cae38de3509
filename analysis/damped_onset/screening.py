r"""Which modes may begin to grow, or end to, between two loads: perturbation theory, and small pencils of a few modes.

In an eigenbasis of the symmetric part of A at a load nearby, :math:`H = X^T A X` and :math:`\Gamma = X^T G X` are
nearly diagonal. Mode k alone has :math:`s^2 + s \Gamma_{kk} + H_{kk} = 0`. The others add in second order

.. math::

    \sigma_k = - \sum_{l \ne k} \frac{V_{kl} V_{lk}}{g_{kl}}, \qquad V_{kl} = H_{kl} + s \Gamma_{kl}, \qquad
    g_{kl} = H_{ll} - H_{kk} + s (\Gamma_{ll} - \Gamma_{kk})

to :math:`H_{kk}`, so that its damping is :math:`d_k = \Gamma_{kk} + \mathrm{Im}\,\sigma_k / \omega_k`. Only terms with
at least one factor of :math:`\Gamma` have imaginary parts. The third order is estimated in this way, however weak the
damping is: the root of the sum of squares of its terms, times `SAFE`. A mode surely loses energy if :math:`d_k` exceeds
this estimate and `SPARE` of :math:`\Gamma_{kk}`, at both loads and half-way, and if no other mode comes so close that
:math:`|V_{kl}/g_{kl}|` exceeds `CLOSE` in between.

**All other modes** are *suspects*. They form clusters with `MARGIN` modes on either side. A cluster is a small pencil:
that of vectors to which the modes outside are added in first order. It is a straight line between the loads, and all of
its windows are found as those of a small system. The operator has the last word about what begins or ends there.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh
from scipy.sparse import csr_array

from ..motion.state_space import StateSpace
from ..packing.packing import Floats, Indices
from ..spectrum.spectrum import Complexes
from .modes import Pencil

SAFE = 5.0
"""Third order, in roots of its sum of squares: its terms have random signs."""

SPARE = 0.1
"""Share of a mode's own damping that has to be left."""

CLOSE = 0.25
"""Mixing of two modes up to which the second order is trusted: what is left out is of the relative order of its square,
0.06."""

WEAK = 0.3
"""Damping over frequency up to which a mode counts as oscillating."""

MARGIN = 20
"""Modes of a cluster on either side: farther ones mix by less than a hundredth, and are there in first order."""

APART = 10
"""Suspects that are closer belong to one cluster."""

LARGEST = 100
"""Modes of a cluster: all modes take no longer than a few larger ones."""


@dataclass(frozen=True, eq=False)
class Reduced:
    """H and Gamma at one load, shape (E, E), 1 / time^2 and 1 / time."""

    stiffness: Floats
    damping: Floats

    def mean(self, other: "Reduced") -> "Reduced":
        """Half-way to another load."""
        return Reduced(0.5 * (self.stiffness + other.stiffness), 0.5 * (self.damping + other.damping))

    @property
    def frequencies(self) -> Floats:
        """omega_k, 1 / time; nan of a level below zero."""
        with np.errstate(invalid="ignore"):
            return np.sqrt(np.diag(self.stiffness))

    def damping_of_modes(self) -> Floats:
        """d_k in second order, shape (E,), 1 / time."""
        h, gamma = np.diag(self.stiffness), np.diag(self.damping)
        s = (-0.5 * gamma + 1j * np.sqrt(h - 0.25 * gamma**2))[:, None]
        g = (h - h[:, None]) + s * (gamma - gamma[:, None])
        np.fill_diagonal(g, np.inf)
        forward = self.stiffness + s * self.damping
        backward = self.stiffness.T + s * self.damping.T
        with np.errstate(divide="ignore", invalid="ignore"):
            shift = -np.sum(forward * backward / g, axis=1)
        return np.asarray(gamma + shift.imag / np.sqrt(h))


@dataclass(frozen=True, eq=False)
class Cluster:
    """A small pencil between two loads, and how its vectors become those of all coordinates.

    Attributes
    ----------
    loads : (float, float)
        The lower and the upper load.
    ends : (Reduced, Reduced)
        The pencil at both of them, shape (m, m).
    right, left : ndarray, shape (3N, m)
        Its right and left vectors on all coordinates.
    owned : (float, float)
        Frequencies of the modes that are its own, 1 / time.
    """

    loads: tuple[float, float]
    ends: tuple[Reduced, Reduced]
    right: Floats
    left: Floats
    owned: tuple[float, float]

    def pencil(self, fx: float) -> Pencil:
        """The small pencil at a load."""
        t = (fx - self.loads[0]) / (self.loads[1] - self.loads[0])
        a, g = (
            csr_array((1 - t) * one + t * other)
            for one, other in (
                (self.ends[0].stiffness, self.ends[1].stiffness),
                (self.ends[0].damping, self.ends[1].damping),
            )
        )
        return Pencil.of_system(fx, StateSpace.of_matrices(a, g, np.ones(a.shape[0])), a.shape[0])

    def owns(self, frequency: float) -> bool:
        """Whether a motion of this frequency is its own, and no other cluster's."""
        return self.owned[0] <= frequency <= self.owned[1]

    def lifted(self, right: Complexes, left: Complexes) -> tuple[Complexes, Complexes]:
        """Vectors of the small pencil on all coordinates."""
        x, y = self.right @ right, self.left @ left
        return x / np.linalg.norm(x), y / np.linalg.norm(y)


class Screen:
    """The clusters that may change along a ramp, from one basis for as many increments as it serves."""

    def __init__(self) -> None:
        self._base: Pencil | None = None
        self._vectors = np.zeros((0, 0))
        self._active: Indices = np.zeros(0, np.int64)
        self._seen: tuple[Pencil, Reduced] | None = None

    def __call__(self, here: Pencil, there: Pencil) -> list[Cluster] | None:
        """The clusters; None if they are not known."""
        found = None if self._base is None else self._look(here, there)
        if (found is None or len(found) > 0) and self._base is not here:
            a = here.inner(here.stiffness).toarray()
            self._base, self._active, self._seen = here, here.active, None
            self._vectors = eigh(0.5 * (a + a.T), driver="evd", overwrite_a=True, check_finite=False)[1]
            found = self._look(here, there)
        return found

    def _look(self, here: Pencil, there: Pencil) -> list[Cluster] | None:
        if not (np.array_equal(here.active, self._active) and np.array_equal(there.active, self._active)):
            return None
        before = self._seen[1] if self._seen is not None and self._seen[0] is here else self._reduced(here)
        after = self._reduced(there)
        self._seen = there, after
        suspects = may_grow(before, after)
        if suspects is None:
            return None
        cores = np.split(suspects, np.flatnonzero(np.diff(suspects) > APART) + 1) if len(suspects) else []
        if any(core[-1] - core[0] + 2 * MARGIN > LARGEST for core in cores):
            return None
        return list(self._clusters((here, before), (there, after), cores))

    def _reduced(self, pencil: Pencil) -> Reduced:
        x = self._vectors
        return Reduced(*(x.T @ (pencil.inner(each) @ x) for each in (pencil.stiffness, pencil.damping)))

    def _clusters(
        self, here: tuple[Pencil, Reduced], there: tuple[Pencil, Reduced], cores: list[Indices]
    ) -> Iterator[Cluster]:
        """The small pencils about some modes each."""
        middle = here[1].mean(there[1])
        level, size = np.diag(middle.stiffness), len(self._active)
        ordered = np.sort(middle.frequencies)
        for core in cores:
            modes = np.arange(max(0, core[0] - MARGIN), min(size, core[-1] + 1 + MARGIN))
            right, left = (_with_others(each, level, modes) for each in (middle.stiffness, middle.stiffness.T))
            metric = np.linalg.inv(left.T @ right)
            left = left @ metric.T
            ends = tuple(
                Reduced(left.T @ each.stiffness @ right, left.T @ each.damping @ right) for each in (here[1], there[1])
            )
            spread = np.zeros((2, here[0].stiffness.shape[0], len(modes)))
            spread[0, self._active], spread[1, self._active] = self._vectors @ right, self._vectors @ left
            owned = _between(ordered, int(core[0])), _between(ordered, int(core[-1]) + 1)
            yield Cluster((here[0].fx, there[0].fx), (ends[0], ends[1]), spread[0], spread[1], owned)


def may_grow(here: Reduced, there: Reduced) -> Indices | None:
    """Modes that may grow at two loads or between them, in increasing order; None if perturbation theory is of no use.

    Parameters
    ----------
    here, there : Reduced
        The pencil at both loads, in one basis.
    """
    points = here, here.mean(there), there
    frequency = np.min([each.frequencies for each in points], axis=0)
    gamma = np.max([np.diag(each.damping) for each in points], axis=0)
    if not np.all(gamma < WEAK * frequency):
        return None
    mixing, third = _mixing_and_third_order(here, there, np.max([each.frequencies for each in points], axis=0))
    least = np.min([each.damping_of_modes() for each in points], axis=0)
    own = np.min([np.diag(each.damping) for each in points], axis=0)
    return np.flatnonzero((least - SAFE * third / frequency <= SPARE * own) | (mixing > CLOSE))


def _mixing_and_third_order(here: Reduced, there: Reduced, frequency: Floats) -> tuple[Floats, Floats]:
    """The largest |V/g| of each mode with another, and the scale of the third order of Im sigma, 1 / time^2."""
    h = np.maximum(np.abs(here.stiffness), np.abs(there.stiffness))
    h = np.maximum(h, h.T).astype(np.float32)
    p = np.maximum(np.abs(here.damping), np.abs(there.damping)) * np.maximum(frequency, frequency[:, None])
    p = p.astype(np.float32)
    for each in (h, p):
        np.fill_diagonal(each, 0.0)
    before, after = (np.subtract.outer(np.diag(each.stiffness), np.diag(each.stiffness)) for each in (here, there))
    real = np.minimum(np.abs(before), np.abs(after))
    real[before * after < 0] = 0.0
    loss = [np.diag(each.damping) for each in (here, there)]
    q = frequency[:, None] * np.max([np.abs(np.subtract.outer(each, each)) for each in loss], axis=0)
    low = frequency[:, None] * np.min([np.abs(np.subtract.outer(each, each)) for each in loss], axis=0)
    g = np.hypot(real, low)
    np.fill_diagonal(g, np.inf)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.nan_to_num((h + p) / g, nan=0.0, posinf=1e9)
    mixing = ratio.max(axis=1)
    ratio = np.minimum(ratio, 1.0)
    imaginary = np.minimum(np.nan_to_num(p / g + ratio * q / g, nan=0.0, posinf=1e9), ratio)
    ratio, imaginary = (each.astype(np.float32) ** 2 for each in (ratio, imaginary))
    h, p = (h + p) ** 2, p**2
    third = np.sum(4 * (ratio @ h) * imaginary + (ratio @ p) * ratio, axis=1)
    return mixing, np.sqrt(third.astype(np.float64))


def _with_others(matrix: Floats, level: Floats, modes: Indices) -> Floats:
    """Unit vectors of some modes, with all others in first order, shape (E, m)."""
    distance = level[modes] - level[:, None]
    distance[modes] = np.inf
    # levels of the margin may lie close to those outside: at the core these are far
    spacing = float(np.median(np.diff(np.sort(level[modes]))))
    small = np.abs(distance) < spacing
    distance[small] = np.where(distance[small] < 0, -spacing, spacing)
    vectors = matrix[:, modes] / distance
    vectors[modes, np.arange(len(modes))] = 1.0
    return np.asarray(vectors)


def _between(frequencies: Floats, first: int) -> float:
    """Half-way between a mode and the one below, one mode more on either side being no harm; 0 or inf at the ends."""
    if first <= 0:
        return 0.0
    if first >= len(frequencies):
        return np.inf
    return float(0.5 * (frequencies[first - 1] + frequencies[first]))
