"""The pages on cycles come out of their tables, no run is left out, and their counts are those of the tables."""

from itertools import combinations, product

import numpy as np

from faultgouge.pywrap.runs.drive import CONFIDENCE, advance_error
from faultgouge.pywrap.runs.drive import NOISES as RUNS_WITH_NOISE
from research.cycle.clock import SLIPS, pulses
from research.cycle.compute import LAWS, LOOKED_AT
from research.cycle.further import CLOCK_TABLE, HERE, ROW, SPRINGS_TABLE
from research.cycle.further import numbers as further_numbers
from research.cycle.make import MANY_TABLE, TABLE, numbers
from research.cycle.springs import LOOKED_AT as OF_SPRING
from research.cycle.springs import SHARES, SPRINGS
from research.tables import read_rows

ROWS, LARGE, CLOCK, DRIVEN = (
    read_rows(HERE / "tables" / name) for name in (TABLE, MANY_TABLE, CLOCK_TABLE, SPRINGS_TABLE)
)
FOUND = further_numbers()


def test_no_run_and_no_slip_is_left_out():
    """Each slip has its state before and its control."""
    assert [(row["seed"], row["law"]) for row in ROWS] == [(1 + k // 2, LAWS[k % 2]) for k in range(len(ROWS))]
    expected = [(seed, law) for law in reversed(LAWS) for seed in range(1, 11)]
    assert [(row["seed"], row["law"]) for row in LARGE] == expected[: len(LARGE)]
    for row, most in [(row, len(row["slips"])) for row in ROWS] + [(row, LOOKED_AT) for row in LARGE]:
        for kind in ("before", "control"):
            slips = list(range(min(most, len(row["slips"]))))
            assert [state["slip"] for state in row["states"] if state["kind"] == kind] == slips
        for state in row["states"]:
            if state["kind"] == "before":
                slip = row["slips"][state["slip"]]
                assert (state["time"], state["force"], state["until"]) == (slip["begins"], slip["force_before"], 0.0)
            elif state["kind"] == "even":
                assert not any(slip["begins"] <= state["time"] <= slip["ends"] for slip in row["slips"])
    expected = [(seed, spring, law) for seed in FOUND["seeds"] for spring, law in product(SPRINGS, LAWS)]
    assert [(row["seed"], row["spring"], row["law"]) for row in DRIVEN] == expected
    for row in DRIVEN:
        looked_at = min(OF_SPRING, len(row["slips"])) if row["law"] == "coulomb" else 0
        assert [(s["slip"], s["kind"]) for s in row["states"]] == list(product(range(looked_at), SHARES))


def test_no_pulse_is_left_out():
    assert FOUND["clock"]["seeds"] == list(range(1, len(FOUND["clock"]["seeds"]) + 1))
    for seed in FOUND["clock"]["seeds"]:
        rows = [row for row in CLOCK if row["seed"] == seed]
        (last,) = [row for row in rows if row["kind"] == "time"]
        assert last["slips"] <= SLIPS
        for slip in range(last["slips"]):
            own = [row for row in rows if row.get("slip") == slip and row["kind"] != "slip"]
            assert [(row["phase"], row["height"], row["omega"]) for row in own] == list(pulses())


def test_the_error_of_a_clock_advance_covers_what_noise_does():
    """Of the pulses of noise on each slip, three give the error of another one; one alone covers 71 of 100."""
    slips = {(row["seed"], row["slip"]) for row in CLOCK if row["kind"] == "slip"}
    covered, by_one = [], []
    for key in slips:
        noise = [row["advance"] for row in CLOCK if row["kind"] == "noise" and (row["seed"], row["slip"]) == key]
        for k, advance in enumerate(noise):
            others = noise[:k] + noise[k + 1 :]
            by_one += [abs(advance) <= max(ROW, abs(other)) for other in others]
            covered += [abs(advance) <= advance_error(few, ROW) for few in combinations(others, RUNS_WITH_NOISE)]
    assert np.mean(covered) >= CONFIDENCE
    assert np.mean(by_one) < 0.8


def test_the_other_page_says_what_the_table_says():
    found = numbers(ROWS)
    said = " ".join((HERE.parents[1] / "docs" / "stick_slip.md").read_text().split())
    for law in LAWS:
        before, control = found["before"][law]["sliding"], found["control"][law]["sliding"]
        assert f"{before['count']} of {before['of']} slips" in said
        assert f"{control['count']} of {control['of']} control states" in said
    folds = [found[kind]["coulomb"]["fold"]["count"] for kind in ("before", "control")]
    assert f"a fold before {folds[0]}, and in {folds[1]}." in said
    third, late, before = FOUND["all"]
    assert before["stays"]["high"] < min(third["stays"]["low"], late["stays"]["low"])
