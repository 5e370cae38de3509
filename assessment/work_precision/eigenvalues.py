r"""Error of eigenvalues over the time that they take, near an exceptional point.

The dense solver is backward stable: it returns the eigenvalues of :math:`A + E`, :math:`|E| \sim u |A|_F`, and so errs
by about :math:`u |A|_F \kappa`, with the condition :math:`\kappa = 1/|y^H x|`, which grows without bound towards an
exceptional point. Shift-invert Arnoldi finds the few eigenvalues nearest to a shift, to a tolerance. The nearer they
are, the smaller is their rounding error. More digits than the coordinates have are of no use, so the study measures how
far the rounding of the coordinates alone moves the eigenvalues. The mean of the two eigenvalues of a pair and their
discriminant do not suffer from this condition, and the search for the onset uses them.

**More digits than doubles have** by Newton's method on an eigenpair: for :math:`A x = \lambda x`, :math:`w^H x = 1` a
step solves the bordered system

.. math::

    \begin{pmatrix} A - \lambda & -x \\ w^H & 0 \end{pmatrix} \begin{pmatrix} \Delta x \\ \Delta\lambda
    \end{pmatrix} = \begin{pmatrix} \lambda x - A x \\ 0 \end{pmatrix}

in doubles, with the right-hand side and the sums in ``numpy.longdouble``: iterative refinement. The remaining error is
the last step, and the rounding of extended precision, :math:`\epsilon |A|_F \kappa`.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
from scipy.linalg import eig, eigvals

from ...analysis import Packing, dynamical_matrix, nearest_modes
from ...analysis.arrays import Floats
from ...analysis.motion.eigenvalues import Complexes, unit_rounding
from ...pywrap import Engine, equilibrate
from ...pywrap.runs.scene_path import scene_path
from .equilibria import root
from .study import Run, Settings, Study, study_of, timed

ARPACK_COUNT = 6
"""Eigenvalues that shift-invert is asked for: the pair and its neighbours."""

DISTANCE_OF_PAIR = 1e-9
"""Distance below the onset, force, at which the pair is near its exceptional point."""


def refine_eigenvalue(
    matrix: Floats, value: complex, vector: Complexes, condition: float, most: int = 30
) -> tuple[np.clongdouble, float]:
    """The eigenvalue of a matrix of doubles, taken as exact, next to an approximation.

    Parameters
    ----------
    matrix : ndarray, shape (n, n)
        A.
    value, vector : complex, and ndarray of complex, shape (n,)
        Where to begin: an eigenvalue and its unit right vector.
    condition : float
        kappa = 1/|y^H x|.
    most : int
        Newton steps at the most. Near an exceptional point the bordered system is nearly singular and a step gains only
        a few digits.

    Returns
    -------
    value, error : numpy.clongdouble and float
        The refined eigenvalue, and its error.
    """
    n, exact = len(matrix), matrix.astype(np.longdouble)
    x, lam = vector.astype(np.clongdouble), np.clongdouble(value)
    rounding = float(np.finfo(np.longdouble).eps * np.linalg.norm(matrix) * condition)
    moved = np.inf
    for _ in range(most):
        residual = lam * x - (exact @ x.real + 1j * (exact @ x.imag))
        bordered = np.zeros((n + 1, n + 1), dtype=np.complex128)
        bordered[:n, :n] = matrix - complex(lam) * np.eye(n)
        bordered[:n, n], bordered[n, :n] = -x.astype(np.complex128), vector.conj()
        change = np.linalg.solve(bordered, np.append(residual, 0).astype(np.complex128))
        if abs(change[n]) > 0.5 * moved:
            break
        x, lam, moved = x + change[:n], lam + change[n], float(abs(change[n]))
        if moved < rounding:
            break
    return lam, moved + rounding


def nearest_refined(packing: Packing, shift: float) -> tuple[Complexes, float, float, float]:
    """The eigenvalues of a packing's operator that are nearest to a shift, by LAPACK, and then refined.

    Returns
    -------
    values : ndarray of complex, shape (ARPACK_COUNT,)
        1 / time^2.
    error, condition : float
        Largest relative error, and largest kappa of these.
    rounding : float
        u |A|_F, 1 / time^2.
    """
    matrix = dynamical_matrix(packing)[0].toarray()
    values, left, right = eig(matrix, left=True, right=True)
    nearest = np.argsort(np.abs(values - shift))[:ARPACK_COUNT]
    condition = 1 / np.abs(np.sum(left.conj() * right, axis=0))
    found = [refine_eigenvalue(matrix, complex(values[k]), right[:, k], float(condition[k])) for k in nearest]
    error = max(float(error / abs(value)) for value, error in found)
    refined = np.array([complex(value) for value, _ in found])
    return refined, error, float(condition[nearest].max()), unit_rounding(matrix)


def near(settings: Settings) -> Study:
    """The eigenvalues about the pair that coalesces, just below the onset."""
    start = settings.ramp[0]
    with Engine(start.packing) as engine:
        found, _ = root(scene_path(engine, start, settings.scene), 2e-3, settings.ramp[-1].fx)
        fx = found.fx_c - DISTANCE_OF_PAIR
        below = max((each for each in settings.ramp if each.fx < fx), key=lambda each: each.fx)
        packing = equilibrate(engine, below, fx).packing
    values, left, right = eig(dynamical_matrix(packing)[0].toarray(), left=True, right=True)
    shift = 1.001 * float(values[np.argmin(np.abs(np.sum(left.conj() * right, axis=0)))].real)  # near, but not on it
    exact, reference_error, condition, rounding = nearest_refined(packing, shift)

    def off(values: Complexes) -> float:
        """Largest relative error, each against the nearest; no less than the rounding of a number."""
        error = np.abs(values[:, None] - exact).min(axis=0) / np.abs(exact)
        return max(float(error.max()), 0.5 * float(np.finfo(float).eps))

    def mean(values: Complexes) -> complex:
        """Of the two that are closest to one another: the pair."""
        apart = np.abs(values[:, None] - values) + np.diag(np.full(ARPACK_COUNT, np.inf))
        return complex(values[list(np.unravel_index(np.argmin(apart), apart.shape))].mean())

    def shift_invert(tolerance: float) -> tuple[Complexes, int | None]:
        found = nearest_modes(packing, shift, ARPACK_COUNT, tolerance=tolerance)
        return found.values, found.solves

    # each coordinate by one unit in the last place, up or down
    sign = np.random.default_rng(0).choice([-1.0, 1.0], packing.position.shape)
    moved, *_ = nearest_refined(replace(packing, position=np.nextafter(packing.position, sign * np.inf)), shift)
    tolerances = np.logspace(-1, -15, 5 if settings.quick else 15).tolist()
    runs: list[Run[Complexes]] = [
        ("dense (LAPACK)", None, lambda: (eigvals(dynamical_matrix(packing)[0].toarray()), None))
    ]
    runs += [("shift-invert (ARPACK)", tolerance, partial(shift_invert, tolerance)) for tolerance in tolerances]
    points, _ = timed(runs, settings, off)
    numbers = {"count": ARPACK_COUNT, "apart": DISTANCE_OF_PAIR, "condition": condition, "sparse": points[-1]}
    numbers["packing"] = packing
    numbers |= {"coordinates": off(moved), "mean": float(abs(mean(moved) / mean(exact) - 1))}
    attainable = rounding * condition / np.abs(exact).min()
    theory = [("u |A| kappa", attainable, ()), ("one unit in the last place of the coordinates", off(moved), ())]
    return study_of("near", points, reference_error, numbers, theory)
