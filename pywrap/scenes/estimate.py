r"""Estimates for a scene before any work starts: steps, increments, memory, size of files, time.

There are two questions. *Is the scene possible?* `refuse_impossible` finds impossible numbers in a scene: overlaps
beyond the contact law, forces below the rounding of the coordinates, a settling that never ends. *How long does it
take?* `estimate_work` counts the work of a command, and `describe_work` refuses absurd amounts. Times are for one core
of 2020, within a factor of about three.

A contact that carries the force f has :math:`\delta = (f/k_n)^{1/p}` and the stiffness :math:`k = p\, k_n
\delta^{p-1}`, with p = 3/2 for Hertz. A time step is a share of :math:`(m/k)^{1/2}`, a disk falls under :math:`F_y`
through the medium at the speed :math:`(F_y d/m)^{1/2}`, d its diameter. The number of steps of a settling is
proportional to their ratio, :math:`(k_n d^{3/2}/F_y)^{1/3}` for Hertz.
"""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from typing import Literal, TypeAlias

from ...analysis import MindlinLaw
from .packing_section import GeneratedPacking, SettlingLoad
from .scene_keys import SceneKeys
from .validation import SceneError

Task: TypeAlias = Literal["settle", "ramp", "perturb", "onset", "onset --all", "reproduce"]

EPSILON = 2.3e-16

FORCE_CHAINS = 10.0
"""The largest contact force, in units of F_y, for which LAMMPS's time steps are made."""

LONGEST = 3.2e7
"""A year, in seconds."""
LARGEST_FILE = 1e13
"""10 TB."""

# Work, measured on packings of 30 to 10,000 disks.
SETTLING_STEPS = 100.0
"""Steps to rest, in units of the time step that F_y's own time has: 26,000 at k_n = 2e5, F_y = 3, as many for 30 disks
as for 100, and growing with (k_n/F_y)^(1/3) from 26,000 to 665,000."""
SETTLING_WITH_FRICTION = 25.0
"""The same with packing.settle_friction, in units of the overdamped time step: between 11 and 33 for 30 disks, Hertz
with k_n = 2e5 and 2e6 and harmonic with 2e4."""
OVERDAMPED_STEPS = 16_000
"""Steps of the default length in one increment of overdamped dynamics."""
SECONDS_A_STEP = 2e-6, 1.7e-7
"""Time of LAMMPS: for a step, and for a step and disk."""
SECONDS_AN_INCREMENT = 1e-3, 1e-4
"""Time of Newton's method: for an increment, and for an increment and disk."""
SECONDS_A_SEARCH = 4e-9, 3e-7
"""Time of the search for complex pairs up to `DENSE` disks, for each disk cubed: for an increment, and for a window."""
WINDOWS = 14.0, 4.0
"""Windows a and b of a packing up to the load u, in units of F_y/N, as a u^2 / (u + b): 1 to 3 up to 0.7, 5 to 11 up to
2, 78 up to 4 where they are most, 474 up to 35."""
DAMPED_SEARCH_COST = 2.5
"""Of the search for growing motion beside that for complex pairs, in units of the latter: 1.3 to 4.5 for 100 disks."""
DENSE = 300
"""Disks up to which the search takes all eigenvalues, and beyond which it ends at the first window."""
SECONDS_A_PASS = 6e-3, 2.2e-6
"""Time of a pass over all slices of the spectrum: for each disk, and for each disk squared."""
DAMPED_PASS = 1.5
"""Time of a pass for growing motion, in units of a pass for complex pairs."""
FIRST = 1.0
"""Load of the first window without dissipation, in units of F_y/N."""
DASHPOTS = 0.013, 1.5e-3
"""Load of the first window with strong dashpots, in units of F_y: between 0.005 and 0.024 in five packings of 100 to
1,000 disks with cn from 5 to 171, beyond 0.033 in one, and nobody knows which before; and the c/(k m)^(1/2), at a
contact that carries F_y, from which on dashpots are strong."""
DRAG = 3.5
"""Load of the first window with drag, in units of F_y/N, for any tau."""
CROWDING_DASHPOT = 0.01
"""The c/(k m)^(1/2) from which on dashpots couple more modes than a cluster has: cn = 50 and 171 do, 0.014
and 0.05."""
SECONDS_OF_ALL_MODES = 2e-7
"""Of all modes at the load of an increment, which such dashpots ask for up to `DENSE` disks, for each disk cubed:
1.7e-7 for 300 disks, 2.9e-7 for 100."""
SECONDS_OF_LOOKS = 3e-5
"""Time of the three searches for all growing motions, with such dashpots, for each disk squared."""
AGAIN = 0.05
"""Time of an increment whose bases are in memory, in units of a pass."""
GROWTH = 300_000
"""Steps of the undamped run in which reproduce measures a growth rate; a tenth or three times as many."""
TRIGGERING_RUNS = 4
"""Runs of [perturb] in the triggering part of reproduce: with and without a perturbation, an eruption, its control."""
BYTES_KEPT = 600
"""Memory of one equilibrium that is kept, for each disk: positions, contacts, and what is computed of them once."""
BYTES_SEARCHED = 50_000
"""Memory of the search in slices of the spectrum, for each disk, in two threads: 5.0 to 5.4 GB for 100,000 disks."""
BYTES_OF_BASES = 150, 3.6e9
"""Memory of the eigenvectors for each disk squared, and the limit beyond which they are not kept."""
BYTES_WRITTEN = 150
"""Size of one equilibrium in run.h5, for each disk."""
BYTES_AT_ALL = 4000
"""Memory of LAMMPS, of the matrices and of their factors, for each disk."""

