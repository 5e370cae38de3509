"""The spring that draws a layer: its force against NumPy, across the period, on ranks, through restart files."""

import numpy as np
import pytest

from faultgouge.analysis import read_dump
from faultgouge.analysis.packing.geometry import nearest_image
from faultgouge.pywrap import Engine
from faultgouge.pywrap.lammps.decks import DECKS
from faultgouge.pywrap.lammps.instance import EngineError

DT, STIFFNESS = 4.9e-4, 300.0
PROTOCOL = [(40.0, 0.1), (0.0, 0.02), (-10.0, 0.06), (5.0, 0.02)]


def way(time):
    """U(t) of PROTOCOL, and the velocity of the far end."""
    ends = np.cumsum([duration for _, duration in PROTOCOL])
    stage = min(np.searchsorted(ends, time, side="right"), len(ends) - 1)
    before = sum(velocity * duration for velocity, duration in PROTOCOL[:stage])
    begin = ends[stage - 1] if stage else 0.0
    return before + PROTOCOL[stage][0] * (time - begin), PROTOCOL[stage][0]


@pytest.fixture(params=["double", "compensated"])
def packing(request, reference_packing):
    packing = reference_packing(1.0)
    if request.param == "double":
        return packing
    from dataclasses import replace

    return replace(packing, position_low=np.zeros_like(packing.position))


def test_force_is_that_of_a_spring_whose_end_moves(packing):
    """A layer that is thrown across the period, and NumPy that follows its disks from one look to the next."""
    words = " ".join(f"{velocity} {duration}" for velocity, duration in PROTOCOL)
    top = packing.top
    with Engine(packing) as engine, engine.undamped(DT) as dynamics:
        do, value = engine.lammps.command, engine.lammps.extract_fix
        do(f"fix drive top drive/spring {STIFFNESS} protocol {words}")
        do("run 0 post no")
        assert value("drive", 0, 0) == 0.0
        place, moved, farthest = packing.position, np.zeros(len(packing)), []
        for step in range(20, 401, 20):
            motion = dynamics.advance(20)
            moved += nearest_image(motion.position - place, packing.box_length)[:, 0]
            place = motion.position
            end, velocity = way(step * DT)
            # rounding of coordinates of order 10, in compensated arithmetic, too, since NumPy has doubles
            assert value("drive", 0, 1, 0) == pytest.approx(moved[top].mean(), abs=1e-13)
            assert value("drive", 0, 1, 1) == pytest.approx(end, abs=1e-14)
            assert value("drive", 0, 1, 2) == velocity
            assert value("drive", 0, 0) == pytest.approx(STIFFNESS * (end - moved[top].mean()), abs=1e-10)
            farthest.append(moved[top].mean())
        assert max(farthest) > 1.2  # disks cross the period
        do("run 0 post no")
        drawn, force = engine.net_force, value("drive", 0, 0)
        do("unfix drive")
        do("run 0 post no")
        difference = (drawn - engine.net_force)[: len(packing)]
        # rounding of forces of order 1e3 in the torn packing
        np.testing.assert_allclose(difference, np.where(top, force, 0.0), rtol=0, atol=1e-11)


def test_rigid_layer_moves_at_the_velocity_and_its_force_is_that_of_the_bed(packing):
    top = packing.top
    with Engine(packing) as engine, engine.undamped(DT) as dynamics:
        engine.lammps.command("fix drive top drive/spring rigid protocol 0.5 0.1 0.0 1.0")
        engine.lammps.command("run 0 post no")
        moving = dynamics.advance(50)
        assert (moving.velocity[top, 0] == 0.5).all()
        assert np.ptp(moving.velocity[top, 1]) > 1e-3
        force = engine.lammps.extract_fix("drive", 0, 0)
        assert engine.lammps.extract_fix("drive", 0, 1, 0) == pytest.approx(50 * DT * 0.5, abs=1e-13)  # 50 roundings
        engine.lammps.command("unfix drive")
        engine.lammps.command("run 0 post no")
        assert force == pytest.approx(-engine.net_force[: len(packing)][top].mean(), rel=1e-12)
        assert force > 0.1


def test_layer_that_is_held_does_not_move(packing):
    with Engine(packing) as engine, engine.undamped(DT) as dynamics:
        engine.lammps.command("fix drive top drive/spring rigid protocol 0.5 0.1 0.0 1.0")
        engine.lammps.command("run 0 post no")
        dynamics.advance(201)
        first = dynamics.advance(10)
        last = dynamics.advance(100)
        assert (first.velocity[packing.top, 0] == 0.0).all()
        assert np.array_equal(first.position[packing.top, 0], last.position[packing.top, 0])


