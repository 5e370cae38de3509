r"""How a packing vibrates: density of states, participation, rotation, quality factors, softness, and plane waves.

**Density of states.** Frequencies are :math:`\omega_k = \sqrt{\lambda_k}` of :math:`K x = \lambda M x`, and g is their
density, of integral one. With :math:`\omega = \Omega \sin(\theta/2)`, :math:`\Omega` above the largest frequency, g is
a cosine series in :math:`\theta`. Its coefficients are

.. math:: \mu_n = \frac1n \sum_k \cos n \theta_k = \frac1n \mathrm{tr}\, T_n(1 - 2 S/\Omega^2),
    \qquad S = M^{-1/2} K M^{-1/2},

and N of them with Jackson's weights show g through a window of the width
:math:`\frac{\pi}{2N} \Omega \cos(\theta/2)`, its `resolution` (A. Weisse, G. Wellein, A. Alvermann and H. Fehske, Rev.
Mod. Phys. 78, 275, 2006). Of few coordinates the :math:`\theta_k` are those of all eigenvalues. Of many the trace is a
mean over random vectors z of :math:`z^T T_n z`, with S in place of its symmetric part, which moves eigenvalues in
second order of the asymmetry alone; `density_error` is the standard error of this mean. The same series with a weight
in the trace has the share of rotation, and the damping rate :math:`x^T C x / x^T M x` of the motions at a frequency;
:math:`Q = \omega` over this rate, to first order in C.

**Participation** of a mode is :math:`(\sum_i e_i)^2 / (N \sum_i e_i^2)` of the kinetic energies of the particles.

**Softness** of a particle is its displacement over a force on it, in the mean over the directions: a third of the
trace of its block of :math:`K^{-1}` for spheres. It is also its thermal mean square displacement over temperature, the
vibrability (H. Tong and N. Xu, Phys. Rev. E 90, 010401, 2014).

**Plane waves.** In a periodic box waves have :math:`\mathbf q = 2 \pi n\, \mathbf g` with the reciprocal vector g of
an edge. A velocity :math:`\mathbf e \cos(\mathbf q \cdot \mathbf x + \phi)` is given to the particles at rest, and
followed with K and C (velocity Verlet). Its projection on itself is fitted by
:math:`a\, e^{-\gamma t} \cos(\omega t + \psi)`: frequency and attenuation by disorder and dashpots together (S. Gelin,
H. Tanaka and A. Lemaitre, Nature Mater. 15, 1177, 2016).
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import eig
from scipy.sparse import csr_array, diags_array
from scipy.sparse.linalg import eigsh

from ..arrays import Floats
from ..configuration import Configuration
from ..errors import BadInputError
from ..has_configuration import HasConfiguration
from ..motion.stable_timestep import stable_timestep
from ..operators.damping import damping_matrix
from ..operators.stiffness import stiffness_matrix
from ..progress import report_progress
from .moduli import QuietResponse

ALL_MODES = 2400
"""Coordinates up to which all modes are computed: a minute of LAPACK."""

MOMENTS, VECTORS = 512, 8
"""Coefficients of g, which give a resolution of 0.3 % of the largest frequency, and random vectors for the trace."""

NO_STIFFNESS = 1e-10
"""Eigenvalue, as a share of the largest, below which a motion has no frequency: rounding of LAPACK's eigenvalues."""

EXACT_SOFTNESS, PROBES = 3000, 64
"""Translations up to which the softness is exact, and random forces on all particles beyond."""

WAVE_PERIODS, WAVE_SAMPLES, WAVE_STEP = 6, 40, 0.2
"""Periods for which a plane wave is followed, samples of each, and its time step over the largest stable one."""


@dataclass(frozen=True, eq=False)
class Vibrations:
    """The density of states of a packing and what its motions are like.

    Attributes
    ----------
    frequency, resolution : ndarray, shape (F,)
        omega, radian / time, and the width of the window through which g is seen there.
    density, density_error : ndarray, shape (F,)
        g, of integral one over the motions that have a frequency; and its standard error, 0 of all eigenvalues.
    rotation, damping : ndarray, shape (F,)
        Share of rotation in the kinetic energy, and damping rate, 1 / time; nan where there is no motion.
    modes : dict of ndarray, or None
        Of all modes, by frequency: `frequency`, `growth_rate` (2 |Im omega|), `participation`, `rotation`, `damping`;
        None of many coordinates.
    largest : float
        Omega, radian / time.
    counted, zero, negative : int
        Motions with a frequency; without stiffness (of many coordinates: rattlers and translations alone); and with a
        negative eigenvalue, which have none.
    """

    frequency: Floats
    resolution: Floats
    density: Floats
    density_error: Floats
    rotation: Floats
    damping: Floats
    modes: dict[str, Floats] | None
    largest: float
    counted: int
    zero: int
    negative: int

    @property
    def quality(self) -> Floats:
        """Q, infinite without damping."""
        with np.errstate(divide="ignore"):
            return np.asarray(self.frequency / np.maximum(self.damping, 0.0))


