r"""Which modes may begin or cease to grow between two loads: perturbation theory, and small pencils of a few modes.

In an eigenbasis of the symmetric part of A at a load nearby, :math:`H = X^T A X` and :math:`\Gamma = X^T G X` are
nearly diagonal. Mode k alone has :math:`s^2 + s \Gamma_{kk} + H_{kk} = 0`. The others add in second order

.. math::

    \sigma_k = - \sum_{l \ne k} \frac{V_{kl} V_{lk}}{g_{kl}}, \qquad V_{kl} = H_{kl} + s \Gamma_{kl}, \qquad
    g_{kl} = H_{ll} - H_{kk} + s (\Gamma_{ll} - \Gamma_{kk})

to :math:`H_{kk}`, so that its damping is :math:`d_k = \Gamma_{kk} + \mathrm{Im}\,\sigma_k / \omega_k`. Only terms with
at least one factor of :math:`\Gamma` have imaginary parts. The third order is estimated in this way, however weak the
damping is: the root of the sum of squares of its terms, times `Limits.third_order`. A mode surely loses energy if
:math:`d_k` exceeds this estimate and `Limits.spare` of :math:`\Gamma_{kk}`, at both loads and half-way, and if no other
mode comes so close that :math:`|V_{kl}/g_{kl}|` exceeds `Limits.largest_mixing` in between.

**A cluster is quiet** where no motion of it can be fed as much as it loses. On the axis, :math:`s = i\omega`, a unit
vector x has :math:`x^H A_s x = \omega^2` and :math:`\omega\, x^H G x = |x^H A_a x|`, with the symmetric and the
antisymmetric part of A. So nothing crosses the axis if :math:`\omega_0 G + i A_a` is positive definite, where
:math:`\omega_0^2` is the lowest level of the cluster. A form that is positive definite at two loads is so on the
straight line between them, and remains so while :math:`A_a` is scaled down to zero. Nothing grows there, then. A
Cholesky factorisation tells.

**All other modes** are *suspects*. They form clusters with `Limits.margin` modes on either side. A cluster is a small
pencil, projected on vectors to which the modes outside are added in first order. The pencil is taken as a straight line
between the loads, and all of its windows are found as those of a small system. The full operator confirms them.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg import eigh, eigvalsh
from scipy.sparse import csr_array

from ...arrays import Floats, Indices
from ..between import Few
from ..edges import DoubtError
from ..limits import LIMITS, Limits
from ..search import Search
from ..slices.eigenbasis import Basis, Levels
from ..space import Space
from ..system import System
from ..system_modes import SystemModes


@dataclass(frozen=True, eq=False)
class Reduced:
    """H and Gamma at one load, 1 / time^2 and 1 / time."""

    stiffness: Levels
    damping: Levels

    def mean(self, other: "Reduced") -> "Reduced":
        """Half-way to another load."""
        return Reduced(self.stiffness.beyond(other.stiffness, 0.5), self.damping.beyond(other.damping, 0.5))

    @cached_property
    def frequencies(self) -> Floats:
        """omega_k, 1 / time; nan of a level below zero."""
        with np.errstate(invalid="ignore"):
            return np.sqrt(self.stiffness.diagonal)

    @cached_property
    def damping_of_modes(self) -> Floats:
        """d_k in second order, shape (E,), 1 / time."""
        h, gamma = self.stiffness.diagonal, self.damping.diagonal
        real = (-0.5 * gamma).astype(np.float32)[:, None]  # s, in two parts: complex numbers take three times as long
        imag = np.sqrt(np.maximum(h - 0.25 * gamma**2, 0.0)).astype(np.float32)[:, None]
        apart = -self.stiffness.distance - real * self.damping.distance
        across = -imag * self.damping.distance
        loss = real * self.damping.coupling
        forward, backward = self.stiffness.coupling + loss, self.stiffness.coupling.T + loss
        loss = imag * self.damping.coupling
        shift = (forward + backward) * loss * apart - (forward * backward - loss * loss) * across
        size = apart * apart + across * across
        np.fill_diagonal(size, 1.0)
        with np.errstate(divide="ignore", invalid="ignore"):  # of modes that hardly oscillate
            return np.asarray(gamma - np.sum(shift / size, axis=1, dtype=np.float64) / np.sqrt(h))

    @cached_property
    def bears(self) -> float:
        """Factor by which the antisymmetric part may surely grow before it feeds any motion of these modes.

        The factor comes from the form of `Cluster.quiet`, taken for all modes of the basis.
        """
        feed = self.stiffness.coupling.astype(np.float64)
        loss = self.damping.coupling + np.diag(self.damping.diagonal)
        softest = float(self.stiffness.diagonal.min())
        if not (softest > 0 and np.any(feed)):
            return 0.0 if softest <= 0 else np.inf
        try:
            taken = LIMITS.dissipation_share * np.sqrt(softest) * (loss + loss.T)
            return 1 / float(eigh(1j * (feed - feed.T), taken, eigvals_only=True)[-1])
        except np.linalg.LinAlgError:
            return 0.0

    def between(self, left: Floats, right: Floats) -> tuple[Floats, Floats]:
        """The blocks of both between some left and right vectors, shape (m, m)."""
        rough = left.T.astype(np.float32), right.astype(np.float32)
        a, g = (
            (left * each.diagonal[:, None]).T @ right + rough[0] @ (each.coupling @ rough[1])
            for each in (self.stiffness, self.damping)
        )
        return a, g


@dataclass(frozen=True, eq=False)
class Cluster:
    """A small pencil between two loads, with vectors that lift its motions to all coordinates.

    Attributes
    ----------
    loads : (float, float)
        The lower and the upper load.
    ends : ((ndarray, ndarray), (ndarray, ndarray)), shape (m, m)
        Stiffness and damping of the pencil at either load.
    right, left : ndarray, shape (3N, m)
        Right and left vectors on all coordinates.
    own_range : (float, float)
        Range of the frequencies that belong to this cluster and to no other, 1 / time.
    """

    loads: tuple[float, float]
    ends: tuple[tuple[Floats, Floats], tuple[Floats, Floats]]
    right: Floats
    left: Floats
    own_range: tuple[float, float]

    def system(self, fx: float) -> System:
        """The small system at a load."""
        t = (fx - self.loads[0]) / (self.loads[1] - self.loads[0])
        return System(fx, *((1 - t) * one + t * other for one, other in zip(*self.ends, strict=True)))

    @property
    def quiet(self) -> bool:
        """Whether nothing can begin to grow in its pencil between the loads; see the module."""
        (a, g), (b, h) = self.ends
        softest = min(float(eigvalsh(0.5 * (each + each.T))[0]) for each in (a, b))
        turning = max(float(np.linalg.norm(each - each.T)) for each in (g, h))
        frequency = np.sqrt(max(0.0, softest)) - turning
        forms = (
            LIMITS.dissipation_share * frequency * (loss + loss.T) + 1j * (force - force.T) for force, loss in self.ends
        )
        try:
            return frequency > 0 and all(np.linalg.cholesky(form).size > 0 for form in forms)
        except np.linalg.LinAlgError:
            return False

    def owns(self, frequency: float) -> bool:
        """Whether a motion of this frequency belongs to this cluster, and not to another one."""
        return self.own_range[0] <= frequency <= self.own_range[1]

    def lift(self, mode: Space) -> tuple[Floats, Floats]:
        """Unit displacements x and y of a mode of the small system on all coordinates."""
        x, y = (basis @ shape[:, 0] for basis, shape in zip((self.right, self.left), mode.shapes, strict=True))
        return x / np.linalg.norm(x), y / np.linalg.norm(y)

    def search(self, limits: Limits = LIMITS) -> Search:
        """The search of its windows from the lower load to the upper one."""
        below, above = self.loads
        search = Search(
            self.system,
            limits.increment_window * (above - below),
            limits=replace(limits, root_width=limits.increment_window),
        )
        for _ in search.along(np.array(self.loads)):
            pass
        return search

    def nearly_growing(self, modes: SystemModes, limits: Limits = LIMITS) -> list[Space]:
        """Own modes that grow or nearly grow at the upper load, or grow a little beyond that load."""
        near = np.flatnonzero(modes.values.real > limits.weak_damping * np.median(modes.values.real))
        found = [modes.space((int(k),)) for k in near if self.owns(modes.values[k].imag)]
        below, above = self.loads
        system = self.system(above + limits.overshoot * (above - below))
        further = SystemModes.of(system)
        if len(further.grows) <= len(modes.grows):
            return found
        return found + [further.space((int(k),)) for k in further.grows if self.owns(further.values[k].imag)]


class GrowthScreen:
    """The motions that may begin or cease to grow along a ramp, from one basis for as many increments as it serves."""

    def __init__(self, limits: Limits = LIMITS) -> None:
        self.limits = limits
        self._base: System | None = None
        self._basis: Basis | None = None
        self._seen: tuple[System, Reduced] | None = None

    def __call__(self, here: System, there: System, growing: Sequence[Space], depth: int) -> Few | None:
        """The modes of the system that grow at the upper load, sought where a few clusters announce them.

        None if the clusters are not known, or too many. A DoubtError says where a cluster has a window in between.
        """
        clusters = self._clusters(here, there)
        most = max(1, self.limits.clusters * here.stiffness.shape[0] ** 2) / 2**depth
        if clusters is None or len(clusters) > most:
            return None
        found: list[Space] = []
        for guess, rate in [each for cluster in clusters for each in self._guesses(cluster, there)]:
            mode = guess.at(there, self.limits, rate)
            if mode is None:
                raise DoubtError
            if mode.grows and not any(mode.equals(each) for each in found):
                found.append(mode)
        return Few([(None, mode) for mode in found], len(clusters))

    def _guesses(self, cluster: "Cluster", there: System) -> list[tuple[Space, complex]]:
        """Modes of a cluster that grow or nearly grow at the upper load: guesses for modes of the system."""
        search = cluster.search(self.limits)
        for each in search.closed:
            if each.kind != "start" and each.fx_end is not None and cluster.owns(each.frequency):
                raise DoubtError(0.5 * (each.fx_onset + each.fx_end))
        modes = cluster.nearly_growing(search.modes_at(cluster.loads[1]), self.limits)
        return [(Space.of(there, *cluster.lift(mode), mode.mean), mode.mean) for mode in modes]

    def _clusters(self, here: System, there: System) -> list["Cluster"] | None:
        """The clusters that may change; None if they are not known."""
        found = None if self._basis is None else self._look(self._basis, here, there)
        if (found is None or len(found) > 0) and self._base is not here:
            self._base, self._basis, self._seen = here, Basis.of(here.stiffness, self.limits), None
            found = self._look(self._basis, here, there)
        return found

    def _look(self, basis: Basis, here: System, there: System) -> list["Cluster"] | None:
        if not (basis.covers(here.stiffness) and basis.covers(there.stiffness)):
            return None
        seen = self._seen or (here, reduce_system(basis, basis.levels(here.stiffness), here))
        before = shift_load(basis, *seen, here)
        after = shift_load(basis, here, before, there)
        self._seen = there, after
        suspects = may_grow(before, after)
        cores = find_cores(suspects)
        largest = max(self.limits.largest_cluster, self.limits.largest_share * len(basis.active))
        if any(core[-1] - core[0] + 2 * self.limits.margin > largest for core in cores):
            return None
        return [each for each in group_clusters(basis, (here, before), (there, after), cores) if not each.quiet]


def reduce_system(basis: Basis, levels: Levels, system: System) -> Reduced:
    """A system in a basis in which the levels of its stiffness are known."""
    nothing = Levels(np.zeros(len(basis.values)), np.zeros((len(basis.values),) * 2, np.float32))
    return Reduced(levels, basis.change(nothing, _damping(system)))


def shift_load(basis: Basis, here: System, reduced: Reduced, there: System) -> Reduced:
    """The reduced system at another load."""
    if here is there:
        return reduced
    return Reduced(
        basis.change(reduced.stiffness, there.stiffness - here.stiffness),
        basis.change(reduced.damping, _damping(there) - _damping(here)),
    )


def _damping(system: System) -> csr_array:
    assert system.damping is not None
    return system.damping


def find_cores(suspects: Indices) -> list[Indices]:
    """Suspects that are close to each other."""
    return np.split(suspects, np.flatnonzero(np.diff(suspects) > LIMITS.suspect_distance) + 1) if len(suspects) else []


def group_clusters(
    basis: Basis, here: tuple[System, Reduced], there: tuple[System, Reduced], cores: list[Indices]
) -> Iterator[Cluster]:
    """The small pencils about some modes each."""
    if not cores:
        return
    middle = here[1].mean(there[1])
    level, size = middle.stiffness.diagonal, len(basis.values)
    ordered = np.sort(middle.frequencies)
    for core in cores:
        modes = np.arange(max(0, core[0] - LIMITS.margin), min(size, core[-1] + 1 + LIMITS.margin))
        coupling = np.asarray(middle.stiffness.coupling, np.float64)
        right, left = (_with_others(each, level, modes) for each in (coupling, coupling.T))
        left = left @ np.linalg.inv(left.T @ right).T
        ends = here[1].between(left, right), there[1].between(left, right)
        spread = np.zeros((2, basis.size, len(modes)))
        spread[0, basis.active], spread[1, basis.active] = basis.vectors @ right, basis.vectors @ left
        own_range = _frequency_between(ordered, int(core[0])), _frequency_between(ordered, int(core[-1]) + 1)
        yield Cluster((here[0].fx, there[0].fx), ends, spread[0], spread[1], own_range)


def may_grow(here: Reduced, there: Reduced) -> Indices:
    """Modes that may grow at two loads or between them, in increasing order; those that hardly oscillate among them.

    Parameters
    ----------
    here, there : Reduced
        The pencil at both loads, in one basis.
    """
    points = here, here.mean(there), there
    frequency = np.min([each.frequencies for each in points], axis=0)
    gamma = np.max([each.damping.diagonal for each in points], axis=0)
    strong = ~(gamma < LIMITS.oscillation_damping * frequency)
    mixing, third = _mixing_and_third_order(here, there, np.max([each.frequencies for each in points], axis=0))
    least = np.min([each.damping_of_modes for each in points], axis=0)
    own = np.min([each.damping.diagonal for each in points], axis=0)
    lost = ~(least - LIMITS.third_order * third / frequency > LIMITS.spare * own)
    return np.flatnonzero(strong | lost | (mixing > LIMITS.largest_mixing))


def _mixing_and_third_order(here: Reduced, there: Reduced, frequency: Floats) -> tuple[Floats, Floats]:
    """The largest |V/g| of each mode with any other, and the scale of the third order of Im sigma, 1 / time^2."""
    frequency = np.nan_to_num(frequency).astype(np.float32)
    h = np.maximum(here.stiffness.largest, there.stiffness.largest)
    p = np.maximum(here.damping.largest, there.damping.largest) * np.maximum(frequency, frequency[:, None])
    apart = here.stiffness.distance, there.stiffness.distance
    real = np.minimum(np.abs(apart[0]), np.abs(apart[1]))
    real[apart[0] * apart[1] < 0] = 0.0
    loss = np.abs(here.damping.distance), np.abs(there.damping.distance)
    q, low = (frequency[:, None] * each(*loss) for each in (np.maximum, np.minimum))
    g = np.hypot(real, low)
    np.fill_diagonal(g, np.inf)
    h += p
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio, imaginary = (np.nan_to_num(each / g, nan=0.0, posinf=1e9) for each in (h, p))
        mixing = ratio.max(axis=1)
        np.minimum(ratio, 1.0, out=ratio)
        imaginary += np.nan_to_num(ratio * q / g, nan=0.0, posinf=1e9)
    np.minimum(imaginary, ratio, out=imaginary)
    for each in (ratio, imaginary, h, p):
        np.square(each, out=each)
    third = np.sum(4 * (ratio @ h) * imaginary + (ratio @ p) * ratio, axis=1, dtype=np.float64)
    return mixing, np.sqrt(third)


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


def _frequency_between(frequencies: Floats, first: int) -> float:
    """The frequency half-way between a mode and the next one below; 0 or inf beyond the ends of the basis."""
    if first <= 0:
        return 0.0
    if first >= len(frequencies):
        return np.inf
    return float(0.5 * (frequencies[first - 1] + frequencies[first]))
