"""Undamped dynamics in LAMMPS against the spectrum: growth above the onset, with dashpots, and of the worst start."""

import numpy as np
import pytest

from faultgouge.analysis import (
    discrete_frequency,
    fit_growth,
    mean_square_displacement,
    nearest_image,
    spectrum,
    transient_gain,
)
from faultgouge.analysis.windows import Motions, System
from faultgouge.pywrap import Engine, Scene, settle
from faultgouge.pywrap.runs.scene_path import scene_path
from faultgouge.pywrap.runs.undamped import time_step


def displace(packing, direction, size):
    """The packing displaced by `size` in the norm of (x, y, u), slips advanced."""
    with Engine(packing) as engine:
        return engine.displace(packing, size * direction / np.linalg.norm(direction))


def run(packing, reference, time, samples, dt):
    """Times, D from the reference, and mean velocity of the upper layer."""
    every = max(1, round(time / dt / samples))
    rows = []
    with Engine(packing) as engine, engine.undamped(dt) as dynamics:
        for k in range(1, samples + 1):
            motion = dynamics.advance(every)
            msd = mean_square_displacement(motion.position, reference.position, reference.box_length)
            rows.append((k * every * dt, msd, motion.velocity[reference.top, 0].mean()))
    return np.array(rows).T


@pytest.mark.long
def test_growth_rate_and_frequency_are_those_of_the_spectrum(climbed):
    """Over six decades of D, from a small start along the pair that coalesces first."""
    packing = climbed(0.024)[-1].packing
    pair = max(spectrum(packing).pairs, key=lambda each: each.growth_rate)
    dt = time_step(packing)
    omega = complex(discrete_frequency(pair.eigenvalue, dt))
    modes = Motions.of(System.of(packing))
    mode = modes.right[:, np.argmin(np.abs(modes.values - pair.eigenvalue))].real
    # from far above the noise of 1e-25 to far below the square of the slip limits
    time, msd, velocity = run(displace(packing, mode, 1e-8), packing, 540.0, 12000, dt)
    growth = fit_growth(time, msd, lower=1e-18, upper=3e-12)
    assert growth.decades > 5.8  # of 6: the ends are means over stretches
    assert growth.rate == pytest.approx(spectrum(packing).growth_rate(dt), rel=5e-3)
    linear = slice(0, int(np.argmax(msd > 3e-12)))
    # of the velocity the frequency alone: the second unstable pair moves the layer, too
    # one growing oscillation: at equal steps h, v_(n+1) = a v_n + b v_(n-1) has the roots exp((+-i omega + rate) h)
    v = np.lib.stride_tricks.sliding_window_view(velocity[linear], 3)
    v = v / np.abs(v).sum(axis=1)[:, None]  # the growth may be large
    a, b = np.linalg.lstsq(v[:, 1::-1], v[:, 2])[0]
    frequency = abs(np.log(0.5 * (a + np.sqrt(complex(a * a + 4 * b)))).imag) / time[0]
    assert frequency == pytest.approx(omega.real, rel=1e-3)


@pytest.mark.long
def test_rounding_noise_grows_by_fifteen_decades(climbed):
    """Nothing but noise to begin with: D rises from 1e-25 by fifteen decades, most of them at the spectrum's rate."""
    packing = climbed(0.024)[-1].packing
    dt = time_step(packing)
    time, msd, _ = run(packing, packing, 1400.0, 7000, dt)
    noise = np.median(msd[time < 100])
    assert msd.max() / noise > 1e15
    # three decades above the noise one pair is alone; at 1e-11 D begins to level off
    growth = fit_growth(time, msd, lower=1e3 * noise, upper=1e-11)
    assert growth.decades > 9
    assert growth.rate == pytest.approx(spectrum(packing).growth_rate(dt), rel=5e-3)


@pytest.mark.long
def test_the_worst_start_grows_as_predicted(climbed):
    """A start of 1e-8 along it, below the onset at 0.02183: far below the slip limits, and far above rounding."""
    packing = climbed(0.0205, 0.0205 / 20)[-1].packing
    predicted = transient_gain(packing)
    steps = int(np.ceil(predicted.time / (0.2 * time_step(packing))))
    start = displace(packing, predicted.start, 1e-8)
    with Engine(start) as engine, engine.undamped(predicted.time / steps) as dynamics:
        dynamics.advance(steps)
        end = engine.packing
    moved = (nearest_image(each.position - packing.position, packing.box_length) for each in (start, end))
    turned = (each.scaled_angle - packing.scaled_angle for each in (start, end))
    before, after = (np.sum(x**2) + np.sum(u**2) for x, u in zip(moved, turned, strict=True))
    assert predicted.gain > 5
    assert after / before == pytest.approx(predicted.gain, rel=1e-2)


@pytest.fixture(scope="module")
def path():
    """Equilibria of README's packing: undamped onset at 0.0150098, with weak normal dashpots at 0.0148548."""
    packing, climb = {"seed": 1}, {"step": 1e-3, "until": 0.02}
    scene = Scene.from_mapping({"packing": packing, "law": {"kn": 2e5}, "load": {"fy": 3.0}, "ramp": climb})
    start = settle(scene)
    with Engine(start.packing) as engine:
        found = scene_path(engine, start, scene)
        list(found.climb(1e-3 * np.arange(1, 16)))
        yield found


@pytest.mark.long
@pytest.mark.parametrize(("fx", "cn", "unstable"), [(0.0155, 3.0, 1), (0.015, 3.0, 0)])
def test_growth_with_dashpots_is_that_of_the_eigenvalue(path, fx, cn, unstable):
    """Over six decades of D; at 0.015 it is the dashpots that make the packing unstable."""
    packing = path(fx).with_dissipation(cn=cn)
    assert len(spectrum(packing).pairs) == unstable
    modes = Motions.of(System.of(packing, dissipation=True))
    (k,) = np.flatnonzero(modes.grows)
    # 0.15 of the limit: damped runs are of second order in the step, and 3e-4 off there
    rate, shape, dt = 2 * modes.values[k].real, modes.right[:, k], 3 * time_step(packing)
    # from rest, displaced along the mode at its largest
    largest = (shape * np.exp(-0.5j * np.angle(np.sum(shape**2)))).real
    start = largest / np.sqrt(np.concatenate([packing.mass, packing.mass, packing.inertia_factor * packing.mass]))
    # Above the noise of 1e-25. So close to a coalescence the rate depends on the amplitude: by a tenth at D = 1e-12.
    time, msd, _ = run(displace(packing, start, 1e-10), packing, 19.5 / rate, 8000, dt)
    growth = fit_growth(time, msd, lower=1e-21, upper=1e-14)
    assert growth.decades > 6  # of 7: the ends are means over stretches
    assert growth.rate == pytest.approx(rate, rel=5e-3)
