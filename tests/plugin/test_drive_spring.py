"""The spring that draws a layer: its force against NumPy, and across the period; on ranks in test_decks.py."""

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


@pytest.fixture(params=[False, True], ids=["double", "compensated"])
def packing(request, reference_packing):
    return reference_packing(1.0, request.param)


@pytest.fixture
def drawn(packing):
    """Its LAMMPS under undamped dynamics: the engine, time steps, and numbers of the spring."""
    with Engine(packing) as engine, engine.undamped(DT) as dynamics:
        yield engine, dynamics.advance, lambda *place: engine.lammps.extract_fix("drive", 0, *place)


def test_force_is_that_of_a_spring_whose_end_moves(packing, drawn):
    """A layer that is thrown across the period, and NumPy that follows its disks from one look to the next."""
    engine, advance, value = drawn
    words = " ".join(f"{velocity} {duration}" for velocity, duration in PROTOCOL)
    engine.lammps.commands_string(f"fix drive top drive/spring {STIFFNESS} protocol {words}\nrun 0 post no")
    assert value(0) == 0.0
    top, place, moved, farthest = packing.top, packing.position, np.zeros(len(packing)), 0.0
    for step in range(20, 401, 20):
        motion = advance(20)
        moved += nearest_image(motion.position - place, packing.box_length)[:, 0]
        place, mean = motion.position, moved[top].mean()
        end, velocity = way(step * DT)
        # rounding of coordinates of order 10, in compensated arithmetic, too, since NumPy has doubles
        assert value(1, 0) == pytest.approx(mean, abs=1e-13)
        assert value(1, 1) == pytest.approx(end, abs=1e-14)
        assert value(1, 2) == velocity
        assert value(0) == pytest.approx(STIFFNESS * (end - mean), abs=1e-10)
        farthest = max(farthest, mean)
    assert farthest > 1.2  # disks cross the period
    engine.command("run 0 post no")
    with_spring, force = engine.net_force, value(0)
    engine.lammps.commands_string("unfix drive\nrun 0 post no")
    difference = (with_spring - engine.net_force)[: len(packing)]
    # rounding of forces of order 1e3 in the torn packing
    np.testing.assert_allclose(difference, np.where(top, force, 0.0), rtol=0, atol=1e-11)


def test_rigid_layer_moves_at_the_velocity_and_then_not_at_all(packing, drawn):
    """Its force is that of the bed."""
    (engine, advance, value), top = drawn, packing.top
    engine.lammps.commands_string("fix drive top drive/spring rigid protocol 0.5 0.1 0.0 1.0\nrun 0 post no")
    moving = advance(50)
    assert (moving.velocity[top, 0] == 0.5).all()
    assert np.ptp(moving.velocity[top, 1]) > 1e-3
    assert value(1, 0) == pytest.approx(50 * DT * 0.5, abs=1e-13)  # 50 roundings
    advance(151)
    first, last = advance(10), advance(100)
    assert (first.velocity[top, 0] == 0.0).all()
    assert np.array_equal(first.position[top, 0], last.position[top, 0])
    force = value(0)
    engine.lammps.commands_string("unfix drive\nrun 0 post no")
    assert force == pytest.approx(-engine.net_force[: len(packing)][top].mean(), rel=1e-12)
    assert abs(force) > 0.1


def test_runs_that_the_spring_cannot_draw_are_refused(reference_packing):
    with Engine(reference_packing(1.0)) as engine, engine.undamped(DT, drag_time=10.0):
        engine.lammps.command("fix drive top drive/spring rigid velocity 1.0")
        with pytest.raises(EngineError, match="rigid does not work with the drag of fix move"):
            engine.command("run 0 post no")
    with Engine(reference_packing(1.0)) as engine, engine.undamped(DT):
        engine.lammps.commands_string("group some id 1:3\nfix drive some drive/spring 1 velocity 1.0\nrun 0 post no")
        engine.lammps.commands_string("group some clear\ngroup some id 2:3")
        with pytest.raises(EngineError, match="had 3 disks when the spring began to draw, and has 2 now"):
            engine.command("run 0 post no")
