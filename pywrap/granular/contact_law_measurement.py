r"""The laws of LAMMPS's granular styles, measured in a second LAMMPS with two particles or one and a wall.

Versions of LAMMPS differ in the tangential stiffness of a wall, in the lever arm of a torque, in how coefficients of
two types mix, and in which damping a name stands for. So the laws are measured. At the overlap :math:`\delta`, with the
effective radius R and the effective mass m of a contact, every law of these styles is a power law,

.. math::

    f_n = k_n \delta^p R^{p-1}, \quad k_t' = k_t (R\delta)^q, \quad
    c_n = \gamma_n m^{g} (R\delta)^{h}, \quad c_t = \gamma_t m^{g'} (R\delta)^{h'}, \quad
    \left|\mathbf f_t\right| \propto \delta^{\beta} \text{ at constant slip},

with one :math:`\beta` while the contact closes and another one while it parts, :math:`|\mathbf f_t| \le \mu f_n`, and
the lever arm :math:`R_i - l' \delta`. A second overlap, another mass and another radius tell the exponents, which are
multiples of 1/4; a law with others is refused. The contact slips by a rotation for one step without an integrator:
nothing moves, and the slip is known to the last digit.
"""

from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np
from mpi4py import MPI

from ...analysis.arrays import Floats
from ..lammps.instance import start_lammps
from .granular_commands import GIVE_LINES, PLANES, Commands, NotTakenError, without_suffix
from .look_in_a_copy import explain_error

EXPONENT_ERROR = 1e-6
"""Distance of a measured exponent from a multiple of 1/4: rounding of forces and overlaps leaves 1e-9 or less."""

OVERLAP_RANGE = 1e-3, 0.1
"""Overlaps at which laws are measured, in units of a radius: an overlap of 1e-10, as of spheres that barely touch, has
lost ten digits, and one beyond a tenth is that of no contact."""

SLIP_TRIALS = 20
"""Slips that are tried, each a hundredth of what the last one would need at most: one is the rule."""


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
    stiffness, tangential, normal_dashpot, tangential_dashpot : PowerOfOverlap
        f_n/delta, whose exponent is p - 1, k_t', c_n and c_t.
    closing, parting : float
        d ln f_t / d ln delta at constant slip.
    mu : float
        Coulomb's coefficient.
    lever : float
        l': 0, or 1/2 of an arm that ends in the middle of the overlap.
    rolling, rolling_dashpot : PowerOfOverlap
        Stiffness and dashpot of rolling friction: a force, at the arm R, by R times the relative rotation.
    mu_rolling : float
        Its bound over the normal force; 0 without rolling friction.
    """

    stiffness: PowerOfOverlap
    tangential: PowerOfOverlap
    normal_dashpot: PowerOfOverlap
    tangential_dashpot: PowerOfOverlap
    closing: float
    parting: float
    mu: float
    lever: float
    rolling: PowerOfOverlap
    rolling_dashpot: PowerOfOverlap
    mu_rolling: float


X, Y, Z = range(3)
"""The normal of the contact that is measured, the direction in which it slips, and the axis about which it rolls."""


class TwoParticleLammps:
    """A LAMMPS with two particles of some types, or one and the wall of a fix, and the commands of a deck.

    The wall is a plane across x, wherever that of the fix is.
    """

    def __init__(self, lmp: Any, commands: Commands, name: tuple[int, int] | str, size: float) -> None:
        self.lammps = start_lammps(MPI.COMM_SELF, None)
        wall = isinstance(name, str)
        self.types = (1,) if isinstance(name, str) else name
        self.run(
            f"units {lmp.extract_global('units')}", "atom_style sphere", "atom_modify map yes sort 0 0",
            "boundary f f f", "newton on", "comm_modify vel yes", f"neighbor {size:.17g} bin",
            "neigh_modify every 1 delay 0 check no",
            f"region box block {f' {-40 * size:.17g} {40 * size:.17g}' * 3} units box",
            f"create_box {lmp.extract_setting('ntypes')} box", "thermo_modify lost ignore norm no",
            *["create_atoms 1 single 0 0 0 units box"] * (1 if wall else 2),
            f"set group all diameter {2 * size:.17g} density 1", "run_style verlet", "group one id 1", *commands.pair,
        )  # fmt: skip
        if isinstance(name, str):
            words = commands.fixes[name].split()
            at = next(k for k, word in enumerate(words) if word in PLANES)
            self.run(" ".join([*words[:2], "all", *words[3:at], "xplane 0 NULL", *words[at + 3 :]]))
        self.run("timestep 1")

    def run(self, *lines: str) -> None:
        """LAMMPS's commands."""
        for line in lines:
            self.lammps.command(line)

    def array(self, name: str) -> Floats:
        """An array of the particles, as LAMMPS has it."""
        return np.asarray(self.lammps.numpy.extract_atom(name))[: len(self.types)]

    def place_at(self, state: State) -> State:
        """Put the particles into a fresh contact, at rest; the state with the overlap to the last digit."""
        count = len(self.types)
        for away in (True, False):
            self.array("radius")[:], self.array("rmass")[:] = state.radii[:count], state.masses[:count]
            self.array("type")[:], self.array("x")[:] = self.types, 0.0
            self.array("x")[0, X] = sum(state.radii) - state.overlap + away * state.radii[0]
            self.radius = state.radius
            self.rest()
        return state._replace(overlap=sum(state.radii) - self.array("x")[0, X])

    def move(self, closing: float = 0.0, slipping: float = 0.0, rolling: float = 0.0, across: float = 0.0) -> None:
        """Give the first particle a velocity towards the other one, a rotation, as the speed of its surface, one
        without slip, as the effective radius times its rate, or a velocity across."""
        self.array("v")[:] = self.array("omega")[:] = 0.0
        radius, rolls = self.array("radius")[0], rolling / self.radius
        self.array("v")[0] = -closing, across + radius * rolls, 0.0
        self.array("omega")[0, Z] = slipping / radius + rolls

    def rest(self) -> None:
        """Stop the particles, and compute their forces at rest."""
        self.move()
        self.run("run 0 post no")

    def force(self) -> tuple[float, float, float]:
        """f_n on the first particle, and the sizes of f_t and, of rolling without slip, of the torque over R."""
        f, torque = self.array("f")[0], self.array("torque")[0, Z]
        return float(f[X]), float(abs(f[Y])), float(abs(torque) / self.radius)


