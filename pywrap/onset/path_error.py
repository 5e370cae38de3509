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
over twice the increment, so that :math:`|F_{2h} - F_h|` is no smaller than the error of :math:`F_h`.

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
from scipy.linalg import eigvals
from scipy.sparse.linalg import ArpackError

from ...analysis import NoEquilibriumError, Onset, Packing, Window, dynamical_matrix, eigenpairs
from ...analysis.damped_onset.modes import DampedModes, Pencil
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
        if np.isnan(self.shift):
            return self.increment
        largest = abs(self.shift) + 2 * self.rounding
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
        Windows with the onset of the exact path and the whole error.
    """
    windows = tuple(
        _whole(window, meeting(window.eigenvalue), engine, path, scene) if window.fx_onset > path.kept[0].fx else window
        for window in onset.windows
    )
    return replace(onset, windows=windows)


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
    return tuple(
        _whole(window, crossing(window.frequency, dissipation), engine, path, scene)
        if window.fx_onset > path.kept[0].fx
        else window
        for window in windows
    )


W = TypeVar("W", Window, DampedWindow)


def _whole(window: W, vanishes: Vanishes, engine: Engine, path: EquilibriumPath, scene: Scene) -> W:
    part = path_error(window.fx_onset, vanishes, window.error, engine, path, scene)
    return replace(window, fx_onset=window.fx_onset + part.correction, error=window.error + part.error)


def path_error(
    fx: float, vanishes: Vanishes, rounding: float, engine: Engine, path: EquilibriumPath, scene: Scene
) -> PathError:
    """What the increments do to the onset at fx, whose rounding error is known.

    Parameters
    ----------
    fx : float
        The onset as found on the path, force.
    vanishes : callable
        Packing -> what goes through zero at the onset: `meeting` or `crossing`.
    rounding : float
        Uncertainty of fx from rounding, force.
    engine, path, scene
        As in `with_path_error`.
    """
    before = [each for each in path.kept if each.fx < fx]
    states = [_state(each.packing, scene.load.fy) for each in (*before, _on(path, fx))]
    changed = np.array([a != b for a, b in pairwise(states)])
    ramp = np.array([*(each.fx for each in before), fx])
    other = _thinned(ramp, changed) if len(changed) >= FEWEST else _halved(ramp)
    weight = _cubes(other) / _cubes(ramp) - 1
    increment = float(np.diff(ramp).max())
    elsewhere = EquilibriumPath(engine, path.kept[0], scene)
    try:
        for load in other[1:-1]:
            elsewhere(float(load))
        shift = _root(lambda there: vanishes(elsewhere(there)), fx, rounding, 0.5 * increment) - fx
    except (NoEquilibriumError, ArpackError):
        shift = np.nan
    return PathError(shift, float(weight), bool(changed.any()), rounding, increment)


def _on(path: EquilibriumPath, fx: float) -> Equilibrium:
    packing = path(fx)
    return Equilibrium(packing, packing.residual, 0.0, 0)


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

    def growth(packing: Packing) -> float:
        rates = DampedModes.of(Pencil.of(dissipation(packing))).rates
        return float(rates[np.argmin(np.abs(rates - 1j * frequency))].real)

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