# Refusals, each where nothing else could be meant.
STEPS_TO_REST = 10_000_000
"""Steps after which the decks give up on a packing of up to 300 disks: 10,000 looks of 1000 steps."""
SINKING_STEPS = 400_000
"""Steps after which they give up on a stage of a larger one."""
LEAST_SHARE = 0.4
"""Of `SETTLING_STEPS`, what a larger packing takes at the least in its first stage; and of `SETTLING_WITH_FRICTION`."""
ROUNDING_LIMIT = 5e-5
"""Rounding of a force, in units of F_y, beyond which a bed never comes to the 1e-3 F_y that the first stage asks."""
WORTH_SAYING = 10.0
"""Seconds from which on somebody wonders whether anything is happening."""


@dataclass(frozen=True)
class Estimate:
    """The work of a command.

    Attributes
    ----------
    disks : int
        Number of disks.
    steps : float
        Time steps of LAMMPS.
    increments : float
        Equilibria after the settled one.
    memory, written : float
        Bytes in memory at the most, and bytes of the files.
    seconds : float
        On one core.
    """

    disks: int
    steps: float
    increments: float
    memory: float
    written: float
    seconds: float

    def __str__(self) -> str:
        parts = [f"{self.disks} disks"]
        if self.steps >= 1:
            parts.append(f"{_count(self.steps)} time steps")
        if self.increments >= 1:
            parts.append(f"{_count(self.increments)} increments of F_x")
        if self.memory > 1e9:
            parts.append(f"{_bytes(self.memory)} of memory")
        if self.written > 1e9:
            parts.append(f"{_bytes(self.written)} of files")
        return f"about {_duration(self.seconds)}: {', '.join(parts)}"