def measure_law(lmp: Any, commands: Commands, name: tuple[int, int] | str, state: State, who: str) -> MeasuredLaw:
    """The law of two types, or of the wall of a fix, from a contact of the packing and from others that are like it.

    Raises
    ------
    NotTakenError
        If it is no power law of the kind above.
    """
    least, most = (share * state.radii[0] for share in OVERLAP_RANGE)
    state = state._replace(overlap=min(max(state.overlap, least), most))
    wanted = (
        state,
        state._replace(overlap=0.5 * state.overlap),
        state._replace(masses=(3 * state.masses[0], 2 * state.masses[1])),
        state._replace(radii=(0.5 * state.radii[0], 0.8 * state.radii[1])),
    )
    try:
        bench = TwoParticleLammps(lmp, commands, name, max(state.radii))
    except Exception as error:  # whatever LAMMPS says of the commands
        raise NotTakenError(
            f"The commands of the {who} do not stand alone ({explain_error(error)}): {GIVE_LINES}."
        ) from error
    with closing(bench.lammps):
        states, found = zip(*(_measure(bench, each) for each in wanted), strict=True)
    law: dict[str, Any] = {name: found[0][name] for name in ("mu", "mu_rolling")}
    for name in ("stiffness", "tangential", "normal_dashpot", "tangential_dashpot", "rolling", "rolling_dashpot"):
        law[name] = _power(f"{name.replace('_', ' ')} of the {who}", states, [each[name] for each in found])
    for name in ("closing", "parting", "lever"):
        law[name] = quarter(found[0][name], f"{'lever arm' if name == 'lever' else 'tangential force'} of the {who}")
    return MeasuredLaw(**law)


def _power(what: str, states: Sequence[State], values: Sequence[float]) -> PowerOfOverlap:
    """The power law of four values: of a contact, and with another overlap, other masses and other radii.

    Raises
    ------
    NotTakenError
        If the values follow no power law of the contact radius.
    """
    if not any(values):
        return PowerOfOverlap(0.0)
    if min(values) <= 0:
        raise NotTakenError(f"The {what} changes its sign, which that of no contact law does.")
    first, deeper, heavier, smaller = states
    ratios = (deeper.overlap / first.overlap, heavier.mass / first.mass, smaller.radius / first.radius)
    by_depth, by_mass, by_size = (
        quarter(np.log(value / values[0]) / np.log(ratio), what)
        for value, ratio in zip(values[1:], ratios, strict=True)
    )
    if by_depth != by_size:
        raise NotTakenError(f"The {what} is no power of its contact radius.")
    factor = values[0] / (first.mass**by_mass * (first.radius * first.overlap) ** by_depth)
    return PowerOfOverlap(factor, by_depth, by_mass)


