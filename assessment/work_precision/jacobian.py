r"""Error of the stability operator K over the time that it takes, and over the step where it is a difference.

A central difference errs by :math:`h^2 |F'''|/6` and by the rounding of the coordinates, :math:`\epsilon |x| k/h`:
with :math:`f_n = k_n \delta^{3/2}` the two meet at a relative error that goes as :math:`\epsilon^{2/3}`. The third
derivative is largest at the smallest overlap, and for steps above that the contact opens. Where slips change sign the
force has a kink in its second derivative, which adds a term of first order for steps above the smallest slip.

The reference extrapolates differences in compensated arithmetic, in which the rounding of the coordinates is 1e-7 of
that of doubles: what is left is the rounding of the forces.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from ...analysis import Packing, stiffness_matrix
from ...analysis.arrays import Floats
from ...pywrap import Engine
from .study import Run, Settings, Study, study_of, timed

REFERENCE_STEP = 1e-8
"""Of the reference, length: below it the rounding of forces counts, above it the kink at a slip of zero."""


def differences(engine: Engine, packing: Packing, step: float) -> tuple[Floats, int]:
    """K by central differences of LAMMPS's forces, a column at a time, and how many forces it took."""
    size = 3 * len(packing)
    matrix = np.empty((size, size))
    for column, unit in enumerate(np.eye(size)):
        forces = []
        for sign in (1, -1):
            engine.displace(packing, sign * step * unit)
            forces.append(engine.net_force)
        matrix[:, column] = (forces[1] - forces[0]) / (2 * step)
    return matrix, 2 * size


def jacobian(settings: Settings) -> Study:
    """The study, on a packing under shear, so that slips are not zero."""
    packing = settings.at(0.02).packing
    low = packing.contacts.slipped(packing.contacts.slip, np.zeros(len(packing.contacts)))
    careful = replace(packing, position_low=np.zeros_like(packing.position), contacts=low)
    with Engine(careful) as engine:
        wide, narrow, finest = (differences(engine, careful, REFERENCE_STEP / n)[0] for n in (1, 2, 4))
    exact, rough = ((4 * fine - coarse) / 3 for fine, coarse in ((narrow, wide), (finest, narrow)))
    scale = float(np.abs(exact).max())
    own = float(np.abs(exact - rough).max()) / scale
    steps = np.logspace(-11, -5, 4 if settings.quick else 7)
    with Engine(packing) as engine:
        runs: list[Run[Floats]] = [
            ("analytic", None, lambda: (stiffness_matrix(packing).toarray(), 1)),
            ("analytic, paper's form", None, lambda: (stiffness_matrix(packing, "paper").toarray(), 1)),
        ]
        name = "central differences in LAMMPS"
        runs += [(name, step, partial(differences, engine, packing, step)) for step in steps.tolist()]
        points, _ = timed(runs, settings, lambda matrix: float(np.abs(matrix - exact).max()) / scale)
    # truncation of f_n at the smallest overlap and rounding of the coordinates at the stiffest contact
    law, overlap, fine = packing.law, packing.geometry.overlap, np.geomspace(steps[0], steps[-1], 60)
    truncation = fine**2 * abs(float(law.normal_curvature(overlap.min(), order=3))) / 6 / scale
    unit = 0.5 * float(np.finfo(float).eps) * float(np.abs(packing.position).max())
    rounding = float(law.normal_stiffness(overlap).max()) * unit / fine / scale
    theory = [("truncation + rounding", truncation + rounding, fine)]
    return study_of("jacobian", points, own, {"packing": packing}, theory)
