"""Stored rows of sweeps: for which scene, code and version they stand, what is tried again, and that none is lost."""

import json
from importlib import import_module

import pytest
from reference_layer import REFERENCE, SMALL, toml

from faultgouge.pywrap import Scene, SceneError, settle
from faultgouge.studies.sweep import sweep_plan
from faultgouge.studies.sweep.run_sweep import merge, run_sweep
from faultgouge.studies.sweep.sweep_plan import Sweep
from faultgouge.studies.sweep.user_function import user_function

TASK = """
import sys
from pathlib import Path

import numpy as np

from faultgouge.analysis import NoEquilibriumError

CALLS = Path(__file__).with_name("calls")

def passing(scene):
    with CALLS.open("a") as file:
        file.write(f"{scene.packing.seed} ")
    if scene.packing.seed == 1:
        raise NoEquilibriumError("it flows")
    if scene.packing.seed == 2 and len(CALLS.read_text().split()) < 4:
        raise OSError("the disk is full")
    return {"seed": scene.packing.seed}

def ends(scene):
    if scene.packing.seed == 1:
        sys.exit()
    return {"seed": scene.packing.seed}

def contacts(scene, settled):
    return {"contacts": np.int64(len(settled.packing.contacts)), "of": {"x": settled.packing.position[:2, 0]}}

def imports(scene):
    from tools.numbers import number

def seed_of(scene): return scene.packing.seed
def nothing(scene): return {"number": float("nan")}
def fails(scene): return {"number": 1 / 0}
"""


@pytest.fixture
def folder(tmp_path):
    """A folder with the file of a task, and the modules that it imports."""
    (tmp_path / "ask.py").write_text(TASK)
    (tmp_path / "tools").mkdir()
    (tmp_path / "tools" / "numbers.py").write_text("from .deeper import number\n")
    (tmp_path / "tools" / "deeper.py").write_text("number = 1  # of nothing\n")
    return tmp_path


def sweep_of(folder, function, seeds="1:3"):
    user_function.cache_clear()
    mapping = {"task": f"ask.py:{function}", "sweep": {"packing.seed": seeds}, "scene": SMALL}
    return Sweep.from_mapping(mapping, folder)


def run(folder, function, place="out", seeds="1:3", part=(1, 1), say=id):
    return run_sweep(sweep_of(folder, function, seeds), folder / place, part, say=say)


@pytest.mark.parametrize(
    ("name", "text", "same"),
    [
        ("tools/deeper.py", "number = 1  # of another", True),
        ("tools/deeper.py", "number = 2", False),
        ("packing.json", REFERENCE.read_text().replace("{", "{ ", 1), False),
        ("signal.txt", "0 0\n0.5 2e-3\n1 0\n", False),
        (None, "0.9", False),
    ],
)
def test_a_row_is_known_by_all_that_its_number_depends_on(folder, monkeypatch, name, text, same):
    """Modules that the task imports of its own but for their comments, files of the scene by their content, version."""
    (folder / "packing.json").write_text(REFERENCE.read_text())
    (folder / "signal.txt").write_text("0 0\n0.5 1e-3\n1 0\n")
    scene = {"packing": {"file": "packing.json"}, "law": {"kn": 2e5}, "load": {"fy": 3.0}, "ramp": SMALL["ramp"]}
    scene |= {"perturb": {"fx": 0.0, "time": 1.0, "signal": "signal.txt"}, "friction": {"v0": 1e-6, "v_ss": "10 v0"}}

    def known():
        triggering = Sweep.from_mapping({"task": "triggering", "scene": scene}, folder)
        return [point.key for sweep in (sweep_of(folder, "imports"), triggering) for point in sweep.points]

    before = known()
    assert known() == before
    if name is None:
        monkeypatch.setattr(sweep_plan, "version", lambda _: text)
    else:
        (folder / name).write_text(text)
    assert (known() == before) is same


def test_a_row_of_a_function_of_a_package_is_known_by_the_modules_of_the_package(tmp_path, monkeypatch):
    package, found = tmp_path / "grains_of_mine", []
    package.mkdir()
    monkeypatch.syspath_prepend(tmp_path)
    (package / "__init__.py").touch()
    (package / "tasks.py").write_text("import beside\nfrom . import numbers\ndef task(scene): ...")
    (package / "numbers.py").write_text("one = 1")
    beside = tmp_path / "beside.py"
    for path, text in ((beside, "two = 2"), (beside, "2"), (package / "numbers.py", "")):
        path.write_text(text)
        user_function.cache_clear()
        found.append(Sweep.from_mapping({"task": "grains_of_mine.tasks:task", "scene": SMALL}).points[0].key)
    assert found[0] == found[1] != found[2]


def test_failures_are_tried_again_but_for_scenes_without_equilibrium(folder):
    rows = run(folder, "passing")
    assert rows[0]["says"] == "it flows"
    assert rows[1]["says"] == "scene 1: passing failed with OSError: the disk is full (ask.py, line 17)"
    again = run(folder, "passing")
    assert (folder / "calls").read_text().split() == ["1", "2", "3", "2"]
    assert [row["result"].get("seed") for row in again] == [None, 2, 3]
    run(folder, "passing")
    assert len((folder / "calls").read_text().split()) == 4


