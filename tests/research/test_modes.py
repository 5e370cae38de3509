"""The pages of the study of complex modes: they come out of the committed tables, and say what these hold."""

import json
import re
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from reference_layer import SMALL
from scipy.stats import mannwhitneyu

from faultgouge.analysis import stiffness_matrix
from faultgouge.analysis.windows import LIMITS
from faultgouge.pywrap import Engine, Scene, equilibrate, settle
from faultgouge.pywrap.scenes.units import real_units
from faultgouge.studies.modes import count_pairs
from faultgouge.studies.sweep.run_sweep import run_sweep
from faultgouge.studies.sweep.sweep_plan import Sweep
from research.modes.count_in_slices import count_in_slices
from research.modes.make import different
from research.modes.packing_rows import computed_again, read_known
from research.modes.page import critical, part
from research.modes.parts_of_b import switched
from research.modes.sets import quartz, sets
from research.statistics import interval

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "research" / "modes"
FOUND = json.loads((DOCS / "modes.json").read_text())
UNITS = (ROOT / "docs" / "units.md").read_text()
REFEREE = (DOCS / "referee.md").read_text()


@pytest.fixture(scope="module")
def loaded():
    """Packings of 60 disks at two loads."""
    state, found = settle(Scene.from_mapping(SMALL | {"packing": {"disks": 60, "width": 9.2, "seed": 77}})), []
    with Engine(state.packing) as engine:
        for fx in (0.06, 0.3, 0.6):
            state = equilibrate(engine, state, fx=fx)
            found.append(state.packing)
    return found[1:]


def test_without_b_no_pair_is_complex(loaded):
    """What is left is the turning of the tangent; b of all contacts is K itself."""
    packing = loaded[1]
    every = np.ones(len(packing.contacts), dtype=bool)
    assert abs(stiffness_matrix(packing, coupled=every) - stiffness_matrix(packing)).max() == 0
    # the law is flat at its bound: what is within 1e-9 of the slip limit has the bound's force but for a rounding
    np.testing.assert_array_equal(packing.sliding, packing.mobilised > 1 - 1e-13)
    found = switched(packing)["b_of"]
    assert found["none"]["pairs"] == 0 < found["sticking"]["pairs"] <= count_pairs(packing).as_dict()["pairs"]


def test_pairs_counted_in_slices_are_those_of_all_eigenvalues(loaded):
    """Five slices of 60 disks, whose neighbours do not cover the spectrum."""
    (found, error), every = count_in_slices(loaded[0], replace(LIMITS, slice_size=35)), count_pairs(loaded[0])
    assert abs(len(found) - len(every.omega)) <= error <= 2
    assert np.sqrt(found).imag.max() == pytest.approx(every.omega[0].imag, rel=1e-2)


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [
        *("force 50", "harmonic"),
        *(pytest.param(f"{each}", marks=pytest.mark.long) for each in ("force 100", "force 200", "pressure 50")),
        pytest.param("friction 50", marks=pytest.mark.long),
    ],
)
def test_a_seed_is_the_packing_of_the_table(name, tmp_path):
    """At the first three loads. Settling is chaotic: with one other bit in a width the packing is another."""
    sweep = sets(0.01)[name]
    first = [load["fx_over_fy"] for load in read_known(DOCS / "tables", name)[1]["loads"][:3]]
    fy, folder = sweep.scene["load"]["fy"], name.replace(" ", "_")
    scene = sweep.scene | {"modes": {"fx_over_fy": first}, "ramp": {"step": 1e-3 * fy, "until": first[-1] * fy}}
    asked = {"task": sweep.task, "sweep": {"packing.seed": [1]}, "scene": scene}
    run_sweep(Sweep.from_mapping(asked), tmp_path / folder)
    [(packing, again, table)] = computed_again(tmp_path, DOCS / "tables")
    assert packing == f"{folder}, seed 1"
    assert different(again["loads"], table["loads"][:3]) == []


