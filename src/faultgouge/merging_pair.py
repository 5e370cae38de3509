"""The pair of eigenvalues that merges at the onset of a scene."""

from __future__ import annotations

from pathlib import Path

from .figures import PairCurve
from .pywrap import Scene
from .pywrap.onset import ONSET_DISTANCES, onset_run
from .pywrap.scenes.scene import scene_of
from .pywrap.scenes.validation import require_section


def pair(scene: Scene | str | Path, mu: float | None = None) -> PairCurve:
    """Follow the pair of eigenvalues that merges at the first onset of a scene, without dissipation.

    Parameters
    ----------
    scene : Scene, str or Path
        With a section [ramp], or its file.
    mu : float, optional
        One of its friction coefficients; the first by default.

    Returns
    -------
    PairCurve
        The pair at the loads of the ramp, and at loads that crowd at the onset, up to the end of its window, or to
        twice the onset. ``faultgouge.figures.draw_pair([curve])`` draws the curve.

    Raises
    ------
    OnsetError, NoEquilibriumError
        As of :func:`faultgouge.onset`.

    Examples
    --------

    >>> curve = faultgouge.pair("three_disks.toml")
    >>> curve.eigenvalues[0].round(3)
    array([1188.882+0.j, 1484.786+0.j])
    >>> curve.eigenvalues[-1].round(3)
    array([1523.763-277.111j, 1523.763+277.111j])
    """
    scene = scene_of(scene, "pair")
    near = ONSET_DISTANCES * require_section(scene.ramp, "ramp").first
    friction = scene.law.mus[0] if mu is None else mu
    return PairCurve.of_onset(onset_run(scene, friction, reached=lambda _: None, near_onset=near, first=True))
