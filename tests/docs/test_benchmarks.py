"""docs/benchmarks.md is what `make benchmark` writes: nothing on the page is written by hand."""

import importlib.util
from pathlib import Path

ROOT = Path(__file__).parents[2]


def test_page_is_the_template_with_the_tables():
    """A sentence belongs into benchmarks.md.j2, a table into benchmarks/tables: `make.py --page` joins both."""
    spec = importlib.util.spec_from_file_location("make_benchmarks", ROOT / "benchmarks" / "make.py")
    make = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(make)
    assert (ROOT / "docs" / "benchmarks.md").read_text() == make.page()
    assert {path.stem for path in (ROOT / "benchmarks" / "tables").glob("*.txt")} >= set(make.BENCHMARKS)
    for name, command in make.BENCHMARKS.items():
        assert make.Table.read(ROOT / "benchmarks" / "tables" / f"{name}.txt").command == command