def claims():
    """Sentences of the page with their truth; intervals are (middle, low, high)."""
    powers, course_of = FOUND["powers"], FOUND["sets"]
    for level in ("0.1", "0.3"):
        middle, low, high = powers[f"load of share {level}"]["power"]
        yield "the load of a share falls as the root of the number of disks", -0.65 < low < middle < high < -0.4
        yield "also at a fixed pressure", FOUND["pressure_powers"][f"load of share {level}"]["power"][2] < 0
    rises, falls = (powers[f"{name} at 0.1"]["power"] for name in ("growth_rate", "least_q"))
    yield "growth rises with the size at a fixed force, and the least Q falls", rises[1] > 0 > falls[2]
    for kind in ("pressure_powers", "thickness_powers"):
        _, low, high = FOUND[kind]["growth_rate at 0.1"]["power"]
        yield f"growth is not known to rise at fixed {kind}", low < 0 < high
    usual, low, high = course_of["force 100"], *course_of["stiff tangent"]["0.1"]["share"][1:]
    yield "harmonic disks have more pairs", course_of["harmonic"]["0.1"]["share"][1] > usual["0.1"]["share"][2]
    yield "with a stiff tangent as many", low < usual["0.1"]["share"][0] < high
    for load in ("0.1", "0.2"):
        halved, ours = course_of["halved increments"][load]["share"], usual[load]["share"]
        others = course_of["other seeds"][load]["share"]
        yield "increments do not matter", course_of["compensated"][load]["share"] == pytest.approx(halved, rel=0.05)
        yield "nor do the seeds", ours[1] < others[2] and others[1] < ours[2]
    for load, parts in FOUND["switches"].items():
        yield "without b there is no pair", parts["none"]["with_pairs"] == 0
        if float(load) >= 0.2:
            least = {name: each["least_q"][0] for name, each in parts.items()}
            yield "sliding contacts make the strong growth", least["sliding"] < 1.6 * least["all"]
            yield "and sticking ones do not", least["sticking"] > 3 * least["all"]
    for course in FOUND["random"].values():
        for measured, drawn, formula in zip(course["measured"], course["random"], course["formula"], strict=True):
            if measured[0] > 0.15:
                yield "the formula is near", formula[0] == pytest.approx(measured[0], rel=0.125)
                yield "random matrices are near", measured[0] < drawn[0] <= 1.25 * measured[0]
    for course in FOUND["loss"].values():
        for weak, strong in pairwise(sorted(course["grows"], reverse=True)):
            for one, other in zip(course["grows"][weak], course["grows"][strong], strict=True):
                yield "stronger loss stops more", other["count"] <= one["count"]
        yield "what loss has stopped does not return", course["returns"] == 0
    # within 2 % without tangential dashpots, but for a packing in which several motions grow about as fast
    runs = [run for each in FOUND["runs"].values() for run in each if run["ct_over_cn"] == 0]
    off = np.abs([run["measured"] / run["predicted"] - 1 for run in runs])
    far = {(runs[k]["seed"], runs[k]["fx_over_fy"]) for k in np.flatnonzero(off > 0.02)}
    yield "growth with dashpots is that of the pencil", len(off) >= 12 and np.median(off) < 2e-3 and far <= {(3, 0.2)}


def test_what_the_page_says_holds():
    assert [sentence for sentence, holds in claims() if not holds] == []


