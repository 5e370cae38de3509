r"""Stress and elastic moduli of a packing, over frequency.

**Stress.** The mean over the volume V is a sum over contacts,

.. math:: p_{ab} = \frac1V \sum_c f_a\, r_b ,

with the force :math:`\mathbf f` on the first partner and the branch vector :math:`\mathbf r` from the second partner
to the first. Compression is positive, as in LAMMPS's pressure tensor, whose pxy is :math:`p_{yx}` here; the two differ
where lever arms of torques are not halves of the branch.

**Moduli.** Under a homogeneous displacement gradient :math:`\Gamma` the particles move by
:math:`\Gamma \mathbf x_i + \mathbf q_i`. The affine part alone unbalances the forces, by
:math:`b_{kl} = \partial F / \partial \Gamma_{kl}` on the coordinates, and the particles move on until they balance:

.. math:: (K + i \omega C - \omega^2 M)\, q_{kl} = b_{kl} .

The derivative of the first Piola-Kirchhoff stress, tension positive, is then

.. math:: A_{abkl} = -\frac1V \sum_c r_b\, \frac{\mathrm d f_a}{\mathrm d \Gamma_{kl}},

with the derivative of each force by :math:`\Gamma` and by :math:`q_{kl}`. The derivative of Cauchy's stress, which a
deformed box of LAMMPS shows, also has the turning and the stretch of area of the present stress
:math:`\sigma = -p`:

.. math:: B_{abkl} = A_{abkl} + \sigma_{al}\, \delta_{bk} - \sigma_{ab}\, \delta_{kl}, \qquad
    C_{abkl} = \tfrac12 (B_{abkl} + B_{ablk}) .

(A. Lemaitre and C. Maloney, J. Stat. Phys. 123, 415, 2006, for central forces and over frequency.) Contacts stick: K
is that of reversible motion. Of contacts at Coulomb's bound it knows one of two sides, and `at_bound` counts them.
Frequencies are those of a deformation that carries the particles along with the box; drag acts on q alone.

**The odd part.** In a closed cycle of strain a packing gives out the work :math:`\oint P : \mathrm d F` unless
:math:`A_{abkl} = A_{klab}`. Friction makes K asymmetric, and with K the moduli. The antisymmetric part is that of odd
elasticity (C. Scheibner et al., Nature Physics 16, 475, 2020). It is taken of A: C of any material under stress has a
part :math:`\sigma_{kl} \delta_{ab} - \sigma_{ab} \delta_{kl}` that does no work in a cycle.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csc_array, csr_array, diags_array

from ..arrays import Complexes, Floats
from ..assembly import as_springs, contact_derivatives
from ..configuration import Configuration
from ..contacts import LinearisedContacts
from ..counted import counted
from ..errors import BadInputError
from ..factors.sparse_lu import general_lu
from ..has_configuration import HasConfiguration

FLOPPY = 1e-10
"""Stiffness, as a share of the largest entry of K, of a spring that holds motions without stiffness: particles that
touch nothing, spheres that spin. `CORRECTIONS` takes its effect out of all other motions."""

CORRECTIONS = 4
"""Each refinement leaves a share FLOPPY/(FLOPPY + lambda) of a motion of stiffness lambda: one of 1e-8 of the largest
is right to 1e-10."""

UNSOLVED = 1e-6
"""Residual of the displacements, as a share of the forces, beyond which moduli are refused: a motion without stiffness
is driven."""

AXIS_NAMES = "xyz"
FLAT_NORMAL = 1e-9
"""Parts of a wall's normal across its axis up to which the wall is flat across this axis: rounding."""


