"""Sweeps: which scenes, what is kept, that kills, workers and shards leave the same table, and what is refused."""

import csv
import json
import multiprocessing
import os
import re
import signal
import subprocess
import time
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from reference_layer import BIN, SMALL, on_ranks, toml
from table_rows import rows_of

from faultgouge.pywrap import SceneError, settle
from faultgouge.pywrap.onset import onset_run
from faultgouge.studies.sweep import workers
from faultgouge.studies.sweep.draw import draw_sweep
from faultgouge.studies.sweep.run_sweep import WorkerError, merge, read_results, run_sweep
from faultgouge.studies.sweep.sweep_plan import Sweep, other_packings

SWEEPS = Path(__file__).parents[2] / "scenes" / "sweeps"
AXES = {"packing.seed": "1:4", "law.mu": [1.0, 0.5, -1.0]}
TOML = 'task = "onset"\n' + toml({"sweep": {json.dumps(key): values for key, values in AXES.items()}})
TOML += toml(SMALL, "scene.")


def sweep_of(axes, task="onset", folder=Path(), **changes):
    scene = {section: values | changes.get(section, {}) for section, values in SMALL.items()}
    return Sweep.from_mapping({"task": task, "sweep": axes, "scene": scene}, folder)


def table(folder):
    with (folder / "results.csv").open() as file:
        return list(csv.DictReader(file))


def test_points_are_the_product_and_keys_those_of_scenes():
    """The last key varies fastest."""
    sweep = sweep_of({"packing.seed": "3:4", "load.fy, ramp.until": [[3.0, 0.02], [6.0, 0.04]]})
    assert sweep.names == ["packing.seed", "load.fy", "ramp.until"]
    values = [tuple(p.values.values()) for p in sweep.points]
    assert values == [(3, 3.0, 0.02), (3, 6.0, 0.04), (4, 3.0, 0.02), (4, 6.0, 0.04)]
    assert values == [(p.scene.packing.seed, p.scene.load.fy, p.scene.ramp.until) for p in sweep.points]
    one, other = sweep_of({"packing.seed": [2]}), sweep_of({"law.mu": [0.5, 1.0], "packing.seed": [1, 2]})
    assert one.points[0].key == other.points[3].key  # mu = 1 is the default
    assert one.points[0].key != sweep_of({"packing.seed": [2]}, task="triggering").points[0].key


@pytest.mark.parametrize(
    ("axes", "packing", "shared", "named"),
    [
        ({"law.mu": [0.5, 1.0]}, {}, True, None),
        ({"ramp.until": [0.01, 0.02]}, {}, True, None),
        ({"law.mu": [0.5, 1.0]}, {"settle_friction": True}, False, "law.mu"),
        ({"load.fy": [3.0, 3.001]}, {}, False, "load.fy"),
        ({"law.kn": [1e5, 2e5]}, {}, False, "law.kn"),
        ({"load.fy": [3.0, 3.001]}, {"settle_at": {"fy": 3.0}}, False, None),
        ({"law.kn": [1e5, 2e5]}, {"settle_at": {"fy": 3.0, "kn": 2e5}}, False, None),
        ({"law.kn": [1e5, 2e5]}, {"settle_at": {"fy": 3.0}}, False, "law.kn"),  # settled at each stiffness
    ],
)
def test_what_settles_alike_and_where_a_seed_is_several_packings(axes, packing, shared, named):
    sweep = sweep_of(axes, packing=packing)
    first, second = sweep.points
    assert (first.settling_key == second.settling_key) is shared
    says = other_packings(sweep)
    assert says is None if named is None else says.startswith(f"{named}: settling is chaotic")


def test_an_overburden_that_varies_is_a_load_that_does():
    sweep = Sweep.from_toml(SWEEPS / "depth.toml")
    assert other_packings(sweep) is None  # settled at one load
    sweep = replace(sweep, axes=sweep.axes | {"packing.seed": [1]})
    loads = np.array([point.scene.load.fy for point in sweep.points])
    assert loads / loads[1] == pytest.approx([0.5, 1.0, 2.0], rel=1e-11)


@pytest.mark.parametrize(("mapping", "says"), rows_of("studies/refused_sweeps.txt"))
def test_a_bad_sweep_is_refused_in_a_sentence(tmp_path, mapping, says):
    codes = {"ask": "def three(scene, settled, more): ...", "broken": "def", "ends": "raise SystemExit(0)"}
    for name, code in codes.items():
        (tmp_path / f"{name}.py").write_text(code)
    with pytest.raises(SceneError, match=re.escape(says)):
        Sweep.from_mapping(mapping, tmp_path)


