"""Growth rates from D(t): of motions whose rate is known, between noise and ceiling."""

import numpy as np
import pytest

from faultgouge.analysis import fit_growth, growth_rate, mean_square_displacement


def motion(eigenvalue, vector, time):
    """D of q = Re(v exp(i omega t)), the growing member of a complex pair."""
    omega = np.sqrt(complex(eigenvalue))
    omega = omega if omega.imag < 0 else np.conj(omega)
    q = (np.exp(1j * omega * time)[:, None] * vector).real
    return np.mean(q**2, axis=1)


@pytest.mark.parametrize("eigenvalue", [2058.0 + 1.8j, 2058.0 + 0.3j, 40.0 + 0.5j])
@pytest.mark.parametrize("shape", ["standing", "turning", "mixed"])
def test_rate_of_a_complex_pair(eigenvalue, shape):
    """A standing wave, as beside an exceptional point, dips to zero twice a period; the means do not care."""
    rng = np.random.default_rng(1)
    vector = {
        "standing": rng.normal(size=30) + 0j,
        "turning": np.array([1, 1j] * 15),
        "mixed": rng.normal(size=30) + 0.1j * rng.normal(size=30),
    }[shape]
    rate = growth_rate(eigenvalue)
    time = np.linspace(0, 34 / rate, 20001)
    growth = fit_growth(time, 1e-22 * motion(eigenvalue, vector, time), lower=1e-21, upper=1e-10)
    assert growth.decades > 9
    # 600 samples of incoherent phase make a mean good to 3e-2, and 24 means a slope over 25 e-foldings
    # to 1e-3; three times that for phases that are not all incoherent.
    assert growth.rate == pytest.approx(rate, rel=3e-3)
    assert abs(growth.rate - rate) < 5 * growth.error + 1e-9 * rate


@pytest.mark.parametrize(
    ("time", "msd", "says"),
    [
        (np.arange(10), np.ones(9), "one length"),
        ([0, 1, 3] * 40, np.ones(120), "must increase"),
        (np.geomspace(1, 1e5, 200), np.exp(1e-4 * np.geomspace(1, 1e5, 200)), "stretches with"),
        (np.arange(100), np.ones(100), "decade"),
        (np.arange(100), np.zeros(100), "0 samples"),
        (np.arange(30), np.exp(np.arange(30)), "samples"),
    ],
)
def test_no_growth_to_fit(time, msd, says):
    with pytest.raises(ValueError, match=says):
        fit_growth(time, msd, 0.5, 1e9)


def test_rate_from_samples_at_uneven_times():
    """Those of an undamped run: equally spaced, and besides at times that grow geometrically."""
    every = 50 * np.arange(1, 2001)
    time = 1e-3 * np.union1d(every, np.geomspace(1, every[-1], 200).astype(int))
    msd = 1e-24 * np.exp(0.4 * time) * (1 + 0.5 * np.cos(9 * time))
    # the stretches begin and end at other samples, by a spacing at the most
    growth = fit_growth(time, msd, 1e-22, 1e-10)
    assert growth.rate == pytest.approx(0.4, rel=1e-3)
    used = msd[(time >= growth.start) & (time <= growth.end)]
    assert used[0] >= 1e-22 > msd[time < growth.start].max()
    assert used.max() < 1e-10 <= msd[time > growth.end][0]


def test_mean_square_displacement_of_wrapped_positions():
    reference = np.array([[0.1, 1.0], [9.9, 2.0]])
    moved = np.array([[9.9, 1.0], [0.2, 2.4]])  # by -0.2 and by +0.3, +0.4, across the box
    d = mean_square_displacement(np.array([reference, moved]), reference, box_length=10.0)
    np.testing.assert_allclose(d, [0, (0.04 + 0.25) / 2], rtol=1e-12, atol=0)
    assert mean_square_displacement(moved, reference) > 50
