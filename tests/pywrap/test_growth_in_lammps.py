"""Undamped dynamics in LAMMPS against the spectrum: growth above the onset, none below it."""

from dataclasses import replace

import numpy as np
import pytest

from faultgouge.analysis import discrete_frequency, fit_growth, mean_square_displacement, spectrum
from faultgouge.analysis.onset import Modes, full_operator
from faultgouge.pywrap import Engine
from faultgouge.pywrap.runs.undamped import time_step


def pushed_along(packing, eigenvalue, size):
    """The packing displaced along the mode of an eigenvalue, slips advanced, by `size` in the norm of (x, y, u)."""
    modes = Modes.of(packing.fx, full_operator(packing))
    mode = modes.right[:, np.argmin(np.abs(modes.values - eigenvalue))].real
    with Engine(packing) as engine:
        return engine.displace(packing, size * mode / np.linalg.norm(mode))


def run(packing, reference, time, samples):
    """Times, D from the reference, and mean velocity of the upper layer."""
    dt = time_step(reference)
    every = max(1, round(time / dt / samples))
    rows = []
    with Engine(packing) as engine, engine.undamped(dt) as dynamics:
        for k in range(1, samples + 1):
            motion = dynamics.advance(every)
            msd = mean_square_displacement(motion.position, reference.position, reference.box_length)
            rows.append((k * every * dt, msd, motion.velocity[reference.top, 0].mean()))
    return np.array(rows).T


def frequency(time, signal):
    """Of one growing oscillation: at equal steps h, s_(n+1) = a s_n + b s_(n-1) has roots exp((+-i omega + rate) h)."""
    size = np.abs(signal[:-2]) + np.abs(signal[1:-1]) + np.abs(signal[2:])  # the growth may be large
    a, b = np.linalg.lstsq(np.column_stack([signal[1:-1], signal[:-2]]) / size[:, None], signal[2:] / size)[0]
    return abs(np.log(0.5 * (a + np.sqrt(complex(a * a + 4 * b)))).imag) / np.diff(time).mean()


@pytest.mark.slow
@pytest.mark.long
def test_growth_rate_and_frequency_are_those_of_the_spectrum(loaded):
    """Over six decades of D, from a small start along the pair that coalesces first."""
    packing = loaded(0.024)
    pair = max(spectrum(packing).pairs, key=lambda each: each.growth_rate)
    omega = complex(discrete_frequency(pair.eigenvalue, time_step(packing)))
    # from far above the noise of 1e-25 to far below the square of the slip limits
    time, msd, velocity = run(pushed_along(packing, pair.eigenvalue, 1e-8), packing, 540.0, 12000)
    growth = fit_growth(time, msd, lower=1e-18, upper=3e-12)
    assert growth.decades > 5.8  # of 6: the ends are means over stretches
    assert growth.rate == pytest.approx(2 * abs(omega.imag), rel=5e-3)
    linear = slice(0, int(np.argmax(msd > 3e-12)))
    # of the velocity the frequency alone: the second unstable pair moves the layer, too
    assert frequency(time[linear], velocity[linear]) == pytest.approx(omega.real, rel=1e-3)


@pytest.mark.slow
@pytest.mark.long
def test_rounding_noise_grows_by_fifteen_decades(loaded):
    """Nothing but noise to begin with: D rises from 1e-25 by fifteen decades, most of them at the spectrum's rate."""
    packing = loaded(0.024)
    time, msd, _ = run(packing, packing, 1400.0, 7000)
    noise = np.median(msd[time < 100])
    assert msd.max() / noise > 1e15
    # three decades above the noise one pair is alone; at 1e-11 D begins to level off
    growth = fit_growth(time, msd, lower=1e3 * noise, upper=1e-11)
    assert growth.decades > 9
    assert growth.rate == pytest.approx(spectrum(packing).growth_rate(time_step(packing)), rel=5e-3)


def test_rattlers_are_held_still(loaded):
    packing = loaded(1e-3)
    falling = replace(packing, top=packing.top | np.isin(np.arange(len(packing)), packing.rattlers[:1]))
    dt = time_step(packing)
    with Engine(falling) as engine, engine.undamped(dt) as dynamics:
        motion = dynamics.advance(1000)
    assert np.array_equal(motion.position[packing.rattlers], packing.position[packing.rattlers])
    assert not np.array_equal(motion.position, packing.position)