def test_units_says_what_the_tables_of_quartz_say():
    """Growth in microseconds, and frequencies in megahertz, over the load and over the thickness."""
    for name, load, disks in (
        *(
            (depth, load, None)
            for depth in ("1 MPa", "10 MPa", "100 MPa")
            for load in FOUND["quartz"][f"quartz {depth}"]["loads"]
        ),
        *((f"thick {disks}" if disks != 100 else "10 MPa", 0.1, disks) for disks in (50, 100, 200, 400)),
    ):
        course = FOUND["quartz"].get(name) or FOUND["quartz"][f"quartz {name}"]
        real = real_units(Scene.from_mapping(quartz(name) if disks is None else quartz("10 MPa", disks)))
        k = course["loads"].index(load)
        rate, omegas = course["growth_rate"][k][0], [course[key][k][0] for key in ("slowest", "omega")]
        hertz = ["none" if omega is None else f"{real.frequency(omega) / 1e6:.2g}" for omega in omegas]
        grows = "none" if rate == 0 else f"{1e6 * real.time / rate:.2g}"
        stops = interval(course["least_q"][k]), critical(course["critical_restitution"][k])
        cells = (name, f"{load:g}", f"{course['count'][k]}", grows, hertz[1], *stops, part(course["grows"]["0.9"][k]))
        cells = cells if disks is None else (f"{disks}", f"{course['count'][k]}", *hertz, grows, *stops)
        assert f"| {' | '.join(cells)} |" in UNITS


def rows(name, folder="slices_and_bounds"):
    return [json.loads(line) for line in (DOCS / folder / name).read_text().splitlines()]


def test_bounds_and_counts_in_slices_are_those_of_the_rows():
    """Bounds are never passed, counts are within their errors, and the page has them."""
    cells, off, all_bounds = [], [], rows("bounds.jsonl")
    for load, disks in {(row["fx_over_fy"], row["disks"]) for row in all_bounds}:
        own = [row for row in all_bounds if (row["fx_over_fy"], row["disks"]) == (load, disks)]
        assert all(row["imaginary"] <= row["bound"] for row in own)
        imaginary, bound = (np.median([row[name] for row in own]) for name in ("imaginary", "bound"))
        cells.append(f"{disks} | {load:g} | {len(own)} | {imaginary:.3g} | {bound:.3g}")
    for row in rows("slices.jsonl"):
        assert abs(row["sliced"] - row["pairs"]) <= row["error"]
        numbers = [row[name + way] for name in ("growth_rate", "least_q") for way in ("", "_sliced")]
        off += [abs(numbers[1] / numbers[0] - 1), abs(numbers[3] / numbers[2] - 1)]
        counts = f"{row['seed']} | {row['fx_over_fy']:g} | {row['pairs']} | {row['sliced']} ± {row['error']}"
        cells.append(f"{counts} | {' | '.join(f'{each:.3g}' for each in numbers)}")
    stated = re.search(r"Growth rates and least Q from slices are within ([\d.]+) %", REFEREE)
    assert max(off) < float(stated[1]) / 100 < 1.2 * max(off)
    assert [each for each in cells if f"| {each} |" not in REFEREE] == []


def shares_told(load, ratio, power=0.53):
    """Shares of packings of 1,000 disks at the load that the law of sizes names for packings `ratio` times larger."""
    found = []
    for row in rows("force_1000.jsonl", "tables"):
        loads, shares = zip(*((each["fx_over_fy"], each["share"]) for each in row["loads"]), strict=True)
        if loads[-1] >= load * ratio**power:
            found.append(np.interp(load * ratio**power, loads, shares))
    return found


def test_shares_of_larger_packings_are_those_that_the_law_of_smaller_ones_tells():
    counted = {}
    for row in rows("slices_large.jsonl"):
        share = 2 * row["sliced"] / row["modes"]
        counted.setdefault((row["disks"], row["fx_over_fy"]), []).append(share)
        cells = f"{row['disks']} | {row['seed']} | {row['fx_over_fy']:g} | {row['sliced']} ± {row['error']}"
        assert f"| {cells} | {row['modes']} | {share:.2f} | {row['growth_rate_sliced']:.3g} |" in REFEREE
    for (disks, load), shares in counted.items():
        assert mannwhitneyu(shares, shares_told(load, disks / 1000)).pvalue > 0.05
    shares = counted[3000, 0.03]
    left = [k / 100 for k in range(120) if mannwhitneyu(shares, shares_told(0.03, 3, k / 100)).pvalue >= 0.05]
    assert f"at 0.03 from {min(left):.2f} to {max(left):.2f}" in " ".join(REFEREE.split())
