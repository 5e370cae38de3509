"""One trajectory, to the bit: over ranks, newton, sorting, restarts and whatever looks on, with dashpots or without."""

from pathlib import Path

import pytest

from faultgouge.pywrap.lammps.decks import DECKS

START = Path(__file__).with_name("inputs").joinpath("start.in").read_text()
# a layer that is torn off: contacts slide, open and close, disks go round the periodic box, and the
# neighbour lists are built thirty times
RUN = """
run             500
write_dump      all custom {} id x y ${{low}} vx vy omegaz d_theta f_floor[3] modify sort id format float %.17g
"""
FIRST, SECOND = RUN.format("middle"), RUN.format("end")
RESTART = "write_restart middle.restart\n"
DOUBLE = {"precision": "double", "low": ""}
COMPENSATED = {"precision": "compensated", "low": "f_low[*]"}
UNDAMPED = {"cn": 0.0, "drag": ""}
DAMPED = {"cn": 5.0, "ct": 3.0, "drag": "drag 50.0"}
KINDS = {
    "double": DOUBLE | UNDAMPED,
    "compensated": COMPENSATED | UNDAMPED,
    "slider, damped": DOUBLE | DAMPED | {"history": "coulomb"},
    "harmonic, damped, compensated": COMPENSATED | DAMPED | {"exponent": 1, "kn": 1e4},
}


UNCHANGED = {}
"""Trajectories of each kind without a change."""


# the last kind is compensated, too
@pytest.fixture(params=[pytest.param(kind, marks=[pytest.mark.long] * (kind == "compensated")) for kind in KINDS])
def variables(request):
    return {"decks": DECKS, "fx": 3.0, "newton": "on", "sort": 1000, **KINDS[request.param]}


@pytest.fixture
def trajectory(lmp, tmp_path, variables):
    def run(*, extra="", middle="", ranks=1, **changes):
        lmp(START + extra + FIRST + middle + SECOND, ranks=ranks, **(variables | changes))
        return (tmp_path / "middle").read_text(), (tmp_path / "end").read_text()

    return run


@pytest.fixture
def unchanged(trajectory, variables):
    """The trajectory without a change."""
    kind = str(variables)
    UNCHANGED[kind] = UNCHANGED.get(kind) or trajectory()
    return UNCHANGED[kind]


ACTS = {
    None: "",
    "weaken": f"variable v0 index 0.01\nvariable v_ss index 1.0\ninclude {DECKS}/weaken.in",
    "spring": "fix drive top drive/spring 50.0 protocol 3 0.6 0 0.6 -3 10\n",
}
"""What acts on the layer, beside a signal on the layer or the floor."""
AGAIN = f"{RESTART}clear\nvariable restart index middle.restart\n{START}"
LOOKS = """
compute         seen all pair/local p1 p2 p3 p4 p5 p6 p7 cutoff radius
dump            seen all local 1 seen.* index c_seen[*]
"""


@pytest.mark.ranks
@pytest.mark.parametrize(
    "changes",
    [
        pytest.param({"ranks": 2}, id="2 ranks", marks=pytest.mark.long),
        pytest.param({"newton": "off", "sort": 0}, id="newton off, no sorting"),
        pytest.param({"newton": "off", "sort": 50, "ranks": 2}, id="newton off, sorting, 2 ranks"),
        pytest.param({"extra": "run 0\n" * 20 + LOOKS}, id="looking on"),
        pytest.param({"middle": AGAIN}, id="restart in the same process"),
        pytest.param({"middle": AGAIN, "ranks": 2}, id="the same, 2 ranks", marks=pytest.mark.long),
    ],
)
@pytest.mark.slow
def test_same_trajectory(trajectory, unchanged, changes):
    assert unchanged[0] != unchanged[1]
    assert trajectory(**changes) == unchanged


@pytest.mark.ranks
@pytest.mark.parametrize(
    ("ranks", "acts"),
    [(1, None), (1, "layer"), (2, "weaken"), (1, "spring")]
    + [pytest.param(*each, marks=pytest.mark.long) for each in ((2, None), (1, "floor"), (1, "weaken"))],
)
@pytest.mark.slow
def test_restart_in_a_new_process(trajectory, unchanged, variables, lmp, tmp_path, ranks, acts):
    """Without more; with a signal, which goes by the time of the run, which a restart file keeps; with friction that
    has weakened, which the file keeps as the last forces had it; and with a spring, whose protocol counts from the
    beginning."""
    (tmp_path / "wave.txt").write_text("\n".join(f"{0.1 * k} {(-1) ** k * 0.3}" for k in range(21)))
    extra = ACTS.get(acts, f"variable signal index wave.txt\nvariable on index {acts}\ninclude {DECKS}/signal.in")
    straight = trajectory(ranks=ranks, extra=extra, middle=RESTART)
    (tmp_path / "end").unlink()
    lmp(START + extra + SECOND, ranks=3 - ranks, restart="middle.restart", **variables)
    assert (tmp_path / "end").read_text() == straight[1]
    assert (straight == unchanged) == (acts is None)


@pytest.mark.parametrize("variables", ["compensated", "harmonic, damped, compensated"], indirect=True)
def test_compensated_run_in_one_piece_or_two(lmp, tmp_path, unchanged, variables):
    """Disks are wrapped into the box at every set-up: on the grid that is exact."""
    lmp(START + SECOND.replace("500", "1000"), **variables)
    assert (tmp_path / "end").read_text() == unchanged[1]
