"""One trajectory, to the bit: over ranks, newton, sorting, restarts and whatever looks on, with dashpots or without."""

import pytest

from faultgouge.pywrap.lammps.decks import DECKS

HEAD = """
newton          {newton}
variable        decks index {decks}
variable        fx index 3.0
variable        precision index {precision}
variable        exponent index {exponent}
variable        kn index {kn}
variable        history index {history}
include         {decks}/system.in
atom_modify     sort {sort} 0.0
timestep        2e-3
{dashpots}
"""
START = (
    HEAD
    + """
fix             move all nve/disc 1.0 {drag} ${{compensated}}
{extra}
"""
)
# a layer that is torn off: contacts slide, open and close, disks go round the periodic box, and the
# neighbour lists are built some 180 times
RUN = """
run             1000
write_dump      all custom middle id x y {low} vx vy omegaz d_theta f_floor[3] modify sort id format float %.17g
{middle}
run             1000
write_dump      all custom end id x y {low} vx vy omegaz d_theta f_floor[3] modify sort id format float %.17g
"""
DEFAULTS = {"newton": "on", "sort": "1000", "extra": "", "middle": "", "decks": DECKS}
HERTZ = {"exponent": "1.5", "kn": "2e5", "history": "total"}
RESCALED = {**HERTZ, "history": "rescaled"}
HARMONIC = {"exponent": "1", "kn": "1e4", "history": "total"}
DOUBLE = {"precision": "double", "low": ""}
COMPENSATED = {"precision": "compensated", "low": "f_low[*]"}
UNDAMPED = {"dashpots": "", "drag": ""}
DAMPED = {"dashpots": "variable cn index 5.0\nvariable ct index 3.0\ninclude ${decks}/dashpots.in", "drag": "drag 50.0"}
KINDS = {
    "double": {**DOUBLE, **HERTZ, **UNDAMPED},
    "compensated": {**COMPENSATED, **HERTZ, **UNDAMPED},
    "rescaled, damped": {**DOUBLE, **RESCALED, **DAMPED},
    "harmonic, damped, compensated": {**COMPENSATED, **HARMONIC, **DAMPED},
}


@pytest.fixture(params=KINDS)
def defaults(request):
    return {**DEFAULTS, **KINDS[request.param]}


@pytest.fixture
def trajectory(lmp, tmp_path, defaults):
    def run(*, script=START + RUN, ranks=1, **changes):
        done = lmp(script.format(**{**defaults, **changes}), ranks=ranks)
        assert done.returncode == 0, done.stdout[-2000:]
        return (tmp_path / "middle").read_text(), (tmp_path / "end").read_text()

    return run


@pytest.fixture(scope="module")
def known():
    """Trajectories of each kind, as they are without a change."""
    return {}


@pytest.fixture
def unchanged(trajectory, request, known):
    """The trajectory without a change."""
    kind = request.node.callspec.params["defaults"]
    if kind not in known:
        known[kind] = trajectory()
    return known[kind]


@pytest.mark.ranks
@pytest.mark.parametrize(
    "changes",
    [
        pytest.param({"ranks": 2}, marks=pytest.mark.long),
        {"newton": "off", "sort": "0"},
        {"newton": "off", "sort": "50", "ranks": 2},
        {
            "extra": "run 0\n" * 20 + "compute seen all pair/local p1 p2 p3 p4 p5 p6 p7 cutoff radius\n"
            "dump seen all local 1 seen.* index c_seen[*]"
        },
    ],
    ids=["2 ranks", "newton off, no sorting", "newton off, sorting, 2 ranks", "looking on"],
)
@pytest.mark.slow
def test_same_trajectory(trajectory, unchanged, changes):
    assert unchanged[0] != unchanged[1]
    assert trajectory(**changes) == unchanged


@pytest.mark.ranks
@pytest.mark.parametrize("ranks", [1, pytest.param(2, marks=pytest.mark.long)])
@pytest.mark.slow
def test_restart_in_the_same_process(trajectory, unchanged, defaults, ranks):
    again = (
        """
write_restart   middle.restart
clear
variable        restart index middle.restart
"""
        + HEAD.format(**defaults)
        + """
fix             move all nve/disc 1.0 {drag} ${{compensated}}
""".format(**defaults)
    )
    assert trajectory(ranks=ranks, middle=again) == unchanged


@pytest.mark.ranks
@pytest.mark.parametrize("ranks", [1, pytest.param(2, marks=pytest.mark.long)])
@pytest.mark.slow
def test_restart_in_a_new_process(trajectory, unchanged, defaults, lmp, tmp_path, ranks):
    straight = trajectory(ranks=ranks, middle="write_restart middle.restart")
    (tmp_path / "end").unlink()
    second = (START + RUN[RUN.index("{middle}") :]).format(**{**defaults, "middle": ""})
    done = lmp(second, "-var", "restart", "middle.restart", ranks=3 - ranks)
    assert done.returncode == 0, done.stdout[-2000:]
    assert (tmp_path / "end").read_text() == straight[1] == unchanged[1]


@pytest.mark.parametrize("defaults", ["double", "compensated"], indirect=True)
@pytest.mark.parametrize("on", ["layer", "floor"])
@pytest.mark.slow
def test_signal_through_a_restart(trajectory, unchanged, defaults, lmp, tmp_path, on):
    """A signal goes by the time of the run, which a restart file keeps."""
    rows = (f"{0.1 * k} {(-1) ** k * 0.3}" for k in range(41))
    (tmp_path / "wave.txt").write_text("\n".join(rows))
    extra = f"variable signal index wave.txt\nvariable on index {on}\ninclude {DECKS}/signal.in"
    straight = trajectory(extra=extra, middle="write_restart middle.restart")
    (tmp_path / "end").unlink()
    second = (START + RUN[RUN.index("{middle}") :]).format(**{**defaults, "extra": extra})
    done = lmp(second, "-var", "restart", "middle.restart", ranks=2)
    assert done.returncode == 0, done.stdout[-2000:]
    assert (tmp_path / "end").read_text() == straight[1] != unchanged[1]


@pytest.mark.parametrize("defaults", ["compensated", "harmonic, damped, compensated"], indirect=True)
def test_compensated_run_in_one_piece_or_two(lmp, tmp_path, unchanged, defaults):
    """Disks are wrapped into the box at every set-up: on the grid that is exact."""
    done = lmp((START + RUN[RUN.index("{middle}") :].replace("1000", "2000")).format(**defaults))
    assert done.returncode == 0, done.stdout[-2000:]
    assert (tmp_path / "end").read_text() == unchanged[1]


@pytest.mark.slow
def test_restart_without_the_plugin_says_so(lmp, trajectory, monkeypatch):
    trajectory(middle="write_restart middle.restart")
    # the entry point prepends the plugin's folder, so that it is unloaded here instead
    done = lmp("plugin unload pair mindlin/smooth\nread_restart middle.restart\n")
    assert done.returncode != 0
    assert "mindlin/smooth" in done.stdout