def estimate_work(scene: SceneKeys, task: Task) -> Estimate:
    """Estimate the work of a command for a scene.

    Parameters
    ----------
    scene : Scene
        What is wanted.
    task : {"settle", "ramp", "perturb", "onset", "onset --all", "reproduce"}
        Each includes the settling; perturb the ramp up to its equilibrium, onset that
        up to the first window, with --all up to its end, reproduce the
        onset, a run whose growth is measured and, where the scene has [friction], the runs of [perturb].
    """
    disks = scene.packing.disks
    steps = _settling_steps(scene) if isinstance(scene.packing, GeneratedPacking) else 0.0
    increments, kept = 0.0, 1.0
    ramp, perturb = scene.ramp, scene.perturb
    seconds = 0.0
    if task in ("ramp", "onset", "onset --all", "reproduce") and ramp is not None:
        # the layer slides on whatever bears it once F_x exceeds mu F_y
        way = ramp.length if task == "ramp" else abs(ramp.first)
        if len(ramp.turning_points) == 1 or task != "ramp":
            way = min(way, max(scene.law.mus) * scene.load.fy + ramp.step)
        increments = way / ramp.step
        if task == "onset":
            first = _first_load(scene) * scene.load.fy / disks
            increments = min(increments, math.ceil(first / ramp.step))
    if task == "perturb" and perturb is not None:
        step = ramp.step if ramp is not None else scene.load.fy / 3000
        fx = perturb.fx if perturb.fx is not None else _first_load(scene) * scene.load.fy / disks
        increments = fx / step
    if ramp is not None and ramp.method == "overdamped":
        steps += increments * _overdamped_steps(scene)
    else:
        seconds += increments * (SECONDS_AN_INCREMENT[0] + SECONDS_AN_INCREMENT[1] * disks)
    if task == "perturb" and perturb is not None:
        runs = 2 if scene.friction is not None and scene.friction.v0 == "calibrated" else 1
        steps += runs * perturb.time / (perturb.time_step or _undamped_step(scene))
    if task == "reproduce":
        steps += GROWTH
        if perturb is not None and scene.friction is not None:
            steps += TRIGGERING_RUNS * perturb.time / (perturb.time_step or _undamped_step(scene))
    if task in ("onset", "onset --all", "reproduce"):
        search = _search_seconds(scene, increments, task)
        seconds = len(scene.law.mus) * (seconds + search)
        kept = increments + 1
    seconds += steps * (SECONDS_A_STEP[0] + SECONDS_A_STEP[1] * disks)
    memory = disks * (BYTES_AT_ALL + kept * BYTES_KEPT)
    if task in ("onset", "onset --all", "reproduce") and disks > DENSE:
        # the ramp ends at the first onset, and few equilibria are kept
        memory = max(memory, disks * BYTES_AT_ALL + _searched_bytes(disks))
    written = 0.0 if task.startswith("onset") else disks * BYTES_WRITTEN * (increments + 1)
    return Estimate(disks, steps, increments, memory, written, seconds)


def describe_work(scene: SceneKeys, task: Task) -> str:
    """What a command will do and how long that takes, in a line; empty where it takes no time.

    Parameters
    ----------
    scene : Scene
        What is wanted.
    task : {"settle", "ramp", "perturb", "onset", "onset --all", "reproduce"}
        As in `estimate_work`.

    Raises
    ------
    SceneError
        If it takes a year, more memory than there is, or a file of more than `LARGEST_FILE`.
    """
    work = estimate_work(scene, task)
    if not work.seconds < LONGEST:
        what = "a year and more"
    elif work.memory > _installed_memory():
        what = f"more memory than the {_bytes(_installed_memory())} of this machine"
    elif work.written > LARGEST_FILE:
        what = f"more than the {_bytes(LARGEST_FILE)} that a file may take"
    else:
        return f"{task}: {work}" if work.seconds > WORTH_SAYING else ""
    raise SceneError(f"the scene asks {task} for {what} ({work}): {_remedy(scene, task)}")


