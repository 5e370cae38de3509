"""What dissipation does to the onset, also in SI, and to the gain: README's packing, and the tables of the docs."""

import json
from pathlib import Path

import numpy as np
import pytest
from reference_layer import SMALL, UNITS, toml

from faultgouge.analysis import stiffness_matrix
from faultgouge.pywrap import Scene
from faultgouge.pywrap.scenes.units import real_units
from research.dissipation.compute import (
    RATIOS,
    first_undamped_window,
    loads_of,
    over_distance,
    over_strength,
    ramped,
    weak_cases,
    windows_with,
)
from research.dissipation.weak_limit import balancing_ratio, drag_onset, weak_limit
from research.packing_tools import with_seed

TABLES = Path(__file__).parents[2] / "research" / "dissipation" / "tables"

SCENE = Scene.from_mapping(
    {"packing": {"seed": 1}, "law": {"kn": 2e5}, "load": {"fy": 3.0}, "ramp": {"step": 1e-3, "until": 0.016}}
)


WEAK = [row for line in (TABLES / "weak.jsonl").read_text().splitlines() if "cn" in (row := json.loads(line))]


@pytest.fixture(scope="module")
def ramp():
    with ramped(SCENE) as found:
        yield found


@pytest.mark.long
def test_weak_normal_dashpots_lower_the_onset_and_drag_raises_it_to_its_crossover(ramp):
    """From 0.0150098 to between 0.0148 and 0.0149, for C_N = 0.1 and 1 alike, and to 0.0150163."""
    weak, stronger = over_strength(ramp, "cn", [0.1, 1.0], start=0.0139)
    assert weak["undamped"] == pytest.approx(0.0150098323, abs=1e-10)
    assert 0.0148 < weak["onset"] < stronger["onset"] < 0.0149
    assert stronger["onset"] == pytest.approx(0.0148553091558, abs=1e-9)
    assert weak["onset"] == pytest.approx(weak["predicted"], rel=1e-6)
    (dragged,) = over_strength(ramp, "drag", [1e-2], start=0.0149)
    assert dragged["onset"] == pytest.approx(0.0150163, abs=1e-7)
    assert dragged["onset"] == pytest.approx(dragged["predicted"], rel=1e-9)


@pytest.mark.long
def test_the_limit_of_weak_dashpots_is_predicted(ramp):
    """One ratio of one packing anew, tangential dashpots alone, and it is that of the table."""
    known = {(each["cn"], each["ct"]): each for each in WEAK if each["seed"] == 1}
    for case in weak_cases(ramp, [(0.0, 1.0)]):
        assert case["predicted"] == pytest.approx(case["measured"], rel=1e-3)
        assert case["predicted"] < case["undamped"]
        assert case["measured"] == pytest.approx(known[case["cn"], case["ct"]]["measured"], rel=1e-8)


@pytest.fixture(scope="module")
def window(ramp):
    """The first window without dissipation."""
    return first_undamped_window(ramp)


@pytest.mark.slow
@pytest.mark.parametrize(("cn", "ct"), [pytest.param(1.0, 0.0, marks=pytest.mark.long), (0.0, 1.0)])
def test_the_limit_of_weak_dashpots_and_its_frequency(ramp, window, cn, ct):
    predicted = weak_limit(ramp, loads_of(ramp), window, cn, ct)
    assert predicted.fx < window.fx_onset
    (found, *_) = windows_with(ramp, [0.014, window.fx_onset + 1e-6], cn=1e-4 * cn, ct=1e-4 * ct)
    # Re s of 1e-12 tells loads apart that differ by as much as the rounding of their equilibria leaves
    assert found.error < 1e-10
    assert predicted.fx == pytest.approx(found.fx_onset, abs=2 * found.error)
    assert predicted.frequency == pytest.approx(found.frequency, rel=1e-6)


@pytest.mark.slow
def test_balanced_dashpots_leave_the_onset_alone(ramp, window):
    ratio = balancing_ratio(ramp(window.fx_onset), window)
    assert ratio == pytest.approx(0.1987, abs=5e-5)
    limits = {share: weak_limit(ramp, loads_of(ramp), window, 1.0, share * ratio).fx for share in (0.5, 1.0, 2.0)}
    assert limits[1.0] == pytest.approx(window.fx_onset, rel=1e-8)
    assert max(limits[0.5], limits[2.0]) < window.fx_onset - 1e-10


@pytest.mark.slow
def test_drag_shifts_the_onset_to_where_the_growth_exceeds_it(ramp, window):
    """The closed form of the pair against all modes; 2 |Im omega| = 1/tau to second order."""
    tau = 100.0
    predicted = drag_onset(ramp, loads_of(ramp), window, tau)
    assert predicted > window.fx_onset
    (found, *_) = windows_with(ramp, [0.0149, predicted + 1e-5], drag_time=tau)
    assert predicted == pytest.approx(found.fx_onset, rel=1e-9)
    rates = np.linalg.eigvals(stiffness_matrix(ramp(predicted)).toarray())
    fastest = np.abs(np.sqrt(rates.astype(complex)).imag).max()
    assert 2 * fastest == pytest.approx(1 / tau, rel=1e-4)


def test_the_table_of_weak_dashpots():
    """Five ratios of ten packings: predicted and measured among all modes."""
    assert sorted((each["cn"], each["ct"]) for each in WEAK) == sorted(RATIOS * 10)
    assert all(each["predicted"] <= each["undamped"] for each in WEAK)
    assert max(abs(each["predicted"] / each["measured"] - 1) for each in WEAK) < 1e-3


@pytest.mark.long
def test_an_onset_just_before_the_last_load_is_found():
    """The last load lies a millionth of F_x beyond the onset, which is less than small pencils know."""
    with ramped(with_seed(SCENE, 15)) as found:
        (case,) = weak_cases(found, [(0.0, 1.0)])
    assert case["measured"] == pytest.approx(case["predicted"], rel=1e-9)


@pytest.mark.long
def test_the_gain_grows_towards_the_onset_and_drag_limits_it(ramp):
    far, dragged = over_distance(ramp, [1e-2], [(0.0, 0.0), (0.0, 0.1)])
    near, damped = over_distance(ramp, [1e-3], [(0.0, 0.0), (1.0, 0.0)])
    assert dragged["gain"] < 0.5 * far["gain"]
    # the inverse of the distance, where one pair has most of it
    assert 5 < near["gain"] / far["gain"] < 20
    assert near["gain"] > 100
    assert far["gain"] <= far["bound"]
    assert damped["gain"] is None  # weak dashpots have lowered the onset to below this load: there is no largest gain


@pytest.mark.long
@pytest.mark.parametrize("damping", ["", "[damping]\ncn = 1.0\n"])
@pytest.mark.slow
def test_onset_in_si(faultgouge_here, tmp_path, damping):
    (tmp_path / "scene.toml").write_text(
        toml(SMALL | {"packing": {"disks": 30, "seed": 4}, "ramp": {"step": 4e-3, "until": 0.012}}) + UNITS + damping
    )
    done = faultgouge_here("onset", "scene.toml", "-o", "onset.json")
    found = json.loads((tmp_path / "onset.json").read_text())
    real = real_units(Scene.from_toml(tmp_path / "scene.toml"))
    window = found["windows"][0]
    omega = window["frequency"] if damping else window["lambda"] ** 0.5
    assert found["si"][0] == real.onset(found["fx_c"], omega)
    assert found["si"][0]["shear_stress_Pa"] == pytest.approx(found["fx_c"] / 3.0 * real.overburden, rel=1e-12)
    for number in found["si"][0].values():
        assert f"{number:.4g}" in done.stdout
