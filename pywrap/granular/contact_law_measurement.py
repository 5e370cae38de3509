r"""The laws of LAMMPS's granular styles, measured in a second LAMMPS with two particles or one and a wall.

Versions of LAMMPS differ in what a name stands for, so that laws are measured. At the overlap :math:`\delta`, with the
effective radius R and the effective mass m of a contact, every law of these styles is a power law,

.. math::

    f_n = k_n \delta^p R^{p-1}, \quad k_t' = k_t (R\delta)^q, \quad
    c_n = \gamma_n m^{g} (R\delta)^{h}, \quad c_t = \gamma_t m^{g'} (R\delta)^{h'}, \quad
    \left|\mathbf f_t\right| \propto \delta^{\beta} \text{ at constant slip},

with one :math:`\beta` while the contact closes and another one while it parts, :math:`|\mathbf f_t| \le \mu f_n`, and
the lever arm :math:`R_i - l' \delta`. A second overlap, another mass and another radius tell the exponents, multiples
of 1/4. The contact slips by a rotation for one step without an integrator: nothing moves, and the slip is known to the
last digit.
"""

from contextlib import closing
from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI

from ...analysis.arrays import Floats
from ..lammps.instance import start_lammps
from .granular_commands import GIVE_LINES, PLANES, Commands, NotTakenError
from .look_in_a_copy import explain_error

EXPONENT_ERROR = 1e-6
"""Distance of a measured exponent from a multiple of 1/4: rounding of forces and overlaps leaves 1e-9 or less."""

OVERLAP_RANGE, SLIP_TRIALS = (1e-3, 0.1), 20
"""Overlaps at which laws are measured, in units of a radius: one of 1e-10, as of spheres that barely touch, has lost
ten digits; and slips that are tried, each a hundredth of what the last one would need at most: one is the rule."""

POWERS = "stiffness", "tangential", "normal_dashpot", "tangential_dashpot", "rolling", "rolling_dashpot"
CLOSING, SLIPPING, ROLLING = X, Y, Z = range(3)
"""Motions of a contact, and the components of its force that they change: its normal is along x, it slips along y, and
rolls about z."""

Law = dict[str, Any]
"""What :func:`measure_law` returns."""


class State(NamedTuple):
    """One contact: radii, masses (of a wall 0 and infinite) and overlap."""

    radii: tuple[float, float]
    masses: tuple[float, float]
    overlap: float

    @property
    def effective(self) -> tuple[float, float]:
        """R_i R_j/(R_i + R_j) and m_i m_j/(m_i + m_j), or R_i and m_i at a wall."""
        a, b = self.radii
        return a * b / (a + b) if b else a, 1 / (1 / self.masses[0] + 1 / self.masses[1])


class PowerOfOverlap(NamedTuple):
    """factor m^mass (R delta)^overlap."""

    factor: float
    overlap: float = 0.0
    mass: float = 0.0

    def at(self, radius: Floats, overlap: Floats, mass: Floats) -> Floats:
        """The values of contacts with these effective radii, overlaps and effective masses."""
        return np.asarray(self.factor * mass**self.mass * (radius * overlap) ** self.overlap)


def measure_law(lmp: Any, commands: Commands, name: tuple[int, int] | str, state: State, who: str) -> Law:
    """The law of two types, or of the wall of a fix, from a contact of the packing and from others that are like it.

    Returns
    -------
    dict
        A PowerOfOverlap each: stiffness, f_n/delta, whose exponent is p - 1; tangential, k_t'; normal_dashpot and
        tangential_dashpot, c_n and c_t; rolling and rolling_dashpot, of rolling friction, a force at the arm R by R
        times the relative rotation. Numbers: closing and parting, d ln f_t / d ln delta at constant slip; mu,
        Coulomb's coefficient; lever, l', 0 or 1/2 of an arm that ends in the middle of the overlap; and mu_rolling,
        the bound of rolling friction over the normal force. A NotTakenError where it is no power law of this kind.
    """
    least, most = (share * state.radii[0] for share in OVERLAP_RANGE)
    first = state._replace(overlap=min(max(state.overlap, least), most))
    heavier, smaller = (3 * first.masses[0], 2 * first.masses[1]), (0.5 * first.radii[0], 0.8 * first.radii[1])
    changes = ({"overlap": 0.5 * first.overlap}, {"masses": heavier}, {"radii": smaller})
    others = tuple(first._replace(**change) for change in changes)
    try:
        bench = TwoParticleLammps(lmp, commands, name, max(state.radii))
    except Exception as error:  # whatever LAMMPS says of the commands
        says = f"The commands of the {who} do not stand alone ({explain_error(error)}): {GIVE_LINES}."
        raise NotTakenError(says) from error
    with closing(bench.lammps):
        states, found = zip(*(bench.measure(each) for each in (first, *others)), strict=True)
    law: Law = {each: found[0][each] for each in ("mu", "mu_rolling")}
    for each in POWERS:
        law[each] = _power(f"{each.replace('_', ' ')} of the {who}", states, [values[each] for values in found])
    for each in ("closing", "parting", "lever"):
        law[each] = _quarter(found[0][each], f"{'lever arm' if each == 'lever' else 'tangential force'} of the {who}")
    return law


