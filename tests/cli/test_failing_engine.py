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
from faultgouge.pywrap import Engine, EngineError

wanted, rank = int(sys.argv[1]), int(sys.argv[2])
displaced, calls = Engine.displaced, 0

def failing(self, *arguments):
    global calls
    calls += 1
    if calls == wanted and rank in (-1, MPI.COMM_WORLD.rank):
        raise EngineError(f"LAMMPS stopped: it was told to at call {wanted}.")
    return displaced(self, *arguments)

Engine.displaced = failing
sys.argv = ["faultgouge", "onset", "scene.toml"]
main()
"""

EVERY_CALL = """
import sys
from mpi4py import MPI
from faultgouge.commands import program
from faultgouge.pywrap import Engine, EngineError

displaced, calls, wanted = Engine.displaced, 0, 0

def failing(self, *arguments):
    global calls
    calls += 1
    if calls == wanted:
        raise EngineError("as it was told to")
    return displaced(self, *arguments)

def search():
    global calls
    calls = 0
    program()(["onset", "scene.toml", *sys.argv[2:]], standalone_mode=False)

Engine.displaced = failing
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


@pytest.fixture
def scene(tmp_path):
    (tmp_path / "scene.toml").write_text(toml(SCENE))
    return tmp_path


@pytest.fixture(scope="module")
def settled(faultgouge_in, tmp_path_factory):
    """A folder with the scene of the packing that is settled already."""
    folder = tmp_path_factory.mktemp("settled")
    (folder / "scene.toml").write_text(toml(SCENE))
    faultgouge_in(folder, "settle", "scene.toml", "-o", "settled.h5")
    (folder / "scene.toml").write_text(toml(SCENE | {"packing": {"file": "settled.h5"}}))
    return folder


@pytest.mark.ranks
@pytest.mark.parametrize(
    ("ranks", "rank"), [(1, -1), (2, 1), *(pytest.param(2, k, marks=pytest.mark.long) for k in (-1, 0))]
)
@pytest.mark.parametrize("call", [1, pytest.param(30, marks=pytest.mark.long)])
@pytest.mark.slow
def test_its_sentence_reaches_the_command(scene, ranks, rank, call):
    command = [sys.executable, "-c", FAILING, str(call), str(rank)]
    if ranks > 1:
        command = [BIN / "mpiexec", "-n", str(ranks), *command]
    done = subprocess.run(command, cwd=scene, capture_output=True, text=True, timeout=300)
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
    command = [BIN / "mpiexec", "-n", str(ranks), sys.executable, "-c", EVERY_CALL, str(stride), *search]
    done = subprocess.run(command, cwd=settled, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr[-500:]
    assert int(done.stdout.splitlines()[-1]) > 20
