"""What each part of a scene costs, with it and without it in turns: `python benchmarks/parts.py [--fast] [SCENE]`.

Both runs of a feature take so many steps in a turn as need ten milliseconds; every other turn begins with the second.
"""

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from faultgouge.analysis import Packing, touching
from faultgouge.analysis.responses.signals import Signal
from faultgouge.assessment.explain import FALLS, affordable, run_of
from faultgouge.pywrap import Engine, Scene, settle
from faultgouge.pywrap.lammps.dynamics import Dynamics
from faultgouge.pywrap.lammps.plain_file_names import temporary_folder

HEAD = """## What each part of a scene costs

Undamped runs of `{scene}` in LAMMPS that differ in one part, in {turns} turns: the median of the ratios, with
quartiles. `faultgouge explain` says which parts a scene has.

| part | with it : without it | µs a step without |
|---|---|---|"""

SECONDS_A_TURN, TRIAL = 10e-3, 200

QUIET_SHARE = 1e-4
"""Time step of the runs, in units of the decks': a packing that has lost its floor or its sides stays what it is while
it is timed. The time that a step takes does not depend on it."""

Run = tuple[Packing, dict[str, Any]]
"""An undamped run: a packing, and the keywords of `set_up`."""


def main() -> None:
    """Print the section."""
    turns = 3 if "--fast" in sys.argv else 12
    (name,) = [word for word in sys.argv[1:] if word != "--fast"] or ["scenes/paper.toml"]
    scene, _ = affordable(Scene.from_toml(name))
    packing = settle(scene).packing
    print(HEAD.format(scene=name, turns=turns))
    for part, without, with_it in features(packing, run_of(scene, packing)):
        with set_up(without[0], **without[1]) as (_, plain), set_up(with_it[0], **with_it[1]) as (_, other):
            plain.advance(TRIAL)
            steps = max(50, int(SECONDS_A_TURN * TRIAL / seconds_of(plain, TRIAL)))
            other.advance(2 * TRIAL)
            seconds = np.empty((turns, 2))
            for turn in range(turns):
                for place in (1, 0) if turn % 2 else (0, 1):
                    seconds[turn, place] = seconds_of((plain, other)[place], steps)
        low, middle, high = np.quantile(seconds[1:, 1] / seconds[1:, 0], (0.25, 0.5, 0.75))
        microseconds = 1e6 * np.median(seconds[1:, 0]) / steps
        print(f"| {part} | {middle:.2f} [{low:.2f}, {high:.2f}] | {microseconds:.1f} |")


def seconds_of(dynamics: Dynamics, steps: int) -> float:
    """Processor time of so many steps."""
    begin = time.process_time()
    dynamics.advance(steps)
    return time.process_time() - begin


@contextmanager
def set_up(
    packing: Packing, log: Path | None = None, floor: bool = True, files: str = "", **motion: Any
) -> Iterator[tuple[Engine, Dynamics]]:
    """LAMMPS on this process alone, and its dynamics ready for `advance`.

    Without the floor, or with files beside the log: "dumps", the decks' of the start, or "contacts", the forces of each
    contact every 100 steps. `motion` is what `Engine.undamped` is given beside the time step.
    """
    # the decks' step: a tenth of the limit of a disk whose contacts carry ten times F_y, see undamped.in
    most = 10 * packing.fy
    motion["time_step"] = float(QUIET_SHARE * 0.2 / np.sqrt(12 * most / packing.law.overlap_of_force(most)))
    with temporary_folder() as folder, Engine(packing, MPI.COMM_SELF, log) as engine:
        if files == "dumps":
            engine.dump((log or Path(folder) / "log").with_name("run.1"))
        with engine.undamped(**motion) as dynamics:
            if not floor:
                engine.lammps.command("unfix floor")
            if files == "contacts":
                engine.lammps.command("compute contact all pair/local p1 p2 p3 cutoff radius")
                engine.lammps.command(f'dump contact all local 100 "{folder}/contacts" index c_contact[*]')
            if files == "contacts" or not floor:
                engine.lammps.command("run 0 post no")
            yield engine, dynamics


def features(packing: Packing, motion: dict[str, Any]) -> Iterator[tuple[str, Run, Run]]:
    """The features of a run, each with two runs that differ in it alone, of which the second has it.

    The value of a feature is the scene's; where the scene has none, dashpots and drag have a hundredth of the critical
    value of one contact.
    """
    law, box, low = packing.law, packing.box_length, packing.compensated
    bare: Run = packing, {}
    of = partial(replace, packing)
    yield "floor", (packing, {"floor": False}), bare
    rough = law if law.frictional else replace(law, kt=2 / 7 * law.kn, mu=1.0)
    # zero slips in both, so that friction alone differs
    unslipped = partial(of, contacts=touching(packing.position, packing.radius, box))
    yield "tangential history", (unslipped(law=replace(law, mu=0.0)), {}), (unslipped(law=rough), {})
    opened, closed = opened_and_closed(packing)
    yield "periodicity", (opened, {}), (closed, {})
    falls = {"weakening": motion.get("weakening", FALLS)}
    yield "dynamic friction", (of(law=rough), {}), (of(law=rough), falls)
    stiffness = packing.fy / law.overlap_of_force(packing.fy)
    rate, tau = np.sqrt(stiffness / packing.mass.mean()), packing.drag_time
    dashpot = float(0.01 * packing.mass.mean() * rate / law.growth(np.array(law.overlap_of_force(packing.fy))))
    damped = law if law.damped else replace(law, cn=dashpot, ct=dashpot)
    yield "dashpots", (of(law=replace(law, cn=0.0, ct=0.0)), {}), (of(law=damped), {})
    yield "drag", (of(drag_time=None), {}), (of(drag_time=tau or 100 / rate), {})

    def moved(*names: str, **otherwise: Any) -> Run:
        """The run with the scene's own force of some names in `motion`, or with another one."""
        own = {key: value for key, value in motion.items() if key in (*names, "target")}
        return packing, own if names[0] in own else otherwise

    yield "perturbation", bare, moved("amplitude", "omega", amplitude=1e-9, omega=0.01)
    constant = Signal(np.array([0.0, 1e6]), np.array([1e-9, 1e-9]))
    yield "signal", bare, moved("signal", "on", signal=constant, on="layer")
    soft = float(packing.fy / packing.radius.mean())
    yield "spring", bare, moved("spring", "stages", spring=soft, stages=((1e-9, np.inf),))
    plain = of(position_low=None, contacts=replace(packing.contacts, slip_low=None))
    fine = packing if low else of(position_low=np.zeros_like(packing.position))
    yield "compensated coordinates", (plain, {}), (fine, {})
    yield "dumps", bare, (packing, {"files": "dumps"})
    yield "per-contact output", bare, (packing, {"files": "contacts"})


def opened_and_closed(packing: Packing) -> Iterator[Packing]:
    """The packing with open sides and with a period."""
    position, length = packing.position.copy(), packing.box_length
    if length is None:
        room = 2 * packing.radius.max()
        position[:, 0] += room - position[:, 0].min()
        length = position[:, 0].max() + room
    else:
        position[:, 0] %= length
    for box in (None, length):
        yield replace(packing, position=position, box_length=box, contacts=touching(position, packing.radius, box))


if __name__ == "__main__":
    main()
