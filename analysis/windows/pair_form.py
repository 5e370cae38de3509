r"""Where a real packing's pair stands in the normal form, through equilibria on the way to its onset.

On the right invariant subspace of two modes the operator A of a packing is a real 2 x 2 block. In an
orthonormal basis of that plane its traceless part is a symmetric one, which a rotation makes diag(-p, p), and
an antisymmetric one, q times the quarter turn, which a rotation leaves alone. With the mean m of the
eigenvalues, :math:`\delta = p/m`, :math:`\eta = q/m` and :math:`t \to \sqrt m\, t`, it is the normal form without an
approximation; a reflection takes care of the sign of q. What is oblique is only how the plane sees the other
coordinates: a displacement z of the packing enters it by the left plane, :math:`W^T z`, with :math:`W^T V = 1`.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ..motion.eigenvalues import Complexes
from ..motion.normal_form import ORTHOGONAL, NormalForm
from ..packing.packing import Floats, Packing
from .space import Space
from .system import System
from .system_modes import SystemModes


@dataclass(frozen=True, eq=False)
class PairForm:
    """A packing's pair of modes in the normal form.

    Attributes
    ----------
    fx : float
        Load of the packing, force per top disk.
    form : NormalForm
        delta and epsilon of the pair.
    frequency : float
        Square root of the mean eigenvalue, radian / time: the unit of time of the normal form is its inverse.
    right : ndarray, shape (3N, 2)
        V, orthonormal directions of the two coordinates of the normal form, in mass-weighted coordinates.
    left : ndarray, shape (3N, 2)
        W, with W^T V = 1: coordinates of a displacement z are W^T z.
    """

    fx: float
    form: NormalForm
    frequency: float
    right: Floats
    left: Floats

    @classmethod
    def of(cls, pair: Space) -> "PairForm":
        """A pair of modes, from the operator itself."""
        v, u = pair.right, pair.left
        dual = np.linalg.solve(u.T @ v, u.T).T
        b = dual.T @ pair.system.image(v)
        mean = 0.5 * (b[0, 0] + b[1, 1])
        # Traceless part: ((-c, k), (k, c)) + q ((0, 1), (-1, 0)); c = p cos 2a, k = -p sin 2a.
        c, k, q = 0.5 * (b[1, 1] - b[0, 0]), 0.5 * (b[0, 1] + b[1, 0]), 0.5 * (b[0, 1] - b[1, 0])
        p, angle = np.hypot(c, k), 0.5 * np.arctan2(-k, c)
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        turn[:, 1] *= 1.0 if q >= 0 else -1.0
        # (p - |q|)/p by way of the discriminant, the one number that is linear in the load.
        epsilon = pair.discriminant / (4 * p * (p + abs(q)))
        return cls(pair.fx, NormalForm(float(p / mean), float(epsilon)), float(np.sqrt(mean)), v @ turn, dual @ turn)

    @property
    def start(self) -> Floats:
        """The unit displacement across the coalescing eigenvectors, mass-weighted, shape (3N,)."""
        return self.right @ ORTHOGONAL

    def amplitude(self, damping_time: float | None = None) -> float:
        """Response to `start`, as of `NormalForm.amplitude`, for a damping time in the packing's units of time."""
        return self.form.amplitude(None if damping_time is None else damping_time * self.frequency)

    @property
    def tau_d(self) -> float:
        """1 / (delta epsilon^(1/2)) in the packing's units of time."""
        return self.form.tau_d / self.frequency

    def half_gain_time(self) -> float:
        """The crossover of `NormalForm.half_gain_time` in the packing's units of time."""
        return self.form.half_gain_time() / self.frequency


def pair_forms(packings: Sequence[Packing], eigenvalue: float) -> list[PairForm]:
    """The normal form of one pair, through equilibria on the way to its onset.

    Parameters
    ----------
    packings : sequence of Packing
        Equilibria in order of their distance from the onset, nearest first, close enough for the planes of the
        pair to be recognised.
    eigenvalue : float
        The double eigenvalue at the onset, as of :class:`~faultgouge.analysis.Window`, 1 / time^2: the nearest two of
        the first packing are the pair.

    Returns
    -------
    list of PairForm
        In the order of the packings.
    """
    return [PairForm.of(pair) for pair in _follow_pair(packings, eigenvalue)]


def pair_eigenvalues(packings: Sequence[Packing], eigenvalue: float) -> Complexes:
    """Both eigenvalues of one pair, from its onset on through other loads.

    The two are followed by the plane that they span, and computed from the 2 x 2 block on it: half its trace -+ half
    the root of its discriminant. So they are two real numbers or two exact conjugates at every load.

    Parameters
    ----------
    packings : sequence of Packing
        As of :func:`pair_forms`, on one side of the onset.
    eigenvalue : float
        As of :func:`pair_forms`.

    Returns
    -------
    ndarray of complex, shape (S, 2)
        1 / time^2; nan from where on the planes are not recognised any more.
    """
    values = np.full((len(packings), 2), np.nan, dtype=np.complex128)
    before: Space | None = None
    for row, pair in zip(values, _follow_pair(packings, eigenvalue), strict=True):
        if before is not None and not before.like(pair):
            break
        root = 0.5 * np.emath.sqrt(pair.discriminant)
        row[:] = pair.mean - root, pair.mean + root
        before = pair
    return values


def _follow_pair(packings: Sequence[Packing], eigenvalue: float) -> Iterator[Space]:
    """The pair at each load: followed from the load before, and sought among all modes where that leads nowhere."""
    pair: Space | None = None
    for packing in packings:
        system = System.of(packing)
        image = None if pair is None else pair.at(system)
        if image is None:
            modes = SystemModes.of(system)
            image = modes.space(modes.nearest(pair) if pair else modes.about(eigenvalue))
        pair = image
        yield pair
