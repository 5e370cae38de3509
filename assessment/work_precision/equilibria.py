r"""Error over time on the way to an equilibrium, and to the onset.

**Relaxation.** The load of a packing in equilibrium is raised by one increment. Three methods lead to the next
equilibrium: the paper's overdamped dynamics :math:`\mathbf v = \mathbf F/\gamma`, velocity Verlet with viscous drag,
and Newton's method, whose unknown is the displacement from the last equilibrium. LAMMPS's own minimizers advance no
slips and are refused by the pair style.

**Onset.** A *scan* computes the spectrum at each increment of a ramp, and takes the middle between the last real and
the first complex spectrum; it errs by half an increment at the most. The other method solves for the *root of the
discriminant* of the two eigenvalues (:mod:`~faultgouge.analysis.windows`). Both use Newton's method for the equilibria.
"""

from __future__ import annotations

from functools import partial
from itertools import count

import numpy as np

from ...analysis import Onset, Packing, dynamical_matrix, find_onset, spectrum
from ...pywrap import Engine, Equilibrium, equilibrate
from ...pywrap.load_path import LoadPath
from ...pywrap.runs.scene_path import scene_path
from .study import COMPENSATED_SUFFIX, Run, Settings, Study, compensate, study_of, timed

FROM, TO = 0.010, 0.011
"""F_x before and after the increment of a relaxation, far from the onset."""

Path = LoadPath[Equilibrium]


def distance(packing: Packing, end: Packing) -> float:
    """Largest difference of a coordinate (x, y, R theta) of a disk with contacts, length."""
    low, end_low = (np.zeros(2) if each.position_low is None else each.position_low for each in (packing, end))
    apart = packing.position - end.position + (low - end_low)
    turned = packing.scaled_angle - end.scaled_angle
    return float(np.abs(np.delete(np.column_stack([apart, turned]), end.rattlers, axis=0)).max())


def relaxation(settings: Settings) -> Study:
    """Three methods, each with several accuracies, and Newton's in both arithmetics."""
    start = settings.at(FROM)
    careful_start = compensate(start)
    with Engine(start.packing) as engine, Engine(careful_start.packing) as careful:
        end = equilibrate(careful, careful_start, TO)
        values = np.linalg.eigvals(dynamical_matrix(end.packing)[0].toarray()).real
        slowest, fastest = float(values.min()), float(values.max())
        # nearly the longest stable steps, and critical drag of the slowest mode
        relax_step, verlet_step, drag = 0.95 * 2 / fastest, 0.95 * 2 / np.sqrt(fastest), 2 * np.sqrt(slowest)

        def newton(engine: Engine, start: Equilibrium, tolerance: float) -> tuple[Packing, int]:
            """Without a tolerance to the rounding floor."""
            found = equilibrate(engine, start, TO, tolerance or None)
            return found.packing, found.evaluations

        def verlet(steps: int) -> tuple[Packing, int]:
            engine.restore(start.packing)
            engine.set_fx(TO)
            with engine.undamped(verlet_step, drag_time=1 / drag) as dynamics:
                dynamics.advance(steps)
                return engine.packing, steps

        def overdamped(tolerance: float) -> tuple[Packing, int]:
            """Forces are looked at every 200 steps."""
            engine.restore(start.packing)
            engine.set_fx(TO)
            steps = engine.relax(tolerance, time_step=relax_step, chunk=200).steps
            return engine.packing, steps

        plain, fine = (1e-1, 1e-4, 1e-7, 0.0), (1e-1, 1e-4, 1e-7, 1e-12, 0.0)
        runs: list[Run] = [("Newton", force, partial(newton, engine, start, force)) for force in plain]
        name = "Newton" + COMPENSATED_SUFFIX
        runs += [(name, force, partial(newton, careful, careful_start, force)) for force in fine]
        runs += [("Verlet with drag", n, partial(verlet, n)) for n in (50, 100, 200, 400, 800)]
        forces = np.logspace(-3, -9, 4 if settings.quick else 7).tolist()
        runs += [("overdamped", force, partial(overdamped, force)) for force in forces]
        # errors of the forces as independent ones on all coordinates, through K^-1
        reference_error = end.floor * float(np.sqrt(np.mean(values**-2.0)))
        # both increments of the compensated arithmetic end at the same packing
        points, _ = timed(runs, settings, lambda packing: distance(packing, end.packing) or reference_error)
    numbers = {"packing": end.packing, "start": start, "slowest": slowest, "fastest": fastest}
    return study_of("relaxation", points, reference_error, numbers)


def scan(path: Path, increment: float) -> tuple[float, int]:
    """The onset in the middle of the first increment that ends in a complex pair, and the number of equilibria."""
    k = next(k for k in count(1) if spectrum(path(k * increment)).pairs)
    return (k - 0.5) * increment, k


def root(path: Path, increment: float, beyond: float) -> tuple[Onset, int]:
    """The onset by the root of the discriminant on a ramp to the first increment beyond a force, and the number of
    equilibria."""
    asked = list[float]()

    def equilibrium(fx: float) -> Packing:
        asked.append(fx)
        return path(fx)

    return find_onset(equilibrium, increment * np.arange(np.ceil(beyond / increment) + 1)), len(asked)


def onset(settings: Settings) -> Study:
    """Two methods for the onset of the ramp."""
    start, quick = settings.ramp[0], settings.quick
    exact_start = compensate(start)
    check, finest = (2e-3, 1e-3) if quick else (5e-4, 2.5e-4)
    with Engine(start.packing) as engine, Engine(exact_start.packing) as exact_engine:
        fresh = partial(scene_path, engine, start, settings.scene)
        careful = partial(scene_path, exact_engine, exact_start, settings.scene)
        guess = scan(fresh(), 1e-3)[0] + 0.5e-3
        found, rough = (root(careful(), increment, guess)[0] for increment in (finest, check))
        exact, resolution = found.fx_c, float(np.spacing(found.fx_c))

        def by_root(increment: float) -> tuple[float, int]:
            found, computed = root(fresh(), increment, exact)
            return found.fx_c, computed

        fine = (4e-3, 2e-3, 1e-3) if quick else (4e-3, 2e-3, 1e-3, 5e-4, 2e-4)
        runs: list[Run] = [("scan, Newton", h, partial(lambda h: scan(fresh(), h), h)) for h in fine]
        coarse = (4e-3,) if quick else (4e-3, 2e-3, 1e-3)
        runs += [("root of the discriminant", h, partial(by_root, h)) for h in coarse]
        points, _ = timed(runs, settings, lambda fx: max(abs(fx - exact), resolution))
    numbers = {"exact": exact, "packing": start.packing, "finest": finest, "check": check, "resolution": resolution}
    numbers |= {"residual": max(each.residual for each in settings.ramp)}
    return study_of("onset", points, found.error + abs(rough.fx_c - exact), numbers)
