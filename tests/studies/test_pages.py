"""Lines of generated pages fit a screen, and mean what they meant before they were folded."""

import re

from faultgouge.figures.pages import WIDTH, filled

PROSE = "The exponent is 0.5 - 0.001 + 0.002 > 0, as in 1. and in # 2, over all of the many loads that are there. " * 3


def test_prose_and_items_are_folded_where_no_line_begins_a_list():
    lines = filled(PROSE).split("\n")
    assert max(map(len, lines)) <= WIDTH
    assert not [line for line in lines if re.match(r"([-+>#]|\d+\.) ", line)]
    assert " ".join(lines).split() == PROSE.split()
    first, *more = filled("- " + PROSE).split("\n")
    assert first.startswith("- ")
    assert all(re.match(r"  \S", line) for line in more)


def test_tables_pictures_code_and_formulas_stay():
    text = "\n".join(["| " + PROSE, "![" + PROSE + "](a.png)", "```", PROSE, "```", "$$", PROSE, "$$", "    " + PROSE])
    assert filled(text) == text