@dataclass(frozen=True, eq=False)
class ElasticModuli:
    """Elastic moduli of a packing; force / area, or force / length of disks.

    Attributes
    ----------
    tensor : ndarray, shape (3, 3, 3, 3)
        C, the derivative of Cauchy's stress (tension positive) by strain; complex where a frequency is given; zero
        where z has no part of a packing of disks.
    affine : ndarray, shape (3, 3, 3, 3)
        C if all particles moved with the strain.
    by_gradient : ndarray, shape (3, 3, 3, 3)
        B, the derivative by the displacement gradient du_k/dx_l.
    work : ndarray, shape (3, 3, 3, 3)
        A, the derivative of the first Piola-Kirchhoff stress by the gradient.
    displacement : ndarray, shape (coordinates, 3, 3)
        q of each gradient, length.
    dimension, at_bound : int
        2 or 3; contacts at Coulomb's bound, which stick here.
    volume, density : float
        Volume (area of disks), and mass of the particles that touch others over it.
    frequency : float or None
        Radian / time.
    box : str
        Which volume is meant, in words.
    """

    tensor: Complexes
    affine: Complexes
    by_gradient: Complexes
    work: Complexes
    displacement: Complexes
    dimension: int
    at_bound: int
    volume: float
    density: float
    frequency: float | None
    box: str

    @cached_property
    def _lame(self) -> tuple[Any, Any]:
        """Lame's lambda and mu of the isotropic tensor that is nearest to C."""
        d = self.dimension
        one, other = np.einsum("iijj", self.tensor), np.einsum("ijij", self.tensor)
        mu = (other - one / d) / (d * d + d - 2)
        return (one - 2 * d * mu) / d**2, mu

    @property
    def shear(self) -> Any:
        """G of the nearest isotropic tensor."""
        return self._lame[1]

    @property
    def bulk(self) -> Any:
        """The bulk modulus, lambda + 2 G / d."""
        return self._lame[0] + 2 * self._lame[1] / self.dimension

    @property
    def poisson(self) -> Any:
        """Poisson's ratio of the nearest isotropic tensor, in the plane for disks."""
        lame, mu = self._lame
        return lame / (2 * mu + (self.dimension - 1) * lame)

    @property
    def young(self) -> Any:
        """Young's modulus of the nearest isotropic tensor."""
        return 2 * self.shear * (1 + self.poisson)

    @property
    def anisotropy(self) -> float:
        """Distance from the nearest isotropic tensor, as a share of the tensor."""
        (lame, mu), one = self._lame, np.diag(np.arange(3) < self.dimension).astype(float)
        pairs = np.einsum("ik,jl->ijkl", one, one)
        isotropic = lame * np.einsum("ij,kl->ijkl", one, one) + mu * (pairs + pairs.transpose(0, 1, 3, 2))
        return float(np.linalg.norm(self.tensor - isotropic) / np.linalg.norm(self.tensor))

    @property
    def antisymmetric(self) -> Complexes:
        """The odd part, (A_abkl - A_klab)/2 of strains, shape (3, 3, 3, 3): work in closed cycles."""
        a = 0.25 * sum(self.work.transpose(order) for order in ((0, 1, 2, 3), (1, 0, 2, 3), (0, 1, 3, 2), (1, 0, 3, 2)))
        return np.asarray(0.5 * (a - a.transpose(2, 3, 0, 1)))

    def speeds(self, direction: ArrayLike) -> Complexes:
        """Speeds of long plane waves along a direction, fastest first, shape (d,): Christoffel's equation with A."""
        n = np.zeros(3)
        n[: self.dimension] = np.asarray(direction, float)[: self.dimension]
        n /= np.linalg.norm(n)
        acoustic = np.einsum("iakb,a,b->ik", self.work, n, n)[: self.dimension, : self.dimension] / self.density
        squares = np.linalg.eigvals(acoustic).astype(complex)
        speeds = np.sqrt(squares[np.argsort(-squares.real)])
        return speeds if np.any(speeds.imag) else speeds.real

    @property
    def wave_speeds(self) -> Complexes:
        """`speeds` along x, y and z, shape (d, d); with a frequency complex: omega over the complex wave number."""
        return np.array([self.speeds(axis) for axis in np.eye(3)[: self.dimension]])

    def __repr__(self) -> str:
        odd = np.linalg.norm(self.antisymmetric) / np.linalg.norm(self.tensor)
        bound = f", {counted(self.at_bound, 'contact')} at Coulomb's bound taken as sticking" if self.at_bound else ""
        over = "" if self.frequency is None else f" at omega = {self.frequency:g}"
        names = f"E = {self.young:.6g}, nu = {self.poisson:.4g}, G = {self.shear:.6g}, bulk {self.bulk:.6g}"
        more = f"anisotropy {self.anisotropy:.2g}, odd part {odd:.2g} of the tensor; {self.box}{bound}"
        return f"<ElasticModuli{over}: {names}, {more}>"


