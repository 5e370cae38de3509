"""The comparison of a page with what its commands print tells right from wrong."""

import pytest

from docs.run_page import commands, difference, files, run

SHOWN = ("mu = 1: F_x^c = 0.015009832275(11)", "written to run.h5")


@pytest.mark.parametrize(
    ("printed", "right"),
    [
        ("mu = 1: F_x^c = 0.015009832275(11)\nwritten to run.h5\n", True),
        ("mu = 1:  F_x^c = 0.015009832999(13)\n\nwritten to run.h5", True),
        ("mu = 1: F_x^c = 0.0151(11)\nwritten to run.h5", False),
        ("mu = 1: F_x^c = 0.015009832275(11)\nwritten to other.h5", False),
        ("mu = 1: F_x^c = 0.015009832275(11)", False),
        ("mu = 1: F_x^c = 0.015009832275(11)\nwritten to run.h5\nand more", False),
    ],
)
def test_words_are_equal_and_numbers_agree(printed, right):
    assert (difference(SHOWN, printed) == "") is right


def test_noise_of_rounding_may_differ_but_stays_noise():
    assert difference(("residual 5.1e-11",), "residual 7e-12") == ""
    assert difference(("residual 5.1e-11",), "residual 5.1e-6") != ""


def test_progress_of_a_slow_machine_is_no_difference():
    assert difference(SHOWN, "settling: 2000 steps\nequilibria: 5 of 21\n" + "\n".join(SHOWN)) == ""


def test_dots_stand_for_any_lines():
    assert difference(("a 1", "...", "z 9"), "a 1\nb 2\nc 3\nz 9\n") == ""
    assert difference(("a 1", "...", "z 9"), "a 1\nb 2\n") != ""


def test_a_page_is_run(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("```toml\n# a.toml\nx = 1\n```\n\n```console\n$ cat a.toml\n# a.toml\nx = 2\n$ false\n```\n")
    assert list(files(page)) == ["a.toml"]
    assert [command.line for command in commands(page)] == ["cat a.toml", "false"]
    wrong = run(page, tmp_path)
    assert "x = 1" in wrong[0]
    assert "exit code 1" in wrong[1]
