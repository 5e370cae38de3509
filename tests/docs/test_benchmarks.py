"""docs/benchmarks.md is what `make benchmark` prints: nothing on the page is written by hand, or of another run."""

import re
import runpy
from pathlib import Path

ROOT = Path(__file__).parents[2]


def test_page_has_the_sections_of_the_scripts():
    page = (ROOT / "docs" / "benchmarks.md").read_text()
    sections = runpy.run_path(str(ROOT / "benchmarks" / "make.py"))["SECTIONS"]
    scripts = [(ROOT / "benchmarks" / f"{name}.py").read_text() for name in sections]
    headings = [re.search(r'^HEAD = """(## .*)$', script, re.MULTILINE)[1] for script in scripts]
    assert re.findall(r"^## .*$", page, re.MULTILINE) == headings
    heads = [line for script in scripts for line in re.findall(r'^(\|.*)\n\|[-|]+\|"""$', script, re.MULTILINE)]
    assert [line for line in re.findall(r"^(\|.*)\n\|-", page, re.MULTILINE)] == heads
    assert re.search(r"in one run of \d+ minutes, on \d+ \w+ 20\d\d:\nfaultgouge [\d.]+", page)
