"""Each page of a study comes out of its committed tables, to the letter, and its numbers to the last digits."""

import shutil
from importlib import import_module
from pathlib import Path

import pytest
from reference_layer import parted

RESEARCH = Path(__file__).parents[2] / "research"
LONG = ("cycle.make", "modes.page", "genericity.make")
WRITERS = ("coverage.make", "lammps_laws.make", "laws.page", "protocols.make", "rising.make", "validation.make")
FURTHER = {"cycle.further": "write_further", "yielding.page further": "write_lasting"}
NUMBERS = {"genericity.make": "genericity.json", "laws.page": "laws.json", "modes.page": "modes.json"}


@pytest.mark.parametrize(
    "writer",
    [
        *(pytest.param(each, marks=pytest.mark.long) for each in LONG),
        *(pytest.param(each, marks=pytest.mark.slow) for each in (*WRITERS, "yielding.page", *FURTHER)),
    ],
)
def test_a_page_is_what_its_tables_make(tmp_path, monkeypatch, writer):
    module = writer.split()[0]
    folder, made = RESEARCH / module.split(".")[0], import_module(f"research.{module}")
    if writer == "genericity.make":
        monkeypatch.setattr(made, "draw_all", lambda *_: None)  # pictures depend on fonts
    if (folder / "tables").is_dir():
        shutil.copytree(folder / "tables", tmp_path / "tables")
    given = (folder / "tables", tmp_path) if writer in ("laws.page", "modes.page") else (tmp_path,)
    page = getattr(made, FURTHER.get(writer, "write_page"))(*given).read_text()
    assert page == (folder / ("further.md" if writer in FURTHER else "README.md")).read_text()
    if writer in NUMBERS:
        (words, found), (stored, expected) = (parted(each / NUMBERS[writer]) for each in (tmp_path, folder))
        assert words == stored
        assert found == pytest.approx(expected, rel=1e-12)  # logarithms and sums differ by processor
