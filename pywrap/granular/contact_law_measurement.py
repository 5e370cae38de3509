r"""The laws of LAMMPS's granular styles, measured in a second LAMMPS with two particles or one and a wall.

What a wall's tangential stiffness is, where the lever arm of a torque ends, how coefficients of two types mix, and
which damping a model's name stands for differ between versions of LAMMPS. None of it is looked up. At the overlap
:math:`\delta`, with the effective radius R and the effective mass m of a contact, every law of these styles is a
power law,

.. math::

    f_n = k_n \delta^p R^{p-1}, \quad k_t' = k_t (R\delta)^q, \quad
    c_n = \gamma_n m^{g} (R\delta)^{h}, \quad c_t = \gamma_t m^{g'} (R\delta)^{h'}, \quad
    \left|\mathbf f_t\right| \propto \delta^{\beta} \text{ at constant slip},

with one :math:`\beta` while the contact closes and another one while it parts, :math:`|\mathbf f_t| \le \mu f_n`, and
the lever arm :math:`R_i - l' \delta`. A second overlap, another mass and another radius tell the exponents, which are
multiples of 1/4; whatever has others is refused. A push is a rotation for one step without an integrator:
nothing moves, and the slip is known to the last digit.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI

from ...analysis.packing.arrays import Floats
from ..lammps.instance import lammps_instance
from .granular_commands import Commands, SnapshotError, wall_plane

EXACT = 1e-6
"""Distance of a measured exponent from a multiple of 1/4: rounding of forces and overlaps leaves 1e-9 or less."""

OVERLAP_RANGE = 1e-3, 0.1
"""Overlaps at which laws are measured, in units of a radius: an overlap of 1e-10, as of spheres that barely touch, has
lost ten digits, and one beyond a tenth is that of no contact."""


class State(NamedTuple):
    """One contact: radii, masses (of a wall 0 and infinite) and overlap."""

    radii: tuple[float, float]
    masses: tuple[float, float]
    overlap: float

    @property
    def radius(self) -> float:
        """R_i R_j/(R_i + R_j), or R_i at a wall."""
        a, b = self.radii
        return a * b / (a + b) if b else a

    @property
    def mass(self) -> float:
        """m_i m_j/(m_i + m_j), or m_i at a wall."""
        return 1 / (1 / self.masses[0] + 1 / self.masses[1])


@dataclass(frozen=True)
class PowerOfOverlap:
    """factor m^mass (R delta)^overlap."""

    factor: float
    overlap: float = 0.0
    mass: float = 0.0

    def at(self, radius: Floats, overlap: Floats, mass: Floats | float = 1.0) -> Floats:
        """The values of contacts with these effective radii, overlaps and effective masses."""
        return np.asarray(self.factor * mass**self.mass * (radius * overlap) ** self.overlap)


@dataclass(frozen=True)
class MeasuredLaw:
    """The law of one pair of types, or of one wall.

    Attributes
    ----------
    exponent : float
        p of f_n.
    stiffness, tangential, normal_dashpot, tangential_dashpot : PowerOfOverlap
        f_n/delta, k_t', c_n and c_t.
    closing, parting : float
        d ln f_t / d ln delta at constant slip.
    mu : float
        Coulomb's coefficient.
    lever : float
        l': 0, or 1/2 of an arm that ends in the middle of the overlap.
    """

    exponent: float
    stiffness: PowerOfOverlap
    tangential: PowerOfOverlap
    normal_dashpot: PowerOfOverlap
    tangential_dashpot: PowerOfOverlap
    closing: float
    parting: float
    mu: float
    lever: float


class TwoParticleLammps:
    """A LAMMPS with two particles, or one and a wall, that knows the pair styles and walls of a deck."""

    def __init__(self, commands: Commands, units: str, types: int, size: float, wall: str | None = None) -> None:
        self.lammps = lammps_instance(MPI.COMM_SELF, None)
        self.axis, self.sign, self.place, self.wall = 0, 1.0, 0.0, wall
        if wall is not None:
            self.axis, low, high = wall_plane(wall)
            if low is None and high is None:
                raise SnapshotError(f"{wall!r} has no plane.")
            self.sign, self.place = (1.0, low) if low is not None else (-1.0, high or 0.0)
        across = {0: 1, 1: 2, 2: 0}
        self.across, self.about = across[self.axis], across[across[self.axis]]
        middle = np.zeros(3)
        middle[self.axis] = self.place
        edges = " ".join(f"{m - 40 * size:.17g} {m + 40 * size:.17g}" for m in middle)
        self.run(
            f"units {units}", "atom_style sphere", "atom_modify map yes sort 0 0", "boundary f f f", "newton on",
            "comm_modify vel yes", f"neighbor {size:.17g} bin", "neigh_modify every 1 delay 0 check no",
            f"region box block {edges} units box", f"create_box {types} box", "thermo_modify lost ignore norm no",
        )  # fmt: skip
        corner = " ".join(f"{m:.17g}" for m in middle)
        for _ in range(1 if wall else 2):
            self.run(f"create_atoms 1 single {corner} units box")
        self.run(f"set group all diameter {2 * size:.17g}", "set group all density 1", "run_style verlet")
        self.run(*commands.pair)
        if wall is not None:
            words = wall.split()
            words[2] = "all"
            self.run(" ".join(words))
        self.run("timestep 1")

    def run(self, *lines: str) -> None:
        """LAMMPS's commands."""
        for line in lines:
            self.lammps.command(line)

    def array(self, name: str) -> Floats:
        """An array of the particles, as LAMMPS has it."""
        return np.asarray(self.lammps.numpy.extract_atom(name))[: 1 if self.wall else 2]

    def place_at(self, state: State, types: tuple[int, int] = (1, 1)) -> State:
        """Put the particles into a fresh contact, at rest; the state with the overlap to the last digit."""
        for away in (True, False):
            if self.wall is None:
                self.array("radius")[:], self.array("rmass")[:] = state.radii, state.masses
                self.array("type")[:] = types
            else:
                self.array("radius")[:], self.array("rmass")[:] = state.radii[0], state.masses[0]
            x = self.array("x")
            x[:] = 0.0
            x[:, self.axis] = self.place
            distance = sum(state.radii) - state.overlap + away * state.radii[0]
            x[0, self.axis] += self.sign * distance
            self.move((0.0, 0.0))
            self.run("run 0 post no")
        x = self.array("x")
        other = self.place if self.wall else x[1, self.axis]
        return state._replace(overlap=sum(state.radii) - abs(x[0, self.axis] - other))

    def move(self, speed: tuple[float, float]) -> None:
        """Give the first particle a velocity towards the other one, and a rotation, as the speed of its surface."""
        self.array("v")[:] = self.array("omega")[:] = 0.0
        self.array("v")[0, self.axis] = -self.sign * speed[0]
        self.array("omega")[0, self.about] = speed[1] / self.array("radius")[0]

    def force(self) -> tuple[float, float]:
        """f_n on the first particle, and the size of f_t."""
        f = self.array("f")[0]
        return float(self.sign * f[self.axis]), float(abs(f[self.across]))

    def lever(self) -> float:
        """Torque over tangential force of the first particle, length."""
        return float(abs(self.array("torque")[0, self.about] / self.array("f")[0, self.across]))

    def close(self) -> None:
        """End LAMMPS."""
        self.lammps.close()


