"""What runs with weakening friction show, and what the page says of them: jump, growth, or neither."""

from types import SimpleNamespace

import numpy as np
import pytest

from faultgouge.analysis.responses.normal_form import NormalForm
from faultgouge.analysis.responses.power_law import PowerLaw
from faultgouge.figures.pages import render
from faultgouge.pywrap.lammps.dynamics import Weakening
from faultgouge.studies.triggering import Forecast, Sensitivity, Triggering, judge, summary

V0, LENGTH = 1e-11, 400.0
TIME = np.linspace(0.1, LENGTH, 4000)


def run_of(msd, crossing):
    """A run whose layer is fast enough from a time on, or never."""
    fast = (np.inf if crossing is None else crossing) <= TIME
    return {
        "time": TIME,
        "msd": msd,
        "layer_velocity": np.where(fast, 2 * V0, 0.5 * V0),
        "friction": np.where(fast, 0.48, 0.6),
    }


def noise(exponent=2.0):
    """Of doubles, whose D grows as a power of the time: 1e-26 at first, 1e-24 in the end."""
    return 1e-24 * (TIME / LENGTH) ** exponent


def msd_with_jump(height, at, then=0.0):
    """D that jumps at a time, and grows on from a thousandth of its jump at a rate."""
    later = np.maximum(TIME - at, 0.0)
    return noise() + (at <= TIME) * height * (np.sin(later) ** 2 + 1e-3 * np.exp(then * later))


STABLE, UNSTABLE = Forecast(1.55e-12, 0.0, 1.2, 0.0), Forecast(1e-16, 9.0, 5.0, 0.1)
QUIET = Forecast(1e-16, 0.0, 5.0, 0.0)
CASES = {
    # the whole jump, after the first twentieth of the run: no growth over 13.6 decades
    "late jump": (run_of(msd_with_jump(1.5e-12, 265.0), 265.0), STABLE, "jump alone", "shows the jump alone"),
    # nothing but rounding: the first twentieth has a smaller D than the rest
    "noise": (run_of(noise(), None), STABLE, "does not weaken", "friction does not weaken"),
    "at the end": (run_of(msd_with_jump(1e-12, 390.0), 390.0), STABLE, "too short", "a longer perturb.time"),
    "grows": (
        run_of(msd_with_jump(1e-16, 50.0, 0.1), 50.0),
        UNSTABLE,
        "grows",
        "an instability, and not the jump alone",
    ),
    "faster": (run_of(msd_with_jump(1e-16, 50.0, 0.16), 50.0), UNSTABLE, "unexplained", "not the spectrum's below"),
    "nothing grows": (run_of(msd_with_jump(1e-16, 50.0, 0.1), 50.0), QUIET, "unexplained", "has nothing that grows"),
    # beyond the jump of its first moments, but not beyond the one that is foreseen
    "foreseen": (
        run_of(msd_with_jump(1e-16, 50.0, 0.02), 50.0),
        Forecast(1e-15, 0.1, 1.2, 0.1),
        "jump alone",
        "jump alone",
    ),
}


def triggering(run, foreseen, unperturbed):
    pairs = tuple(NormalForm(0.2, e) for e in (1e-6, 1e-2))
    packing = SimpleNamespace(law=SimpleNamespace(mu=0.6))
    settings = SimpleNamespace(time=LENGTH, amplitude=1e-12, omega=0.01)
    return Triggering(
        scene=SimpleNamespace(perturb=settings),
        start=SimpleNamespace(fx=0.036, packing=packing),
        weakening=Weakening(B=0.2, w=0.4, mu_ss=0.8, v0=V0, v_ss=10 * V0),
        runs={
            "unperturbed": run_of(unperturbed, None),
            "perturbed": run_of(noise(), None),
            "erupting": run,
            "strong": run_of(noise(), None),
        },
        response=SimpleNamespace(msd=noise()),
        foreseen=foreseen,
        outcome=judge(run, V0, foreseen),
        control_rate=None,
        sensitive=Sensitivity(np.array([1e-6, 1e-2]), pairs, PowerLaw(-0.5, 1e-3, 1.0)),
    )


def page(found):
    numbers = summary(found)
    jump = numbers["jump"]
    text = render(
        "faultgouge.studies.reproduce",
        "triggering.md.j2",
        triggering=found,
        numbers=numbers,
        calibrated=True,
        highest_speed=2 * V0,
        jumped=None if jump is None else 0.0,
        above_noise=1e3,
    )
    return " ".join(text.split())


@pytest.mark.parametrize("case", CASES)
def test_only_growth_at_the_rate_of_the_spectrum_and_beyond_the_jump_is_an_instability(case):
    run, foreseen, verdict, sentence = CASES[case]
    found = triggering(run, foreseen, 1e-2 * noise())
    assert found.outcome.verdict == verdict
    said = page(found)
    assert sentence in said
    assert ("an instability, and not" in said) is (verdict == "grows")
    assert "The perturbation does not show" not in said


def test_a_perturbation_that_drowns_in_noise_is_said_to():
    said = page(triggering(CASES["grows"][0], UNSTABLE, noise()))
    assert "The perturbation does not show" in said


def test_plateaus_stand_beside_their_theory():
    """Of four decades of epsilon: 100 by its power, 98 by the whole normal form."""
    found = triggering(CASES["grows"][0], UNSTABLE, noise())
    near, far = found.sensitive.pairs
    assert summary(found)["plateaus"] == {"measured": near.amplitude() / far.amplitude(), "theory": pytest.approx(100)}
    assert "tau_d = 1/(delta sqrt(epsilon))" in page(found)