def test_rows_of_a_function_hold_its_numbers_or_say_why_not(folder):
    (first,) = run(folder, "contacts", "contacts", "1:1")
    rest = settle(Scene.from_mapping(SMALL | {"packing": SMALL["packing"] | {"seed": 1}})).packing
    assert first["result"] == {"contacts": len(rest.contacts), "of": {"x": rest.position[:2, 0].tolist()}}
    exits = "scene 0: ends failed with SystemExit:  (ask.py, line 22)"
    for function, says in (("ends", exits), ("seed_of", "returned 1: ")):
        first, second = run(folder, function, function, "1:2")
        assert says in first["says"]
        assert (second["says"] is None) is (function == "ends")


def test_merge_keeps_the_rows_of_its_target_and_reads_parts_that_are_written(folder, monkeypatch):
    """A target that has more than the parts, as a row that was computed since, loses none; another sweep is refused.
    What is no number is the same result again. The keys are those that the sweep had."""
    for function in ("ends", "nothing"):
        one, two, whole = (folder / function / name for name in ("part1", "part2", "whole"))
        for k, part in enumerate((one, two), 1):
            run(folder, function, part, part=(k, 2))
        half = (one / "results.jsonl").read_text() + '{"key": "0123'
        (one / "results.jsonl").write_text(half)
        assert len(merge([one, two], whole, id)[1]) == 3
        before = (whole / "results.jsonl").read_text()
        merge([one], whole, id)
        merge([one, two, whole], whole, id)
        assert ((whole / "results.jsonl").read_text(), (one / "results.jsonl").read_text()) == (before, half)
        assert len((whole / "results.csv").read_text().splitlines()) == 4
    run(folder, "ends", "other", "7:9")
    files = {path: path.read_bytes() for path in (folder / "other").iterdir()}

    def refused(says, target="new"):
        with pytest.raises(SceneError, match=says):
            merge([one, two], folder / target, id)

    refused(r"other is of another sweep than .*part1.* \(task differs\)", "other")
    assert {path: path.read_bytes() for path in (folder / "other").iterdir()} == files
    monkeypatch.setattr(import_module("faultgouge.studies.sweep.run_sweep"), "version", lambda _: "0.9")
    run(folder, "nothing", two, part=(2, 2))
    refused(r"part2 is of another sweep than .*part1.* \(version differs\)")
    for text in ('{"task": "onset", "sweep": {}, "scene": {}, "shard": [1, 2]}', "no JSON", "3"):
        (one / "sweep.json").write_text(text)
        refused(r"part1 is no folder of a sweep, or of version 1\.0\.0 or before")
    assert not (folder / "new").exists()


def test_a_good_row_goes_before_an_error_and_two_results_are_named(folder):
    for name, change in (("good", {}), ("bad", {"says": "out of memory"}), ("other", {"result": {"seed": 5}})):
        (first, *_), lines = run(folder, "ends", name, "2:3"), folder / name / "results.jsonl"
        row, second = lines.read_text().splitlines()
        lines.write_text(f"{json.dumps(json.loads(row) | change)}\n{second}\n")
    for names in (("good", "bad"), ("bad", "good")):
        rows = merge([folder / name for name in names], folder / "-".join(names), id)[1]
        assert [row["result"] for row in rows] == [{"seed": 2}, {"seed": 3}]
    with pytest.raises(SceneError, match=rf"good/.*jsonl and .*other/.*jsonl have .*seed = 2; key {first['key']}"):
        merge([folder / "good", folder / "other"], folder / "whole", id)
    assert not (folder / "whole" / "results.csv").exists()


def test_rows_of_other_code_stay_and_are_told(folder):
    run(folder, "ends")
    before, said = (folder / "out" / "results.jsonl").read_text(), []
    (folder / "ask.py").write_text(TASK.replace('{"seed": scene.packing.seed}', '{"seed": 2 * scene.packing.seed}'))
    rows = run(folder, "ends", say=said.append)
    assert [row["result"].get("seed") for row in rows] == [None, 4, 6]
    assert said == ["3 rows there are of other scenes, code or versions, and are not in the table"]
    assert (folder / "out" / "results.jsonl").read_text().startswith(before)


@pytest.mark.slow
def test_a_sweep_of_which_all_failed_ends_with_1(folder, faultgouge_here):
    text = 'task = "ask.py:fails"\n' + toml({"sweep": {'"packing.seed"': [1, 2]}}) + toml(SMALL, "scene.")
    (folder / "fails.toml").write_text(text)
    done = faultgouge_here("sweep", "fails.toml", "-o", "out", "--workers", "1", code=1)
    assert "none of the 2 scenes has a result; the first says: scene 0: fails failed with ZeroDivision" in done.stderr
    assert len((folder / "out" / "results.csv").read_text().splitlines()) == 3
    (folder / "fails.toml").write_text(text.replace("fails", "ends"))
    faultgouge_here("sweep", "fails.toml", "-o", "some", "--workers", "1")  # one has failed, and one has not
