"""Links between pages lead somewhere, lines fit a screen, commands print what a page shows, and notebooks run."""

import json
import re
import subprocess
from importlib import import_module
from pathlib import Path

import pytest
from printed_numbers import number
from reference_layer import BIN, REFERENCE, SMALL, toml

from docs.run_page import commands, files, run
from faultgouge.pywrap import Scene
from faultgouge.pywrap.scenes.validation import read_toml
from faultgouge.studies.sweep.sweep_plan import Sweep

ROOT = Path(__file__).parents[2]
PAGES = [*sorted(ROOT.glob("*.md")), *sorted((ROOT / "docs").glob("*.md"))]
PROSE = [*PAGES, *sorted((ROOT / "docs").glob("*/*.md")), *sorted((ROOT / "research").glob("*/*.md"))]
NOTEBOOKS = ROOT / "docs" / "notebooks"
EXPLANATIONS = ("physics", "numerics", "complex_pairs", "arithmetic", "dissipation")
NO_PROSE = re.compile(r"^(```|\$\$).*?^(```|\$\$)$|^(\||    ).*?$", re.MULTILINE | re.DOTALL)
"""Blocks of code and formulas, and rows of tables."""


def origin_of(page):
    """The page that a page includes, or the page itself."""
    included = re.match(r"```{include} (\S+)", page.read_text())
    return (page.parent / included[1]).resolve() if included else page


