r"""The modes that are followed from load to load without the others: an invariant subspace of Z.

**What is followed.** On an invariant subspace of Z with orthonormal bases V of the right and U of the left one, Z is a
block :math:`B = (U^H V)^{-1} U^H Z V`. Without dissipation two modes are followed together, in real numbers. V, U, half
the trace and the *discriminant*

.. math:: D = (\lambda_1 - \lambda_2)^2 = (B_{11} - B_{22})^2 + 4 B_{12} B_{21}

are smooth functions of the load where the two eigenvectors become parallel, at an exceptional point (Kato,
*Perturbation Theory for Linear Operators*, 1966, II.1). D > 0 is a pair of real eigenvalues, D < 0 a complex pair. With
dissipation one mode is followed, and B is its s. One number of the block, the *growth*, is positive where the motion
grows: -D of two modes, Re s of one.

**Continuation.** The bases of a neighbouring load are improved by inverse iteration,
:math:`V \leftarrow (Z - \sigma)^{-1} V`, :math:`U \leftarrow (Z - \sigma)^{-H} U`, with one factorisation for all
steps. The error falls by :math:`|\lambda - \sigma| / |\lambda_3 - \sigma|` a step, :math:`\lambda_3` the closest of the
other eigenvalues. The shift stands off the pair by a tenth of B - mean, or the common eigenvector would dominate the
inverse close to a coalescence. If a third eigenvalue is closer to that shift, others are tried. A complex pair is also
found with its own eigenvalue as the shift: no other eigenvalue is nearer than the real axis. For a single mode the
shift is s itself, and is renewed as long as that helps.

**Acceptance.** The residuals :math:`Z V - V (V^H Z V)`, and those on the left, must be at the level of rounding: the
error of the growth is their product over the distance of the other modes. The shapes must also be those of the modes.

**Large operators.** There a factorisation costs as much as a hundred solutions. The factors P of a neighbour serve as
well in *residual inverse iteration* (Neumaier, SIAM J. Numer. Anal. 22, 914 (1985)),

.. math:: V \leftarrow V - P^{-1} (Z V - V (V^H Z V)) ,

which ends at an invariant subspace of Z whatever P is. So sparse factors need no pivoting.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg import eig

from ..arrays import Floats
from ..motion.eigenvalues import Complexes, growing
from .limits import LIMITS, Limits
from .system import Inverse, System, halves

Planes = tuple[Any, Any]


@dataclass(frozen=True, eq=False)
class Space:
    """An invariant subspace of Z, shape (N, N), at one load: two modes without dissipation, one mode with it.

    A cluster of k modes without dissipation is followed in the same way; `discriminant` and `growth` are of two.

    Attributes
    ----------
    system : System
        Z.
    right, left : ndarray, shape (N, 2), (N, 1) or (N, k)
        Orthonormal bases V and U of the right and of the left subspace; of one mode complex.
    inverse : Inverse or None
        Sparse factors with which they were found; they may serve for a neighbour as well.
    """

    system: System
    right: Any = field(repr=False)
    left: Any = field(repr=False)
    inverse: Inverse | None = field(default=None, repr=False)

    @classmethod
    def of(cls, system: System, right: Any, left: Any, rate: complex = 0.0) -> "Space":
        """The subspace of a complex mode, or of two real modes, from right and left vectors in columns.

        With dissipation the vectors are displacements x and y, and s is `rate`.
        """
        if system.damping is None:
            return cls(system, _real_plane(right), _real_plane(left))
        x, y = (np.asarray(each, complex).reshape(-1, 1) for each in (right, left))
        velocities = np.conj(rate) * y + system.transposed[1] @ y
        states = np.concatenate([x, rate * x]), np.concatenate([velocities, y])
        return cls(system, _orthonormal(states[0]), _orthonormal(states[1]))

    @property
    def fx(self) -> float:
        """The load, force per top disk."""
        return self.system.fx

    def block_of(self, image: Any) -> Any:
        """(U^H V)^-1 U^H times the image of V under any matrix, shape (2, 2) or (1, 1)."""
        adjoint = self.left.conj().T
        return np.linalg.solve(adjoint @ self.right, adjoint @ image)

    @cached_property
    def block(self) -> Any:
        """B, 1 / time^2, with dissipation 1 / time."""
        return self.block_of(self.system.image(self.right))

    @cached_property
    def mean(self) -> Any:
        """Half the trace of B, a real number, or s."""
        mean = np.trace(self.block) / len(self.block)
        return complex(mean) if self.system.dissipative else float(mean)

    @cached_property
    def discriminant(self) -> float:
        """D = (lambda_1 - lambda_2)^2 of two modes, 1 / time^4."""
        b = self.block
        return float((b[0, 0] - b[1, 1]) ** 2 + 4 * b[0, 1] * b[1, 0])

    @property
    def growth(self) -> float:
        """A number that is positive where the motion grows: -D, 1 / time^4, or Re s, 1 / time."""
        return float(self.mean.real) if self.system.dissipative else -self.discriminant

    @cached_property
    def grows(self) -> bool:
        """Whether the motion grows; with dissipation beyond rounding."""
        if not self.system.dissipative:
            return self.growth > 0
        return bool(growing(self.mean, self.overlap, self.system.rounding))

    @property
    def traceless(self) -> Floats:
        """B - mean, shape (2, 2), 1 / time^2."""
        return np.asarray(self.block - self.mean * np.eye(len(self.block)))

    @cached_property
    def spread(self) -> float:
        """Frobenius norm of B - mean, 1 / time^2."""
        return float(np.linalg.norm(self.traceless))

    @cached_property
    def shapes(self) -> tuple[Any, Any]:
        """Unit displacements x and y of a mode, shape (n, 1), or the bases of two modes."""
        if not self.system.dissipative:
            return self.right, self.left
        x, y = halves(self.right)[0], halves(self.left)[1]
        return x / np.linalg.norm(x), y / np.linalg.norm(y)

    @cached_property
    def overlap(self) -> float:
        """|y^H x| of unit left and right vectors, the smaller one of two modes; zero at an exceptional point.

        With dissipation it is |y^H (2 s + G) x| / |2 s|.
        """
        if self.system.damping is not None:
            x, y = self.shapes
            slant = np.vdot(y, 2 * self.mean * x + self.system.damping @ x)
            return float(abs(slant) / abs(2 * self.mean)) if self.mean else 0.0
        values, z = np.linalg.eig(self.block)
        if values[0] == values[1]:
            return 0.0
        # x = V z and y = U (U^T V)^-T w, of the eigenvectors z, w of the block
        y = np.linalg.solve(self.right.T @ self.left, np.linalg.inv(z).conj().T)
        return float(np.min(1.0 / (np.linalg.norm(y, axis=0) * np.linalg.norm(z, axis=0))))

    @property
    def eigenpairs(self) -> tuple[Complexes, Complexes, Complexes]:
        """Without dissipation the eigenvalues, with unit right and left vectors in columns."""
        values, w, z = eig(self.block, left=True)
        x, y = self.right @ z, self.left @ np.linalg.solve(self.right.T @ self.left, w)
        return values, x / np.linalg.norm(x, axis=0), y / np.linalg.norm(y, axis=0)

    def slope(self, other: System) -> float:
        """First-order change of the growth on the way to another load."""
        b, db = self.block, self.drift(other)
        if self.system.dissipative:
            return float(db[0, 0].real)
        # The planes turn in first order, which changes invariants of the block in second order only.
        return float(-2 * (b[0, 0] - b[1, 1]) * (db[0, 0] - db[1, 1]) - 4 * (db[0, 1] * b[1, 0] + b[0, 1] * db[1, 0]))

    def drift(self, other: System) -> Any:
        """The change of Z on the way to another load as a block on this subspace."""
        return self.block_of(self.system.change(other, self.right))

    # Which is which

    def like(self, other: "Space") -> bool:
        """Whether both have the same shapes rather than not: all principal angles below 60 degrees."""
        ends = zip(self.shapes, other.shapes, strict=True)
        return min(float(np.linalg.norm(a.conj().T @ b, -2)) for a, b in ends) > 0.5

    def equals(self, other: "Space") -> bool:
        """Whether two subspaces of one load are one and the same.

        Shapes of two modes that nearly coalesce are alike: eigenvalues tell single modes apart.
        """
        if self.system.dissipative:
            return abs(self.mean - other.mean) * min(self.overlap, other.overlap) <= LIMITS.same_mode * abs(self.mean)
        return self.like(other)

    # From load to load

    def extrapolate(self, other: "Space", system: System) -> "Space | None":
        """A guess at another load: subspaces on the line through those at two loads; None too far away."""
        share = (system.fx - self.fx) / (other.fx - self.fx)
        if abs(share) > LIMITS.extrapolation:
            return None
        ends = (self.right, other.right), (self.left, other.left)
        right, left = (np.linalg.qr(a + share * (b @ np.linalg.inv(a.conj().T @ b) - a))[0] for a, b in ends)
        return replace(self, right=right, left=left)

    def at(self, system: System, limits: Limits = LIMITS, rate: complex | None = None) -> "Space | None":
        """The same modes at a neighbouring load; None if no iteration converges to modes of about the same shapes.

        A single mode is sought from a `rate` on, by default from its s in first order.
        """
        guess = Space(system, self.right, self.left, self.inverse)
        ways = _single_mode(guess, rate, limits) if system.dissipative else _real_modes(self, guess, limits)
        return next((found for found in ways if found is not None and found.like(self)), None)

    def refine(self, rate: complex) -> "Space | None":
        """The mode next to a guess of one, from a `rate` on; None if the iteration does not converge."""
        return next(_single_mode(self, rate, LIMITS), None)

    def follow(self, system: System, limits: Limits = LIMITS) -> "Space | None":
        """The same modes at another load, if need be in small steps on the straight line between both systems."""
        if system is self.system:
            return self
        moving, done, step = self, 0.0, 1.0
        while done < 1:
            share = min(1.0, done + step)
            image = moving.at(system if share == 1 else self.system.towards(system, share), limits)
            if image is not None:
                moving, done = image, share
            elif step > limits.shortest_step:
                step *= 0.5
            else:
                return None
        return moving


def _single_mode(guess: Space, rate: complex | None, limits: Limits) -> Iterator[Space | None]:
    """A single mode: its s is the shift, renewed where the iteration is slow."""
    for _ in range(limits.shifts):
        shift, rate = guess.mean if rate is None else rate, None
        inverse = guess.system.inverse(shift * (1 + limits.off_eigenvalue), limits) if np.isfinite(shift) else None
        if inverse is None:
            return
        found, planes = _iterate(
            guess.system, _inverse_iteration(guess, inverse), limits.neighbour_steps, limits, limits.slow_share
        )
        if found:
            yield Space(guess.system, *planes)
            return
        guess = Space(guess.system, *planes)


def _real_modes(pair: Space, guess: Space, limits: Limits) -> Iterator[Space | None]:
    """Two or more modes without dissipation: ways to their subspaces, the cheapest first."""
    system = guess.system
    if guess.inverse is not None:
        yield _space_of(system, _inverse_iteration(guess, guess.inverse), guess.inverse, limits.neighbour_steps, limits)
    scale = max(pair.spread, 1e3 * np.finfo(np.float64).eps * abs(pair.mean))
    levels = np.linalg.eigvals(guess.block).real
    middle = 0.5 * (levels.min() + levels.max())
    for turn, offset in enumerate(limits.offsets):
        inverse = system.inverse(middle + offset * scale, limits)
        if inverse is not None:
            yield _space_of(
                system, _inverse_iteration(guess, inverse), None if inverse.exact else inverse, limits.steps, limits
            )
        if turn == 0 and len(pair.block) == 2 and pair.growth > 0 and guess.growth > 0:
            inverse = system.inverse(complex(guess.mean, 0.5 * np.sqrt(guess.growth)), limits)
            if inverse is not None:
                yield _space_of(system, _complex_inverse_iteration(guess, inverse), None, limits.steps, limits)


def _space_of(
    system: System, bases: Iterator[Planes], inverse: Inverse | None, most: int, limits: Limits
) -> Space | None:
    found, planes = _iterate(system, bases, most, limits)
    return Space(system, *planes, inverse) if found else None


def _inverse_iteration(guess: Space, inverse: Inverse) -> Iterator[Planes]:
    """(Residual) inverse iteration of both bases, good through a coalescence."""
    v, u = guess.right, guess.left
    while True:
        if inverse.exact:
            v, u = (inverse.solve(each, adjoint) for each, adjoint in ((v, False), (u, True)))
        else:
            system = guess.system
            v, u = (b - inverse.solve(_residual(system, b, turn), turn) for b, turn in ((v, False), (u, True)))
        v, u = _orthonormal(v), _orthonormal(u)
        yield v, u


def _complex_inverse_iteration(guess: Space, inverse: Inverse) -> Iterator[Planes]:
    """Inverse iteration of a complex pair with its own eigenvalue as the shift, for both members, in real numbers."""
    v, u = guess.right, guess.left
    while True:
        v, u = (np.linalg.qr(inverse.solve(b, turn).imag)[0] for b, turn in ((v, False), (u, True)))
        yield v, u


def _iterate(
    system: System, bases: Iterator[Planes], most: int, limits: Limits, slow: float = np.inf
) -> tuple[bool, Planes]:
    """The first bases whose residuals are rounding; the last bases if the pace says that none will be in time.

    The iteration also ends if a step leaves more than the share `slow` of the residual.
    """
    level, residuals = limits.residual_factor * system.backward_error, []
    for planes in bases:
        residuals.append(
            max(
                float(np.linalg.norm(_residual(system, b, turn))) for b, turn in zip(planes, (False, True), strict=True)
            )
        )
        if residuals[-1] < level:
            return True, planes
        if len(residuals) > 1 and residuals[-1] > slow * residuals[-2]:
            break
        left = most - len(residuals)
        if len(residuals) > min(2 * limits.pace_steps, most // 2):
            gain = residuals[-1] / residuals[-1 - limits.pace_steps]
            if left <= 0 or not residuals[-1] * gain ** (left / limits.pace_steps) < level:
                break
    return False, planes


def _residual(system: System, basis: Any, adjoint: bool) -> Any:
    """Z V - V (V^H Z V), or the same of Z^H."""
    image = system.image(basis, adjoint)
    return image - basis @ (basis.conj().T @ image)


def _orthonormal(vectors: Any) -> Any:
    return vectors / np.linalg.norm(vectors) if vectors.shape[1] == 1 else np.linalg.qr(vectors)[0]


def _real_plane(vectors: Complexes) -> Floats:
    """Orthonormal real basis, shape (n, 2), of the plane of two real or two complex conjugate vectors."""
    vectors = np.asarray(vectors).reshape(len(vectors), -1)
    both = np.hstack([vectors.real, vectors.imag]) if np.iscomplexobj(vectors) else vectors
    return np.asarray(np.linalg.svd(both, full_matrices=False)[0][:, :2])
