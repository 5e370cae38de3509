"""Small motion in LAMMPS against its predictions: growth with dashpots, and the worst start below the onset."""

import numpy as np
import pytest

from faultgouge.analysis import (
    fit_growth,
    mean_square_displacement,
    nearest_image,
    spectrum,
    transient_gain,
)
from faultgouge.analysis.damped_onset.modes import DampedModes, Pencil
from faultgouge.analysis.damped_onset.windows import dissipating
from faultgouge.pywrap import Engine, Scene, settle
from faultgouge.pywrap.runs.path import EquilibriumPath
from faultgouge.pywrap.runs.undamped import time_step


def displacement(packing, reference):
    moved = nearest_image(packing.position - reference.position, reference.box_length)
    return np.concatenate([moved[:, 0], moved[:, 1], packing.scaled_angle - reference.scaled_angle])


@pytest.mark.slow
@pytest.mark.long
def test_the_worst_start_grows_as_predicted(loaded):
    """A start of 1e-8 along it, below the onset at 0.02183: far below the slip limits, and far above rounding."""
    packing = loaded(0.0205, 0.0205 / 20)
    predicted = transient_gain(packing)
    steps = int(np.ceil(predicted.time / (0.2 * time_step(packing))))
    with Engine(packing) as engine:
        pushed = engine.displace(packing, 1e-8 * predicted.start)
    with Engine(pushed) as engine, engine.undamped(predicted.time / steps) as dynamics:
        dynamics.advance(steps)
        end = engine.packing
    before, after = (np.sum(displacement(each, packing) ** 2) for each in (pushed, end))
    assert predicted.gain > 5
    assert after / before == pytest.approx(predicted.gain, rel=1e-2)


@pytest.fixture(scope="module")
def path():
    """Equilibria of README's packing: undamped onset at 0.0150098, with weak normal dashpots at 0.0148548."""
    scene = Scene.from_mapping(
        {"packing": {"seed": 1}, "law": {"kn": 2e5}, "load": {"fy": 3.0}, "ramp": {"step": 1e-3, "until": 0.02}}
    )
    start = settle(scene)
    with Engine(start.packing) as engine:
        found = EquilibriumPath(engine, start, scene)
        for k in range(1, 16):
            found(k * 1e-3)
        yield found


def grown(packing, mode, time, dt):
    """Times and D of a run that starts from rest, displaced by 1e-10 along a mode at its largest."""
    every = round(time / dt / 8000)
    shape = (mode.right * np.exp(-0.5j * np.angle(np.sum(mode.right**2)))).real
    start = shape / np.sqrt(np.concatenate([packing.mass, packing.mass, packing.inertia_factor * packing.mass]))
    with Engine(packing) as engine:
        pushed = engine.displace(packing, 1e-10 * start / np.linalg.norm(start))
    rows = []
    with Engine(pushed) as engine, engine.undamped(dt) as dynamics:
        for k in range(1, 8001):
            motion = dynamics.advance(every)
            moved = mean_square_displacement(motion.position, packing.position, packing.box_length)
            rows.append((k * every * dt, moved))
    return np.array(rows).T


@pytest.mark.slow
@pytest.mark.long
@pytest.mark.parametrize(("fx", "cn", "unstable"), [(0.0155, 3.0, 1), (0.015, 3.0, 0)])
def test_growth_with_dashpots_is_that_of_the_eigenvalue(path, fx, cn, unstable):
    """Over six decades of D; at 0.015 it is the dashpots that make the packing unstable."""
    packing = dissipating(path, cn=cn)(fx)
    assert len(spectrum(packing).pairs) == unstable
    modes = DampedModes.of(Pencil.of(packing))
    (index,) = modes.growing
    # 0.15 of the limit: damped runs are of second order in the step, and 3e-4 off there
    mode, dt = modes.mode(int(index)), 3 * time_step(packing)
    rate = 2 * mode.rate.real
    # Above the noise of 1e-25. So close to a coalescence the rate depends on the amplitude: by a tenth at D = 1e-12.
    time, msd = grown(packing, mode, 19.5 / rate, dt)
    growth = fit_growth(time, msd, lower=1e-21, upper=1e-14)
    assert growth.decades > 6  # of 7: the ends are means over stretches
    assert growth.rate == pytest.approx(rate, rel=5e-3)