def measure_law(bench: TwoParticleLammps, state: State, types: tuple[int, int], who: str) -> MeasuredLaw:
    """The law of a contact, from its own overlap, radii and masses, and from others.

    Parameters
    ----------
    bench : TwoParticleLammps
        LAMMPS with the law.
    state : State
        A contact of the packing; its law is measured at an overlap that is neither minute nor large.
    types : tuple of (int, int)
        Types of the two particles.
    who : str
        Whose law it is, for messages.

    Raises
    ------
    SnapshotError
        If it is no power law of the kind above.
    """
    least, most = (share * state.radii[0] for share in OVERLAP_RANGE)
    state = state._replace(overlap=min(max(state.overlap, least), most))
    heavy = (3 * state.masses[0], state.masses[1] if bench.wall else 2 * state.masses[1])
    small = State((0.5 * state.radii[0], 0.8 * state.radii[1]), state.masses, state.overlap)
    states = [state, state._replace(overlap=0.5 * state.overlap), state._replace(masses=heavy), small]
    found = [_measure(bench, each, types) for each in states]
    here, shallow, heavier, smaller = (values for _, values in found)
    depth = np.log(found[1][0].overlap / found[0][0].overlap)
    size = np.log(states[3].radius / states[0].radius)
    weight = np.log(states[2].mass / states[0].mass)

    def power(name: str) -> PowerOfOverlap:
        values = [getattr(each, name) for each in (here, shallow, heavier, smaller)]
        if values[0] == 0 and not any(values):
            return PowerOfOverlap(0.0)
        if min(values) <= 0:
            raise SnapshotError(
                f"{who} has a {name.replace('_', ' ')} that changes its sign, which no contact law does."
            )
        by_depth, by_mass, by_size = (
            quarter(np.log(value / values[0]) / scale, f"{name.replace('_', ' ')} of {who}")
            for value, scale in zip(values[1:], (depth, weight, size), strict=True)
        )
        if by_depth != by_size:
            raise SnapshotError(f"The {name.replace('_', ' ')} of {who} is no power of its contact radius.")
        first = found[0][0]
        return PowerOfOverlap(
            values[0] / (first.mass**by_mass * (first.radius * first.overlap) ** by_depth), by_depth, by_mass
        )

    stiffness = power("stiffness")
    exponents = here.closing, here.parting
    return MeasuredLaw(
        exponent=1 + stiffness.overlap,
        stiffness=stiffness,
        tangential=power("tangential"),
        normal_dashpot=power("normal_dashpot"),
        tangential_dashpot=power("tangential_dashpot"),
        closing=quarter(exponents[0], f"tangential force of {who}"),
        parting=quarter(exponents[1], f"tangential force of {who}"),
        mu=here.mu,
        lever=quarter(here.lever, f"lever arm of {who}"),
    )


