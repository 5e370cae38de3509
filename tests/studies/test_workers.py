"""Whoever computes the points of a sweep, the rows are the same; a worker that is killed takes nothing with it."""

import multiprocessing
import signal
from concurrent.futures import ThreadPoolExecutor

import pytest
from reference_layer import SMALL

from faultgouge.studies.hands import Processes, hands
from faultgouge.studies.sweep.compute import run_sweep
from faultgouge.studies.sweep.points import Sweep
from faultgouge.studies.sweep.tasks import TASKS
from faultgouge.studies.sweep.workers import WorkerError, computed

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def sweep():
    axes = {"packing.seed": "1:3", "law.mu": [1.0, 0.5, -1.0]}
    return Sweep.from_mapping({"task": "onset", "sweep": axes, "scene": SMALL}, TASKS)


@pytest.fixture(scope="module")
def rows(sweep):
    return sorted(stripped(row) for row in computed(None, sweep.task, sweep.points))


def stripped(row):
    """A row without its times, as text."""
    return str({name: value for name, value in row.items() if "seconds" not in name})


def test_processes_and_an_executor_of_somebody_else_give_the_rows_of_one(sweep, rows, tmp_path):
    found = run_sweep(sweep, tmp_path / "processes", say=id, workers=2)
    assert [row["key"] for row in found] == [point.key for point in sweep.points]
    with ThreadPoolExecutor(1) as executor:
        others = run_sweep(sweep, tmp_path / "executor", say=id, executor=executor)
    for each in (found, others):
        assert sorted(stripped(row) for row in each) == rows


@pytest.mark.long
def test_a_killed_worker_takes_nothing_with_it(sweep, rows):
    found = []
    with hands(2) as pool:
        for row in computed(pool, sweep.task, sweep.points):
            if not found:
                one, _ = multiprocessing.active_children()
                one.kill()
            found.append(stripped(row))
    assert sorted(found) == rows


class Deadly(Processes):
    """Processes of which each dies of the first point that it takes."""

    def submit(self, fn, /, *args, **kwargs):
        return super().submit(signal.raise_signal, signal.SIGKILL)


def test_a_point_that_kills_every_worker_is_not_tried_for_ever(sweep):
    pool = Deadly(2)
    with pytest.raises(WorkerError, match="fewer --workers"):
        list(computed(pool, sweep.task, sweep.points))
    pool.shutdown()


@pytest.mark.long
def test_a_distributed_engine_whose_worker_is_killed_loses_nothing(tmp_path):
    """Dask's local cluster, as docs/howto_cluster.md has it."""
    pytest.importorskip("distributed")
    from benchmarks.killed_worker import sweep_of, with_a_killed_worker, without_times

    sweep = sweep_of(40)
    alone = run_sweep(sweep, tmp_path / "alone", say=id, workers=1)
    found, killed = with_a_killed_worker(sweep, tmp_path / "cluster", 4)
    assert killed > 0
    assert [row["key"] for row in found] == [point.key for point in sweep.points]
    assert [without_times(row) for row in found] == [without_times(row) for row in alone]
