"""What a second processor would change in a run: ranks of MPI in LAMMPS, and threads in BLAS."""

import pickle
import subprocess
import sys
from contextlib import ExitStack
from pathlib import Path

import numpy as np
from mpi4py import MPI

from ...analysis import Packing, dynamical_matrix
from ...analysis.arrays import Floats
from .cost_comparison import FEW_TURNS, TURNS, Part, cost_of, same_motion
from .switches import UndampedRun

SOLVED_EQUATIONS = 400
"""Equations of the linear solve that threads are tried on, at the most."""


def ranks(run: UndampedRun, steps: int, folder: Path, timed: bool) -> Part:
    """Compare a run on one rank with the run on two ranks, in a separate process, which takes seconds to begin."""
    size = MPI.COMM_WORLD.size
    reason = f"{size} rank{'s' * (size > 1)}"
    adds = ("messages between ranks",)
    same = "positions and velocities"
    if not timed:
        return Part(
            "MPI", size > 1, reason if size > 1 else f"{reason}: nothing is sent", adds, None, "not tried", None
        )
    program = Path(sys.executable).parent / "mpiexec"
    if size > 1 or not program.exists():
        return Part("MPI", size > 1, f"{reason}: not measured here", adds, None, same, None)
    job = folder / "run.pickle"
    job.write_bytes(pickle.dumps((run, steps)))
    code = "import sys; from faultgouge.assessment.explain.processors import time_ranks; time_ranks(sys.argv[1])"
    # each on its own core: ranks that share one wait for each other's turns
    command = [str(program), "-bind-to", "core", "-n", "2", sys.executable, "-c", code, str(job)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        return Part("MPI", False, f"{reason}: two ranks did not run here", adds, None, same, None)
    cost, identical = pickle.loads((folder / "run.pickle.times").read_bytes())
    return Part("MPI", False, f"{reason}: nothing is sent", adds, cost, same, identical)


def time_ranks(job: str) -> None:
    """The work of each of two ranks: the run of both together, and in turns the same on the first alone.

    Parameters
    ----------
    job : str
        File with a pickled pair of a `UndampedRun` and the steps of a turn; the result goes beside it.
    """
    world = MPI.COMM_WORLD
    run, steps = pickle.loads(Path(job).read_bytes())
    with ExitStack() as both:
        _, together = both.enter_context(run.start(world))
        alone = both.enter_context(run.start(MPI.COMM_SELF))[1] if world.rank == 0 else None

        def on_one() -> None:
            if alone is not None:
                alone.advance(steps)
            world.Barrier()

        cost = cost_of("step", on_one, lambda: together.advance(steps), TURNS, steps, parallel=True)
        motion = together.advance(1)
        if alone is not None:
            result = cost, same_motion(alone.advance(1), motion)
            Path(f"{job}.times").write_bytes(pickle.dumps(result))


def threads(packing: Packing, timed: bool) -> Part:
    """A dense solve, such as eigenvalues are made of, with one thread and with two."""
    from threadpoolctl import threadpool_info, threadpool_limits

    here = max((pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"), default=1)
    matrix = dynamical_matrix(packing)[0][:SOLVED_EQUATIONS, :SOLVED_EQUATIONS].toarray()
    force = np.ones(len(matrix))
    solutions: dict[int, Floats] = {}

    def solve(threads: int) -> None:
        with threadpool_limits(threads, "blas"):
            solutions[threads] = np.linalg.solve(matrix, force)

    # two threads that wait for one core take a third of a second
    per = f"dense solve of {len(matrix)} equations"
    cost = cost_of(per, lambda: solve(1), lambda: solve(2), FEW_TURNS if timed else 0, parallel=True)
    reason = f"{here} thread{'s' * (here > 1)} in BLAS, by OPENBLAS_NUM_THREADS; the plugin has none"
    identical = np.array_equal(solutions[1], solutions[2])
    same = "the solution" if identical else "the solution differs in its last digits"
    return Part("threads", here > 1, reason, ("a second thread",), cost, same, identical)
