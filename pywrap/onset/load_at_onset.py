"""The load of an undamped run, where the scene leaves it to the onset.

A run that shows growth begins a little beyond the onset: one increment of the ramp, or in the middle of a window that
is narrower. With friction that weakens, a run shows triggering between two onsets: the packing is stable with the
static friction, and unstable with the weakened one. The run then begins in the middle between the two.
"""

from __future__ import annotations

from ...analysis import Onset
from ..scenes.scene import Scene
from ..scenes.validation import SceneError, require_section
from .undamped import onset_run


def load_at_onset(scene: Scene, known: dict[float, Onset] | None = None) -> float:
    """F_x for the undamped run of a scene without perturb.fx, force.

    Parameters
    ----------
    scene : Scene
        With a section [ramp], in whose range onsets are sought.
    known : dict, optional
        Onsets of the scene that have been found already, by friction coefficient.

    Raises
    ------
    SceneError
        If the scene has no section [ramp], or the weakened friction has no earlier onset.
    OnsetError
        If no pair becomes complex up to the ramp's end.
    """
    ramp, mu, found = require_section(scene.ramp, "ramp"), scene.law.mus[0], dict(known or {})

    def onset_for(wanted: float) -> Onset:
        near = [each for each in found if abs(each - wanted) < 1e-12 * wanted]  # exact but for a product's rounding
        return found[near[0]] if near else onset_run(scene, wanted, first=True).onset

    first = onset_for(mu).windows[0]
    if scene.friction is not None:
        weakened = onset_for(mu * scene.friction.mu_ss).fx_c
        if not weakened < first.fx_onset:
            raise SceneError(
                f"perturb.fx is missing, and there is no load between two onsets: F_x^c = {weakened:.6g} with the "
                f"weakened friction does not lie below F_x^c = {first.fx_onset:.6g}. Give perturb.fx"
            )
        return 0.5 * (weakened + first.fx_onset)
    end = ramp.first if first.fx_end is None else first.fx_end
    return min(first.fx_onset + ramp.step, 0.5 * (first.fx_onset + end))
