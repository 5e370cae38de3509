"""Lossy layers left to themselves with both histories of the slip, and layers of 400 disks: the tables of further.md.

python -m research.yielding.further rest FOLDER [SEED ...]      rows of lasting.jsonl
python -m research.yielding.further draws FOLDER [SEED ...]     rows of draws.jsonl: further draws, and the standard law
python -m research.yielding.further large FOLDER [SEED ...]     rows of quartz_400.jsonl, as those of the task "yield"
python -m research.yielding.further flow FOLDER SEED ...        rows of flow_400.jsonl: those that flow, by each law
python -m research.yielding.further standard FOLDER [SEED ...]  rows of standard_100.jsonl, loaded by the standard law
python -m research.yielding.further sliding FOLDER [SEED ...]   rows of sliding_100.jsonl: what their growth needs
"""

import sys
from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from faultgouge.pywrap import Engine, Equilibrium, Scene, settle, time_step
from faultgouge.studies.result_rows import append_row
from research.laws.both_laws import as_slider
from research.modes.loss import with_dashpots
from research.packing_tools import distance_of_bearing_disks, shake_disks
from research.tables import read_toml
from research.yielding.compute import INCREMENTS, NOISE, SHARES, dashpots, dynamic, dynamic_runs, noise_seed
from research.yielding.static import Branch, branch, layer_slip

SCENE = Path(__file__).parent / "yield.toml"
HISTORIES = ("total", "rescaled")
TIME, WINDOW = 300, 50
DRAWS = 3
"""Draws of noise of a layer, where a run decides."""

RESTITUTION = 0.9
"""Of the lossy runs with the standard law, and of further draws."""

FRICTION, RESTITUTIONS = (1.0, 1.01), (RESTITUTION, 0.7)
"""Friction over that of the law, and restitutions, of the runs of `growth_at_bound`."""

FLOW_SHARES = (0.9, 0.97)
"""Shares of the static yield at which layers of 400 disks were seen to flow."""

LARGE = {"disks": 400, "width": 23.8, "top": 20}


def scene(seed: int, **packing: Any) -> Scene:
    """The scene of the sweep with another seed and other packings."""
    given = read_toml(SCENE)["scene"]
    given["packing"] |= {"seed": seed} | packing
    return Scene.from_mapping(given)


def with_history(start: Equilibrium, history: str) -> Equilibrium:
    """The same disks and forces; only what the slip does later differs, and with "coulomb" a contact at the bound."""
    if history == "coulomb":
        return replace(start, packing=as_slider(start.packing))
    law = replace(start.packing.law, rescaled=history == "rescaled")
    return replace(start, packing=replace(start.packing, law=law))


def lasting_motion(seed: int) -> Iterator[dict[str, Any]]:
    """Runs from the equilibria of total slips at 0.97 and 0.9 of the static yield with noise, with either history."""
    given = scene(seed)
    path = branch(settle(given))
    for share in (0.97, 0.9):
        here = path.borne(share * path.equilibria[-1].fx)
        if here is None:
            continue
        for history in HISTORIES:
            start = with_history(here, history)
            known = {"seed": seed, "share": share, "fx_over_fy": here.fx / given.load.fy, "history": history}
            if history == "rescaled":  # those of total slips are in quartz_100.jsonl
                yield known | {"restitution": 1.0} | dynamic(start, 0.0, seed)
            for restitution in (0.9, 0.7) if share > 0.9 else ():
                yield known | {"restitution": restitution} | left_alone(start, dashpots(given, restitution), seed)


def left_alone(start: Equilibrium, cn: float, seed: int) -> dict[str, Any]:
    """A run with dashpots and no other loss: mean kinetic energy in windows of time, slip of the layer.

    "moves" is the range of the slip after the first window, "fastest" the share of one disk in the last energy.
    """
    packing = with_dashpots(start.packing, cn)
    dt, energies, slips = time_step(packing), [], [0.0]
    with Engine(packing) as engine:
        shake_disks(engine, packing, NOISE, seed)
        before = engine.packing
        with engine.undamped(dt) as dynamics:
            for time in range(1, TIME + 1):
                motion = dynamics.advance(int(time / dt) - engine.steps)
                now = engine.packing
                slips.append(slips[-1] + layer_slip(before, now))
                before = now
                each = 0.5 * packing.mass * np.sum(motion.velocity**2, axis=1)
                energies.append(float(each.sum()))
    early, late = (float(np.mean(energies[first : first + WINDOW])) for first in (WINDOW, TIME - WINDOW))
    last = {"D": distance_of_bearing_disks(packing, now), "slip": slips[-1], "fastest": float(each.max() / each.sum())}
    return {"time": TIME, "early": early, "late": late, "moves": float(np.ptp(slips[WINDOW + 1 :]))} | last


