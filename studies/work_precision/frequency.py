r"""Error of a frequency and of a growth rate over the time step.

A packing is displaced along one mode of its frozen operator A and left to undamped dynamics. The velocity, projected on
the mode's left vector, :math:`b = y^H M^{1/2} \dot q`, contains that mode alone, and at equal intervals h obeys

.. math:: b_{n+1} + b_{n-1} = 2 \cos(\Omega h)\, b_n ,

with complex :math:`\Omega` if the eigenvalue is complex: least squares give :math:`\cos\Omega h`. What velocity Verlet
makes of a frequency is known exactly, :math:`\sin\tfrac12\Omega\,\Delta t = \tfrac12\omega\,\Delta t`: the error is
:math:`\omega^3 \Delta t^2/24`, and it can be taken out of what was measured.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.linalg import eig

from ...analysis import Packing, discrete_frequency, dynamical_matrix, spectrum, stable_timestep
from ...analysis.spectrum import Complexes, unit_rounding
from ...pywrap import Engine
from .extended import refined
from .study import Point, Settings, Study, Theory, fit_order
from .timing import timed

AMPLITUDE = {"frequency": 1e-8, "growth rate": 2e-9}
"""Length by which the disk that moves most is displaced: far above the rounding of a coordinate, 2e-15, and far below
the overlaps. Ten times more or less makes the results worse (measured); above the onset the smallest overlap is
4e-6."""

SHARES = (0.8, 0.4, 0.2, 0.1, 0.05, 0.025, 0.0125)
"""Time steps in units of the limit 2/omega_max."""

RUN, CORRECTED, SPECTRUM = "run", "run, dispersion taken out", "eigenvalue of K, no run"


@dataclass(frozen=True, eq=False)
class Mode:
    """A mode of a packing's operator in mass-weighted coordinates.

    Attributes
    ----------
    packing : Packing
        The equilibrium.
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
        return AMPLITUDE["growth rate" if self.growing else "frequency"]

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
        with engine.undamped(dt):
            for _ in range(max(4, int(time / dt / every))):
                motion = engine.advance(every)
                velocity = np.concatenate([*motion.velocity.T, self.packing.radius * motion.spin])
                signal.append(np.vdot(self.left, root * velocity))
        b = np.array(signal)
        cosine = np.vdot(b[1:-1], b[2:] + b[:-2]) / (2 * np.vdot(b[1:-1], b[1:-1]).real)
        return complex(np.arccos(cosine) / (every * dt))


def corrected(frequency: complex, dt: float) -> complex:
    """omega with velocity Verlet's dispersion taken out of Omega: 2/dt sin(Omega dt/2), radian / time."""
    return complex(2 / dt * np.sin(0.5 * dt * frequency))


def frequency(settings: Settings) -> Study:
    """The frequency of the fastest mode of a stable packing."""
    mode = Mode.of(settings.at(0.01).packing, growing=False)
    periods = 50 if settings.quick else 200
    study = partial(
        Study,
        name="time step: frequency",
        question=f"The frequency of the fastest mode of a packing of {len(mode.packing)} disks, {mode.exact:.6g}, from "
        f"{periods} of its periods.",
        error="relative error of the frequency",
    )
    return _study(
        settings,
        mode,
        study,
        periods * 2 * np.pi / mode.exact,
        "Take {coarse:g} of the limit 2/omega_max and take the dispersion out, omega = 2/dt sin(Omega dt/2): the error "
        "is then {noise:.0e}, whatever the step.",
        "Take 0.05 of the limit where the motion itself has to be right, which leaves {default:.0e} on the fastest "
        "mode, and no run at all where frequencies are all that is wanted: K has them to {spectrum:.0e}.",
    )


def growth(settings: Settings) -> Study:
    """The growth rate of D in a packing above its onset."""
    mode = Mode.of(settings.at(0.023).packing, growing=True)
    times = 5 if settings.quick else 25
    study = partial(
        Study,
        name="time step: growth rate",
        question=f"The growth rate 2 |Im omega| = {mode.exact:.6g} of the mean square displacement D at F_x = "
        f"{mode.packing.fx:g}, above the onset, from a run in which D grows {times} times.",
        error="relative error of the growth rate",
    )
    return _study(
        settings,
        mode,
        study,
        np.log(times) / mode.exact,
        "Take {coarse:g} of the limit 2/omega_max, and take the dispersion out if {raw:.0e} is too much: the pair is "
        "{slower:.0f} times slower than the fastest mode, so that the rate hardly feels the step.",
        "Take the spectrum of K where the growth at one load is all that is wanted: it needs no run and has the rate "
        "to {spectrum:.0e}.",
    )


def _study(
    settings: Settings, mode: Mode, study: Callable[..., Study], time: float, many_steps: str, otherwise: str
) -> Study:
    """Runs of a length over the time step; the advice is filled in."""
    exact = mode.exact
    shares = SHARES[:5] if settings.quick else SHARES
    steps = [share * mode.limit for share in shares]
    with Engine(mode.packing) as engine:
        jobs: list[Callable[[], complex]] = [partial(mode.measured, engine, dt, time) for dt in steps]
        *runs, (alone, seconds_alone) = timed([*jobs, mode.from_spectrum], settings.repeats, settings.progress)
    points = []
    for method, change in ((RUN, lambda found, _: found), (CORRECTED, corrected)):
        for dt, (found, seconds) in zip(steps, runs, strict=True):
            off = abs(mode.quantity(change(found, dt)) / exact - 1)
            points.append(Point(method, dt, off, seconds, int(time / dt)))
    own = max(abs(alone / exact - 1), float(np.finfo(float).eps))
    points.append(Point(SPECTRUM, None, own, seconds_alone, None))
    noise = float(np.median([point.error for point in points if point.method == CORRECTED]))
    raw = {share: point.error for share, point in zip(shares, points, strict=False)}
    fine = np.geomspace(steps[-1], steps[0], 60)
    predicted = [abs(mode.quantity(complex(discrete_frequency(mode.eigenvalue, dt))) / exact - 1) for dt in fine]
    order = fit_order(points, RUN, 2, least=10 * noise, most=0.01)
    figures = {
        "coarse": shares[1],
        "noise": noise,
        "default": raw[0.05],
        "raw": raw[shares[1]],
        "spectrum": max(own, mode.resolution),
        "slower": 2 / mode.limit / abs(np.sqrt(mode.eigenvalue)),
    }
    return study(
        parameter="time step",
        evaluations="steps",
        abscissa="parameter",
        reference="the eigenvalue of the frozen K, refined in extended precision; its error is what the rounding "
        "of K's entries amounts to",
        reference_error=mode.resolution,
        points=tuple(points),
        advice=(many_steps.format(**figures), otherwise.format(**figures)),
        orders=(order,),
        theory=(
            Theory("velocity Verlet on a frozen K", tuple(map(float, predicted)), tuple(map(float, fine))),
            Theory("rounding of K", (mode.resolution,)),
        ),
        remarks=(
            f"With the dispersion taken out, the runs differ from K's eigenvalue by {noise:.0e}: the rounding of "
            f"the forces, and that the packing is not quite linear at displacements of {mode.amplitude:g}.",
        ),
    )
