r"""Error of the onset F_x^c over the time that it takes to find it.

There are three methods. A *scan* computes the spectrum at each increment of a ramp, and takes the middle between the
last real and the first complex spectrum. A *bisection* divides the increment in which the onset lies. The third method
solves for the *root of the discriminant* of the two eigenvalues (:mod:`~faultgouge.analysis.windows`). All
use Newton's method for the equilibria.

A scan errs by half an increment at the most. A bisection ends where a complex pair can no longer be distinguished from
rounding, see `believable`: the imaginary part and the overlap :math:`|y^H x|` both vanish as
:math:`(F_x - F_x^c)^{1/2}`, their product linearly, and the pair is believed from :math:`50\, u |A|_F` on.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np

from ....analysis import Onset, Packing, find_onset, spectrum
from ....analysis.motion.eigenvalues import SAFETY
from ....pywrap import Engine, Equilibrium, Scene
from ....pywrap.load_path import LoadPath
from ....pywrap.runs.path_error import with_path_error
from ....pywrap.runs.scene_path import scene_path
from .work_precision_study import Run, Settings, StatedError, Study, Theory, compensate, study_of, timed_points

SCAN = "scan, Newton"
BISECTION, ROOT = "bisection", "root of the discriminant"

DISTANCE_BEYOND = 1e-5
"""Distance beyond the onset, force, at which the pair's imaginary part and overlap are measured for the floor."""

INCREMENTS = (2e-3, 1e-3, 5e-4, 2.5e-4)
"""Increments of the ramps whose stated errors are compared with the true ones."""


class OnsetMethods:
    """The methods that find the onset of one settled packing."""

    def __init__(self, engine: Engine, start: Equilibrium, scene: Scene) -> None:
        self._engine, self._start, self._scene = engine, start, scene

    def scan(self, increment: float) -> tuple[float, int]:
        """The onset in the middle of an increment, and the number of equilibria."""
        path, last = self._up(increment)
        return (last - 0.5) * increment, len(path.equilibria) - 1

    def bisect(self, increment: float, halvings: int) -> tuple[float, int]:
        """The onset after a bisection of the scan's increment, and the number of equilibria."""
        path, last = self._up(increment)
        low, high = (last - 1) * increment, last * increment
        for _ in range(halvings):
            middle = 0.5 * (low + high)
            if spectrum(path(middle)).pairs:
                high = middle
            else:
                low = middle
        return 0.5 * (low + high), len(path.equilibria) - 1 + halvings

    def root(self, increment: float, beyond: float) -> tuple[float, int]:
        """The onset by the root of the discriminant on a ramp to the first increment beyond a force, and the number of
        equilibria."""
        found, _, computed = self.solve(increment, beyond)
        return found.fx_c, computed

    def solve(self, increment: float, beyond: float) -> tuple[Onset, LoadPath[Equilibrium], int]:
        """The onset as in `root`, with its stated error, and the path."""
        path, asked = self._path(), list[float]()

        def equilibrium(fx: float) -> Packing:
            asked.append(fx)
            return path(fx)

        found = find_onset(equilibrium, increment * np.arange(np.ceil(beyond / increment) + 1))
        return found, path, len(asked)

    def whole(self, increment: float, beyond: float) -> Onset:
        """The onset and its stated error, which includes the error of the path."""
        found, path, _ = self.solve(increment, beyond)
        return with_path_error(found, path)

    def beyond(self, onset: float) -> tuple[float, float]:
        """The error at which a bisection ends, and |y^H x| at the distance `DISTANCE_BEYOND` above the onset."""
        path, _ = self._up(1e-3)
        found = spectrum(path(onset + DISTANCE_BEYOND))
        pair = max(found.pairs, key=lambda each: each.overlap * each.eigenvalue.imag)
        return SAFETY * found.rounding * DISTANCE_BEYOND / (pair.overlap * pair.eigenvalue.imag), pair.overlap

    def _up(self, increment: float) -> tuple[LoadPath[Equilibrium], int]:
        """The ramp up to the first equilibrium with a complex pair, and its number."""
        path, k = self._path(), 1
        while not spectrum(path(k * increment)).pairs:
            k += 1
        return path, k

    def _path(self) -> LoadPath[Equilibrium]:
        return scene_path(self._engine, self._start, self._scene)


def onset(settings: Settings) -> Study:
    """The study: three methods for the onset of the ramp."""
    start = settings.ramp[0]
    exact_start = compensate(start)
    with Engine(start.packing) as engine, Engine(exact_start.packing) as exact_engine:
        reference = OnsetMethods(exact_engine, exact_start, settings.scene)
        return _study(settings, OnsetMethods(engine, start, settings.scene), reference)


def _study(settings: Settings, ways: OnsetMethods, reference: OnsetMethods) -> Study:
    quick = settings.quick
    check, finest = (2e-3, 1e-3) if quick else (5e-4, 2.5e-4)
    guess = ways.scan(1e-3)[0] + 0.5e-3
    found, *_ = reference.solve(finest, guess)
    exact = found.fx_c
    reference_error = found.error + abs(reference.root(check, guess)[0] - exact)
    runs = _runs(ways, quick, exact)
    resolution = float(np.spacing(exact))
    points = timed_points(runs, settings, lambda found: max(abs(found - exact), resolution))
    lost, overlap = ways.beyond(exact)
    numbers = {
        "exact": exact,
        "disks": len(settings.ramp[0].packing),
        "finest": finest,
        "check": check,
        "beyond": DISTANCE_BEYOND,
        "overlap": overlap,
        "residual": max(each.residual for each in settings.ramp),
        "resolution": resolution,
    }
    return study_of(
        "onset",
        points=points,
        numbers=numbers,
        reference_error=reference_error,
        theory=(_half_an_increment(exact), Theory("pair lost in rounding", (lost,))),
        covered=_compare_errors(
            {"doubles": ways, "compensated": reference}, INCREMENTS[:2] if quick else INCREMENTS, beyond=guess
        ),
    )


def _runs(ways: OnsetMethods, quick: bool, exact: float) -> list[Run[float]]:
    """The methods that find the onset, with their increments."""
    coarse = (4e-3,) if quick else (4e-3, 2e-3, 1e-3)
    fine = (4e-3, 2e-3, 1e-3) if quick else (4e-3, 2e-3, 1e-3, 5e-4, 2e-4)
    halvings = (5, 25) if quick else (2, 5, 10, 20, 30)
    return [
        *((SCAN, increment, partial(ways.scan, increment)) for increment in fine),
        *((BISECTION, 1e-3 * 2.0**-n, partial(ways.bisect, 1e-3, n)) for n in halvings),
        *((ROOT, increment, partial(ways.root, increment, exact)) for increment in coarse),
    ]


def _compare_errors(
    ways: Mapping[str, OnsetMethods], increments: Sequence[float], beyond: float
) -> tuple[StatedError, ...]:
    """Stated and true errors of the onset over arithmetics and increments.

    The last arithmetic, with half of the last increment, is the truth; its own error counts as covered.
    """
    *_, finest = ways.values()
    truth = finest.whole(0.5 * increments[-1], beyond)
    cases = []
    for arithmetic, those in ways.items():
        for increment in increments:
            found = those.whole(increment, beyond)
            cases.append(StatedError(arithmetic, increment, abs(found.fx_c - truth.fx_c), found.error + truth.error))
    return tuple(cases)


def _half_an_increment(exact: float) -> Theory:
    """The error of a scan over the number of its equilibria."""
    counts = np.array([3.0, 300.0])
    return Theory("half an increment", tuple((0.5 * exact / counts).tolist()), tuple(counts.tolist()))