def vibrations(packing: HasConfiguration, moments: int | None = None, vectors: int = VECTORS) -> Vibrations:
    """The density of states of a packing, with participation, rotation and damping.

    Parameters
    ----------
    packing : Packing or Configuration
        Contacts stick.
    moments, vectors : int
        N, the inverse of the resolution, by default 512, or an eighth of few coordinates; and random vectors where not
        all modes are computed.

    Raises
    ------
    BadInputError
        If nothing vibrates, or if one of many motions has a negative eigenvalue.

    Examples
    --------

    >>> start = faultgouge.settle("three_disks.toml").packing
    >>> faultgouge.vibrations(start).modes["frequency"].round(3)[:4]
    array([19.585, 34.48 , 38.533, 57.444])
    """
    configuration = packing.configuration
    scale = 1.0 / np.sqrt(configuration.coordinate_mass)
    scaled, operators = diags_array(scale), (stiffness_matrix(configuration), damping_matrix(configuration))
    a, g = (csr_array(scaled @ each @ scaled) for each in operators)
    if not a.nnz:
        raise BadInputError("Nothing vibrates: no particle touches another.")
    moments = moments or min(MOMENTS, max(64, configuration.coordinates // 8))
    if configuration.coordinates <= ALL_MODES:
        return _of_all_modes(configuration, a, g, moments)
    return _of_vectors(configuration, a, g, moments, vectors)


def _of_all_modes(c: Configuration, a: csr_array, g: csr_array, moments: int) -> Vibrations:
    moves = np.flatnonzero(np.diff(a.indptr))
    values, left, right = eig(a[moves][:, moves].toarray(), left=True)
    # a factor of each pair of vectors does not count: only y^H C x over y^H x does
    one = np.einsum("ik,ik->k", left.conj(), right)
    with np.errstate(divide="ignore", invalid="ignore"):
        damping = np.real(np.einsum("ik,ik->k", left.conj(), g[moves][:, moves] @ right) / one)
    energy = np.abs(right) ** 2
    of_particle = np.array([np.bincount(moves % len(c), each, len(c)) for each in energy.T])
    participation = of_particle.sum(axis=1) ** 2 / (len(c) * np.sum(of_particle**2, axis=1))
    rotation = energy[moves >= c.dimension * len(c)].sum(axis=0) / energy.sum(axis=0)
    least = NO_STIFFNESS * float(np.abs(values).max())
    some = np.flatnonzero(values.real > least)
    some = some[np.argsort(values.real[some])]
    omega = np.sqrt(values[some])
    names = {"participation": participation, "rotation": rotation, "damping": damping}
    modes = {"frequency": omega.real, "growth_rate": 2 * np.abs(omega.imag)} | {k: v[some] for k, v in names.items()}
    top = 1.01 * float(omega.real.max())
    angle = 2 * np.arcsin(omega.real / top)
    weights = np.array([np.ones(len(some)), modes["rotation"], np.nan_to_num(modes["damping"])])
    series = weights @ np.cos(np.outer(angle, np.arange(moments)))
    negative = int(np.sum(values.real < -least))
    counts = {"counted": len(some), "zero": c.coordinates - len(some) - negative, "negative": negative}
    return _seen(series[:, None] / len(some), top, modes=modes, **counts)


def _of_vectors(c: Configuration, a: csr_array, g: csr_array, moments: int, vectors: int) -> Vibrations:
    symmetric, damping, size = csr_array(0.5 * (a + a.T)), 0.5 * (g + g.T), a.shape[0]
    rng = np.random.default_rng(0)
    (top,) = eigsh(symmetric, k=1, which="LA", tol=1e-3, v0=rng.standard_normal(size), return_eigenvectors=False)
    moves = np.diff(a.indptr) > 0
    # uniform translations, where nothing opposes them
    axes = np.repeat(np.eye(c.axes)[: c.dimension], len(c), axis=1) * np.sqrt(c.coordinate_mass) * moves
    free = axes / np.linalg.norm(axes, axis=1)[:, None]
    free = free[np.linalg.norm(symmetric @ free.T, axis=0) < NO_STIFFNESS * top]
    start = rng.choice([-1.0, 1.0], size=(size, vectors)) * moves[:, None]
    start -= free.T @ (free @ start)
    rotates = (np.arange(size) >= c.dimension * len(c)).astype(float)
    weights = [start, rotates[:, None] * start, np.asarray(damping @ start)]
    bound = 1.01 * float(top)
    step = csr_array(diags_array(np.ones(size)) - (2 / bound) * symmetric)
    before, now = np.asarray(step @ start), start  # T_-1 = T_1
    series = np.empty((3, vectors, moments))
    for n in range(moments):
        series[:, :, n] = [np.einsum("ik,ik->k", each, now) for each in weights]
        before, now = now, 2 * (step @ now) - before if n else before
        if n % 32 == 0:
            report_progress(f"density of states, {n} of {moments} moments")
    if np.any(np.abs(series[0]) > 1.5 * series[0, :, :1]):  # a Chebyshev polynomial grows outside of [-1, 1] alone
        raise BadInputError("A motion has a negative eigenvalue: the packing leaves its place; see `stability`.")
    counted = int(moves.sum()) - len(free)
    names = {"modes": None, "counted": counted, "zero": size - counted, "negative": 0}
    return _seen(series / counted, float(np.sqrt(bound)), **names)


def _seen(series: Floats, largest: float, **more: Any) -> Vibrations:
    """g, rotation and damping of moments, shape (3, vectors, N), through Jackson's window."""
    moments = series.shape[-1]
    n, turn = np.arange(moments), np.pi / (moments + 1)
    jackson = ((moments - n + 1) * np.cos(n * turn) + np.sin(n * turn) / np.tan(turn)) / (moments + 1)
    angle = (np.arange(moments) + 0.5) * np.pi / moments
    cosines = np.cos(np.outer(n, angle)) * (jackson * np.where(n, 2.0, 1.0))[:, None] / np.pi
    by_angle = series @ cosines
    whole, rotation, damping = by_angle.mean(axis=1)
    seen = whole > 1e-3 * whole.mean()  # elsewhere a share is rounding over rounding
    share, loss = (np.divide(each, whole, out=np.full(moments, np.nan), where=seen) for each in (rotation, damping))
    stretch = 2 / (largest * np.cos(angle / 2))
    error = np.std(by_angle[0], axis=0, ddof=1) / np.sqrt(len(by_angle[0])) if len(by_angle[0]) > 1 else 0 * whole
    return Vibrations(
        frequency=largest * np.sin(angle / 2), resolution=np.pi / (moments * stretch), density=whole * stretch,
        density_error=error * stretch, rotation=share, damping=loss, largest=largest, **more,
    )  # fmt: skip


def softness(packing: HasConfiguration) -> tuple[Floats, Floats]:
    """How far each particle moves over a force on it, in the mean over directions.

    Returns
    -------
    softness, error : ndarray, shape (N,)
        Length / force; infinite of particles that nothing holds. The error is 0 up to 3,000 translations, and a
        standard error beyond.
    """
    c = packing.configuration
    response, d, n, rng = QuietResponse(c), c.dimension, len(c), np.random.default_rng(0)
    translations = np.flatnonzero(np.diff(response.matrix.indptr)[: d * n])
    exact = len(translations) <= EXACT_SOFTNESS
    floats = not c.contacts.wall.any() and bool(c.free.all())
    found, probes = np.zeros((2, d * n)), len(translations) if exact else PROBES
    batches = np.array_split(np.arange(probes), max(1, probes // 64) if exact else 4)

    def without_mean(vectors: Floats) -> Floats:
        """The box as a whole has nothing to hold it: forces and displacements are those without their mean."""
        parts = vectors.reshape(d, n, -1)
        return np.asarray(parts - floats * parts.mean(axis=1, keepdims=True)).reshape(d * n, -1)

    for done, batch in enumerate(batches):
        drives = np.zeros((c.coordinates, len(batch)))
        if exact:
            drives[translations[batch], np.arange(len(batch))] = 1.0
        else:
            drives[translations] = rng.choice([-1.0, 1.0], size=(len(translations), len(batch)))
        force = drives[: d * n].copy()
        drives[: d * n] = without_mean(force)
        values = force * without_mean(np.real(response.solve(drives, 1)[: d * n]))
        found += [values.sum(axis=1), (values**2).sum(axis=1)]
        report_progress(f"softness, {done + 1} of {len(batches)}")
    mean = found[0] if exact else found[0] / PROBES
    spread = np.zeros(d * n) if exact else np.sqrt(np.maximum(found[1] / PROBES - mean**2, 0.0) / PROBES)
    soft, error = mean.reshape(d, n).mean(axis=0), np.linalg.norm(spread.reshape(d, n), axis=0) / d
    loose = (soft > 0.01 / (d * response.held)) | ~np.isin(np.arange(n), translations % n)
    return np.where(loose, np.inf, soft), np.where(loose, 0.0, error)


class PlaneWave(NamedTuple):
    """A plane wave: |q|, 1 / length; 0 longitudinal, 1 or 2 transverse; omega, radian / time; gamma, 1 / time; and the
    root mean square by which the fit misses, of an amplitude of one."""

    wave_number: float
    polarisation: int
    frequency: float
    attenuation: float
    misfit: float


def dispersion(packing: HasConfiguration, axis: int = 0, waves: int = 4) -> list[PlaneWave]:
    """Frequencies and attenuation of the longest plane waves along an axis of the box.

    Parameters
    ----------
    packing : Packing or Configuration
        Periodic along the axis.
    axis : int
        Edge of the box, whose reciprocal vector is the direction.
    waves : int
        PlaneWave lengths, from that of the box.

    Raises
    ------
    BadInputError
        If the box is not periodic along the axis.
    """
    c = packing.configuration
    if not (0 <= axis < c.dimension and c.periodic[axis]):
        raise BadInputError(f"Plane waves need a box that is periodic along {'xyz'[axis]}, and this one is not.")
    d, n = c.dimension, len(c)
    stiffness, damping, mass = stiffness_matrix(c), damping_matrix(c), c.coordinate_mass
    edges = np.eye(3)  # an open axis has no edge
    edges[:d][c.periodic[:d]] = c.box[:d][c.periodic[:d]]
    reciprocal = 2 * np.pi * np.linalg.inv(edges)[:d, axis]
    ahead = reciprocal / np.linalg.norm(reciprocal)
    directions = np.linalg.qr(np.column_stack([ahead, np.delete(np.eye(d), np.argmax(abs(ahead)), axis=1)]))[0]
    limit = WAVE_STEP * float(stable_timestep(c, stiffness))
    bears = (np.diff(stiffness.indptr) > 0)[: d * n].reshape(d, n).any(axis=0)
    found, by_mass = [], 1 / mass[:, None]
    for number in range(1, waves + 1):
        phase, start = c.position @ (number * reciprocal), np.zeros((c.coordinates, 2 * d))
        for k, shape in np.ndindex(d, 2):
            wave = (np.cos, np.sin)[shape](phase) * bears
            start[: d * n, 2 * k + shape] = np.outer(directions[:, k], wave).ravel()
        size = np.einsum("ik,i,ik->k", start, mass, start)
        rough = float(np.sqrt(np.einsum("ik,ik->k", start, stiffness @ start) / size).max())
        every = max(1, int(2 * np.pi / rough / WAVE_SAMPLES / limit))
        # velocity Verlet; the velocity is that of the half step before
        place, velocity, weighted = np.zeros_like(start), start.copy(), start * mass[:, None]
        samples = [np.einsum("ik,ik->k", weighted, velocity)]
        for step in range(1, every * (WAVE_PERIODS * WAVE_SAMPLES - 1) + 1):
            force = stiffness @ place + (damping @ velocity if damping.nnz else 0.0)
            half = velocity - (0.5 * limit) * by_mass * force
            velocity = velocity - limit * by_mass * force
            place += limit * velocity
            if step % every == 0:
                samples.append(np.einsum("ik,ik->k", weighted, half))
        kept = np.mean((np.array(samples) / size).reshape(-1, d, 2), axis=2)
        time = np.asarray(np.arange(len(kept)) * (every * limit), dtype=float)
        for k in range(d):
            omega, gamma, misfit = _fit(time, np.ascontiguousarray(kept[:, k]), rough)
            # Verlet's own frequency of a motion is (2/dt) arcsin(omega dt/2)
            true = 2 / limit * np.sin(omega * limit / 2)
            found.append(PlaneWave(float(np.linalg.norm(number * reciprocal)), k, float(true), gamma, misfit))
        report_progress(f"plane waves, {number} of {waves}")
    return found


def _fit(time: Floats, values: Floats, rough: float) -> tuple[float, float, float]:
    """omega, gamma and root mean square misfit of a exp(-gamma t) cos(omega t + psi)."""
    from scipy.optimize import least_squares

    def model(p: Floats) -> Floats:
        return np.asarray(np.exp(-p[1] * time) * (p[2] * np.cos(p[0] * time) + p[3] * np.sin(p[0] * time)))

    scale = [rough, rough, 1.0, 1.0]
    starts = [[share * rough, 0.05 * rough, 1.0, 0.0] for share in (0.6, 0.8, 1.0)]
    fits = [least_squares(lambda p: model(p) - values, each, x_scale=scale) for each in starts]
    best = min(fits, key=lambda fit: fit.cost)
    return abs(float(best.x[0])), float(best.x[1]), float(np.sqrt(2 * best.cost / len(time)))