def volume_of(configuration: Configuration, volume: float | None = None) -> tuple[float, str]:
    """The volume of a packing (area of disks), and which one is meant, in words. A BadInputError if nothing bounds the
    packing along an axis, and no volume is given."""
    c, d = configuration.contacts, configuration.dimension
    if volume is not None:
        return float(volume), f"volume {volume:g} as given"
    edges, words, sides = configuration.box.copy(), [], {(a, s): place for a, s, place in configuration.planes}
    edges[d:] = np.eye(3)[d:]
    for axis in range(d):
        if configuration.periodic[axis]:
            words.append(f"periodic along {AXIS_NAMES[axis]}")
            continue
        low, high, along = sides.get((axis, 1.0)), sides.get((axis, -1.0)), np.abs(c.normal[:, axis])
        tilted = np.any(c.wall & (along > FLAT_NORMAL) & (along < 1 - FLAT_NORMAL))
        if low is None or high is None or tilted:
            open_side = f"along {AXIS_NAMES[axis]} it is neither periodic nor between two flat walls that it touches"
            raise BadInputError(f"The packing has no volume: {open_side}; give volume=, of disks the area.")
        edges[axis] = (high - low) * np.eye(3)[axis]
        words.append(f"between walls at {AXIS_NAMES[axis]} = {low:g} and {high:g}")
    return float(abs(np.linalg.det(edges))), ", ".join(words)


def stress(packing: HasConfiguration, volume: float | None = None) -> Floats:
    """The mean stress of the contacts, compression positive.

    Parameters
    ----------
    packing : Packing or Configuration
        Forces at rest; dashpots have none.
    volume : float, optional
        Volume, or area of disks; by default that of the periodic box, with two flat walls in place of each open side.

    Returns
    -------
    ndarray, shape (3, 3)
        p_ab, force / area: of the force along a, and the branch vector along b.

    Raises
    ------
    BadInputError
        If the packing has no volume, or contacts do not say its forces.

    References
    ----------
    J. Christoffersen, M. M. Mehrabadi and S. Nemat-Nasser, J. Appl. Mech. 48, 339 (1981).

    Examples
    --------

    A layer has no ceiling, so that its area is given, here a floor of 2.8 times a height of 1.36:

    >>> start = faultgouge.settle("three_disks.toml").packing
    >>> print(faultgouge.stress(start, volume=2.8 * 1.36).diagonal().round(3))
    [2.29  0.735 0.   ]
    """
    configuration = packing.configuration
    _require_laws(configuration, "The stress")
    c = configuration.contacts
    force = ~c.couple[:, None] * (c.normal_force[:, None] * c.normal + c.tangential_force)
    return np.asarray(force.T @ configuration.branch / volume_of(configuration, volume)[0])


