"""A sweep on a Dask cluster of this machine, one worker of which is killed on the way; and the same in one process.

pip install distributed
python benchmarks/killed_worker.py [--scenes 1000] [--workers 4]
"""

import argparse
import os
import signal
import tempfile
import threading
import time
from pathlib import Path
from typing import Any

import dask
from distributed import Client, LocalCluster, SpecCluster

from faultgouge.studies.sweep.run_sweep import run_sweep
from faultgouge.studies.sweep.sweep_plan import Sweep
from faultgouge.studies.sweep.tasks import TASKS

SCENE = {
    "packing": {"disks": 30, "top": 5, "width": 6.0},
    "law": {"kn": 2e5},
    "load": {"fy": 3.0},
    "ramp": {"step": 5e-3, "until": 0.025},
}

PATIENT = {
    "distributed.comm.timeouts.connect": "5 minutes",
    "distributed.comm.timeouts.tcp": "5 minutes",
    "distributed.deploy.lost-worker-timeout": "5 minutes",
}
"""Dask's patience, as on the page for clusters: by default half a minute, and a quarter for a worker to start anew."""

Row = dict[str, Any]


def sweep_of(scenes: int) -> Sweep:
    """Onsets of so many packings of 30 disks."""
    return Sweep.from_mapping({"task": "onset", "sweep": {"packing.seed": f"1:{scenes}"}, "scene": SCENE}, TASKS)


def without_times(row: Row) -> str:
    """A row without its times, as text: floats to the last bit."""
    return repr({name: value for name, value in row.items() if "seconds" not in name})


def with_a_killed_worker(sweep: Sweep, folder: Path, workers: int) -> tuple[list[Row], int]:
    """The rows of a sweep on a local cluster, and the process that was killed once a tenth of the rows was there."""
    killed: list[int] = []
    # one thread a worker: LAMMPS does not stand several in a process
    with (
        dask.config.set(PATIENT),
        LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=None) as cluster,
        Client(cluster) as client,
    ):
        killer = threading.Thread(target=_kill_one, args=(cluster, folder, len(sweep.points) // 10, killed))
        killer.start()
        rows = run_sweep(sweep, folder, say=lambda _: None, executor=client.get_executor(pure=False))
        killer.join()
    return rows, killed[0]


def _kill_one(cluster: SpecCluster, folder: Path, after: int, killed: list[int]) -> None:
    """Kill a worker's process, as the system does where memory runs out, once so many rows are stored."""
    stored = folder / "results.jsonl"
    while not stored.exists() or stored.read_bytes().count(b"\n") < after:
        time.sleep(0.02)
    pid = next(iter(cluster.workers.values())).pid
    os.kill(pid, signal.SIGKILL)
    killed.append(pid)


def main() -> None:
    """Print both times, and whether the rows agree."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=int, default=1000)
    parser.add_argument("--workers", type=int, default=4)
    options = parser.parse_args()
    sweep = sweep_of(options.scenes)
    with tempfile.TemporaryDirectory() as name:
        begin = time.perf_counter()
        rows, killed = with_a_killed_worker(sweep, Path(name) / "cluster", options.workers)
        middle = time.perf_counter()
        alone = run_sweep(sweep, Path(name) / "alone", say=lambda _: None, workers=1)
        end = time.perf_counter()
    same = [without_times(row) for row in rows] == [without_times(row) for row in alone]
    print(
        f"{len(rows)} of {options.scenes} scenes with {options.workers} workers, of which process {killed} was killed: "
        f"{middle - begin:.0f} s; in one process: {end - middle:.0f} s; rows are {'' if same else 'NOT '}the same to "
        "the bit"
    )


if __name__ == "__main__":
    main()