def _power(what: str, states: tuple[State, ...], values: list[float]) -> PowerOfOverlap:
    """The power law of four values: of a contact, and with another overlap, other masses and other radii."""
    if not any(values):
        return PowerOfOverlap(0.0)
    if min(values) <= 0:
        raise NotTakenError(f"The {what} changes its sign, which that of no contact law does.")
    (radius, mass), (_, heavier), (smaller, _) = (states[k].effective for k in (0, 2, 3))
    ratios = states[1].overlap / states[0].overlap, heavier / mass, smaller / radius
    measured = np.log(np.array(values[1:]) / values[0]) / np.log(ratios)
    by_depth, by_mass, by_size = (_quarter(each, what) for each in measured)
    if by_depth != by_size:
        raise NotTakenError(f"The {what} is no power of its contact radius.")
    return PowerOfOverlap(values[0] / (mass**by_mass * (radius * states[0].overlap) ** by_depth), by_depth, by_mass)


def _quarter(value: float, what: str) -> float:
    """The multiple of 1/4 that a measured exponent is; an error if it is none."""
    nearest = round(4 * value) / 4
    if not abs(value - nearest) < EXPONENT_ERROR:
        says = f"The {what} has the measured exponent {value:.9g}"
        raise NotTakenError(f"{says}, which no contact law of LAMMPS that is known here has.")
    return nearest


