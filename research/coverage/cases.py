"""Stated and true errors of onsets before which contacts slide, stick, close or open, undamped and damped.

Scenes are drawn at random: seeds, numbers of disks, friction, stiffness and exponent of the law, dashpots, increments,
both arithmetics. A scene counts if its ramp has an onset and contacts change before the onset. The true onset is the
onset of a ramp whose increments are `REFINEMENT` times smaller. A ramp with twice these increments shows how accurate
the true onset is. The search looks for windows in each of these small increments, because between loads farther apart
the search may miss a window that a change of contacts ends.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from importlib.resources import files
from itertools import pairwise
from pathlib import Path
from typing import Literal, get_args

import numpy as np

from faultgouge.analysis import NoEquilibriumError, Onset, OnsetError, Packing, find_onset
from faultgouge.analysis.windows import Window
from faultgouge.pywrap import Engine, Equilibrium, LoadPath, Scene, ramp_loads, scene_path, settle
from faultgouge.pywrap.runs.path_error import contact_changes, with_path_error
from research.tables import known_rows

Dissipation = Literal["undamped", "damped"]

REFINEMENT = 20
"""How many times smaller the increments of the ramp are on which the true onset is found."""

INCREMENTS_AT_ONCE = 3
"""Increments that are searched at once: an onset far below the ramp's end costs no more than it has to."""

FIRST_SCENES = {
    "packing": {"file": str(files("faultgouge") / "scenes" / "packing7.json")},
    "law": {"kn": 2e5, "mu": 1.0},
    "load": {"fy": 3.0},
    "ramp": {"step": 1e-3, "until": 0.05},
    "damping": {"cn": 10.0, "ct": 5.0},
}
"""The first damped scene. An independent code has its limit of small increments, 0.039834(8)."""


@dataclass(frozen=True)
class CoverageCase:
    """A scene, its onset with the stated error, and the onset in the limit of small increments.

    Attributes
    ----------
    kind : {"undamped", "damped"}
        Whether it is the onset without or with dissipation.
    number : int
        Number of the draw.
    disks : int
        Disks in the packing.
    mu : float
        Friction coefficient.
    precision : str
        Arithmetic.
    increment : float
        Of the ramp, force.
    changes : int
        Increments before the onset in which contacts changed; 0 for a scene that does not count.
    fx_c, stated : float or None
        The onset and its stated error, force; None if the scene has no onset.
    limit, uncertain : float or None
        The onset on the finest ramp and its difference from the one with increments twice as large, force.
    fresh : bool
        Whether the scene was drawn after the rule for the stated error was chosen.
    """

    kind: Dissipation
    number: int
    disks: int
    mu: float
    precision: str
    increment: float
    changes: int = 0
    fx_c: float | None = None
    stated: float | None = None
    limit: float | None = None
    uncertain: float | None = None
    fresh: bool = False

    @property
    def counts(self) -> bool:
        """Whether the case has an onset to compare, before which contacts change."""
        return self.limit is not None

    @property
    def true(self) -> float:
        """True error of the onset, force."""
        assert self.fx_c is not None
        assert self.limit is not None
        return abs(self.fx_c - self.limit)

    @property
    def holds(self) -> bool:
        """Whether the stated error covers the true one."""
        return self.share <= 1

    @property
    def share(self) -> float:
        """The true error in units of the stated one."""
        assert self.stated is not None
        return self.true / self.stated


def draw_scene(number: int) -> Scene:
    """The scene of a draw, with dashpots; without the dashpots the same scene gives the undamped onset."""
    if number == 0:
        return Scene.from_mapping(FIRST_SCENES)
    chance = np.random.default_rng(number)
    stiffness = float(chance.choice([2e3, 2e4, 2e5]))
    cn = float(chance.choice([0.5, 2.0, 10.0])) * float(np.sqrt(stiffness / 2e5))
    return Scene.from_mapping(
        {
            "precision": str(chance.choice(["double", "compensated"])),
            "packing": {"disks": int(chance.choice([16, 20, 30])), "seed": int(chance.integers(1, 400))},
            "law": {
                "kn": stiffness,
                "mu": round(float(np.exp(chance.uniform(np.log(0.05), 0.0))), 2),
                "kt": str(chance.choice(["2/7 kn", "0.5 kn", "1 kn"])),
                "exponent": float(chance.choice([1.5, 1.5, 1.0])),
            },
            "load": {"fy": 3.0},
            "ramp": {"step": float(chance.choice([4e-3, 2e-3])), "until": 0.1},
            "damping": {"cn": cn, "ct": cn * float(chance.choice([0.0, 2 / 7, 1.0]))},
        }
    )


