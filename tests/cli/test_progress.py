"""Off a terminal: a line every minute, also within one long call."""

import time

import pytest

from faultgouge.commands import terminal


@pytest.fixture(autouse=True)
def _short_minutes(monkeypatch):
    monkeypatch.setattr(terminal, "EVERY", 0.02)


@pytest.mark.slow
def test_one_long_call_is_not_silent(capsys):
    with terminal.status("settling") as show:
        time.sleep(0.5)
        show("ramp")
        time.sleep(0.5)
    lines = capsys.readouterr().err.splitlines()
    assert set(lines) == {"settling", "ramp"}
    time.sleep(0.2)
    assert capsys.readouterr().err == ""


@pytest.mark.slow
def test_progress_counts(capsys):
    for _ in terminal.progress([1, 2], "equilibria", 5, done=3):
        time.sleep(0.5)
    lines = capsys.readouterr().err.splitlines()
    assert set(lines) - {"equilibria: 3 of 5"} == {"equilibria: 4 of 5", "equilibria: 5 of 5"}


@pytest.mark.slow
def test_progress_that_is_left_early_ends_its_lines(capsys):
    for _ in terminal.progress(range(9), "samples"):
        break
    time.sleep(0.2)
    capsys.readouterr()
    time.sleep(0.2)
    assert capsys.readouterr().err == ""
