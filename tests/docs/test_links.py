"""Links between pages lead somewhere, lines fit a screen, commands print what a page shows, and notebooks run."""

import json
import re
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest
from reference_layer import BIN, REFERENCE, SMALL, toml

from docs.run_page import commands, files, run
from faultgouge.pywrap import Scene
from faultgouge.pywrap.scenes.validation import read_toml
from faultgouge.studies.sweep.sweep_plan import Sweep

ROOT = Path(__file__).parents[2]
PAGES = [*sorted(ROOT.glob("*.md")), *sorted((ROOT / "docs").glob("*.md"))]
PROSE = [*PAGES, *sorted((ROOT / "docs").glob("*/*.md")), *sorted((ROOT / "research").glob("*/*.md"))]
NOTEBOOKS = ROOT / "docs" / "notebooks"
NAMES = ("exceptional_point", "own_packing")
EXPLANATIONS = ("physics", "numerics", "complex_pairs", "arithmetic", "dissipation")
NO_PROSE = re.compile(r"^(```|\$\$).*?^(```|\$\$)$|^(\||    ).*?$", re.MULTILINE | re.DOTALL)
"""Blocks of code and formulas, and rows of tables."""


def anchors(page):
    """The headings of a page, and of the page that it includes, as links name them."""
    text = page.read_text()
    included = re.match(r"```{include} (\S+)", text)
    if included:
        return anchors(page.parent / included[1])
    headings = re.findall(r"^#+ (.*)$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def test_extras_of_the_pages_exist():
    """An extra that a page names is one of the package, and the page about the installation has them all."""
    extras = read_toml(ROOT / "pyproject.toml", "project")["project"]["optional-dependencies"].keys()
    install = (ROOT / "docs" / "install.md").read_text()
    assert set(re.findall(r"^\| `(\w+)` \|", install, re.MULTILINE)) == extras
    named = [found for page in PAGES if page.name != "CHANGELOG.md"
             for found in re.findall(r"(?:'\.|faultgouge|\.whl)\[([\w,]+)\]'", page.read_text())]  # fmt: skip
    assert len(named) >= 3
    assert {each for found in named for each in found.split(",")} <= extras


def lost_links(page, text):
    """Links of a page that lead nowhere; and of an included one those to pages that are not built."""
    for link, anchor in re.findall(r"\]\((?!https?:)([^)#\s]*)(?:#([^)\s]*))?\)", text):
        target = page.parent / link if link else page
        if not target.exists() or (anchor and target.suffix == ".md" and anchor not in anchors(target)):
            yield f"{link}#{anchor}"
    included = re.match(r"```{include} (\S+)", text)
    if included and page.is_relative_to(ROOT / "docs"):
        origin = (page.parent / included[1]).resolve()
        for link in re.findall(r"\]\((?!https?:)([^)#\s]+\.md)", origin.read_text()):
            beside = "/" not in link and (page.parent / link).exists()
            if not beside and not (origin.parent / link).resolve().is_relative_to(ROOT / "docs"):
                yield link


def test_links_lead_somewhere_and_prose_fits_a_screen():
    """In one pass over all pages."""
    wrong = {}
    for page in PROSE:
        text = page.read_text()
        long = [line for line in NO_PROSE.sub("", text).splitlines() if len(line) > 120]
        if found := [*lost_links(page, text), *long]:
            wrong[str(page.relative_to(ROOT))] = found
    assert wrong == {}


def test_explanations_are_two_screens_with_a_picture_before_any_number():
    assert (ROOT / "README.md").read_text().count("\n") <= 195  # three screens, with the table of other packages
    for page in EXPLANATIONS:
        text = (ROOT / "docs" / f"{page}.md").read_text()
        assert text.count("\n") <= 100, page
        assert re.findall(r"\d\.\d|10\^|\b\d\d+", text[: text.index("![")]) == [], page


def with_blocks(language):
    """Pages with blocks of a language; two ranks that share their cores with others take ten times as long."""
    for path in PROSE:
        text = path.read_text()
        if re.search(rf"^```{language}\n(?!# [\w.]+\n)", text, re.MULTILINE):
            yield pytest.param(path, id=path.name, marks=[pytest.mark.ranks] * ("\n$ mpiexec" in text))


@pytest.mark.long
@pytest.mark.parametrize("path", list(with_blocks("console")))
def test_a_page_shows_what_its_commands_print(tmp_path, path):
    assert list(commands(path))
    assert run(path, tmp_path) == []
    shown = re.findall(r"\]\((pictures/tutorial/[\w.]+)\)", path.read_text())
    assert all((path.parent / picture).exists() for picture in shown)
    assert all((tmp_path / Path(picture).name).stat().st_size > 10_000 for picture in shown)


@pytest.mark.parametrize("path", list(with_blocks("toml")))
def test_scenes_and_sweeps_of_a_page_are_read(tmp_path, path):
    base = {"packing": {}, "law": {"kn": 2e5}, "load": {"fy": 3.0}}
    (tmp_path / "packing.json").write_text(REFERENCE.read_text())
    for name, block in files(path).items():  # the function of a task
        (tmp_path / name).write_text(block)
    for text in re.findall(r"^```toml\n(.*?)^```", path.read_text(), re.MULTILINE | re.DOTALL):
        (tmp_path / "block.toml").write_text(text)
        if "[sweep]" in text:
            points = Sweep.from_toml(tmp_path / "block.toml").points
            assert [point.says for point in points if point.scene is None] == []
        elif "[packing]" in text:
            Scene.from_toml(tmp_path / "block.toml")
        else:
            Scene.from_mapping(base | read_toml(tmp_path / "block.toml", "scene"))


@pytest.mark.long
@pytest.mark.parametrize("path", list(with_blocks("python")))
def test_blocks_of_python_run_one_after_the_other(faultgouge, tmp_path, path):
    """In a folder with the run of a scene that erupts, whose files have the names that pages give them."""
    text = path.read_text()
    for name, block in files(path).items():
        (tmp_path / name).write_text(block)
    if "scene.toml" not in files(path):
        (tmp_path / "scene.toml").write_text(toml(SMALL))
    faultgouge("ramp", "scene.toml", "-o", "run.h5")
    if 'RunFile("drive.h5")' in text:
        faultgouge("drive", ROOT / "scenes" / "drive.toml", "-o", "drive.h5")
    script = re.findall(r"^```python\n(?!# [\w.]+\n)(.*?)^```", text, re.MULTILINE | re.DOTALL)
    (tmp_path / "blocks.py").write_text("\n".join(script))
    done = subprocess.run([sys.executable, "blocks.py"], cwd=tmp_path, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr


@pytest.mark.slow
def test_the_readme_runs_in_an_empty_folder(tmp_path, faultgouge_here, monkeypatch):
    readme = (ROOT / "README.md").read_text()
    monkeypatch.chdir(tmp_path)
    faultgouge_here("examples", "pour")
    verdict = re.search(r"^\$ faultgouge stability pour.in\n(.*?)^```$", readme, re.MULTILINE | re.DOTALL)[1]
    assert verdict.startswith("stable: every motion decays")
    # on another machine the spheres come to rest at other places
    printed = faultgouge_here("stability", "pour.in").stdout
    assert re.sub(r"[\d.e-]+", "1", printed) == re.sub(r"[\d.e-]+", "1", verdict)
    scripts = {name: text for name, text in files(ROOT / "README.md").items() if name.endswith(".py")}
    assert list(scripts) == ["ramp.py"]
    (tmp_path / "ramp.py").write_text(scripts["ramp.py"])
    done = subprocess.run([sys.executable, "ramp.py"], cwd=tmp_path, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    assert "F_x = 0.016 " in done.stdout


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted({path.name for path in (ROOT / "scenes" / "examples").iterdir()} - {"pour.in"}))
def test_examples_run(tmp_path, faultgouge_here, monkeypatch, name):
    """Each example of the shelf, by the command that it names; that of the README runs there."""
    monkeypatch.chdir(tmp_path)
    *_, said = faultgouge_here("examples", name).stdout.splitlines()
    assert (tmp_path / name).exists()
    for command in said.removeprefix("next: ").split(" && "):
        words = command.split()
        if words[0] == "faultgouge":
            words += ["--workers", "1"] if words[1] == "sweep" else []
            faultgouge_here(*words[1:])
        else:
            done = subprocess.run([sys.executable, *words[1:]], capture_output=True, text=True, timeout=100)
            assert done.returncode == 0, done.stderr


def test_no_output_is_stored():
    nbformat = pytest.importorskip("nbformat")
    assert sorted(path.stem for path in NOTEBOOKS.glob("*.ipynb")) == sorted(NAMES)
    cells = [cell for name in NAMES for cell in nbformat.read(NOTEBOOKS / f"{name}.ipynb", 4).cells]
    assert [cell for cell in cells if cell.get("outputs") or cell.get("execution_count")] == []


def number(text, before):
    return float(re.search(re.escape(before) + r" (\d[-+.\de]*)", text)[1])


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "pictures", "layer"), [("exceptional_point", 7, "a hundred disks"), ("own_packing", 3, "own packing")]
)
def test_notebooks_run_and_find_the_onset_of_the_command(faultgouge, tmp_path, name, pictures, layer):
    """A cell that ends with a figure shows it. Paths with other increments find the same onset, within its error."""
    nbformat, nbclient = map(pytest.importorskip, ("nbformat", "nbclient"))
    pytest.importorskip("ipykernel")
    notebook = nbformat.read(NOTEBOOKS / f"{name}.ipynb", 4)
    nbclient.NotebookClient(notebook, timeout=300).execute()
    outputs = [each for cell in notebook.cells for each in cell.get("outputs", [])]
    text = "".join(each["text"] for each in outputs if each.output_type == "stream" and each.name == "stdout")
    assert sum("image/png" in each.get("data", {}) for each in outputs) == pictures
    if name == "own_packing":
        page = (ROOT / "docs" / "howto_own_packing.md").read_text()
        deck, scene = re.findall(r"```\n(.*?)```", page, re.DOTALL)
        (tmp_path / "pour.in").write_text(deck)
        subprocess.run([BIN / "lmp", "-in", "pour.in"], cwd=tmp_path, capture_output=True, check=True)
        [relaxing] = re.findall(r"^    faultgouge (import .*)$", page, re.MULTILINE)
        faultgouge(*relaxing.split())
    else:
        # beside the root stands a term that is proportional to the distance: a hundredth of the load at the most
        assert number(text, "exponent") == pytest.approx(0.5, abs=0.01)
        seed = {"packing": {"seed": 1}, "law": {"kn": 2e5}, "load": {"fy": 3.0}}
        scene = toml(seed | {"ramp": {"step": 1e-3, "until": 0.02}})
    (tmp_path / "scene.toml").write_text(scene)
    found = json.loads(faultgouge("onset", "scene.toml", "--json").stdout)
    assert number(text, f"{layer}: F_x^c =") == pytest.approx(found["fx_c"], abs=found["error"] + 5e-12)


@pytest.mark.parametrize(
    ("page", "package"),
    [
        ("analysis", "faultgouge.analysis"),
        ("windows", "faultgouge.analysis.windows"),
        ("pywrap", "faultgouge.pywrap"),
        ("formats", "faultgouge.analysis.files.formats"),
        ("figures", "faultgouge.figures"),
    ],
)
def test_the_api_pages_list_the_public_names_and_no_others(page, package):
    text = (ROOT / "docs" / "api" / f"{page}.md").read_text()
    [listed] = re.findall(r"autosummary::\n\n((?:   \w+\n)+)", text)
    assert sorted(listed.split()) == sorted(import_module(package).__all__)