def quarter(value: float, what: str) -> float:
    """The multiple of 1/4 that a measured exponent is; an error if it is none."""
    nearest = round(4 * value) / 4
    if not abs(value - nearest) < EXACT:
        raise SnapshotError(
            f"The {what} has the measured exponent {value:.9g}, which no contact law of LAMMPS that is known here has."
        )
    return nearest


class _Values(NamedTuple):
    stiffness: float
    tangential: float
    normal_dashpot: float
    tangential_dashpot: float
    closing: float
    parting: float
    mu: float
    lever: float


def _measure(bench: TwoParticleLammps, wanted: State, types: tuple[int, int]) -> tuple[State, _Values]:
    """Forces of one contact at rest and in motion."""
    state = bench.place_at(wanted, types)
    fn, delta = bench.force()[0], state.overlap
    # a time step so long that dashpots are weak beside slips
    step = 1e3 * np.sqrt(state.mass * delta / fn)
    bench.run(f"timestep {step:.17g}")
    normal_dashpot = _dashpot(bench, (1.0, 0.0), fn, 0.1 * delta / step)
    slip = 1e3 * delta  # far beyond Coulomb's bound
    bench.place_at(wanted, types)
    bench.move((0.0, slip / step))
    bench.run("run 1 post no")
    mu = bench.force()[1] / fn  # while the contact slides: a dashpot has its share of it
    if mu == 0:
        return state, _Values(fn / delta, 0.0, normal_dashpot, 0.0, 0.0, 0.0, 0.0, 0.0)
    slip = 0.01 * min(mu, 1.0) * delta
    ft = _push_contact(bench, wanted, types, slip / step)[1]
    if ft > 0.1 * mu * fn:  # a stiff spring: once more, with less
        slip *= 0.1 * mu * fn / ft / 10
        ft = _push_contact(bench, wanted, types, slip / step)[1]
    if ft == 0:
        raise SnapshotError("A contact law has friction without a tangential stiffness: use one with a history.")
    lever = (state.radii[0] - bench.lever()) / delta
    # the exponents at constant slip, in steps of a tenth of the overlap
    forces, overlaps = [ft], [delta]
    for direction in (-1.0, 1.0):
        speed = direction * 0.1 * delta / step
        x = bench.array("x")[0, bench.axis]
        velocity = np.zeros(3)
        velocity[bench.axis] = -bench.sign * speed
        bench.run("group one id 1", "fix go one move linear " + " ".join(f"{v:.17g}" for v in velocity) + " units box")
        bench.run("run 1 post no", "unfix go", "group one delete")
        bench.move((0.0, 0.0))
        bench.run("run 0 post no")
        forces.append(bench.force()[1])
        overlaps.append(overlaps[-1] + bench.sign * (x - bench.array("x")[0, bench.axis]))
    parting, closing = np.log(np.array(forces[1:]) / forces[:-1]) / np.log(np.array(overlaps[1:]) / overlaps[:-1])
    bench.place_at(wanted, types)
    tangential_dashpot = _dashpot(bench, (0.0, 1.0), mu * fn, slip / step)
    return state, _Values(fn / delta, ft / slip, normal_dashpot, tangential_dashpot, closing, parting, mu, lever)


