"""The report of the protocol in plain words."""

from __future__ import annotations

from itertools import pairwise

from ...analysis import Packing
from ...figures.pages import render
from ...pywrap import Scene
from ...pywrap.onset.undamped import OnsetRun
from ..triggering.page import section
from .compute import GrowthRun, TriggeringRun
from .si import si_rows


def report(scene: Scene, runs: list[OnsetRun], growth: GrowthRun, triggered: TriggeringRun | None) -> str:
    """report.md.

    Parameters
    ----------
    scene : Scene
        What was run.
    runs : list of OnsetRun
        Ramp and onset for each friction coefficient.
    growth : GrowthRun
        The undamped run above the onset.
    triggered : TriggeringRun or None
        The perturbation below it, if the scene has one.
    """
    packing = runs[0].equilibria[0].packing
    order = sorted(runs, key=lambda run: run.mu)
    return render(
        __package__ or "",
        "report.md.j2",
        packing=packing,
        ramp=scene.ramp,
        runs=runs,
        last=runs[0].equilibria[-1],
        residual=max(each.residual for run in runs for each in run.equilibria),
        mus_rise=all(a.onset.fx_c < b.onset.fx_c for a, b in pairwise(order)),
        growth=growth,
        triggering=_triggering(triggered),
        another=triggered if triggered is not None and triggered.scene is not scene else None,
        assumptions=_assumptions(scene, packing),
        si=si_rows(scene, runs, growth, triggered),
    )


def _triggering(triggered: TriggeringRun | None) -> str:
    if triggered is None:
        return ""
    if triggered.triggering is None or triggered.sensitive is None:
        return f"## Triggering\n\n{triggered.says}\n\n"
    return section(triggered.triggering, triggered.sensitive, triggered.scene, triggered.onsets[0].mu)


def _assumptions(scene: Scene, packing: Packing) -> list[str]:
    periodic = packing.box_length is not None
    return [
        f"side boundaries: {'periodic in x, width ' + format(packing.box_length, 'g') if periodic else 'open'}",
        "upper layer: free disks, the constant force on each, no bond between them",
        f"inertia: I_0 = {packing.inertia_factor:g} in I = I_0 m R^2 (a uniform disk has 1/2)",
        f"tangential stiffness: k_t = {packing.law.kt:.10g}, k_n = {packing.law.kn:g}",
        "settling: "
        + (
            "with friction, so that the packing carries tangential load at F_x = 0"
            if getattr(scene.packing, "settle_friction", False)
            else "without friction, which then begins with zero slips, so that K is symmetric at F_x = 0; every disk "
            "is pulled down first, so that the upper layer comes to lie on the bed"
        ),
        "time step of undamped runs: 0.05 of the stability limit 2/omega_max, if the scene has none; damping in "
        "relaxation only",
        "f_min: the force on a disk, with torque over radius, in the units of k_n and F_y; what was reached is said "
        "above",
        "stability operator: the exact derivative of the forces, with the turning of the tangent that the paper's "
        "Eq. 14 leaves out",
        "units: mass of a disk 1, diameter of a small disk 1, k_n as given",
    ]