def quarter(value: float, what: str) -> float:
    """The multiple of 1/4 that a measured exponent is; an error if it is none."""
    nearest = round(4 * value) / 4
    if not abs(value - nearest) < EXPONENT_ERROR:
        raise NotTakenError(
            f"The {what} has the measured exponent {value:.9g}, which no contact law of LAMMPS that is known here has."
        )
    return nearest


def _measure(bench: TwoParticleLammps, wanted: State) -> tuple[State, dict[str, float]]:
    """The numbers of a MeasuredLaw for one contact, from its forces at rest and in motion."""
    state = bench.place_at(wanted)
    fn, delta = bench.force()[0], state.overlap
    if not fn > 0:
        raise NotTakenError("A contact law has no normal force that pushes: it cannot be measured.")
    # a time step so long that dashpots are weak beside slips
    step = 1e3 * np.sqrt(state.mass * delta / fn)
    bench.run(f"timestep {step:.17g}")
    normal_dashpot = _dashpot(bench, "closing", fn, 0.1 * delta / step)
    rolling = _rolling(bench, wanted, fn, delta, step)
    bench.place_at(wanted)
    bench.move(slipping=1e60 * delta / step)  # far beyond Coulomb's bound, of the softest spring, too
    bench.run("run 1 post no")
    mu = bench.force()[1] / fn  # while the contact slides: dashpots bear a part of the force
    if mu == 0:
        none = dict.fromkeys(("tangential", "tangential_dashpot", "closing", "parting", "mu", "lever"), 0.0)
        return state, {"stiffness": fn / delta, "normal_dashpot": normal_dashpot} | none | rolling
    ft, slip = _force_of_slip(bench, wanted, mu * fn, 1e-8 * min(mu, 1.0) * delta, step)
    if rolling["mu_rolling"]:  # a slip without rotation, which turns the particle by friction alone
        _push_contact(bench, wanted, across=slip / step)
    arm = abs(bench.array("torque")[0, Z] / bench.array("f")[0, Y])
    lever = float(state.radii[0] - arm) / delta
    parting, closing = _exponents(bench, ft, delta, step)
    bench.place_at(wanted)
    tangential_dashpot = _dashpot(bench, "slipping", mu * fn, 0.01 * min(mu, 1.0) * delta / step)
    return state, {
        "stiffness": fn / delta, "tangential": ft / slip, "normal_dashpot": normal_dashpot,
        "tangential_dashpot": tangential_dashpot, "closing": closing, "parting": parting, "mu": mu, "lever": lever,
    } | rolling  # fmt: skip


def _rolling(bench: TwoParticleLammps, wanted: State, fn: float, delta: float, step: float) -> dict[str, float]:
    """Stiffness, dashpot and bound of rolling friction, from rolling without slip for one step; zeros without any."""

    def roll(way: float, *, rests: bool = True) -> float:
        bench.place_at(wanted)
        bench.move(rolling=way / step)
        bench.run("run 1 post no")
        if rests:
            bench.rest()
        return bench.force()[2]

    way = 1e-8 * delta
    force = roll(way)
    if force <= 1e-14 * fn:
        return dict.fromkeys(("rolling", "rolling_dashpot", "mu_rolling"), 0.0)
    bound = roll(1e3 * way * fn / force, rests=False)  # while it rolls on: the dashpot bears a part of the force
    for _ in range(SLIP_TRIALS):
        if force <= 0.1 * bound:
            break
        way *= 0.01 * bound / force
        force = roll(way)
    bench.place_at(wanted)
    dashpot = _dashpot(bench, "rolling", bound, 0.01 * bound * way / (force * step))
    return {"rolling": force / way, "rolling_dashpot": dashpot, "mu_rolling": bound / fn}