@pytest.mark.slow
def test_rows_are_the_onsets_of_their_scenes_and_share_settled_packings(tmp_path, monkeypatch):
    settled, original = [], workers.settle_bed
    monkeypatch.setattr(workers, "settle_bed", lambda *given: settled.append(given) or original(*given))
    sweep = sweep_of({"packing.seed": [3, 2], "law.mu": [0.5, 1.0]})
    run_sweep(sweep, tmp_path, say=id)
    assert len(settled) == 2
    rows = table(tmp_path)
    assert [row["ends"] for row in rows] == ["until", "until", "onset", "onset"]
    row, scene = rows[2], sweep.points[2].scene
    window = onset_run(scene, 0.5).windows[0]
    # the run extrapolates the path's increments away, and states what that may miss; a row does not
    assert float(row["fx_c"]) == pytest.approx(window.fx_onset, abs=window.error + float(row["error"]))
    assert row["kind"] == window.kind == "coalescence"
    assert 1 <= float(row["participation"]) <= 30
    assert row["contacts"] == str(len(settle(scene).packing.contacts))
    # the page names each column, and no other
    page = (Path(__file__).parents[2] / "docs" / "howto_sweep.md").read_text().partition("The table of the task")[2]
    lines = [line.split(" | ")[0] for line in page.splitlines() if line.startswith("| `")]
    assert {name for line in lines for name in re.findall(r"`(\w+)`", line)} == {*row} - {"packing.seed", "law.mu"}


SEEDS = "def seed_of(scene): return {'seed': scene.packing.seed}\n"


def test_a_cut_line_is_computed_again_and_a_longer_sweep_goes_on(tmp_path):
    (tmp_path / "ask.py").write_text(SEEDS)
    sweeps = [sweep_of({"packing.seed": seeds}, "ask.py:seed_of", tmp_path) for seeds in ("1:1", "1:2")]
    run_sweep(sweeps[0], tmp_path, say=id)
    lines, said = tmp_path / "results.jsonl", []
    first = lines.read_text()
    lines.write_text(first + first[:40])
    run_sweep(sweeps[1], tmp_path, say=said.append, workers=2)
    assert said == [f"1 of 2 points are in {lines} already"]
    assert lines.read_text().startswith(first)
    assert [row["values"]["packing.seed"] for row in read_results(lines).values()] == [1, 2]  # nothing of the cut line
    of_list = first.strip().replace('"key": "', '"key": ["').replace('", "ver', '"], "ver')
    for strange in ("no result", '{"key": "0"}', of_list):
        lines.write_text(f"{first}{strange}\n")
        with pytest.raises(SceneError, match="line 2 is no result of a sweep: take it out"):
            read_results(lines)


def test_failures_are_rows_and_merge_tells_what_is_missing(tmp_path):
    (failed,) = run_sweep(sweep_of({"packing.width": [1.0, 6.0]}), tmp_path / "a", (1, 2), say=id)
    assert "width" in failed["says"]
    with pytest.raises(SceneError, match="is no folder of a sweep"):
        merge([tmp_path / "a", tmp_path], tmp_path / "c", id)
    said = []
    merge([tmp_path / "a"], tmp_path / "c", said.append)
    assert said[0].startswith("1 of 2 scenes")
    assert [row["says"] for row in table(tmp_path / "c")] == [failed["says"]]


def test_the_picture_has_a_curve_for_each_value(tmp_path, monkeypatch):
    drawn, known = [], {mu: np.random.default_rng(1).uniform(0, 0.04, 20) for mu in (0.5, 0.8)}
    rows = [{"values": {}, "result": {"ramps": 3}}]
    for mu, seed in product(known, range(20)):
        fx = float(known[mu][seed])
        result = {"ends": "onset", "fx_c": fx} if fx < 0.03 else {"ends": "until", "reach": 0.03}
        rows.append({"values": {"law.mu": mu, "packing.seed": seed}, "result": result})
    monkeypatch.setattr("faultgouge.studies.sweep.draw.save", lambda figure, stem: drawn.append(figure))
    assert draw_sweep(rows, tmp_path, print).endswith("results.png")
    (axes,) = drawn[0].axes
    assert [text.get_text() for text in axes.get_legend().get_texts()] == [f"law.mu = {mu}" for mu in known]
    for found, curve in zip(known.values(), axes.lines, strict=True):
        fx, level = curve.get_data()
        np.testing.assert_allclose(np.sort(found[found < 0.03]), fx[1:-1])
        assert level[-1] == pytest.approx(np.mean(found < 0.03))


