r"""Error of eigenvalues over the time that they take, near an exceptional point.

The dense solver is backward stable: it returns the eigenvalues of :math:`A + E`, :math:`|E| \sim u |A|_F`, and so errs
by about :math:`u |A|_F \kappa`, with the condition :math:`\kappa = 1/|y^H x|`, which grows without bound towards an
exceptional point. Shift-invert Arnoldi finds the few eigenvalues nearest to a shift, to a tolerance. The nearer they
are, the smaller is their rounding error. More digits than the coordinates have are of no use, so the study measures how
far the rounding of the coordinates alone moves the eigenvalues. The mean of the two eigenvalues of a pair and their
discriminant do not suffer from this condition, and the search for the onset uses them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.linalg import eig, eigvals

from ....analysis import Packing, dynamical_matrix, nearest_modes
from ....analysis.motion.eigenvalues import Complexes
from ....pywrap import Engine, equilibrate
from .extended import refined_near
from .onset import OnsetMethods
from .work_precision_study import Run, Settings, Study, Theory, study_of, timed_points

ARPACK_COUNT = 6
"""Eigenvalues that shift-invert is asked for: the pair and its neighbours."""

DISTANCE_OF_PAIR = 1e-9
"""Distance below the onset, force, at which the pair is near its exceptional point."""

DENSE, ARPACK, REFINED = "dense (LAPACK)", "shift-invert (ARPACK)", "dense, refined"


@dataclass(frozen=True, eq=False)
class Target:
    """The eigenvalues of a packing next to a shift.

    Attributes
    ----------
    packing : Packing
        The configuration.
    shift : float
        Near the pair, but not on it, 1 / time^2.
    exact : ndarray of complex, shape (ARPACK_COUNT,)
        The eigenvalues nearest to it, in extended precision, 1 / time^2.
    error : float
        Largest relative error of these eigenvalues.
    condition : float
        Largest kappa of these eigenvalues.
    rounding : float
        u |A|_F, 1 / time^2.
    """

    packing: Packing
    shift: float
    exact: Complexes
    error: float
    condition: float
    rounding: float

    @classmethod
    def of(cls, packing: Packing, shift: float) -> Target:
        """Solve the eigenproblem and refine the eigenvalues next to the shift."""
        found, condition, rounding = refined_near(packing, shift, ARPACK_COUNT)
        exact = np.array([complex(each.value) for each in found])
        error = max(each.error / abs(each.value) for each in found)
        return cls(packing, shift, exact, float(error), condition, rounding)

    @property
    def attainable(self) -> float:
        """u |A|_F kappa, relative."""
        return float(self.rounding * self.condition / np.abs(self.exact).min())

    @property
    def coordinates(self) -> tuple[float, float]:
        """Relative changes of the eigenvalues, and of the mean of the pair, when each coordinate changes by one unit
        in the last place, up or down."""
        sign = np.random.default_rng(0).choice([-1.0, 1.0], self.packing.position.shape)
        position = np.nextafter(self.packing.position, sign * np.inf)
        moved = Target.of(replace(self.packing, position=position), self.shift)
        return self.off(moved.exact), float(abs(moved.mean / self.mean - 1))

    @property
    def mean(self) -> complex:
        """Mean of the two of these eigenvalues that are closest to one another: the pair, 1 / time^2."""
        apart = np.abs(self.exact[:, None] - self.exact) + np.diag(np.full(ARPACK_COUNT, np.inf))
        return complex(self.exact[list(np.unravel_index(np.argmin(apart), apart.shape))].mean())

    def off(self, values: Complexes) -> float:
        """Largest relative error of the eigenvalues, each against the nearest; no less than the rounding of a
        number."""
        error = np.abs(values[:, None] - self.exact).min(axis=0) / np.abs(self.exact)
        return max(float(error.max()), 0.5 * float(np.finfo(float).eps))

    def dense(self) -> tuple[Complexes, int | None]:
        """All eigenvalues by LAPACK."""
        return eigvals(dynamical_matrix(self.packing)[0].toarray()), None

    def shift_invert(self, tolerance: float) -> tuple[Complexes, int | None]:
        """The nearest few by ARPACK, and the number of solves."""
        found = nearest_modes(self.packing, self.shift, ARPACK_COUNT, tolerance=tolerance)
        return found.values, found.solves

    def refine(self) -> tuple[Complexes, int | None]:
        """The nearest few by LAPACK and then Newton's method in extended precision, and the number of steps."""
        found, *_ = refined_near(self.packing, self.shift, ARPACK_COUNT)
        return np.array([complex(each.value) for each in found]), sum(each.steps for each in found)


def near(settings: Settings) -> Study:
    """The eigenvalues about the pair that coalesces, just below the onset."""
    packing, pair = _near(settings)
    target = Target.of(packing, 1.001 * pair)
    tolerances = np.logspace(-1, -15, 5 if settings.quick else 15).tolist()
    runs: list[Run[Complexes]] = [
        (DENSE, None, target.dense),
        *((ARPACK, tolerance, partial(target.shift_invert, tolerance)) for tolerance in tolerances),
        (REFINED, None, target.refine),
    ]
    points = timed_points(runs, settings, target.off)
    last = {point.method: point for point in points}  # shift-invert's with the smallest tolerance
    coordinates, mean = target.coordinates
    return study_of(
        "near",
        points=points,
        numbers={
            "count": ARPACK_COUNT,
            "apart": DISTANCE_OF_PAIR,
            "target": target,
            "disks": len(packing),
            "fx": packing.fx,
            "dense": last[DENSE],
            "sparse": last[ARPACK],
            "coordinates": coordinates,
            "mean": mean,
        },
        reference_error=target.error,
        theory=(
            Theory("u |A| kappa", (target.attainable,)),
            Theory("one unit in the last place of the coordinates", (coordinates,)),
        ),
    )


def _near(settings: Settings) -> tuple[Packing, float]:
    """The packing just below the onset, and the pair there, 1 / time^2."""
    start = settings.ramp[0]
    with Engine(start.packing) as engine:
        onset, _ = OnsetMethods(engine, start, settings.scene).bisect(1e-3, 30)
        below = max((each for each in settings.ramp if each.fx < onset - DISTANCE_OF_PAIR), key=lambda each: each.fx)
        packing = equilibrate(engine, below, onset - DISTANCE_OF_PAIR).packing
    values, left, right = eig(dynamical_matrix(packing)[0].toarray(), left=True, right=True)
    return packing, float(values[np.argmin(np.abs(np.sum(left.conj() * right, axis=0)))].real)
