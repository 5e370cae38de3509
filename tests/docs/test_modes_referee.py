"""The page for referees states what its tables hold."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import mannwhitneyu

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


def shares_told(load, ratio, power=0.53):
    """Shares of packings of 1,000 disks at the load that the law of sizes names for packings `ratio` times larger."""
    found = []
    for row in rows("tables/force_1000.jsonl"):
        loads, shares = zip(*((each["fx_over_fy"], each["share"]) for each in row["loads"]), strict=True)
        if loads[-1] >= load * ratio**power:
            found.append(np.interp(load * ratio**power, loads, shares))
    return found


def test_shares_of_larger_packings_are_those_that_the_law_of_smaller_ones_tells():
    def words(shares):
        spread = f" ({min(shares):.2f} to {max(shares):.2f}, {len(shares)} packings)" if len(shares) > 1 else ""
        return f"{np.median(shares):.2f}{spread}"

    counted = {}
    for row in rows("slices_large.jsonl"):
        share = 2 * row["sliced"] / row["modes"]
        counted.setdefault((row["disks"], row["fx_over_fy"]), []).append(share)
        cells = f"{row['disks']} | {row['seed']} | {row['fx_over_fy']:g} | {row['sliced']} ± {row['error']}"
        assert f"| {cells} | {row['modes']} | {share:.2f} | {row['growth_rate_sliced']:.3g} |" in PAGE
    for (disks, load), shares in counted.items():
        told, at = shares_told(load, disks / 1000), load * (disks / 1000) ** 0.53
        probability = mannwhitneyu(shares, told).pvalue
        assert probability > 0.05
        cells = f"{disks} | {load:g} | {at:.3f} | {words(told)} | {words(shares)}"
        assert f"| {cells} | {f'{probability:.2f}' if len(shares) > 1 else '-'} |" in PAGE


def test_powers_that_a_rank_test_leaves():
    shares = [2 * row["sliced"] / row["modes"] for row in rows("slices_large.jsonl") if row["fx_over_fy"] == 0.03]
    shares = shares[:4]  # of 3,000 disks
    left = [k / 100 for k in range(120) if mannwhitneyu(shares, shares_told(0.03, 3, k / 100)).pvalue >= 0.05]
    assert f"at 0.03 from {min(left):.2f} to {max(left):.2f}" in " ".join(PAGE.split())


def test_packings_that_bear_more_are_no_others_from_the_start():
    """Share and rate at 0.1 of those that bear 0.2, and of those that do not."""
    found = []
    for disks in (50, 100, 200, 400):
        packings = rows(f"tables/force_{disks}.jsonl")
        loads = [{load["fx_over_fy"]: load for load in row.get("loads", ())} for row in packings]
        for key in ("share", "growth_rate"):
            on = [each[0.1][key] for each in loads if 0.2 in each]
            ended = [each[0.1][key] for each in loads if 0.1 in each and 0.2 not in each]
            found.append(mannwhitneyu(on, ended).pvalue)
    stated = re.search(r"none has a probability below\s+([\d.]+\d)", PAGE)
    assert stated
    assert min(found) >= float(stated[1]) > 0.02
