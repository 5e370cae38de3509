"""The page for referees states what its tables hold."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import mannwhitneyu

from faultgouge.analysis import MindlinLaw

DOCS = Path(__file__).parents[2] / "docs" / "modes"
PAGE = (DOCS / "referee.md").read_text()


def rows(name):
    return [json.loads(line) for line in (DOCS / name).read_text().splitlines()]


def bounds(load, disks):
    return np.array(
        [(r["imaginary"], r["bound"]) for r in rows("bounds.jsonl") if r["fx_over_fy"] == load and r["disks"] == disks]
    )


def test_the_table_of_bounds_is_that_of_the_rows():
    for row in rows("bounds.jsonl"):
        assert row["imaginary"] <= row["bound"]
        found = bounds(row["fx_over_fy"], row["disks"])
        imaginary, bound = np.median(found, axis=0)
        assert f"| {row['disks']} | {row['fx_over_fy']:g} | {len(found)} | {imaginary:.3g} | {bound:.3g} |" in PAGE


def test_the_sentences_about_bounds_hold():
    for load in (0.1, 0.2):
        shares = [np.median(found[:, 0] / found[:, 1]) for n in (50, 100, 200, 400) if len(found := bounds(load, n))]
        assert 0.03 < min(shares) < max(shares) < 0.13
    small, large = (np.median(bounds(0.1, n)[:, 1]) for n in (50, 1000))
    assert large / small == pytest.approx(5, abs=1)


def test_counts_in_slices_are_within_their_errors():
    off = []
    for row in rows("slices.jsonl"):
        assert abs(row["sliced"] - row["pairs"]) <= row["error"]
        numbers = [row[name + way] for name in ("growth_rate", "least_q") for way in ("", "_sliced")]
        off += [abs(numbers[1] / numbers[0] - 1), abs(numbers[3] / numbers[2] - 1)]
        cells = f"{row['seed']} | {row['fx_over_fy']:g} | {row['pairs']} | {row['sliced']} ± {row['error']}"
        assert f"| {cells} | {' | '.join(f'{each:.3g}' for each in numbers)} |" in PAGE
    stated = re.search(r"Growth rates and least Q from slices are within ([\d.]+) %", PAGE)
    assert stated
    assert max(off) < float(stated[1]) / 100 < 1.2 * max(off)


def test_shares_of_3000_disks_are_those_that_the_law_of_smaller_packings_tells():
    smaller = [json.loads(line) for line in (DOCS / "tables" / "force_1000.jsonl").read_text().splitlines()]
    for load in (0.03, 0.1):
        at, told = load * 3**0.53, []
        for row in smaller:
            loads, shares = zip(*((each["fx_over_fy"], each["share"]) for each in row["loads"]), strict=True)
            if loads[-1] >= at:
                told.append(np.interp(at, loads, shares))
        words = f"{np.median(told):.2f} ({min(told):.2f} to {max(told):.2f}, {len(told)} packings)"
        assert words in " ".join(PAGE.split())
        for row in rows("slices_3000.jsonl"):
            if row["fx_over_fy"] == load:
                share, error = 2 * row["sliced"] / row["modes"], 2 * row["error"] / row["modes"]
                assert min(told) - error <= share <= max(told) + error
                assert f"| {load:g} | {row['sliced']} ± {row['error']} | {row['modes']} | {share:.2f} |" in PAGE


def test_packings_that_bear_more_are_no_others_from_the_start():
    """Share and rate at 0.1 of those that bear 0.2, and of those that do not."""
    found = []
    for disks in (50, 100, 200, 400):
        packings = [json.loads(line) for line in (DOCS / "tables" / f"force_{disks}.jsonl").read_text().splitlines()]
        loads = [{load["fx_over_fy"]: load for load in row.get("loads", ())} for row in packings]
        for key in ("share", "growth_rate"):
            on = [each[0.1][key] for each in loads if 0.2 in each]
            ended = [each[0.1][key] for each in loads if 0.1 in each and 0.2 not in each]
            found.append(mannwhitneyu(on, ended).pvalue)
    stated = re.search(r"none has a probability below\s+([\d.]+\d)", PAGE)
    assert stated
    assert min(found) >= float(stated[1]) > 0.02


def test_b_is_at_most_friction_times_the_normal_stiffness():
    law, overlap = MindlinLaw(2e5, 5e4, 0.7), np.full(201, 1e-4)
    slip = np.linspace(-1, 1, 201) * law.slip_limit(overlap)
    b = np.abs(law.derivatives(overlap, slip).overlap_derivative)
    ceiling = law.mu * law.normal_stiffness(overlap)
    assert np.all(b <= ceiling * (1 + 1e-12))
    assert b[[0, -1]] == pytest.approx(ceiling[[0, -1]], rel=1e-12)