def refuse_impossible(scene: SceneKeys) -> tuple[str, str] | None:
    """What in the numbers of a scene no packing can bear: the key, and the rest of the sentence; None if nothing is."""
    packing, law, fy = scene.packing, scene.law, scene.load.fy
    if not isinstance(packing, GeneratedPacking):
        return None
    if packing.settle_at is not None:
        cannot = refuse_impossible(_at_settling(scene, packing.settle_at))
        if cannot is not None:
            return "packing.settle_at", f"does not settle, since {' '.join(cannot)}"
    overlap = _law(scene).overlap_of_force(fy)
    smallest = min(packing.radii)
    if not overlap < smallest:
        return "load.fy", (
            f"= {fy:g} presses two disks {overlap:.2g} into each other, deeper than the smallest radius {smallest:g}, "
            f"where the contact law does not hold: lower it, or raise law.kn = {law.kn:g}"
        )
    rounding = EPSILON * packing.width * _stiffness(scene, fy) / fy
    if not rounding < ROUNDING_LIMIT:
        return "law.kn", (
            f"= {law.kn:g} is too stiff for load.fy = {fy:g}: the last digit of a coordinate is {rounding:.1g} of F_y, "
            "and no packing comes to rest: lower it, or raise load.fy"
        )
    steps = _settling_steps(scene)
    if packing.settle_friction:
        ends = LEAST_SHARE * steps < STEPS_TO_REST
    else:
        ends = steps < STEPS_TO_REST if packing.disks <= DENSE else LEAST_SHARE * steps < SINKING_STEPS
    if not ends:
        return "law.kn", (
            f"= {law.kn:g} is too stiff for load.fy = {fy:g}: settling takes about {_count(steps)} time steps, more "
            "than are made: lower it, or raise load.fy"
        )
    if scene.ramp is not None and scene.ramp.method == "overdamped":
        steps = _overdamped_steps(scene)
        if not steps < STEPS_TO_REST:
            return "relax.time_step", (
                f"= {scene.relax.time_step:g} needs about {_count(steps)} steps to an equilibrium, more than are made: "
                f"raise it, or leave it out for {_overdamped_step(scene):.2g}"
            )
    return None


def _at_settling(scene: SceneKeys, at: SettlingLoad) -> SceneKeys:
    """The scene with the load and the stiffness under which its packing settles."""
    law = scene.law.model_copy(update={"kn": at.kn or scene.law.kn})
    load = scene.load.model_copy(update={"fy": at.fy or scene.load.fy})
    packing = scene.packing.model_copy(update={"settle_at": None})
    return scene.model_copy(update={"law": law, "load": load, "packing": packing, "ramp": None})


def _search_seconds(scene: SceneKeys, increments: float, task: Task) -> float:
    """Time of the search for the onset, on one core."""
    disks, damped = scene.packing.disks, task != "reproduce" and scene.damping is not None
    crowded = damped and _dashpot_share(scene) > CROWDING_DASHPOT
    step = scene.ramp.step if scene.ramp is not None else 0.0
    unit = scene.load.fy / disks
    if disks <= DENSE:
        load = increments * step / unit
        if task == "onset":  # windows without dissipation beyond the first one are passed by without their errors
            load = min(load, FIRST)
        windows = WINDOWS[0] * load**2 / (load + WINDOWS[1])
        search = disks**3 * (SECONDS_A_SEARCH[0] * increments + SECONDS_A_SEARCH[1] * windows)
        return (
            search * (1 + DAMPED_SEARCH_COST if damped else 1) + disks**3 * SECONDS_OF_ALL_MODES * increments * crowded
        )
    one = disks * (SECONDS_A_PASS[0] + SECONDS_A_PASS[1] * disks)
    kept, seconds = BYTES_OF_BASES[0] * disks**2 < BYTES_OF_BASES[1], 0.0
    if crowded:
        seconds += SECONDS_OF_LOOKS * disks**2
    for first, share in [(FIRST, 1.0), (_first_load(scene), DAMPED_PASS)][: 1 + damped]:
        searched = min(increments, first * unit / step) if step else 0.0
        # a basis that is not kept serves twice as many increments each time
        seconds += share * one * (1 + (AGAIN * searched if kept else math.log2(1 + 0.5 * searched)))
    return seconds


