"""The pages of yield come out of their tables, and other pages say the same."""

from pathlib import Path

from research.tables import read_rows
from research.yielding.page import SEEN_GROWTH, UNREST, numbers, rows_of, standard, worst_ends

YIELDING = Path(__file__).parents[2] / "research" / "yielding"
ROWS, _ = rows_of(YIELDING / "tables" / "quartz_100.jsonl")
STANDARD = read_rows(YIELDING / "tables" / "standard_100.jsonl")
AT_BOUND = read_rows(YIELDING / "tables" / "sliding_100.jsonl")


def test_flow_is_told_from_a_layer_that_finds_no_rest_under_drag():
    worst = worst_ends(ROWS, 1.0)
    runs = [[run for run in row["dynamic"] if run["restitution"] == 1.0] for row in ROWS]
    flowing = sum(any(run["ends"] == "flows" for run in each) for each in runs)
    assert worst["counts"]["flows"]["count"] == flowing == 9
    undamped, *lossy = numbers(ROWS)["yields"]
    assert sum(each["count"] for each in worst["counts"].values()) == undamped["unrest"] > len(ROWS) / 2
    assert all(each["unrest"] == 0 and each["share"] == [1, 1, 1] for each in lossy)
    assert all(row["static"] >= row["newton"] for row in ROWS)


def test_the_standard_law_loads_the_same_packings_and_motion_from_the_bound_needs_contacts_there():
    """A lossy layer whose spectrum is stable moves while contacts slide on, and not with a little more friction."""
    assert [row["seed"] for row in STANDARD] == list(range(1, len(STANDARD) + 1))
    found = standard(STANDARD)
    assert found["flows"][0.9]["count"] == 0
    # a run that noise decides has three draws, a stable layer one
    for row in STANDARD:
        for share, loss in {(run["share"], run["restitution"]) for run in row["dynamic"]}:
            runs = [run for run in row["dynamic"] if (run["share"], run["restitution"]) == (share, loss)]
            assert len(runs) == (1 if runs[0]["ends"] == "stable" else 3)
    assert {seed for seed, _ in found["at_bound"]} == {row["seed"] for row in AT_BOUND} != set()
    for seed, share in found["at_bound"]:
        chosen = [row for row in AT_BOUND if (row["seed"], row["share"]) == (seed, share)]
        runs = {(row["friction"], row["restitution"]): row for row in chosen}
        assert runs[1.0, 0.9]["at_bound"] > 0 == runs[1.01, 0.9]["at_bound"]
        assert runs[1.0, 0.9]["largest_D"] > SEEN_GROWTH > 100 * runs[1.01, 0.9]["largest_D"]


def test_one_layer_of_400_disks_flows_in_spite_of_loss_by_the_papers_law_alone():
    large = read_rows(YIELDING / "tables" / "quartz_400.jsonl")
    lossy = {row["seed"] for row in large for run in row["dynamic"] if run["restitution"] < 1 and run["ends"] in UNREST}
    runs = read_rows(YIELDING / "tables" / "flow_400.jsonl")
    assert {run["seed"] for run in runs} == lossy
    assert all((run["ends"] == "rests") == (run["history"] != "total") for run in runs)
    said = f"[{len(lossy)} of {len(large)}](yield/further.md#400-disks) of 400"
    assert said in (YIELDING.parents[1] / "docs" / "paper.md").read_text()
