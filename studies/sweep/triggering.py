r"""The task "triggering": onsets of one packing for several friction coefficients, and whether it erupts between them.

The packing is ramped for every friction coefficient of the scene, and for the weakened friction :math:`\mu \mu_{ss}`
(without [friction] in the scene, for the last coefficient), each as in :mod:`~faultgouge.studies.sweep.onset`.

Weakening lowers the onset if :math:`F_x^c(\mu \mu_{ss}) < F_x^c(\mu)`, which may be known even if one of the two is
censored. If both are known and there is a window between them, three undamped runs from its middle show whether the
packing erupts (:mod:`~faultgouge.studies.triggering`): unperturbed, perturbed, perturbed with mu(v). The *rise* is the
distance in decades between the largest D of the last two.

A rise alone does not prove an instability: D also *jumps* in a packing that is stable with the weakened friction
(:mod:`~faultgouge.studies.triggering.compute`). A *control* shows how far: mu(v) at a force as far below the lower
onset as the middle of the window is above it. In an instability, D continues to *grow* after the jump, at the rate of
the spectrum with the weakened friction. The pair may also be real again at the middle of the window, or grow too slowly
for the length of the run; the rate is therefore stored as well.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from mpi4py import MPI

from ...analysis import FaultgougeError
from ...pywrap import Engine, Equilibrium, Scene
from ...pywrap.lammps.dynamics import Weakening
from ...pywrap.runs.path_error import with_path_error
from ...pywrap.runs.scene_path import scene_path
from ...pywrap.runs.undamped import perturb
from ...pywrap.scenes.sections import Friction, Perturb
from ...pywrap.scenes.validation import require_section
from ..packing_tools import Start
from ..statistics import sign_test
from ..triggering.compute import (
    Series,
    calibrate_weakening,
    differs,
    equilibrium_at,
    foresee,
    judge,
    largest,
    series_of,
    weakened_rate,
)
from .onset import first_window

Row = dict[str, Any]


def rise_in_decades(eruption: Row, of: str = "weakening") -> float:
    """Decades between the largest D of the perturbed run and of the run with mu(v), or of the "control"."""
    return float(np.log10(eruption[of] / eruption["perturbed"]))


def grows(eruption: Row) -> bool:
    """Whether D goes on to grow after the jump, at the rate of the spectrum with the weakened friction."""
    return bool(eruption["verdict"] == "grows")


def triggering(scene: Scene, start: Start) -> Row:
    """The task. An error is the row's "says", beside the results of the stages before.

    Returns
    -------
    dict
        ramps : what `first_onset` finds for each friction coefficient, the scene's first one first and what it weakens
        to last; lowered : whether weakening friction lowers the onset, None if that cannot be known; eruption : what
        `eruption` finds, None without a window between the two onsets, or without [perturb] in the scene.
    """
    row: Row = {"ramps": [], "lowered": None, "eruption": None}
    require_section(scene.ramp, "ramp")
    try:
        for found in _examination(scene, start):
            row |= found
    except (FaultgougeError, ValueError) as error:  # ValueError: of LAPACK
        row["says"] = str(error)
    return row


def _examination(scene: Scene, start: Start) -> Iterator[Row]:
    """The results of each stage, so that a stage that fails loses none of the earlier ones."""
    ramps: list[Row] = []
    paths: list[tuple[Equilibrium, ...]] = []
    for mu in frictions(scene):
        end, path = first_onset(scene, mu, start)
        paths.append(path)
        ramps.append(end)
        yield {"ramps": [*ramps]}
    if len(ramps) < 2:
        return
    strong, weak = ramps[0], ramps[-1]
    lowered = sign_test(strong, weak)
    yield {"lowered": lowered}
    if lowered and strong["ends"] == "onset" and scene.perturb is not None and scene.friction is not None:
        window = weak["reach"], strong["reach"]
        yield {"eruption": eruption(scene, paths[0], window, scene.perturb, scene.friction)}


def frictions(scene: Scene) -> tuple[float, ...]:
    """The scene's friction coefficients: the first one weakens, and the last one is its weakened value."""
    if scene.friction is None:
        return scene.law.mus
    weak = scene.friction.mu_ss * scene.law.mus[0]
    # 0.8 * 0.7 is not 0.56 to the last bit
    return (*(mu for mu in scene.law.mus if not np.isclose(mu, weak, rtol=1e-12, atol=0.0)), weak)


