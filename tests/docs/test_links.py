"""Links between pages lead somewhere, and the map names files that are there."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = [*sorted(ROOT.glob("*.md")), *sorted((ROOT / "docs").glob("*.md"))]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page):
    links = re.findall(r"\]\((?!https?:)([^)#\s]+)(?:#[^)]*)?\)", page.read_text())
    assert [link for link in links if not (page.parent / link).exists()] == []


def test_files_of_the_map_are_there():
    rows = re.findall(r"^\| [^|`]+ \| (.*`.*) \|$", (ROOT / "ARCHITECTURE.md").read_text(), re.MULTILINE)
    missing = []
    for row in rows:
        folder = ""
        for name in re.findall(r"`([\w/]+(?:\.(?:py|h|cpp)|/))`", row):
            folder = name.rsplit("/", 1)[0] + "/" if "/" in name else folder
            path = name if "/" in name else folder + name
            missing += [] if (ROOT / path).exists() else [path]
    assert len(rows) > 12
    assert missing == []