FAST = {"force_tolerance": 1e-3, "time": 0.15, "velocity": 60.0, "spring": 500.0, "states": 0.04, "every": 1}
RUNS = {
    "spring": FAST,
    "protocol": {**FAST, "protocol": "60 0.1 0 0.02 -60 0.03"},
    "rigid": {**FAST, "velocity": 5.0, "spring": "rigid"},
    "signal": {**FAST, "signal": "record.txt", "scale": 1.0},
}


@pytest.mark.ranks
@pytest.mark.parametrize("precision", ["double", pytest.param("compensated", marks=pytest.mark.long)])
@pytest.mark.parametrize("run", RUNS)
@pytest.mark.slow
def test_deck_runs_alone_and_the_same_on_ranks(lmp, tmp_path, run, precision):
    """A layer that goes round the period; on three ranks in `make long`, as they share two cores.

    LAMMPS's own sums depend on the ranks in the last digits.
    """
    others = 3 if (run, precision) == ("spring", "compensated") else 2
    (tmp_path / "record.txt").write_text("# time value\n0 0\n0.1 1\n0.2 -1\n")
    ends, sums = [], []
    for ranks in (1, others):
        done = lmp(DECKS / "drive.in", ranks=ranks, decks=DECKS, precision=precision, **RUNS[run])
        assert "WARNING" not in done.stdout
        rows = np.loadtxt(tmp_path / "drive.series")
        ends.append(((tmp_path / "drive.end.disks").read_text(), rows[:, :4].tobytes()))
        sums.append(rows[:, 4:])
    assert len(set(ends)) == 1
    np.testing.assert_allclose(sums[1], sums[0], rtol=1e-13, atol=0)
    packing = read_dump(tmp_path / "drive.end.disks")
    assert packing.law.cn == 60.0
    assert packing.fx == pytest.approx(rows[-1, 2], rel=1e-15)
    if run == "spring":
        assert rows[-1, 3] > 3.0


SCRIPT = """
include {decks}/system.in
fix move all nve/disc 1.0 rotation yes ${{compensated}}
fix drive top drive/spring 50.0 protocol 30 0.2 0 0.1 -30 10
timestep 5e-4
{runs}
variable force equal f_drive
variable moved equal f_drive[1]
print "force $(v_force:%.17g) moved $(v_moved:%.17g)"
write_dump all custom end.dump id x y vx vy omegaz modify sort id format float %.17g
"""


@pytest.mark.parametrize("precision", ["double", "compensated"])
@pytest.mark.slow
def test_run_that_goes_on_from_a_restart_file_is_the_same(lmp, tmp_path, precision):
    """The stages of the protocol and the displacement count from the beginning, not from the restart."""
    seen = []
    for runs, more in (
        ("run 500\nwrite_restart half.restart\nrun 500", {}),
        ("run 500", {"restart": tmp_path / "half.restart"}),
    ):
        done = lmp(SCRIPT.format(decks=DECKS, runs=runs), decks=DECKS, precision=precision, **more)
        (line,) = (line for line in done.stdout.splitlines() if line.startswith("force "))
        seen.append((line, (tmp_path / "end.dump").read_text()))
    assert seen[0] == seen[1]
    assert float(seen[0][0].split()[-1]) > 1.0


def test_runs_that_the_spring_cannot_draw_are_refused(reference_packing):
    with Engine(reference_packing(1.0)) as engine, engine.undamped(DT, drag_time=10.0) as dynamics:
        engine.lammps.command("fix drive top drive/spring rigid velocity 1.0")
        with pytest.raises(EngineError, match="rigid does not work with the drag of fix move"):
            dynamics.begin()
    with Engine(reference_packing(1.0)) as engine, engine.undamped(DT) as dynamics:
        engine.lammps.command("group some id 1:3")
        engine.lammps.command("fix drive some drive/spring 1 velocity 1.0")
        dynamics.begin()
        engine.lammps.command("set atom 1 type 1")
        engine.lammps.command("group some clear")
        engine.lammps.command("group some id 2:3")
        with pytest.raises(EngineError, match="had 3 disks when the spring began to draw, and has 2 now"):
            dynamics.begin()