def draws(seed: int) -> Iterator[dict[str, Any]]:
    """Lossy runs at 0.97 of the static yield: further draws with total slips, all draws with the standard law."""
    given = scene(seed)
    path = branch(settle(given))
    here = path.borne(0.97 * path.equilibria[-1].fx)
    if here is None:
        return
    cn = dashpots(given, RESTITUTION)
    for history, first in (("total", 1), ("coulomb", 0)):
        start = with_history(here, history)
        known = {"seed": seed, "share": 0.97, "fx_over_fy": here.fx / given.load.fy, "history": history}
        for draw in range(first, DRAWS):
            yield known | {"restitution": RESTITUTION, "draw": draw} | left_alone(start, cn, noise_seed(seed, draw))


def standard(seed: int) -> Iterator[dict[str, Any]]:
    """Static yield and dynamic runs of 100 disks that the standard law has loaded.

    Lossy layers run whatever the spectrum says. A contact at Coulomb's bound sticks in the spectrum. It slides on while
    a growing motion exceeds its last peak.
    """
    given, path = with_slider(seed)
    known = {"seed": seed, "newton": path.newton / given.load.fy, "static": path.equilibria[-1].fx / given.load.fy}
    undamped = dynamic_runs(given, path, (1.0,), DRAWS)
    lossy = dynamic_runs(given, path, (RESTITUTION,), DRAWS, all_layers=True)
    yield known | {"dynamic": [*undamped, *lossy]}


def growth_at_bound(seed: int) -> Iterator[dict[str, Any]]:
    """The largest D of these runs with the friction that no contact reaches, and with more loss.

    A little more friction changes no force of an equilibrium: it takes the contacts off the bound.
    """
    given, path = with_slider(seed)
    for share in SHARES:
        here = path.borne(share * path.equilibria[-1].fx)
        if here is None:
            continue
        for friction, restitution in product(FRICTION, RESTITUTIONS):
            law = replace(here.packing.law, mu=friction * here.packing.law.mu)
            start = replace(here, packing=replace(here.packing, law=law))
            known = {"seed": seed, "share": share, "friction": friction, "restitution": restitution}
            known["at_bound"] = int(np.count_nonzero(start.packing.sliding))
            yield known | dynamic(start, dashpots(given, restitution), seed, all_layers=True)


def with_slider(seed: int) -> tuple[Scene, Branch]:
    """The scene with the standard law, and the layer's path to its static yield."""
    given = scene(seed)
    given = given.model_copy(update={"law": given.law.model_copy(update={"history": "coulomb"})})
    return given, branch(settle(given))


def large(seed: int) -> Iterator[dict[str, Any]]:
    """Static yield and dynamic runs of 400 disks."""
    given = scene(seed, **LARGE)
    path = branch(settle(given))
    known = {"seed": seed, "newton": path.newton / given.load.fy, "static": path.equilibria[-1].fx / given.load.fy}
    yield known | {"dynamic": list(dynamic_runs(given, path))}


def flow(seed: int) -> Iterator[dict[str, Any]]:
    """Lossy runs of 400 disks from the same equilibria with each history, and the static yield by increment."""
    given = scene(seed, **LARGE)
    settled, fy = settle(given), given.load.fy
    path = branch(settled)
    last = path.equilibria[-1].fx
    static = [last, *(branch(settled, step).equilibria[-1].fx for step in INCREMENTS)]
    for share in FLOW_SHARES:
        here = path.borne(share * last)
        if here is None:
            continue
        for history, draw in product((*HISTORIES, "coulomb"), range(DRAWS)):
            start = with_history(here, history)
            known = {"seed": seed, "static": [fx / fy for fx in static], "share": share, "fx_over_fy": here.fx / fy}
            known |= {"history": history, "restitution": RESTITUTION, "draw": draw}
            yield known | dynamic(start, dashpots(given, RESTITUTION), noise_seed(seed, draw), all_layers=True)


if __name__ == "__main__":
    kind, folder, *seeds = sys.argv[1:]
    compute, name = {
        "rest": (lasting_motion, "lasting"),
        "draws": (draws, "draws"),
        "large": (large, "quartz_400"),
        "flow": (flow, "flow_400"),
        "standard": (standard, "standard_100"),
        "sliding": (growth_at_bound, "sliding_100"),
    }[kind]
    for seed in map(int, seeds or range(1, 21)):
        for row in compute(seed):
            append_row(Path(folder) / f"{name}.jsonl", row)
