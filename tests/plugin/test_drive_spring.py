"""The spring that draws a layer: its force against NumPy, and across the period; on ranks in test_decks.py."""

from dataclasses import replace

import numpy as np
import pytest

from faultgouge.analysis.packing.geometry import nearest_image
from faultgouge.pywrap import Engine
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


def test_rigid_layer_moves_at_the_velocity_and_then_not_at_all(packing):
    """Its force is that of the bed."""
    top = packing.top
    with Engine(packing) as engine, engine.undamped(DT) as dynamics:
        do, value = engine.lammps.command, engine.lammps.extract_fix
        do("fix drive top drive/spring rigid protocol 0.5 0.1 0.0 1.0")
        do("run 0 post no")
        moving = dynamics.advance(50)
        assert (moving.velocity[top, 0] == 0.5).all()
        assert np.ptp(moving.velocity[top, 1]) > 1e-3
        assert value("drive", 0, 1, 0) == pytest.approx(50 * DT * 0.5, abs=1e-13)  # 50 roundings
        dynamics.advance(151)
        first, last = dynamics.advance(10), dynamics.advance(100)
        assert (first.velocity[top, 0] == 0.0).all()
        assert np.array_equal(first.position[top, 0], last.position[top, 0])
        force = value("drive", 0, 0)
        do("unfix drive")
        do("run 0 post no")
        assert force == pytest.approx(-engine.net_force[: len(packing)][top].mean(), rel=1e-12)
        assert abs(force) > 0.1


def test_runs_that_the_spring_cannot_draw_are_refused(reference_packing):
    with Engine(reference_packing(1.0)) as engine, engine.undamped(DT, drag_time=10.0):
        engine.lammps.command("fix drive top drive/spring rigid velocity 1.0")
        with pytest.raises(EngineError, match="rigid does not work with the drag of fix move"):
            engine.command("run 0 post no")
    with Engine(reference_packing(1.0)) as engine, engine.undamped(DT):
        engine.lammps.command("group some id 1:3")
        engine.lammps.command("fix drive some drive/spring 1 velocity 1.0")
        engine.command("run 0 post no")
        engine.lammps.command("set atom 1 type 1")
        engine.lammps.command("group some clear")
        engine.lammps.command("group some id 2:3")
        with pytest.raises(EngineError, match="had 3 disks when the spring began to draw, and has 2 now"):
            engine.command("run 0 post no")
