"""The stiff and extreme cases: their small part, their files, and a case that fails among others."""

import json
from dataclasses import replace

import pytest

from faultgouge.analysis import stiffness_matrix
from faultgouge.assessment.extremes import cases
from faultgouge.assessment.extremes.cases import Case
from faultgouge.assessment.extremes.packings import crystal, shear_packing
from faultgouge.assessment.extremes.run import check, extremes, try_case
from faultgouge.assessment.results import AssessmentError
from faultgouge.pywrap import Equilibrium
from faultgouge.pywrap.equilibria.quasistatic import rounding_floor

QUICK = [case for case in cases.cases() if case.quick]


@pytest.mark.parametrize("case", QUICK, ids=lambda case: f"{case.group}: {case.name}")
def test_case(case):
    outcome = try_case(case)
    assert outcome["status"] == ("refused" if case.refusal else "holds"), outcome["says"]
    assert case.refusal or outcome["figure"] <= outcome["bound"]


def raising(error):
    raise error


def case(name, outcome, refusal=""):
    """A case with its figure, bound and words, or with what its run does."""
    return Case("a", name, outcome if callable(outcome) else lambda: outcome, False, refusal)


CRASH, TWO = ZeroDivisionError("in the middle of it\nand more"), ValueError("two\nlines")
TROUBLE = [
    case("good", (0.5, 1.0, "half of it")),
    case("too large", (2.0, 1.0, "twice")),
    case("no number", (float("nan"), 1.0, "what should hold")),
    case("crash", lambda: raising(CRASH)),
    case("crash in place of a refusal", lambda: raising(CRASH), "in the middle of it"),
    case("refused", lambda: int("x"), "invalid literal"),
    case("not refused", lambda: int("1"), "int"),
    case("other words", lambda: int("x"), "no digit"),
    case("two lines", lambda: raising(TWO), "two"),
    case("last", (0.0, 0.0, "nothing at all")),
]


def test_failures_are_told_and_the_others_go_on(tmp_path, monkeypatch):
    """And so is a picture that cannot be drawn."""
    no_font, told = RuntimeError("no font at all"), []
    monkeypatch.setattr("matplotlib.figure.Figure.savefig", lambda *_, **__: raising(no_font))
    result = extremes(tmp_path / "out", say=told.append, wanted=TROUBLE)
    status = {each["name"]: each["status"] for each in result["cases"]}
    fine = {"good": "holds", "last": "holds", "refused": "refused"}
    assert status == dict.fromkeys((each.name for each in TROUBLE), "fails") | fine
    assert told[2] == "a, crash: ZeroDivisionError: in the middle of it"
    assert json.loads((tmp_path / "out" / "extremes.json").read_text()) == result | {"faultgouge_format": 1}
    page = (tmp_path / "out" / "extremes.md").read_text()
    assert "10 cases: 2 hold, 1 are refused" in page
    assert "| too large | fails | 2 | 1 | twice |" in page
    assert "extremes.png was not drawn (RuntimeError: no font at all)" in told[-1]
    with pytest.raises(KeyboardInterrupt):  # results are written as they come
        extremes(tmp_path / "cut", wanted=[TROUBLE[0], case("killed", lambda: raising(KeyboardInterrupt))])
    assert json.loads((tmp_path / "cut" / "extremes.json").read_text())["cases"] == result["cases"][:1]
    with pytest.raises(AssessmentError, match=r"7 of 10 cases failed: too large; no number; crash"):
        check(result)


def test_checks_tell_a_wrong_operator_and_a_force(monkeypatch):
    """The paper's form lacks the turning of the tangent, a thousandth of K here."""
    packing = crystal(3)
    figure, bound, _ = cases.derivative(packing)
    assert figure <= bound
    monkeypatch.setattr(cases, "stiffness_matrix", lambda each: stiffness_matrix(each, "paper"))
    assert max(bound, 1e-5) < cases.derivative(packing)[0] < 1e-2
    balanced = shear_packing(packing).packing
    pushed = replace(balanced, fx=balanced.fx + 1e-9)
    figure, bound, _ = cases.balance(Equilibrium(pushed, pushed.residual, rounding_floor(pushed), 0))
    assert figure > bound


@pytest.mark.ranks
@pytest.mark.long
def test_quick_cases_hold_with_the_same_table_on_two_ranks(faultgouge, tmp_path):
    """The command fails where a case does."""
    one = faultgouge("extremes", "--quick", "-o", "one", "--json").stdout
    assert (tmp_path / "one" / "extremes.png").stat().st_size > 10_000
    faultgouge("extremes", "--quick", "-o", "two", ranks=2)
    tables = [(tmp_path / name / "extremes.json").read_text() for name in ("one", "two")]
    assert tables[0] == tables[1]
    assert json.loads(one) == json.loads(tables[0])


@pytest.mark.ranks
@pytest.mark.long
def test_error_of_one_rank_ends_the_others(faultgouge, tmp_path):
    """A contact that the law does not cover is found by the rank that owns it; the other one waits for its forces."""
    (tmp_path / "scene.toml").write_text(
        "packing = { disks = 24, top = 5, width = 5.95, seed = 2 }\nlaw = { kn = 2e5 }\nload = { fy = 2e4 }\n"
    )
    done = faultgouge("settle", "scene.toml", ranks=2, code=None)
    assert done.returncode != 0
    assert "where the contact law does not hold: lower the load" in done.stderr
    assert ".cpp" not in done.stderr