@pytest.mark.ranks
@pytest.mark.long
def test_one_table_after_kills_on_workers_and_in_shards(faultgouge, tmp_path):
    """Five kills at random moments with one process and with two workers, and three shards: one table to the byte."""
    (tmp_path / "sweep.toml").write_text(TOML)
    faultgouge("sweep", "sweep.toml", "-o", "whole")
    expected = (tmp_path / "whole" / "results.csv").read_bytes()
    assert (tmp_path / "whole" / "results.png").stat().st_size > 10_000
    random = np.random.default_rng(5)
    for name, ranks in (("one", 1), ("two", 3)):
        command = [*on_ranks(ranks), BIN / "faultgouge", "sweep", "sweep.toml", "-o", name]
        lines = tmp_path / name / "results.jsonl"
        lines.parent.mkdir()
        lines.touch()
        for _ in range(5):
            before = lines.read_text()
            process = subprocess.Popen(command, cwd=tmp_path, start_new_session=True, stderr=subprocess.DEVNULL)
            deadline = time.monotonic() + 120
            while process.poll() is None and time.monotonic() < deadline and lines.read_text() == before:
                time.sleep(0.05)
            time.sleep(random.uniform(0, 0.5))
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()
        faultgouge("sweep", "sweep.toml", "-o", name, ranks=ranks)
        assert (tmp_path / name / "results.csv").read_bytes() == expected
    for k in (3, 1, 2):
        faultgouge("sweep", "sweep.toml", "-o", f"part{k}", "--shard", f"{k}/3")
    merge([tmp_path / f"part{k}" for k in (1, 2, 3)], tmp_path / "merged", id)
    assert (tmp_path / "merged" / "results.csv").read_bytes() == expected
    ends = [row["ends"] for row in table(tmp_path / "whole")]
    assert len(ends) == 12
    assert {"onset", "until"} <= set(ends)


@pytest.mark.long
def test_trigger_and_eruptions_as_tasks(tmp_path):
    """Rows of both studies, which come to the sections of their own in the swept scene."""
    more = {"friction": {"v0": 1e-6, "v_ss": "10 v0"}, "trigger": {"distance": [0.1], "omega": [5.0], "runs": 0}}
    scene, found = SMALL | more | {"eruptions": {"load": [0.02], "time": 1.0}}, {}
    for task in ("trigger", "eruptions"):
        wanted = Sweep.from_mapping({"task": task, "sweep": {"packing.seed": [2]}, "scene": scene})
        (row,) = run_sweep(wanted, tmp_path / task, say=id)
        found[task] = row["result"]
    assert found["trigger"]["map"][0]["predicted"] > 0
    assert found["eruptions"]["runs"][0]["fx"] == 0.02


def stripped(rows):
    """Rows without their times."""
    return [{name: value for name, value in row.items() if "seconds" not in name} for row in rows]


def killing(kill, after):
    """A progress of rows that once kills a worker after some of them, as the system does where memory runs out."""
    seen = []

    def progress(rows, count):
        for row in rows:
            yield row
            seen.append(row)
            if len(seen) == after:
                kill()

    return progress


@pytest.mark.long
def test_a_killed_worker_takes_nothing_with_it(tmp_path):
    sweep, said = sweep_of({"packing.seed": "1:3", "law.mu": [1.0, 0.5, -1.0]}), []
    alone = run_sweep(sweep, tmp_path / "alone", say=id)
    progress = killing(lambda: multiprocessing.active_children()[0].kill(), 1)
    found = run_sweep(sweep, tmp_path / "two", say=said.append, progress=progress, workers=2)
    assert stripped(found) == stripped(alone)
    assert "a worker was killed" in said[0]


@pytest.mark.slow
def test_points_that_kill_every_worker_are_not_tried_for_ever(tmp_path):
    (tmp_path / "ask.py").write_text("import os\ndef dies(scene): os.kill(os.getpid(), 9)\n")
    with pytest.raises(WorkerError, match="fewer --workers"):
        run_sweep(sweep_of({"packing.seed": "1:2"}, "ask.py:dies", tmp_path), tmp_path, say=id, workers=2)


TIMES = ("comm.timeouts.connect", "comm.timeouts.tcp", "deploy.lost-worker-timeout")
PATIENCE = {f"distributed.{name}": "5 minutes" for name in TIMES}
"""Dask's patience, as on the page for clusters: by default half a minute, and a quarter for a worker to start anew."""


@pytest.mark.long
def test_a_distributed_engine_whose_worker_is_killed_loses_nothing(tmp_path):
    """Dask's local cluster, as docs/howto_cluster.md has it."""
    distributed, dask = pytest.importorskip("distributed"), pytest.importorskip("dask")
    sweep = sweep_of({"packing.seed": "1:40"})
    alone = run_sweep(sweep, tmp_path / "alone", say=id, workers=1)
    # one thread a worker: LAMMPS does not stand several in a process
    with (
        dask.config.set(PATIENCE),
        distributed.LocalCluster(n_workers=4, threads_per_worker=1, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):
        progress = killing(lambda: os.kill(next(iter(cluster.workers.values())).pid, signal.SIGKILL), 4)
        executor = client.get_executor(pure=False)
        found = run_sweep(sweep, tmp_path / "cluster", say=id, progress=progress, executor=executor)
    assert [row["key"] for row in found] == [point.key for point in sweep.points]
    assert stripped(found) == stripped(alone)