def anchors(page):
    """The headings of a page as links name them."""
    headings = re.findall(r"^#+ (.*)$", origin_of(page).read_text(), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def test_extras_of_the_pages_exist():
    """An extra that a page names is one of the package, and the page about the installation has them all."""
    extras = read_toml(ROOT / "pyproject.toml", "project")["project"]["optional-dependencies"].keys()
    install = (ROOT / "docs" / "install.md").read_text()
    assert set(re.findall(r"^\| `(\w+)` \|", install, re.MULTILINE)) == extras
    text = "".join(page.read_text() for page in PAGES if page.name != "CHANGELOG.md")
    named = re.findall(r"(?:'\.|faultgouge|\.whl)\[([\w,]+)\]'", text)
    assert len(named) >= 3
    assert set(",".join(named).split(",")) <= extras


def lost_links(page):
    """Links of a page that lead nowhere; and of an included one those to pages that are not built."""
    origin = origin_of(page)
    for link, anchor in re.findall(r"\]\((?!https?:)([^)#\s]*)(?:#([^)\s]*))?\)", origin.read_text()):
        target = (origin.parent / link).resolve() if link else origin
        is_page, beside = target.suffix == ".md", "/" not in link and (page.parent / link).exists()
        built = origin == page or not is_page or beside or target.is_relative_to(ROOT / "docs")
        if not target.exists() or not built or (anchor and is_page and anchor not in anchors(target)):
            yield f"{link}#{anchor}"


def test_links_lead_somewhere_and_prose_fits_a_screen():
    """In one pass over all pages."""
    wrong = {}
    for page in PROSE:
        long = [line for line in NO_PROSE.sub("", page.read_text()).splitlines() if len(line) > 120]
        if found := [*lost_links(page), *long]:
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
    block = tmp_path / "block.toml"
    for text in re.findall(r"^```toml\n(.*?)^```", path.read_text(), re.MULTILINE | re.DOTALL):
        block.write_text(text)
        if "[sweep]" in text:
            assert [point.says for point in Sweep.from_toml(block).points if point.scene is None] == []
        else:
            Scene.from_mapping(({} if "[packing]" in text else base) | read_toml(block, "scene"), tmp_path)


@pytest.mark.long
@pytest.mark.parametrize("path", list(with_blocks("python")))
def test_blocks_of_python_run_one_after_the_other(faultgouge, tmp_path, of_script, path):
    """In a folder with the run of a scene that erupts, whose files have the names that pages give them."""
    text = path.read_text()
    for name, block in ({"scene.toml": toml(SMALL)} | files(path)).items():
        (tmp_path / name).write_text(block)
    faultgouge("ramp", "scene.toml", "-o", "run.h5")
    if 'RunFile("drive.h5")' in text:
        faultgouge("drive", ROOT / "scenes" / "drive.toml", "-o", "drive.h5")
    script = re.findall(r"^```python\n(?!# [\w.]+\n)(.*?)^```", text, re.MULTILINE | re.DOTALL)
    of_script("blocks.py", **{"blocks.py": "\n".join(script)})


@pytest.mark.slow
def test_the_readme_runs_in_an_empty_folder(faultgouge_here, of_script):
    readme = (ROOT / "README.md").read_text()
    faultgouge_here("examples", "pour")
    verdict = re.search(r"^\$ faultgouge stability pour.in\n(.*?)^```$", readme, re.MULTILINE | re.DOTALL)[1]
    assert verdict.startswith("stable: every motion decays")
    # on another machine the spheres come to rest at other places
    printed = faultgouge_here("stability", "pour.in").stdout
    assert re.sub(r"[\d.e-]+", "1", printed) == re.sub(r"[\d.e-]+", "1", verdict)
    [(name, text)] = [each for each in files(ROOT / "README.md").items() if each[0].endswith(".py")]
    assert "F_x = 0.016 " in of_script(name, **{name: text})


@pytest.mark.long
@pytest.mark.slow
@pytest.mark.parametrize("name", sorted({path.name for path in (ROOT / "scenes" / "examples").iterdir()} - {"pour.in"}))
def test_examples_run(tmp_path, faultgouge_here, of_script, name):
    """Each example of the shelf, by the command that it names; that of the README runs there."""
    *_, said = faultgouge_here("examples", name).stdout.splitlines()
    assert (tmp_path / name).exists()
    for command in said.removeprefix("next: ").split(" && "):
        first, *words = command.split()
        if first == "faultgouge":
            faultgouge_here(*words, *(["--workers", "1"] if words[0] == "sweep" else []))
        else:
            of_script(*words)


def test_no_output_is_stored():
    cells = [cell for path in NOTEBOOKS.glob("*.ipynb") for cell in json.loads(path.read_text())["cells"]]
    assert len(cells) > 10
    assert not any(cell.get("outputs") or cell.get("execution_count") for cell in cells)


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "pictures", "layer"), [("exceptional_point", 7, "hundred disks"), ("own_packing", 3, "own packing")]
)
def test_notebooks_run_and_find_the_onset_of_the_command(faultgouge, tmp_path, name, pictures, layer):
    """A cell that ends with a figure shows it. Paths with other increments find the same onset, within its error."""
    nbformat, nbclient = map(pytest.importorskip, ("nbformat", "nbclient"))
    pytest.importorskip("ipykernel")
    notebook = nbformat.read(NOTEBOOKS / f"{name}.ipynb", 4)
    nbclient.NotebookClient(notebook, timeout=300).execute()
    outputs = [each for cell in notebook.cells for each in cell.get("outputs", [])]
    assert sum("image/png" in each.get("data", {}) for each in outputs) == pictures
    text = "".join(each["text"] for each in outputs if each.output_type == "stream" and each.name == "stdout")
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
        scene = toml(SMALL | {"packing": {"seed": 1}, "ramp": {"step": 1e-3, "until": 0.02}})
    (tmp_path / "scene.toml").write_text(scene)
    found = json.loads(faultgouge("onset", "scene.toml", "--json").stdout)
    assert number(text, f"{layer}: F_x^c =") == pytest.approx(found["fx_c"], abs=found["error"] + 5e-12)


@pytest.mark.parametrize("package", ["analysis", "analysis.windows", "pywrap", "analysis.files.formats", "figures"])
def test_the_api_pages_list_the_public_names_and_no_others(package):
    text = (ROOT / "docs" / "api" / f"{package.split('.')[-1]}.md").read_text()
    [listed] = re.findall(r"autosummary::\n\n((?:   \w+\n)+)", text)
    assert sorted(listed.split()) == sorted(import_module(f"faultgouge.{package}").__all__)