class TwoParticleLammps:
    """A LAMMPS with two particles of some types, or one and the wall of a fix, and the commands of a deck.

    The wall is a plane across x, wherever that of the fix is.
    """

    def __init__(self, lmp: Any, commands: Commands, name: tuple[int, int] | str, size: float) -> None:
        self.lammps = start_lammps(MPI.COMM_SELF, None)
        self.types = (1,) if isinstance(name, str) else name
        self.lammps.commands_list([
            f"units {lmp.extract_global('units')}", "atom_style sphere", "atom_modify map yes sort 0 0",
            "boundary f f f", "newton on", "comm_modify vel yes", f"neighbor {size:.17g} bin",
            "neigh_modify every 1 delay 0 check no",
            f"region box block {f' {-40 * size:.17g} {40 * size:.17g}' * 3} units box",
            f"create_box {lmp.extract_setting('ntypes')} box", "thermo_modify lost ignore norm no",
            *["create_atoms 1 single 0 0 0 units box"] * len(self.types),
            f"set group all diameter {2 * size:.17g} density 1", "run_style verlet", "group one id 1", *commands.pair,
        ])  # fmt: skip
        if isinstance(name, str):
            words = commands.fixes[name].split()
            at = next(k for k, word in enumerate(words) if word in PLANES)
            self.lammps.command(" ".join([*words[:2], "all", *words[3:at], "xplane 0 NULL", *words[at + 3 :]]))
        names = ("x", "v", "omega", "f", "torque", "radius", "rmass", "type")
        self.array = {name: np.asarray(self.lammps.numpy.extract_atom(name))[: len(self.types)] for name in names}

    def place_at(self, state: State) -> None:
        """Put the particles into a fresh contact, at rest; its overlap to the last digit is that of `state`."""
        count, self.state = len(self.types), state
        for away in (True, False):
            self.array["radius"][:], self.array["rmass"][:] = state.radii[:count], state.masses[:count]
            self.array["type"][:], self.array["x"][:] = self.types, 0.0
            self.array["x"][0, X] = sum(state.radii) - state.overlap + away * state.radii[0]
            self.force()
        self.state = state._replace(overlap=sum(state.radii) - self.array["x"][0, X])

    def force(self, motion: int = CLOSING, speed: float = 0.0, across: float = 0.0, steps: int = 0) -> list[float]:
        """f_n on the first particle, and the sizes of f_t and, of rolling without slip, of the torque over R, after
        some steps of a motion: towards the other one, a rotation, as the speed of its surface, or one without slip, as
        the effective radius times its rate; or with a velocity across. None of them moves the particles."""
        v, omega, own, (radius, _) = self.array["v"], self.array["omega"], self.state.radii[0], self.state.effective
        v[:] = omega[:] = 0.0
        rolls = speed / radius if motion == ROLLING else 0.0
        v[0] = -speed if motion == CLOSING else 0.0, across + own * rolls, 0.0
        omega[0, Z] = (speed / own if motion == SLIPPING else 0.0) + rolls
        self.lammps.command(f"run {steps} post no")
        f, torque = self.array["f"][0], self.array["torque"][0, Z]
        return [float(f[X]), float(abs(f[Y])), float(abs(torque) / radius)]

    def push(self, state: State, motion: int, speed: float, **across: float) -> float:
        """The force at rest of a fresh contact that has moved for one step."""
        self.place_at(state)
        self.force(motion, speed, **across, steps=1)
        return self.force()[motion]

    def measure(self, wanted: State) -> tuple[State, dict[str, float]]:
        """The numbers of a law for one contact, from its forces at rest and in motion; and the contact."""
        self.place_at(wanted)
        state, fn = self.state, self.force()[CLOSING]
        if not fn > 0:
            raise NotTakenError("A contact law has no normal force that pushes: it cannot be measured.")
        # a time step so long that dashpots are weak beside slips
        delta, step = state.overlap, 1e3 * np.sqrt(state.effective[1] * state.overlap / fn)
        self.lammps.command(f"timestep {step:.17g}")
        law = dict.fromkeys((*POWERS, "closing", "parting", "mu", "lever", "mu_rolling"), 0.0)
        law |= {"stiffness": fn / delta, "normal_dashpot": self._dashpot(CLOSING, fn, 0.1 * delta / step)}
        way = 1e-8 * delta
        force = self.push(wanted, ROLLING, way / step)
        if force > 1e-14 * fn:
            self.place_at(wanted)
            # while it rolls on: the dashpot bears a part of the force
            bound = self.force(ROLLING, 1e3 * way * fn / force / step, steps=1)[ROLLING]
            force, way = self._far_below(wanted, ROLLING, bound, way, step)
            self.place_at(wanted)
            dashpot = self._dashpot(ROLLING, bound, 0.01 * bound * way / (force * step))
            law |= {"rolling": force / way, "rolling_dashpot": dashpot, "mu_rolling": bound / fn}
        self.place_at(wanted)
        # far beyond Coulomb's bound, of the softest spring, too; while the contact slides: dashpots bear a part
        bound = self.force(SLIPPING, 1e60 * delta / step, steps=1)[SLIPPING]
        mu = law["mu"] = bound / fn
        if mu == 0:
            return state, law
        force, slip = self._far_below(wanted, SLIPPING, bound, 1e-8 * min(mu, 1.0) * delta, step)
        if not 0 < force <= 0.1 * bound:
            raise NotTakenError("A contact law has friction without a tangential stiffness: use one with a history.")
        if law["mu_rolling"]:  # a slip without rotation, which turns the particle by friction alone
            self.push(wanted, SLIPPING, 0.0, across=slip / step)
        arm = abs(self.array["torque"][0, Z] / self.array["f"][0, Y])
        law |= {"tangential": force / slip, "lever": float(state.radii[0] - arm) / delta}
        overlap = delta
        for name, direction in (("parting", -1.0), ("closing", 1.0)):  # at constant slip, by a tenth of the overlap
            x, before, velocity = self.array["x"][0, X], (force, overlap), -direction * 0.1 * delta / step
            move = f"fix go one move linear {velocity:.17g} 0 0 units box"
            self.lammps.commands_list([move, "run 1 post no", "unfix go"])
            force, overlap = self.force()[SLIPPING], overlap + x - self.array["x"][0, X]
            law[name] = float(np.log(force / before[0]) / np.log(overlap / before[1]))
        self.place_at(wanted)
        law["tangential_dashpot"] = self._dashpot(SLIPPING, bound, 0.01 * min(mu, 1.0) * delta / step)
        return state, law

    def _far_below(self, wanted: State, motion: int, bound: float, way: float, step: float) -> tuple[float, float]:
        """A force far below its bound, and the way that leads to it: LAMMPS's classic models forget most of a slip that
        was cut at the bound."""
        for _ in range(SLIP_TRIALS):
            force = self.push(wanted, motion, way / step)
            if force <= 0.1 * bound:
                break
            way *= 0.01 * bound / force  # a stiff spring: once more, with less
        return force, way

    def _dashpot(self, motion: int, scale: float, speed: float) -> float:
        """Force per velocity of a contact without slip: first at some speed, then where the force is a tenth of
        scale."""
        rest, found, force = self.force()[motion], 0.0, 0.0
        for _ in range(6):  # a speed whose force is lost in rounding, or is cut at the bound, comes nearer
            force = self.force(motion, speed)[motion] - rest
            found = force / speed
            if 0.01 * scale < abs(force) < 0.5 * scale or (abs(force) <= 1e-9 * scale and speed > 1e24):
                break
            speed *= 0.1 * scale / abs(force) if abs(force) > 1e-9 * scale else 1e6
        return found if abs(force) > 1e-9 * scale else 0.0
