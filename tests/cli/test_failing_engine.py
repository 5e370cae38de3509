"""An engine that fails in the middle of a search: its sentence and exit code 1, at whatever call it fails."""

import subprocess
import sys

import pytest
from reference_layer import BIN, toml

SCENE = {"packing": {"disks": 16, "seed": 10}, "law": {"kn": 2e5}, "load": {"fy": 3.0}}
SCENE["ramp"] = {"step": 0.11, "until": 0.11}

FAILING = """
import sys
from mpi4py import MPI
from faultgouge.cli import main
from faultgouge.commands import program
from faultgouge.pywrap import Engine, EngineError

displaced, calls, wanted, failing_rank = Engine.displaced, 0, 0, -1

def failing(self, *arguments):
    global calls
    calls += 1
    if calls == wanted and failing_rank in (-1, MPI.COMM_WORLD.rank):
        raise EngineError(f"LAMMPS stopped: it was told to at call {wanted}.")
    return displaced(self, *arguments)

Engine.displaced = failing
"""

ONCE = """
wanted, failing_rank = int(sys.argv[1]), int(sys.argv[2])
sys.argv = ["faultgouge", "onset", "scene.toml"]
main()
"""

EVERY_CALL = """
def search():
    global calls
    calls = 0
    program()(["onset", "scene.toml", *sys.argv[2:]], standalone_mode=False)

search()
total = calls
for wanted in range(1, total + 1, int(sys.argv[1])):
    try:
        search()
    except EngineError:
        continue
    sys.exit(f"no error at call {wanted} of {total}")
if MPI.COMM_WORLD.rank == 0:
    print(total)
"""


@pytest.fixture(scope="module")
def settled(faultgouge_in, tmp_path_factory):
    """A folder with the scene of the packing that is settled already."""
    folder = tmp_path_factory.mktemp("settled")
    (folder / "scene.toml").write_text(toml(SCENE))
    faultgouge_in(folder, "settle", "scene.toml", "-o", "settled.h5")
    (folder / "scene.toml").write_text(toml(SCENE | {"packing": {"file": "settled.h5"}}))
    return folder


def with_failing_engine(folder, ranks, script, *arguments):
    launcher = [BIN / "mpiexec", "-n", str(ranks)] if ranks > 1 else []
    command = [*launcher, sys.executable, "-c", FAILING + script, *map(str, arguments)]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=300)


@pytest.mark.ranks
@pytest.mark.parametrize(("ranks", "rank", "call"), [(1, -1, 1), (2, 1, 1), (2, -1, 30), (2, 0, 30)])
@pytest.mark.slow
def test_its_sentence_reaches_the_command(settled, ranks, rank, call):
    done = with_failing_engine(settled, ranks, ONCE, call, rank)
    assert done.returncode == 1
    says = [line for line in done.stderr.splitlines() if line.startswith("Error:")]
    assert says == [f"Error: LAMMPS stopped: it was told to at call {call}."]


@pytest.mark.ranks
@pytest.mark.parametrize("search", [[], ["--modes", "0:39"]], ids=["all_windows", "slices"])
@pytest.mark.parametrize(
    ("ranks", "stride"), [(1, 6), *(pytest.param(n, k, marks=pytest.mark.long) for n, k in ((1, 1), (2, 6)))]
)
@pytest.mark.slow
def test_no_call_is_taken_for_a_missing_onset(settled, ranks, stride, search):
    """At every call on one rank; two ranks call the same, and every sixth call shows that both hear of it."""
    done = with_failing_engine(settled, ranks, EVERY_CALL, stride, *search)
    assert done.returncode == 0, done.stderr[-500:]
    assert int(done.stdout.splitlines()[-1]) > 20