def _first_load(scene: SceneKeys) -> float:
    """Load of the first window, in units of F_y/N."""
    if scene.damping is None:
        return FIRST
    strong, share = DASHPOTS
    dashpots = strong * scene.packing.disks * min(1.0, _dashpot_share(scene) / share)
    return max(FIRST, dashpots, DRAG if scene.damping.tau is not None else 0.0)


def _dashpot_share(scene: SceneKeys) -> float:
    """c/(k m)^(1/2) of a normal dashpot at a contact that carries F_y."""
    if scene.damping is None:
        return 0.0
    overlap = _law(scene).overlap_of_force(scene.load.fy)
    mass = (isinstance(scene.packing, GeneratedPacking) and scene.packing.mass) or 1.0
    dashpot = scene.damping.cn * overlap ** (scene.law.exponent - 1)
    return dashpot / math.sqrt(_stiffness(scene, scene.load.fy) * mass)


def _searched_bytes(disks: int) -> float:
    """Memory of the search in slices of the spectrum."""
    bases = BYTES_OF_BASES[0] * disks**2
    return disks * BYTES_SEARCHED + (bases if bases < BYTES_OF_BASES[1] else 0.0)


def _stiffness(scene: SceneKeys, force: float) -> float:
    law = _law(scene)
    return float(law.normal_stiffness(law.overlap_of_force(force)))


def _law(scene: SceneKeys) -> MindlinLaw:
    """The repulsion alone."""
    return MindlinLaw(scene.law.kn, kt=0.0, mu=0.0, exponent=scene.law.exponent)


def _settling_steps(scene: SceneKeys) -> float:
    assert isinstance(scene.packing, GeneratedPacking)
    stiff = _stiffness(scene, FORCE_CHAINS * scene.load.fy) * 2 * min(scene.packing.radii) / scene.load.fy
    if scene.packing.settle_friction:
        return SETTLING_WITH_FRICTION * 4 * stiff  # overdamped
    return SETTLING_STEPS * math.sqrt(8 * stiff) / 0.8


def _overdamped_step(scene: SceneKeys) -> float:
    return scene.relax.damping / (4 * _stiffness(scene, FORCE_CHAINS * scene.load.fy))


def _overdamped_steps(scene: SceneKeys) -> float:
    step = scene.relax.time_step
    return OVERDAMPED_STEPS if step is None else OVERDAMPED_STEPS * _overdamped_step(scene) / step


def _undamped_step(scene: SceneKeys) -> float:
    packing = scene.packing
    lightest = min(1.0, scene.inertia_factor) * ((isinstance(packing, GeneratedPacking) and packing.mass) or 1.0)
    return 0.1 * math.sqrt(lightest / (6 * _stiffness(scene, scene.load.fy)))


def _remedy(scene: SceneKeys, task: Task) -> str:
    if task == "perturb":
        return "lower perturb.time, or raise perturb.time_step"
    return (
        "take a larger ramp.step, or fewer disks"
        if task in ("ramp", "onset", "onset --all", "reproduce")
        else "take fewer disks"
    )


def _installed_memory() -> float:
    return float(os.sysconf("SC_PAGE_SIZE")) * os.sysconf("SC_PHYS_PAGES")


def _count(number: float) -> str:
    return f"{number:.2g}" if number >= 1e5 else f"{number:.0f}"


def _bytes(number: float) -> str:
    for unit, size in (("TB", 1e12), ("GB", 1e9)):
        if number >= size:
            return f"{number / size:.2g} {unit}"
    return f"{number / 1e6:.2g} MB"


def _duration(seconds: float) -> str:
    for unit, size in (("years", 3.16e7), ("days", 86400.0), ("h", 3600.0), ("min", 60.0)):
        if seconds >= 1.5 * size:
            return f"{seconds / size:.2g} {unit}"
    return f"{max(seconds, 1.0):.0f} s"
