"""Each page of a study comes out of its committed tables, to the letter, and its numbers to the last digits."""

import shutil
from importlib import import_module
from pathlib import Path

import pytest
from reference_layer import parted

RESEARCH = Path(__file__).parents[2] / "research"
LONG = {"cycle.make", "modes.page", "genericity.make"}
PAGES = {
    # what writes it: the page, and its numbers in a file
    "coverage.make:write_page": ("README.md", None),
    "cycle.make:write_page": ("README.md", None),
    "cycle.further:write_further": ("further.md", None),
    "genericity.make:write_page": ("README.md", "genericity.json"),
    "lammps_laws.make:write_page": ("README.md", None),
    "laws.page:write_page": ("README.md", "laws.json"),
    "modes.page:write_page": ("README.md", "modes.json"),
    "protocols.make:write_page": ("README.md", None),
    "rising.make:write_page": ("README.md", None),
    "validation.make:write_page": ("README.md", None),
    "yielding.page:write_page": ("README.md", None),
    "yielding.page:write_lasting": ("further.md", None),
}


@pytest.mark.parametrize(
    "writer",
    [pytest.param(each, marks=pytest.mark.long if each.split(":")[0] in LONG else pytest.mark.slow) for each in PAGES],
)
def test_a_page_is_what_its_tables_make(tmp_path, monkeypatch, writer):
    module, name = writer.split(":")
    page, numbers = PAGES[writer]
    folder, made = RESEARCH / module.split(".")[0], import_module(f"research.{module}")
    if module == "genericity.make":
        monkeypatch.setattr(made, "draw_all", lambda *_: None)  # pictures depend on fonts
    if (folder / "tables").is_dir():
        shutil.copytree(folder / "tables", tmp_path / "tables")
    given = (folder / "tables", tmp_path) if module in ("laws.page", "modes.page") else (tmp_path,)
    assert getattr(made, name)(*given).read_text() == (folder / page).read_text()
    if numbers:
        (words, found), (stored, expected) = (parted(each / numbers) for each in (tmp_path, folder))
        assert words == stored
        assert found == pytest.approx(expected, rel=1e-12)  # logarithms and sums differ by processor
