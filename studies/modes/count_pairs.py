r"""Complex pairs along a ramp: their number, their growth rates, and the loss that stops them.

Beyond the first window the operator :math:`K = S + A` of a packing, S symmetric and A antisymmetric, has ever more
complex pairs. With :math:`\omega = \sqrt\lambda`, the mean square displacement of a pair grows at the rate
:math:`2 |\mathrm{Im}\,\omega|`, and

.. math:: Q = \frac{|\mathrm{Re}\,\omega|}{2\,|\mathrm{Im}\,\omega|}

is the quality factor below which a dissipation that gives each mode the loss :math:`\omega/Q` stops the growth. The
least Q over the pairs of a load is the Q that stops all of them. The *share* of complex modes is twice the number of
pairs over the number of eigenvalues; rattlers have none.

**Which pairs count.** For eigenvalues that nearly merge, rounding makes spurious pairs with imaginary parts of up to
:math:`(u |A|_F\, c)^{1/2}` for couplings c (:mod:`~faultgouge.analysis.motion.spectrum`). No coupling is larger than
the largest eigenvalue, so that a pair beyond that bound is physical, and its vectors are not needed. For the other
pairs the vectors are computed, and decide.

**Where the branch ends.** A real negative eigenvalue is the classical instability: Newton's method has passed a turning
point, and no packing reaches such an equilibrium by itself. The loads of a packing end before this point ("turning
point").

**A bound.** The imaginary part of an eigenvalue is at most the norm of the antisymmetric part, :math:`|\mathrm{Im}\,
\lambda| \le |(A - A^T)/2|_2` with A the mass-weighted operator (Bendixson, Acta Math. 25, 359 (1902)): the key bound. A
contact couples only two disks, so that the norm does not grow with the number of disks unless contacts become stiffer
or more loaded: growth rates cannot grow without limit with the number of disks.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.linalg import eigsh

from ...analysis import (
    NoEquilibriumError,
    Packing,
    dynamical_matrix,
    eigenvalues,
    growth_rate,
    nearest_modes,
    negative_eigenvalues,
    spectrum,
)
from ...analysis.motion.eigenvalues import (
    SAFETY,
    Complexes,
    exceeds_rounding,
    unit_rounding,
)
from ...analysis.motion.spectrum import SLICED
from ...pywrap import Equilibrium, Scene
from ...pywrap.load_path import LoadPath
from ...pywrap.scenes.study_sections import ModesSection
from ...pywrap.scenes.validation import require_section
from ..packing_tools import Start, path_from

SHIFT_OFFSET = 1e-9
"""Distance of a shift from the eigenvalue whose vectors are wanted, in units of the eigenvalue."""

NORM_ERROR = 1e-6
"""Relative error of the norm squared: it is a bound that is several times larger than what it bounds."""

FREQUENCY_DIGITS = 7
"""Digits of the frequencies that are stored."""


@dataclass(frozen=True)
class PairCounts:
    """The complex pairs of one packing.

    Attributes
    ----------
    omega : ndarray of complex, shape (P,)
        Of each pair the frequency with positive real and imaginary part, fastest growing first, 1 / time.
    modes : int
        Number of eigenvalues.
    negative : tuple of float
        The real negative eigenvalues, the most negative first, 1 / time^2.
    """

    omega: Complexes
    modes: int
    negative: tuple[float, ...] = ()

    @classmethod
    def of(cls, values: Complexes) -> PairCounts:
        """Pairs of some eigenvalues: all with a positive imaginary part count."""
        omega = np.sqrt(values[values.imag > 0])
        return cls(omega[np.argsort(-omega.imag)], len(values))

    def as_dict(self) -> dict[str, Any]:
        """Plain numbers: pairs, negative, share, growth_rate, omega (of the fastest pair), least_q."""
        fastest = self.omega[0] if len(self.omega) else None
        rates = [growth_rate(value) for value in self.negative[:1]] + [2 * w.imag for w in self.omega[:1]]
        return {
            "pairs": len(self.omega),
            "share": 2 * len(self.omega) / self.modes if self.modes else 0.0,
            "negative": len(self.negative),
            "growth_rate": float(max(rates, default=0.0)),
            "omega": None if fastest is None else float(fastest.real),
            "least_q": float(np.min(self.omega.real / (2 * self.omega.imag))) if len(self.omega) else None,
        }


def count_pairs(packing: Packing) -> PairCounts:
    """The complex pairs of a packing that exceed their rounding uncertainty.

    Parameters
    ----------
    packing : Packing
        In equilibrium.
    """
    if packing.coordinates > SLICED:
        found = spectrum(packing)
        omega = np.sqrt([pair.eigenvalue for pair in found.pairs]).astype(np.complex128)
        return PairCounts(omega, len(found.eigenvalues), tuple(found.negative.tolist()))
    values = eigenvalues(packing)
    rounding = unit_rounding(dynamical_matrix(packing)[0].data)
    surely = np.sqrt(SAFETY * rounding * np.abs(values).max(initial=0.0))
    doubtful = np.flatnonzero((values.imag > 0) & (values.imag <= surely))
    noise = [k for k in doubtful if not _is_real(packing, values[k], rounding)]
    values = values.copy()
    values[noise] = values[noise].real
    return replace(PairCounts.of(values), negative=tuple(negative_eigenvalues(packing).tolist()))


def _is_real(packing: Packing, value: complex, rounding: float) -> bool:
    found = nearest_modes(packing, value * (1 + SHIFT_OFFSET), 2)
    nearest = int(np.argmin(np.abs(found.values - value)))
    return exceeds_rounding(value, float(found.overlap[nearest]), rounding)


def antisymmetric_norm(packing: Packing) -> float:
    """|(A - A^T)/2|_2 of the mass-weighted operator, which no |Im lambda| exceeds, 1 / time^2."""
    matrix, _ = dynamical_matrix(packing)
    skew = csr_array(0.5 * (matrix - matrix.T))
    if skew.shape[0] < 3 or abs(skew).max() == 0:
        return 0.0
    start = np.random.default_rng(0).standard_normal(skew.shape[0])
    largest = eigsh(csr_array(skew.T @ skew), 1, which="LA", v0=start, tol=NORM_ERROR, return_eigenvectors=False)
    return float(np.sqrt(largest[0]))


def modes(scene: Scene, start: Start) -> dict[str, Any]:
    """The complex pairs of a scene at the loads of its section [modes], as a row of a sweep: the task "modes".

    Raises
    ------
    SceneError
        If the scene has no section [ramp].
    NoEquilibriumError
        If the packing does not settle.
    """
    return along_ramp(scene, start(scene.law.mus[0]), load_row)


def along_ramp(scene: Scene, rest: Equilibrium, look: Callable[[Packing], dict[str, Any]]) -> dict[str, Any]:
    """The row of the packing at each load of [modes] that it bears.

    Parameters
    ----------
    scene : Scene
        With a section [ramp].
    rest : Equilibrium
        The settled packing.
    look : callable
        Packing -> the numbers of one load.
    """
    step, wanted = require_section(scene.ramp, "ramp").step, (scene.modes or ModesSection()).fx_over_fy
    row: dict[str, Any] = {"ends": "until", "loads": []}
    with path_from(rest, scene) as path:
        for share in sorted(wanted):
            try:
                packing = _climb_to(path, share * scene.load.fy, step)
            except NoEquilibriumError:
                row["ends"] = "no equilibrium"
                break
            if len(negative_eigenvalues(packing)):
                row["ends"] = "turning point"
                break
            row["loads"].append({"fx_over_fy": share, "fx": packing.fx} | look(packing))
    return row | {"reach": path.equilibria[-1].fx, "contacts": len(rest.packing.contacts)}


def _climb_to(path: LoadPath[Equilibrium], fx: float, step: float) -> Packing:
    """The packing at fx, by multiples of the step up to there."""
    for k in range(round(path.equilibria[-1].fx / step), int(fx / step) + 1):
        if path.equilibria[-1].fx < k * step < fx:
            path(k * step)
            del path.equilibria[:-2]  # thousands of equilibria of a large packing would fill the memory
    return path(fx)


def load_row(packing: Packing) -> dict[str, Any]:
    """The numbers of one load of the task "modes"."""
    found = count_pairs(packing)
    row = found.as_dict() | {
        "modes": found.modes,
        "contacts": len(packing.contacts),
        "sliding": int(np.count_nonzero(packing.sliding)),
        "rattlers": len(packing.rattlers),
        "bound": antisymmetric_norm(packing),
    }
    if len(found.omega):
        value = found.omega[0] ** 2
        pair = nearest_modes(packing, value * (1 + SHIFT_OFFSET), 1)
        row |= {"participation": float(pair.participation[0]), "rotation": float(pair.rotation[0])}
    digits = [
        [float(f"{w.real:.{FREQUENCY_DIGITS}g}"), float(f"{w.imag:.{FREQUENCY_DIGITS}g}")] for w in found.omega.tolist()
    ]
    return row | {"frequencies": digits}
