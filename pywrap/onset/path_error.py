r"""The part of an onset's error that comes from the path of equilibria.

Friction remembers the path, and a ramp takes the path in finite increments h. Between two equilibria the slips advance
along a straight line with the tangent at its middle: an error of order h^3 an increment, and so of h^2 at the onset. A
contact that closes on the way begins without slip at the end of its increment: what it would have slipped before, up to
all that it slips in one increment, is lost, and the error is of order h. Where a contact reaches the Coulomb bound or
leaves it the order is the second, but the coefficient depends on where in an increment that happens.

So the path is solved once more, to the onset F_h found on the ramp, through every second load of the ramp. On this path
the same pair of eigenvalues coalesces at F_2h. With the increments :math:`h_i` of either path, and no change of the
contacts on the way, the error that is left out is

.. math:: F_h - F = \frac{F_{2h} - F_h}{S_{2h}/S_h - 1}, \qquad S = \sum_i h_i^3,

Richardson's extrapolation, for increments that need not be equal. The onset is given at F, and twice the largest
difference that rounding of both onsets allows is its uncertainty. Where contacts change, nothing is extrapolated. The
loads that are left out are then those after an increment with a change: a contact that closes there loses its slip
over twice the increment. What is lost depends on where in the increment the contact closes, and one other path may
lose by chance about as much as the ramp. A third path therefore goes through the middles of all increments, and with an
error of order h the larger of :math:`|F_{2h} - F_h|` and :math:`2 |F_h - F_{h/2}|` is what is stated.

Of a ramp that has fewer than `FEWEST` increments up to the onset the other path goes through the middles of the
increments, too; its S is then the smaller one, and the same formula holds.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, eigvals
from scipy.sparse.linalg import ArpackError

from ...analysis import NoEquilibriumError, Onset, OnsetError, Packing, Window, dynamical_matrix, eigenpairs
from ...analysis.damped_onset.modes import DampedMode, Pencil, nearest_mode
from ...analysis.damped_onset.windows import DampedWindow
from ...analysis.onset import force_bearing
from ..equilibria.quasistatic import Equilibrium
from ..lammps.engine import Engine
from ..runs.path import EquilibriumPath
from ..scenes.scene import Scene

Floats = NDArray[np.float64]
Vanishes = Callable[[Packing], float]

FEWEST = 4
"""Increments up to the onset from which on every second load may be left out."""

CARRIES = 1e-9
"""Normal force, in units of F_y, from which on a contact counts; that of a disk that carries nothing is noise."""

AT_THE_BOUND = 1 - 1e-9
"""Slip, in units of its limit, from which on a contact slides: a clamped slip differs from the limit by rounding."""

FAILURES = NoEquilibriumError, OnsetError, ArpackError, LinAlgError
"""What another path may end in: an onset that is known is worth more than the error of its path."""

LONGEST_RUN = 2
"""Loads that may be left out one after the other."""

SMALL = 30
"""Disks up to which all eigenvalues take no longer than some."""

STEPS = 8
"""Secant steps to the onset on the other path; two or three do."""

UNKNOWN = 2.0
"""Uncertainty of an extrapolated onset, in units of the correction. As a rule a correction is good to a tenth.
Where its coefficient changes sign along the path, the correction is wrong by more than itself."""

NOISY = 10
"""Rounding errors about which the last of the secant steps may still jump."""

SETTLED = 0.02
"""Last secant step, in units of the shift, at which the shift is known: it only has to tell the size of an error."""


@dataclass(frozen=True)
class PathError:
    """What the increments do to one onset.

    Attributes
    ----------
    shift : float
        F_2h - F_h, force; nan where the pair is not found on the other path.
    finer : float
        F_h/2 - F_h, force, where contacts change; nan where they do not, or the pair is not found on that path.
    weight : float
        S_2h / S_h - 1.
    changes : bool
        Whether contacts close, open, or reach or leave the Coulomb bound before the onset.
    rounding : float
        Uncertainty of either onset from rounding, force.
    increment : float
        Of the ramp at the onset, force.
    """

    shift: float
    finer: float
    weight: float
    changes: bool
    rounding: float
    increment: float

    @property
    def correction(self) -> float:
        """What has to be added to F_h, force: 0 where it is no more than rounding, or contacts change."""
        if self.changes or not abs(self.shift) > 2 * self.rounding:
            return 0.0
        return -self.shift / self.weight

    @property
    def error(self) -> float:
        """Uncertainty of the onset from its path, force; rounding may hide two roundings of the shift."""
        shifts = [part for part in (abs(self.shift), 2 * abs(self.finer)) if not np.isnan(part)]
        if not shifts:
            return self.increment
        largest = max(shifts) + 2 * self.rounding
        part = 1.0 if self.weight > 0 else 2.0  # the ramp is the coarser path of the two
        return part * largest if self.changes else UNKNOWN * largest / abs(self.weight)


def with_path_error(onset: Onset, engine: Engine, path: EquilibriumPath, scene: Scene) -> Onset:
    """An onset with the error of its path: extrapolated where that can be done, bounded where not.

    Parameters
    ----------
    onset : Onset
        As found on the path; the errors of its windows are those of rounding.
    engine : Engine
        LAMMPS with the packing of the path.
    path : EquilibriumPath
        The ramp, at least up to the last window.
    scene : Scene
        Of the ramp.

    Returns
    -------
    Onset
        Windows with the onset of the exact path and the whole error. A window keeps its own, and a `path_error` of
        None, where the ramp has no equilibrium at the onset that the search has found there.
    """
    others = OtherPaths(engine, path, scene)
    return replace(onset, windows=tuple(_whole(window, meeting(window.eigenvalue), others) for window in onset.windows))


def with_damped_path_error(
    windows: Sequence[DampedWindow],
    dissipation: Callable[[Packing], Packing],
    engine: Engine,
    path: EquilibriumPath,
    scene: Scene,
) -> tuple[DampedWindow, ...]:
    """Windows of growing motion with the error of the path on which they were found.

    Parameters
    ----------
    windows : sequence of DampedWindow
        As found on the path; their errors are those of rounding.
    dissipation : callable
        A packing of the path -> the same with its dashpots and drag.
    engine, path, scene
        As in `with_path_error`.
    """
    others = OtherPaths(engine, path, scene)
    return tuple(_whole(window, crossing(window.frequency, dissipation), others) for window in windows)


W = TypeVar("W", Window, DampedWindow)


def _whole(window: W, vanishes: Vanishes, others: OtherPaths) -> W:
    """The window as the exact path has it; as it is where the ramp itself has no equilibrium at its onset."""
    if not window.fx_onset > others.path.kept[0].fx:
        return window
    try:
        part = others.error(window.fx_onset, vanishes, window.error)
    except FAILURES:
        return window
    return replace(
        window,
        fx_onset=window.fx_onset + part.correction,
        error=window.error + part.error,
        path_error=part.error,
    )


class OtherPaths:
    """Paths of one ramp through other loads, which the onsets of the ramp have in common for the most part.

    Parameters
    ----------
    engine : Engine
        LAMMPS with the packing of the path.
    path : EquilibriumPath
        The ramp, at least up to the last onset.
    scene : Scene
        Of the ramp.
    """

    def __init__(self, engine: Engine, path: EquilibriumPath, scene: Scene) -> None:
        self.path = path
        self._engine, self._scene = engine, scene
        self._states = [_state(each.packing, scene.load.fy) for each in path.kept]
        self._coarser, self._finer = [path.kept[0]], [path.kept[0]]

    def error(self, fx: float, vanishes: Vanishes, rounding: float) -> PathError:
        """What the increments do to the onset at fx, whose rounding error is known.

        Parameters
        ----------
        fx : float
            The onset as found on the path, force.
        vanishes : callable
            Packing -> what goes through zero at the onset: `meeting` or `crossing`.
        rounding : float
            Uncertainty of fx from rounding, force.

        Raises
        ------
        NoEquilibriumError
            If the ramp has no equilibrium at fx.
        """
        before = [each for each in self.path.kept if each.fx < fx]
        states = [*self._states[: len(before)], _state(self.path(fx), self._scene.load.fy)]
        changed = np.array([a != b for a, b in pairwise(states)])
        ramp = np.array([*(each.fx for each in before), fx])
        few = len(changed) < FEWEST
        other = _halved(ramp) if few else _thinned(ramp, changed)
        third = _halved(other if few else ramp)
        increment = float(np.diff(ramp).max())

        def shifted(through: Floats, known: list[Equilibrium]) -> float:
            try:
                there = self._along(through, known)
                return _root(lambda load: vanishes(there(load)), fx, rounding, 0.5 * increment) - fx
            except FAILURES:
                return np.nan

        shift = shifted(other, self._coarser)
        finer = shifted(third, self._finer) if changed.any() else np.nan
        return PathError(shift, finer, _cubes(other) / _cubes(ramp) - 1, bool(changed.any()), rounding, increment)

    def _along(self, through: Floats, known: list[Equilibrium]) -> EquilibriumPath:
        """The path through the inner ones of some loads, beginning with what is known of it; what is new is kept."""
        inner = through[1:-1]
        common = 0
        while common < min(len(inner), len(known) - 1) and known[common + 1].fx == inner[common]:
            common += 1
        path = EquilibriumPath(self._engine, known[0], self._scene, known[1 : common + 1])
        try:
            for load in inner[common:]:
                path(float(load))
        finally:
            known[:] = path.kept
        return path


def _state(packing: Packing, fy: float) -> bytes:
    """Which contacts carry a force, and which of them slide, as something that can be compared."""
    carrying = packing.loaded(CARRIES * fy)
    contacts = carrying.contacts
    limit = carrying.law.slip_limit(carrying.geometry.overlap)
    pairs = np.column_stack([contacts.i, contacts.j, np.abs(contacts.slip) > AT_THE_BOUND * limit])
    return pairs[np.lexsort(pairs.T)].tobytes()


def _thinned(loads: Floats, changed: NDArray[np.bool_]) -> Floats:
    """Every second load; after an increment with a change the load is left out, before one it is kept."""
    kept, run = [True], 0
    for k in range(1, len(loads) - 1):
        leave = bool(changed[k - 1]) or (run == 0 and not changed[k])
        leave = leave and run < LONGEST_RUN
        run = run + 1 if leave else 0
        kept.append(not leave)
    return loads[[*kept, True]]


def _halved(loads: Floats) -> Floats:
    return np.sort(np.concatenate([loads, 0.5 * (loads[1:] + loads[:-1])]))


def _cubes(loads: Floats) -> float:
    return float(np.sum(np.diff(loads) ** 3))


def meeting(eigenvalue: float) -> Vanishes:
    """(lambda_1 - lambda_2)^2 of the two eigenvalues nearest to one, 1 / time^4, as a function of the packing."""

    def discriminant(packing: Packing) -> float:
        near = eigenvalue * (1 + 1e-7)  # no eigenvalue to the last digit
        bare = force_bearing(packing)
        values = eigvals(dynamical_matrix(bare)[0].toarray()) if len(bare) < SMALL else eigenpairs(bare, near, 4).values
        one, other = values[np.argsort(np.abs(values - eigenvalue))[:2]]
        return float(((one - other) ** 2).real)

    return discriminant


def crossing(frequency: float, dissipation: Callable[[Packing], Packing]) -> Vanishes:
    """Re s of the motion nearest to a frequency, 1 / time, as a function of the packing without its dissipation."""

    known: list[DampedMode] = []

    def growth(packing: Packing) -> float:
        pencil = Pencil.of(dissipation(packing))
        followed = (known[0].at(pencil) if known else None) or nearest_mode(pencil, frequency)
        if followed is None:
            return np.nan
        known[:] = [followed]
        return float(followed.rate.real)

    return growth


def _root(discriminant: Callable[[float], float], fx: float, rounding: float, reach: float) -> float:
    """The root of a function near fx by secants, known to a share of its distance from fx; nan beyond the reach."""
    step = max(30 * rounding, 1e-9 * fx)
    a, b = fx, fx + step
    at_a, at_b = discriminant(a), discriminant(b)
    for _ in range(STEPS):
        if at_b == at_a:
            return np.nan
        a, b, at_a = b, b - at_b * (b - a) / (at_b - at_a), at_b
        if not abs(b - fx) < reach:
            return np.nan
        if abs(b - a) <= max(SETTLED * abs(b - fx), rounding):
            return b
        at_b = discriminant(b)
    return b if abs(b - a) <= NOISY * rounding else np.nan