def _push_contact(bench: TwoParticleLammps, state: State, types: tuple[int, int], speed: float) -> tuple[float, float]:
    """Forces at rest of a fresh contact that has slipped at a speed for one step."""
    bench.place_at(state, types)
    bench.move((0.0, speed))
    bench.run("run 1 post no")
    bench.move((0.0, 0.0))
    bench.run("run 0 post no")
    return bench.force()


def _dashpot(bench: TwoParticleLammps, direction: tuple[float, float], scale: float, speed: float) -> float:
    """Force per velocity of a contact without slip: first at some speed, then where the force is a tenth of scale."""
    tangential = int(direction[1])
    bench.move((0.0, 0.0))
    bench.run("run 0 post no")
    rest, found = bench.force()[tangential], 0.0
    for _ in range(6):  # a speed whose force is lost in rounding, or is cut at the bound, comes nearer
        bench.move((speed * direction[0], speed * direction[1]))
        bench.run("run 0 post no")
        force = bench.force()[tangential] - rest
        found = force / speed
        if 0.01 * scale < abs(force) < 0.5 * scale:
            break
        speed *= 0.1 * scale / abs(force) if abs(force) > 1e-9 * scale else 1e6
        if abs(force) <= 1e-9 * scale and speed > 1e30:
            break
    return found if abs(found) * speed > 1e-12 * scale else 0.0


def measure_laws(
    commands: Commands, units: str, types: int, pairs: dict[tuple[int, int], State], walls: Iterable[tuple[str, State]]
) -> dict[Any, MeasuredLaw]:
    """The laws of pairs of types, by these, and of walls, by the IDs of their fixes."""
    found: dict[Any, MeasuredLaw] = {}
    if pairs:
        bench = TwoParticleLammps(commands, units, types, max(max(state.radii) for state in pairs.values()))
        try:
            for kinds, state in pairs.items():
                found[kinds] = measure_law(bench, state, kinds, f"the contact of types {kinds[0]} and {kinds[1]}")
        finally:
            bench.close()
    for name, state in walls:
        bench = TwoParticleLammps(commands, units, types, state.radii[0], commands.fixes[name])
        try:
            found[name] = measure_law(bench, state, (1, 1), f"the wall of fix {name}")
        finally:
            bench.close()
    return found
