r"""One mode of a packing, excited in LAMMPS and measured.

The packing is displaced along the mode and left to undamped dynamics. The velocity, projected on the mode's left
vector, :math:`b = y^H M^{1/2} \dot q`, contains that mode alone, and at equal intervals h obeys

.. math:: b_{n+1} + b_{n-1} = 2 \cos(\Omega h)\, b_n ,

with complex :math:`\Omega` if the eigenvalue is complex: least squares give :math:`\cos\Omega h`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import eig

from ....analysis import Packing, dynamical_matrix, spectrum, stable_timestep
from ....analysis.spectrum.spectrum import Complexes, unit_rounding
from ....pywrap import Engine
from .extended import refined

AMPLITUDE = {"compensated": 1e-12, "doubles": 1e-8}
"""Length by which the disk that moves most is displaced: far above what a coordinate is known to, 1e-23 or 2e-15, and
far below the overlaps, 1e-5 and more, so that the packing is nearly linear."""


@dataclass(frozen=True, eq=False)
class Mode:
    """A mode of a packing's operator in mass-weighted coordinates.

    Attributes
    ----------
    packing : Packing
        The equilibrium, whose arithmetic is that of the run.
    growing : bool
        Whether it is the mode that grows fastest, or the fastest of a stable packing.
    right, left : ndarray of complex, shape (3N,)
        Unit vectors; zero on coordinates that feel no force.
    eigenvalue : complex
        Refined in extended precision, 1 / time^2.
    error : float
        What the rounding of the operator's entries amounts to, 1 / time^2.
    limit : float
        2 / omega_max, time.
    """

    packing: Packing
    growing: bool
    right: Complexes
    left: Complexes
    eigenvalue: complex
    error: float
    limit: float

    @classmethod
    def of(cls, packing: Packing, growing: bool) -> Mode:
        """Solve the eigenproblem of a packing and choose."""
        sparse, active = dynamical_matrix(packing)
        matrix = sparse.toarray()
        values, left, right = eig(matrix, left=True, right=True)
        k = int(np.argmin(np.sqrt(values).imag) if growing else np.argmax(values.real))
        spread = np.zeros((2, 3 * len(packing)), dtype=np.complex128)
        spread[:, active] = right[:, k], left[:, k]
        condition = 1 / abs(np.vdot(left[:, k], right[:, k]))
        exact = refined(matrix, complex(values[k]), right[:, k], condition)
        error = unit_rounding(matrix) * condition + exact.error
        limit = stable_timestep(float(np.sqrt(np.abs(values).max())))
        return cls(packing, growing, spread[0], spread[1], complex(exact.value), error, limit)

    def quantity(self, frequency: complex) -> float:
        """What is studied: the growth rate of D, or the frequency, 1 / time."""
        return float(2 * abs(frequency.imag) if self.growing else abs(frequency.real))

    @property
    def amplitude(self) -> float:
        """Largest coordinate of the displacement that a run starts with, length."""
        return AMPLITUDE["compensated" if self.packing.compensated else "doubles"]

    @property
    def exact(self) -> float:
        """The quantity from the refined eigenvalue."""
        return self.quantity(np.sqrt(self.eigenvalue))

    @property
    def resolution(self) -> float:
        """Relative error of the quantity that the rounding of the operator's entries amounts to."""
        return float(self.error / np.sqrt(abs(self.eigenvalue)) / self.exact / (1 if self.growing else 2))

    def from_spectrum(self) -> float:
        """The quantity from the packing's spectrum, without a run."""
        found = spectrum(self.packing)
        return found.growth_rate() if self.growing else found.omega_max

    def measured(self, engine: Engine, dt: float, time: float) -> complex:
        """Omega from an undamped run in LAMMPS that starts displaced along the mode, radian / time."""
        every = max(1, round(0.25 * np.pi / np.sqrt(self.eigenvalue).real / dt))  # an eighth of a period
        mass, inertia = self.packing.mass, self.packing.inertia_factor
        root = np.sqrt(np.concatenate([mass, mass, inertia * mass]))
        displacement = self.right.real / root
        engine.restore(engine.displace(self.packing, self.amplitude * displacement / np.abs(displacement).max()))
        signal = []
        with engine.undamped(dt) as dynamics:
            for _ in range(max(4, int(time / dt / every))):
                motion = dynamics.advance(every)
                velocity = np.concatenate([*motion.velocity.T, self.packing.radius * motion.spin])
                signal.append(np.vdot(self.left, root * velocity))
        b = np.array(signal)
        cosine = np.vdot(b[1:-1], b[2:] + b[:-2]) / (2 * np.vdot(b[1:-1], b[1:-1]).real)
        return complex(np.arccos(cosine) / (every * dt))