def first_onset(scene: Scene, mu: float, start: Start) -> tuple[Row, tuple[Equilibrium, ...]]:
    """How the ramp of a scene ends for one friction coefficient, with its equilibria up to there.

    Returns
    -------
    row : dict
        mu; ends : "onset", a window of complex eigenvalues, "until", the last F_x of the scene, or "flows", no
        equilibrium beyond `reach`; reach : the largest F_x up to which there is no window, force per disk of the upper
        layer: the onset, if there is one; error : uncertainty of the onset, or None.
    path : tuple of Equilibrium
    """
    rest = start(mu)
    with Engine(rest.packing, MPI.COMM_SELF) as engine:
        path = scene_path(engine, rest, scene)
        ends, reach, found = first_window(path, scene)
        error = None
        if found is not None:
            whole = with_path_error(found, path)
            reach, error = whole.fx_c, whole.error
        return {"mu": mu, "ends": ends, "reach": reach, "error": error}, tuple(path.equilibria)


def eruption(
    scene: Scene,
    path: tuple[Equilibrium, ...],
    window: tuple[float, float],
    settings: Perturb,
    friction: Friction,
) -> Row:
    """The runs in a window between two onsets, and the control; path leads up to the upper one.

    Returns
    -------
    dict
        fx, fx_control : the middle of the window, and the control below it, force per disk of the upper layer; rate :
        growth rate of D with the weakened friction at fx, from the spectrum, 1 / time, 0 if it is stable; unperturbed,
        perturbed, weakening, control : largest D, length^2, of the three runs at fx, and with mu(v) at fx_control;
        verdict, weakens_at, jump : whether D grows after its jump, when friction weakens, and the largest D shortly
        after that (`TriggeringOutcome` of :mod:`~faultgouge.studies.triggering.compute`); fitted_rate : of D after the
        jump, or None; foreseen_jump : by linear theory, length^2; perturbation_shows : whether the perturbed run
        differs from the unperturbed one.
    """
    middle = 0.5 * (window[0] + window[1])
    loads = middle, max(0.0, 2 * window[0] - middle)
    start, below = (equilibrium_at(scene, path, fx, MPI.COMM_SELF) for fx in loads)

    def run(start: Equilibrium, amplitude: float, weakening: Weakening | None = None) -> Series:
        changes = {"fx": start.fx, "amplitude": amplitude}
        one = scene.model_copy(update={"perturb": settings.model_copy(update=changes)})
        return series_of(perturb(one, start, communicator=MPI.COMM_SELF, weakening=weakening))

    quiet = run(start, 0.0)
    weakening = calibrate_weakening(friction, quiet)
    perturbed, weakened = run(start, settings.amplitude), run(start, settings.amplitude, weakening)
    foreseen = foresee(start, friction.mu_ss * start.packing.law.mu, weakened, weakening.v0)
    outcome = judge(weakened, weakening.v0, foreseen)
    return {
        "fx": start.fx,
        "fx_control": below.fx,
        "rate": weakened_rate(start.packing, friction.mu_ss),
        "unperturbed": largest(quiet),
        "perturbed": largest(perturbed),
        "weakening": largest(weakened),
        "control": largest(run(below, settings.amplitude, weakening)),
        "verdict": outcome.verdict,
        "weakens_at": outcome.crossing,
        "jump": outcome.jump,
        "fitted_rate": None if outcome.fitted is None else outcome.fitted.rate,
        "foreseen_jump": foreseen.jump,
        "perturbation_shows": differs(perturbed, quiet),
    }