def _force_of_slip(
    bench: TwoParticleLammps, wanted: State, bound: float, slip: float, step: float
) -> tuple[float, float]:
    """A tangential force far below Coulomb's bound, and its slip: LAMMPS's classic models forget most of a slip that
    was cut at the bound."""
    ft = _push_contact(bench, wanted, slipping=slip / step)
    for _ in range(SLIP_TRIALS):
        if ft <= 0.1 * bound:
            break
        slip *= 0.01 * bound / ft  # a stiff spring: once more, with less
        ft = _push_contact(bench, wanted, slipping=slip / step)
    if not 0 < ft <= 0.1 * bound:
        raise NotTakenError("A contact law has friction without a tangential stiffness: use one with a history.")
    return ft, slip


def _exponents(bench: TwoParticleLammps, ft: float, delta: float, step: float) -> tuple[float, float]:
    """d ln f_t / d ln delta at constant slip while the contact parts and closes, in steps of a tenth of the overlap."""
    forces, overlaps = [ft], [delta]
    for direction in (-1.0, 1.0):
        x, velocity = bench.array("x")[0, X], -direction * 0.1 * delta / step
        bench.run(f"fix go one move linear {velocity:.17g} 0 0 units box", "run 1 post no", "unfix go")
        bench.rest()
        forces.append(bench.force()[1])
        overlaps.append(overlaps[-1] + x - bench.array("x")[0, X])
    parting, closing = np.log(np.array(forces[1:]) / forces[:-1]) / np.log(np.array(overlaps[1:]) / overlaps[:-1])
    return float(parting), float(closing)


def _push_contact(bench: TwoParticleLammps, state: State, **speed: float) -> float:
    """Tangential force at rest of a fresh contact that has moved at a speed for one step."""
    bench.place_at(state)
    bench.move(**speed)
    bench.run("run 1 post no")
    bench.rest()
    return bench.force()[1]


def _dashpot(
    bench: TwoParticleLammps, direction: Literal["closing", "slipping", "rolling"], scale: float, speed: float
) -> float:
    """Force per velocity of a contact without slip: first at some speed, then where the force is a tenth of scale."""
    component = ("closing", "slipping", "rolling").index(direction)
    bench.rest()
    rest, found, force = bench.force()[component], 0.0, 0.0
    for _ in range(6):  # a speed whose force is lost in rounding, or is cut at the bound, comes nearer
        bench.move(**{direction: speed})
        bench.run("run 0 post no")
        force = bench.force()[component] - rest
        found = force / speed
        if 0.01 * scale < abs(force) < 0.5 * scale:
            break
        speed *= 0.1 * scale / abs(force) if abs(force) > 1e-9 * scale else 1e6
        if abs(force) <= 1e-9 * scale and speed > 1e30:
            break
    return found if abs(force) > 1e-9 * scale else 0.0


LAW_DIFFERENCE = 0.01
"""Relative difference of a number from that of its line from which on it is remarked."""


def remark_on(law: MeasuredLaw, commands: Commands, name: tuple[int, int] | str, state: State) -> str | None:
    """A sentence on what the law of a gran/*/history style, at a state, has of other numbers than its line; None if it
    has the same. The line has k_n and k_t of k (R delta)^q, with q = 0 for hooke and q = 1/2 for hertz."""
    words = commands.fixes[name].split()[4:] if isinstance(name, str) else commands.pair[0].split()[1:]
    style = without_suffix(words[0]).removeprefix("gran/")
    if style not in ("hooke/history", "hertz/history"):
        return None
    size = (state.radius * state.overlap) ** (0.5 if style.startswith("hertz") else 0.0)
    kn, kt, mu = float(words[1]), 2 / 7 * float(words[1]) if words[2] == "NULL" else float(words[2]), float(words[5])
    here = np.array(state.radius), np.array(state.overlap)
    found = {"a normal stiffness": (law.stiffness.at(*here), kn * size), "a friction coefficient": (law.mu, mu)}
    if law.mu:  # without friction there is no tangential force
        found["a tangential stiffness"] = law.tangential.at(*here), kt * size
    says = [
        f"{what} {measured / said:.3g} times that of the line"
        for what, (measured, said) in found.items()
        if said > 0 and abs(measured / said - 1) > LAW_DIFFERENCE
    ]
    who = f"fix {name}" if isinstance(name, str) else f"Contacts of types {name[0]} and {name[1]}"
    return f"{who}: LAMMPS has {' and '.join(says)} {' '.join(words)!r}, and K has LAMMPS's" if says else None
