"""The onset F_x^c of a scene, with or without dissipation: what the command `faultgouge onset` prints."""

from ...analysis import Onset
from ..scenes.scene import Scene
from .damped import DampedOnset, damped_onset_run
from .undamped import onset_run


def onset(scene: Scene, mu: float | None = None, *, every: bool = False) -> Onset | DampedOnset:
    """Find the onset of a scene; the ramp and the search end there.

    Parameters
    ----------
    scene : Scene
        With a section [ramp]; with a section [damping] the onset is that of growth in spite of the dissipation.
    mu : float, optional
        One of its friction coefficients; the first by default.
    every : bool
        Whether all windows up to the end of the ramp are wanted.

    Returns
    -------
    Onset or DampedOnset
        `fx_c`, `error`, `windows`; it prints as a line.

    Raises
    ------
    OnsetError, DampedOnsetError
        If the ramp shows no onset.
    NoEquilibriumError
        If the packing does not settle, or flows at the first load.
    """
    friction = scene.law.mus[0] if mu is None else mu
    if scene.damping is not None:
        return damped_onset_run(scene, friction, first=not every)
    return onset_run(scene, friction, first=not every).onset
