"""The pages of yield come out of their tables, and other pages say the same."""

import shutil
from pathlib import Path

from research.tables import read_rows
from research.yielding.compute import CONTROLLED_RATE
from research.yielding.page import (
    SEEN_GROWTH,
    UNREST,
    count_vibrating_draws,
    numbers,
    rows_of,
    standard,
    worst_ends,
    write_lasting,
    write_page,
)

YIELDING = Path(__file__).parents[2] / "research" / "yielding"
ROWS, _ = rows_of(YIELDING / "tables" / "quartz_100.jsonl")
STANDARD = read_rows(YIELDING / "tables" / "standard_100.jsonl")
AT_BOUND = read_rows(YIELDING / "tables" / "sliding_100.jsonl")


def test_the_page_of_yield_is_that_of_its_tables(tmp_path):
    shutil.copytree(YIELDING / "tables", tmp_path / "tables")
    assert (YIELDING / "README.md").read_text() == write_page(tmp_path).read_text()


def test_flow_is_told_from_a_layer_that_finds_no_rest_under_drag():
    worst = worst_ends(ROWS, 1.0)
    runs = [[run for run in row["dynamic"] if run["restitution"] == 1.0] for row in ROWS]
    flowing = sum(any(run["ends"] == "flows" for run in each) for each in runs)
    assert worst["counts"]["flows"]["count"] == flowing == 9
    assert sum(each["count"] for each in worst["counts"].values()) == numbers(ROWS)["yields"][0]["unrest"]


def test_the_standard_law_loads_the_same_packings_and_lossy_layers_rest():
    assert [row["seed"] for row in STANDARD] == list(range(1, len(STANDARD) + 1))
    found = standard(STANDARD)
    assert found["flows"][0.9]["count"] == 0
    for cell in found["runs"]:
        assert all(every <= anyhow <= cell["packings"] for every, anyhow in (cell[kind] for kind in UNREST))
    # a run that noise decides has three draws, a stable layer one
    for row in STANDARD:
        for share, loss in {(run["share"], run["restitution"]) for run in row["dynamic"]}:
            runs = [run for run in row["dynamic"] if (run["share"], run["restitution"]) == (share, loss)]
            assert len(runs) == (1 if runs[0]["ends"] == "stable" else 3)


def test_motion_from_the_bound_needs_contacts_there():
    """A lossy layer whose spectrum is stable moves while contacts slide on, and not with a little more friction."""
    found = standard(STANDARD)["at_bound"]
    assert found
    assert {seed for seed, _ in found} == {row["seed"] for row in AT_BOUND}
    for seed, share in found:
        chosen = [row for row in AT_BOUND if (row["seed"], row["share"]) == (seed, share)]
        runs = {(row["friction"], row["restitution"]): row for row in chosen}
        assert runs[1.0, 0.9]["at_bound"] > 0 == runs[1.01, 0.9]["at_bound"]
        assert runs[1.0, 0.9]["largest_D"] > SEEN_GROWTH > 100 * runs[1.01, 0.9]["largest_D"]


def test_draws_are_counted_by_layer():
    lasting = [
        {"seed": s, "history": "total", "share": 0.97, "restitution": 0.9, "early": 1, "late": 1} for s in (1, 2)
    ]
    further = [
        {"seed": 1, "history": history, "draw": draw, "early": 1.0, "late": late}
        for history, lates in (("total", {1: 1.0, 2: 0.1}), ("coulomb", {0: 0.1, 1: 0.1, 2: 0.2}))
        for draw, late in lates.items()
    ]
    found = count_vibrating_draws(lasting, further)
    assert found["seeds"] == [1]  # seed 2 has one draw alone
    assert found["counts"] == {"total": [0, 0, 1, 0], "coulomb": [1, 0, 0, 0]}
    assert found["late"] == 0.2
    assert count_vibrating_draws(lasting, []) is None


def test_layers_without_loss_do_not_rest_below_their_static_yield_and_lossy_ones_do():
    assert all(row["static"] >= row["newton"] for row in ROWS)
    undamped, *lossy = numbers(ROWS)["yields"]
    assert undamped["unrest"] > len(ROWS) / 2
    assert undamped["share"][2] < 1
    assert all(each["unrest"] == 0 and each["share"] == [1, 1, 1] for each in lossy)
    # with more loss the same layers flow as the load rises, and all of them beyond the end of Newton's branch
    flowing = {0.9: [], 0.5: [], 0.1: []}
    for k, row in enumerate(ROWS):
        for run in row["loading"]:
            assert run["flows"] is None or row["newton"] < run["flows"] < row["static"]
            if run["rate"] == CONTROLLED_RATE and run["flows"] is not None and run["restitution"] in flowing:
                flowing[run["restitution"]].append(k)
    assert flowing[0.9] == flowing[0.5] == flowing[0.1] != []


def test_one_layer_of_400_disks_flows_in_spite_of_loss_by_the_papers_law_alone():
    large = read_rows(YIELDING / "tables" / "quartz_400.jsonl")
    lossy = {row["seed"] for row in large for run in row["dynamic"] if run["restitution"] < 1 and run["ends"] in UNREST}
    runs = read_rows(YIELDING / "tables" / "flow_400.jsonl")
    assert {run["seed"] for run in runs} == lossy
    assert all((run["ends"] == "rests") == (run["history"] != "total") for run in runs)
    said = f"[{len(lossy)} of {len(large)}](yield/further.md#400-disks) of 400"
    assert said in (YIELDING.parents[1] / "docs" / "paper.md").read_text()


def test_the_page_of_layers_left_to_themselves_is_that_of_its_tables_and_other_pages_say_the_same(tmp_path):
    shutil.copytree(YIELDING / "tables", tmp_path / "tables")
    written = write_lasting(tmp_path).read_text()
    assert (YIELDING / "further.md").read_text() == written
    referee = " ".join((YIELDING.parent / "modes" / "referee.md").read_text().split())
    assert "one draw of noise for each layer, 5 of 20 (11 to 47 %) layers vibrate" in " ".join(written.split())
    assert "5 of 20 with one draw of noise each, vibrate" in referee
    assert "5 of 20 vibrate on with the noise that they were given" in referee
