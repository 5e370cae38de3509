"""Loads up, down and below zero: the way of F_x, a run that goes on along it, and what it leaves."""

import json
import re
from itertools import pairwise

import numpy as np
import pytest
from reference_layer import toml
from table_rows import rows_of

from faultgouge.analysis import RunFile
from faultgouge.analysis.responses.hysteresis import hysteresis, layer_displacement, turning_points
from faultgouge.pywrap import Scene, SceneError
from faultgouge.pywrap.runs.ramp_loads import all_loads, count_behind, ramp_loads
from faultgouge.pywrap.scenes.sections import Ramp

SCENE = {"packing": {"disks": 12, "width": 4.1, "seed": 3}, "law": {"kn": 2e5, "mu": 0.3}, "load": {"fy": 3.0}}


@pytest.fixture
def cycle(faultgouge_here, tmp_path):
    """Runs a ramp along a way, and gives what it says."""

    def run(until, *words):
        (tmp_path / "scene.toml").write_text(toml(SCENE | {"ramp": {"step": 0.1, "until": until}}))
        return faultgouge_here("ramp", "scene.toml", *words).stdout

    return run


def packings_of(path):
    with RunFile(path) as file:
        return [file.packing(k) for k in range(len(file))]


@pytest.mark.parametrize(
    ("until", "wanted"),
    [
        (0.3, [0, 1, 2, 3]),
        (-0.2, [0, -1, -2]),
        ((0.2, -0.1), [0, 1, 2, 1, 0, -1]),
        ((0.1, 0.2, 0.0), [0, 1, 2, 1, 0]),
        ((0.25, 0.05), [0, 1, 2, 2.5, 2, 1, 0.5]),
    ],
)
def test_the_way_goes_through_multiples_of_the_step(until, wanted):
    loads = all_loads(Ramp(step=0.1, until=until))
    assert loads == pytest.approx([0.1 * each for each in wanted], rel=1e-15)
    assert all(load == k * 0.1 for load, k in zip(loads, wanted, strict=True) if k == int(k))  # to the bit, on each way


def test_a_run_goes_on_where_it_was_on_the_way():
    settings = Ramp(step=0.1, until=(0.2, -0.1, 0.0))
    whole = all_loads(settings)
    assert [count_behind(settings, whole[:k]) for k in range(len(whole) + 1)] == list(range(len(whole) + 1))
    assert count_behind(settings, all_loads(Ramp(step=0.1, until=0.15))) == 2  # goes on to 0.2
    assert count_behind(Ramp(step=0.1, until=0.15), whole[:4]) == 3  # has been there
    with pytest.raises(SceneError, match=r"has gone to F_x = 0\.1 where ramp\.until leads to F_x = 0\.3"):
        count_behind(Ramp(step=0.1, until=0.5), whole[:4])


def test_an_onset_is_sought_on_the_way_to_the_first_turning_point():
    ramps = [{"step": 0.1, "until": until} for until in ([0.2, -0.1], [-0.2, 0.1])]
    there, back = (Scene.from_mapping(SCENE | {"ramp": each}) for each in ramps)
    assert ramp_loads(there).tolist() == [0.0, 0.1, 0.2]
    with pytest.raises(SceneError, match="onsets are sought above 0"):
        ramp_loads(back)


@pytest.mark.parametrize(("sections", "says"), rows_of("pywrap/refused_loads.txt"))
def test_loads_that_make_no_sense_are_refused(sections, says, refused_scene):
    assert says in refused_scene({"packing": {}, "law": {"kn": 2e5}, "load": {"fy": 3.0}} | sections)


@pytest.mark.long
@pytest.mark.slow
def test_a_cycle_is_stored_drawn_and_goes_on_to_the_bit(tmp_path, cycle, faultgouge_here):
    cycle([0.5, -0.2], "-o", "parts.h5")
    assert "F_x is back at 0.5" in cycle([0.5, -0.5, 0.5], "-o", "parts.h5")
    left = json.loads(cycle([0.5, -0.5, 0.5], "-o", "cycle.h5", "--json"))["hysteresis"]
    packings = packings_of(tmp_path / "cycle.h5")
    assert packings == packings_of(tmp_path / "parts.h5")
    assert turning_points(np.array([each.fx for each in packings])) == [5, 15]
    found = hysteresis(packings)
    assert left == {"fx": 0.5, "begin": 5, "remaining": found.remaining, "work": found.work, "closes": False}
    # the work again, disk by disk
    top = packings[0].top
    work = sum(
        0.5 * (here.fx + there.fx) * (there.position - here.position)[top, 0].sum()
        - 3.0 * (there.position - here.position)[top, 1].sum()
        for here, there in pairwise(packings[5:])
    )
    assert found.work == pytest.approx(work, rel=1e-9)
    assert found.work > 0  # friction takes energy
    moved = layer_displacement(packings)[:, 0]
    assert found.remaining == moved[-1] - moved[5]
    # a view of three loads has both turning points, too
    assert faultgouge_here("view", "cycle.h5", "--loads", "3", "-o", "cycle.html").stdout.startswith("5 packings, ")
    assert "displacement of the upper layer" in (tmp_path / "cycle.html").read_text()
    faultgouge_here("export", "cycle.h5", "--frames", "all", "-o", "cycle.xyz")
    heads = (tmp_path / "cycle.xyz").read_text().splitlines()[1 :: len(top) + 2]
    assert [float(re.search(r" fx=(\S+)", head)[1]) for head in heads] == [each.fx for each in packings]


@pytest.mark.slow
def test_a_small_cycle_closes(tmp_path, cycle):
    """No contact slides for good: what remains is 1e-12 of how far the layer has moved, and no work."""
    assert "F_x is back at 0, and so is the upper layer: the path closes, to rounding" in cycle([0.1, 0.0])
    found = hysteresis(packings_of(tmp_path / "run.h5"))
    assert found.closes
    assert abs(found.work) < 1e-9 * 0.1 * 3e-4  # of F_x times the displacement
