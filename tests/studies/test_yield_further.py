"""The page on layers that are left to themselves says what its tables hold."""

import json
import re
from pathlib import Path

FOLDER = Path(__file__).parents[2] / "docs" / "yield"
PAGE = (FOLDER / "further.md").read_text()
FLOWING = ("flows", "bursts", "fails at rest")


def rows(name):
    return [json.loads(line) for line in (FOLDER / "tables" / f"{name}.jsonl").read_text().splitlines()]


LASTING = rows("lasting")
LOSSY = [row for row in LASTING if row["restitution"] < 1]
UNDAMPED = {
    (row["values"]["packing.seed"], run["share"]): run
    for row in rows("quartz_100")
    for run in (row["result"] or {"dynamic": []})["dynamic"]
    if run["restitution"] == 1
}


def test_the_table_of_energies_is_that_of_the_rows():
    for row in LOSSY:
        where = f"| {row['seed']} | {row['fx_over_fy']:.3g} | {row['restitution']} | {row['history']} | {row['time']} |"
        assert f"{where} {row['early']:.0e} | {row['late']:.0e} | {row['slip']:.2g} |" in PAGE


def test_one_layer_vibrates_with_total_slips_alone():
    lasting = {(row["seed"], row["history"]) for row in LOSSY if row["late"] > 0.1 * row["early"]}
    assert lasting == {(13, "total")}
    vibrating = [row for row in LOSSY if (row["seed"], row["history"]) == (13, "total")]
    assert len(vibrating) == 2
    total = {row["seed"] for row in LOSSY if row["history"] == "total"}
    assert f"{len(total) - 1} of {len(total)} lossy layers" in " ".join(PAGE.split())


def test_layers_without_loss_flow_with_either_history():
    undamped = [row for row in LASTING if row["restitution"] == 1]
    for row in undamped:
        other = UNDAMPED[row["seed"], row["share"]]
        words = f"| {row['seed']} | {row['share']} | {row['fx_over_fy']:.3g} | {other['ends']} | {row['ends']} |"
        assert f"{words} {other['slip']:.2g} | {row['slip']:.2g} |" in PAGE
    rescaled = sum(row["ends"] in FLOWING for row in undamped)
    total = sum(UNDAMPED[row["seed"], row["share"]]["ends"] in FLOWING for row in undamped)
    assert rescaled > 0
    stated = re.search(r"(\d+) of these (\d+) runs flow, .* slips, and (\d+) with rescaled", " ".join(PAGE.split()))
    assert tuple(map(int, stated.groups())) == (total, len(undamped), rescaled)


def test_no_layer_of_400_disks_flows():
    for row in rows("quartz_400"):
        for run in row["dynamic"]:
            assert run["ends"] == "rests"
            assert abs(run["slip"]) < (0.3 if run["restitution"] == 1 else 0.01)
            where = f"| {row['seed']} | {row['static']:.3g} | {run['share']} | {run['restitution']} |"
            assert f"{where} {run['ends']} | {run['slip']:.2g} |" in PAGE