class FirstOnset:
    """The first onset of a scene on ramps of any increments.

    Parameters
    ----------
    scene : Scene
        The scene, with a section [ramp]; the onset is damped if there is a section [damping].
    engine : Engine
        LAMMPS with its packing.
    start : Equilibrium
        The settled packing.
    """

    def __init__(self, scene: Scene, engine: Engine, start: Equilibrium) -> None:
        self._engine, self._damping, self._start = engine, scene.damping, start
        self._scene = scene.model_copy(update={"damping": None})
        self._wanted = ramp_loads(scene)

    def first_window(self, finer: int = 1, beyond: float = 0.0) -> tuple[LoadPath[Equilibrium], Window] | None:
        """The ramp with increments so many times smaller, and the first window on it, without the error of the path.

        None if there is no window beyond a given load and before the end of the ramp, or of the equilibria.
        """
        path = scene_path(self._engine, self._start, self._scene, onward=True)
        for first in range(0, len(self._wanted) - 1, INCREMENTS_AT_ONCE):
            part = self._wanted[first : first + INCREMENTS_AT_ONCE + 1]
            fine = np.concatenate([part[:1], *(np.linspace(a, b, finer + 1)[1:] for a, b in pairwise(part))])
            try:
                for fx in fine[1:]:
                    path(float(fx))
            except NoEquilibriumError:
                return None
            window = self._window(path, fine.tolist()) if part[-1] > beyond else None
            if window is not None:
                return path, window
        return None

    def _window(self, path: LoadPath[Equilibrium], part: Sequence[float]) -> Window | None:
        """The first window between some loads."""

        def equilibrium(fx: float) -> Packing:
            return path(fx) if self._damping is None else self._with_dashpots(path(fx))

        try:
            return find_onset(equilibrium, part, dissipation=self._damping is not None).windows[0]
        except OnsetError:
            return None

    def _with_dashpots(self, packing: Packing) -> Packing:
        assert self._damping is not None
        return packing.with_dissipation(self._damping.cn, self._damping.ct, self._damping.tau)

    def changes(self, path: LoadPath[Equilibrium], fx: float) -> int:
        """Number of the increments before a load in which contacts change."""
        return int(contact_changes(path, fx).sum())

    def whole(self, path: LoadPath[Equilibrium], window: Window) -> tuple[float, float]:
        """The onset of a window, and the error that is stated: rounding and path together."""
        first, *_ = with_path_error(Onset((window,), complete=False), path, self._with_dashpots).windows
        return first.fx_onset, first.error


def restate_case(case: CoverageCase) -> CoverageCase:
    """The case with the onset and the stated error of the present code; the limit is not computed again.

    The search begins a few increments before the onset that is known, which saves most of the time.
    """
    assert case.fx_c is not None
    scene = draw_scene(case.number)
    if case.kind == "undamped":
        scene = scene.model_copy(update={"damping": None})
    start = settle(scene.model_copy(update={"damping": None}))
    with Engine(start.packing) as engine:
        onset = FirstOnset(scene, engine, start)
        found = onset.first_window(beyond=case.fx_c - INCREMENTS_AT_ONCE * case.increment)
        assert found is not None  # it was there when the limit was computed
        fx_c, stated = onset.whole(*found)
        return replace(case, changes=onset.changes(found[0], found[1].fx_onset), fx_c=fx_c, stated=stated)


def read(path: Path) -> list[CoverageCase]:
    """The cases of a table, in the order in which they were computed; none where there is no table yet."""
    return [CoverageCase(**row) for row in known_rows(path)]


def compute_cases(number: int) -> list[CoverageCase]:
    """The undamped and the damped case of a draw."""
    scene = draw_scene(number)
    bare = scene.model_copy(update={"damping": None})
    assert scene.ramp is not None
    step = scene.ramp.step
    undamped, damped = (
        CoverageCase(
            kind, number, getattr(scene.packing, "disks", 100), scene.law.mus[0], scene.precision, step, fresh=True
        )
        for kind in get_args(Dissipation)
    )
    try:
        start = settle(bare)
    except NoEquilibriumError:
        return [undamped, damped]
    with Engine(start.packing) as engine:
        undamped = _compare_case(FirstOnset(bare, engine, start), undamped)
        if undamped.changes or number == 0:  # a damped search takes ten times the time, and its onset is near
            damped = _compare_case(FirstOnset(scene, engine, start), damped)
    return [undamped, damped]


def _compare_case(onset: FirstOnset, case: CoverageCase) -> CoverageCase:
    """The case with what its onset states and the limit of small increments, if contacts change before the onset."""
    found = onset.first_window()
    changes = 0 if found is None else onset.changes(found[0], found[1].fx_onset)
    if found is None or not changes:
        return case
    fx_c, stated = onset.whole(*found)
    case = replace(case, changes=changes, fx_c=fx_c, stated=stated)
    before = found[1].fx_onset - INCREMENTS_AT_ONCE * case.increment
    coarser, finest = (onset.first_window(finer, before) for finer in (REFINEMENT // 2, REFINEMENT))
    if coarser is None or finest is None:
        return case
    limit = finest[1].fx_onset
    return replace(case, limit=limit, uncertain=abs(coarser[1].fx_onset - limit))