def elastic_moduli(packing: HasConfiguration, frequency: float | None = None) -> ElasticModuli:
    """The elastic moduli of a packing in a box that is periodic along all of its axes.

    Parameters
    ----------
    packing : Packing or Configuration
        At rest; its particles that are not free move with the strain.
    frequency : float, optional
        omega, radian / time, of a deformation exp(i omega t): moduli are complex, dashpots, drag and inertia count.
        Without it they are those of slow deformation.

    Returns
    -------
    ElasticModuli
        With `.tensor` (3, 3, 3, 3), `.young`, `.poisson`, `.shear`, `.bulk`, `.wave_speeds`, `.antisymmetric`.

    Raises
    ------
    BadInputError
        If the box is not periodic, or a strain drives a motion without stiffness, so that there are no moduli.

    Examples
    --------

    Spheres on a simple cubic lattice, without friction: C_1111 is the stiffness of a contact over the lattice constant.

    >>> from faultgouge.analysis import Material, spheres_of_material
    >>> place = 0.99 * np.array(list(np.ndindex(3, 3, 3)))
    >>> material = Material(kn=1e3, friction=0.0, density=1.0)
    >>> box, periodic = 2.97 * np.eye(3), (True, True, True)
    >>> cubic = spheres_of_material(place, np.full(27, 0.5), material, box=box, periodic=periodic)
    >>> found = faultgouge.elastic_moduli(cubic)
    >>> print(f"{found.tensor[0, 0, 0, 0]:.6f}, {cubic.contacts.normal_stiffness[0] / 0.99:.6f}")
    75.757576, 75.757576
    """
    configuration = packing.configuration
    _require_laws(configuration, "The moduli")
    d, c = configuration.dimension, configuration.contacts
    if not np.all(configuration.periodic[:d]) or configuration.constraint is not None or c.wall.any():
        others = "stress(packing, volume) is that of others"
        raise BadInputError(f"Elastic moduli are of a box periodic along all of its axes, without walls: {others}.")
    volume, box = volume_of(configuration)
    parts: list[tuple[complex, LinearisedContacts]] = [(1.0, c)]
    if frequency is not None and configuration.damped:
        parts.append((1j * frequency, as_springs(c)))
    # u of each contact under the nine gradients, of which disks have four
    one = np.diag(np.arange(3) < d).astype(float)
    branch = configuration.branch @ one
    affine_u = np.einsum("ak,cl->cakl", one, branch).reshape(-1, 3, 9)
    loads = sum(weight * (configuration.force_rates(each)[0] @ affine_u.reshape(-1, 9)) for weight, each in parts)
    response = QuietResponse(configuration, frequency)
    moved = response.solve(loads)
    lacks = float(np.linalg.norm(loads - response.matrix @ moved) / (np.linalg.norm(loads) or 1.0))
    if lacks > UNSOLVED:
        loose = f"under a strain {lacks:.1g} of the forces stay unbalanced, as they drive a motion without stiffness"
        raise BadInputError(f"The packing has no elastic moduli: {loose}.")
    by_motion = [(weight, contact_derivatives(each)) for weight, each in parts]

    def of_stress(u: Complexes, w: Complexes) -> Complexes:
        force = sum(weight * (each.force_by_u @ u + each.force_by_w @ w) for weight, each in by_motion)
        return np.asarray(np.einsum("cb,can->abn", branch, force).reshape(3, 3, 3, 3) / -volume)

    shape = affine_u.shape
    u = (configuration.pair_rows() @ moved).reshape(shape)
    w = (configuration.pair_rows(arms=c.slip_arm) @ moved).reshape(shape)
    affine, work, sigma = of_stress(affine_u, 0 * affine_u), of_stress(affine_u + u, w), -stress(configuration)
    turned = np.einsum("al,bk->abkl", sigma, one) - np.einsum("ab,kl->abkl", sigma, one)
    by_gradient, affine = work + turned, affine + turned
    bears = np.setdiff1d(np.arange(len(configuration)), configuration.rattlers)
    return ElasticModuli(
        tensor=0.5 * (by_gradient + by_gradient.swapaxes(2, 3)), affine=0.5 * (affine + affine.swapaxes(2, 3)),
        by_gradient=by_gradient, work=work, displacement=moved.reshape(-1, 3, 3), dimension=d,
        at_bound=int(c.one_sided.sum()), volume=volume, density=float(configuration.mass[bears].sum() / volume),
        frequency=frequency, box=box,
    )  # fmt: skip


def _require_laws(configuration: Configuration, what: str) -> None:
    if configuration.stiffness is not None:
        raise BadInputError(f"{what} need the law of each contact; K of this packing is a difference of forces.")


class QuietResponse:
    """Displacements under forces of one frequency, or of none; motions without stiffness are held where they are."""

    def __init__(self, configuration: Configuration, frequency: float | None = None) -> None:
        matrix, mass = configuration.assembled_stiffness(), configuration.coordinate_mass
        self.held = FLOPPY * (float(abs(matrix.data).max(initial=0.0)) or 1.0)
        if frequency is not None:
            matrix = csr_array(matrix - diags_array(frequency**2 * mass).astype(complex))
            if configuration.damped:
                matrix = csr_array(matrix + 1j * frequency * configuration.assembled_damping())
        self.matrix = matrix
        self.factors = general_lu(csc_array(matrix + diags_array(np.full(len(mass), self.held))))

    def solve(self, force: Floats | Complexes, refinements: int = CORRECTIONS) -> Complexes:
        """q of (K + i omega C - omega^2 M) q = F, shape (coordinates, n)."""
        moved = self.factors.solve(force)
        for _ in range(refinements):
            moved += self.factors.solve(np.asarray(force - self.matrix @ moved))
        return np.asarray(moved)
