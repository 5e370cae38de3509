"""The force of a signal and friction that weakens: fixes against the same formulas in LAMMPS's variables."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from faultgouge.pywrap import Engine

X = "(0.5*(3.0*step*dt-10.0))"
TABLE = "0 0\n1.5, -0.25 # a comment\n\n2 1\n"
SIGNALS = {
    "cosine": ("cosine 0.3 2.0", "0.3*cos(2.0*step*dt)"),
    "pulse": ("pulse 0.3 3.0", f"0.3*(1-2*{X}*{X})*exp(-{X}*{X})"),
    "sweep": ("sweep 0.3 2.0 5.0 6.0", "0.3*sin(2.0*step*dt+0.5*3.0*(step*dt)^2/6.0)"),
    "record": (
        "record v_name scale 3 stretch 2",
        "3*ternary(step*dt<3,-0.25*step*dt/3,ternary(step*dt<=4,-0.25+1.25*(step*dt-3),0))",
    ),
}


@pytest.mark.parametrize("kind", SIGNALS)
@pytest.mark.parametrize("on", ["layer", "floor"])
def test_force_of_a_signal_is_that_of_a_variable(reference_packing, tmp_path, kind, on):
    (tmp_path / "a table").write_text(TABLE)
    arguments, formula = SIGNALS[kind]
    packing = reference_packing(0.0)
    with Engine(packing) as engine:
        do = engine.lammps.command
        do("timestep 0.25")
        do("fix still all displace/disc rotation no")
        do("set type 2 mass 1.7")
        do(f"variable formula equal {formula}")
        do(f'variable name index "{tmp_path / "a table"}"')
        at_rest, factor = force_at(engine, 0), 1.0 if on == "layer" else -np.where(packing.top, 1.7, 1.0)
        do(f"fix force {'top' if on == 'layer' else 'all'} addforce/signal {arguments} on {on}")
        seen = []
        for step in (0, 1, 7, 12, 13, 16, 17, 24):
            forced = force_at(engine, step) - at_rest
            value = engine.lammps.extract_variable("formula")
            expected = factor * value * (packing.top if on == "layer" else 1.0)
            # rounding of the packing's own forces of order 3, and of a number of 15 digits
            np.testing.assert_allclose(forced[: len(packing)], expected, rtol=0, atol=1e-14)
            assert not forced[len(packing) :].any()
            assert engine.lammps.extract_fix("force", 0, 0) == pytest.approx(value, rel=1e-14, abs=1e-15)
            seen.append(value)
    assert len(set(seen)) > 4


def force_at(engine, step):
    engine.lammps.command(f"reset_timestep {step}")
    engine.lammps.command("run 0 post no")
    return engine.net_force


@given(
    numbers=st.lists(st.floats(allow_nan=False, allow_infinity=False, width=64), min_size=1, max_size=10),
    cancels=st.booleans(),
)
@settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_mean_of_a_layer_is_exact(layer, numbers, cancels):
    """Sums of doubles of any size, those that cancel included, against the exact sum of Python."""
    numbers = [number / 16 for number in numbers]  # so that the sum is a double
    numbers = [*numbers[:5], *(-number for number in reversed(numbers[:5]))] if cancels else numbers
    velocity = np.zeros(10)
    velocity[: len(numbers)] = numbers
    expected = math.fsum(velocity) / 10
    assert layer(velocity) == pytest.approx(expected, rel=3e-16, abs=5e-324)


@pytest.fixture(scope="module")
def layer(reference_packing):
    """Mean by compute layer/velocity of ten velocities."""
    packing = reference_packing(1.0)
    with Engine(packing) as engine:
        lammps, step = engine.lammps, itertools.count(1)
        lammps.command("compute mean top layer/velocity")

        def mean(velocity):
            v = lammps.numpy.extract_atom("v")
            tag = lammps.numpy.extract_atom("id")[: len(packing)]
            v[: len(packing)][packing.top[tag - 1], 0] = velocity
            lammps.command(f"reset_timestep {next(step)}")  # LAMMPS computes once in a step
            return lammps.extract_compute("mean", 0, 0)

        yield mean


VARIABLES = """
compute velocity top layer/velocity
variable friction equal 1.0*ternary(abs(c_velocity)>0.01,0.2*exp(-0.4*(abs(c_velocity)-0.01)/0.3)+0.7,1)
fix weaken all adapt 1 pair mindlin/smooth mu * * v_friction
fix_modify floor mu v_friction
"""


@pytest.mark.parametrize("precision", ["double", "compensated"])
def test_friction_weakens_as_by_variables(reference_packing, precision):
    """A layer that is torn off: it slides on its contacts, and so does what lies below."""
    packing = replace(reference_packing(1.0), fx=3.0)
    if precision == "compensated":
        packing = replace(packing, position_low=np.zeros_like(packing.position))
    ends = []
    for commands in (VARIABLES, "fix weaken top weaken/friction 1.0 0.2 0.4 0.7 0.01 0.3", ""):
        with Engine(packing) as engine, engine.undamped(2e-3) as dynamics:
            for command in commands.strip().splitlines():
                engine.lammps.command(command)
            engine.lammps.command("run 0 post no")
            motion = dynamics.advance(300)
            speed = abs(motion.velocity[packing.top, 0].mean())
            if not commands.startswith("fix"):
                ends.append(motion.velocity)
                continue
            ends.append(motion.velocity)
            friction = 0.2 * np.exp(-0.4 * (speed - 0.01) / 0.3) + 0.7
            assert engine.lammps.extract_fix("weaken", 0, 0) == pytest.approx(friction, rel=1e-14)
            assert engine.lammps.extract_fix("weaken", 0, 1, 0) == pytest.approx(speed, rel=1e-14)
    by_variables, by_fix, constant = ends
    assert speed > 0.1
    # a variable in a formula is rounded to 15 digits, and the motion multiplies that
    assert np.abs(by_fix - by_variables).max() < 1e-11
    assert np.abs(by_fix - constant).max() > 1e-3


def test_friction_falls_to_zero_and_comes_back(reference_packing):
    """The second run begins with mu = 0 in the pair style, and has friction and slips nevertheless."""
    torn = replace(reference_packing(1.0), fx=3.0)
    with Engine(torn) as engine, engine.undamped(2e-3) as dynamics:
        do = engine.lammps.command
        do("fix weaken top weaken/friction 1.0 0 1.0 0 0.5 1e-9")
        do("velocity top set 1.0 0.0 0.0")
        do("run 1 post no")
        assert engine.lammps.extract_fix("weaken", 0, 0) == 0.0
        do("velocity all set 0.0 0.0 0.0")
        do("run 0 post no")
        assert engine.lammps.extract_fix("weaken", 0, 0) == 1.0
        assert not engine.packing.contacts.slip.any()
        dynamics.advance(20)
        contacts = engine.packing.contacts
        assert contacts.slip[contacts.floor].any()
        assert contacts.slip[~contacts.floor].any()
