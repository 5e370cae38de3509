"""The force of a signal and friction that weakens: fixes against the same formulas in LAMMPS's variables."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from faultgouge.pywrap import Engine

X = "(0.5*(3.0*step*dt-10.0))"
TABLE = "0 0\n1.5, -0.25 # a comment\n\n2 1\n"
SIGNALS = {
    "cosine": ("cosine 0.3 2.0", "0.3*cos(2.0*step*dt)"),
    "pulse": ("pulse 0.3 3.0", f"0.3*(1-2*{X}*{X})*exp(-{X}*{X})"),
    "sweep": ("sweep 0.3 2.0 5.0 6.0", "0.3*sin(2.0*step*dt+0.5*3.0*(step*dt)^2/6.0)"),
}
RECORD = "3*ternary(step*dt<3,-0.25*step*dt/3,ternary(step*dt<=4,-0.25+1.25*(step*dt-3),0))"
SIGNALS["record"] = ("record v_name scale 3 stretch 2", RECORD)


@pytest.mark.parametrize("kind", SIGNALS)
@pytest.mark.parametrize("on", ["layer", "floor"])
def test_force_of_a_signal_is_that_of_a_variable(reference_packing, tmp_path, kind, on):
    (tmp_path / "a table").write_text(TABLE)
    arguments, formula = SIGNALS[kind]
    packing, seen = reference_packing(0.0), set()
    factor = packing.top if on == "layer" else -np.where(packing.top, 1.7, 1.0)
    with Engine(packing) as engine:
        engine.lammps.commands_string(f"""
timestep 0.25
fix still all displace/disc rotation no
set type 2 mass 1.7
variable formula equal {formula}
variable name index "{tmp_path / "a table"}"
""")
        at_rest = force_at(engine, 0)
        engine.lammps.command(f"fix force {'top' if on == 'layer' else 'all'} addforce/signal {arguments} on {on}")
        for step in (0, 1, 7, 12, 13, 16, 17, 24):
            forced = force_at(engine, step) - at_rest
            value = engine.lammps.extract_variable("formula")
            # rounding of the packing's own forces of order 3, and of a number of 15 digits
            np.testing.assert_allclose(forced[: len(packing)], factor * value, rtol=0, atol=1e-14)
            assert not forced[len(packing) :].any()
            assert engine.lammps.extract_fix("force", 0, 0) == pytest.approx(value, rel=1e-14, abs=1e-15)
            seen.add(value)
    assert len(seen) > 4


def force_at(engine, step):
    engine.lammps.commands_string(f"reset_timestep {step}\nrun 0 post no")
    return engine.net_force


def test_mean_of_a_layer_is_exact(reference_packing):
    """Sums of ten doubles of any size, those that cancel included, against the exact sum of Python."""
    packing = reference_packing(1.0)
    with Engine(packing) as engine:
        lammps, step = engine.lammps, itertools.count(1)
        lammps.command("compute mean top layer/velocity")

        @given(st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=1, max_size=10), st.booleans())
        @settings(max_examples=200, deadline=None)
        def check(numbers, cancels):
            numbers = [number / 16 for number in numbers]  # so that the sum is a double
            numbers = [*numbers[:5], *(-each for each in numbers[4::-1])] if cancels else numbers
            velocity = np.pad(numbers, (0, 10 - len(numbers)))
            v, tag = (lammps.numpy.extract_atom(name)[: len(packing)] for name in ("v", "id"))
            v[packing.top[tag - 1], 0] = velocity
            lammps.command(f"reset_timestep {next(step)}")  # LAMMPS computes once in a step
            mean = lammps.extract_compute("mean", 0, 0)
            assert mean == pytest.approx(math.fsum(velocity) / 10, rel=3e-16, abs=5e-324)

        check()


VARIABLES = """
compute velocity top layer/velocity
variable friction equal 1.0*ternary(abs(c_velocity)>0.01,0.2*exp(-0.4*(abs(c_velocity)-0.01)/0.3)+0.7,1)
fix weaken all adapt 1 pair mindlin/smooth mu * * v_friction
fix_modify floor mu v_friction
"""


@pytest.mark.parametrize("compensated", [False, True], ids=["double", "compensated"])
def test_friction_weakens_as_by_variables(reference_packing, compensated):
    """A layer that is torn off: it slides on its contacts, and so does what lies below."""
    packing, ends = replace(reference_packing(1.0, compensated), fx=3.0), []
    for commands in ("", VARIABLES, "fix weaken top weaken/friction 1.0 0.2 0.4 0.7 0.01 0.3"):
        with Engine(packing) as engine, engine.undamped(2e-3) as dynamics:
            engine.lammps.commands_string(f"{commands}\nrun 0 post no")
            ends.append(dynamics.advance(300).velocity)
            if commands.startswith("fix"):
                friction, told = (engine.lammps.extract_fix("weaken", 0, *place) for place in ((0,), (1, 0)))
    constant, by_variables, by_fix = ends
    speed = abs(by_fix[packing.top, 0].mean())
    assert speed > 0.1
    assert (friction, told) == pytest.approx((0.2 * np.exp(-0.4 * (speed - 0.01) / 0.3) + 0.7, speed), rel=1e-14)
    # a variable in a formula is rounded to 15 digits, and the motion multiplies that
    assert np.abs(by_fix - by_variables).max() < 1e-11
    assert np.abs(by_fix - constant).max() > 1e-3


def test_friction_falls_to_zero_and_comes_back(reference_packing):
    """The second run begins with mu = 0 in the pair style, and has friction and slips nevertheless."""
    torn = replace(reference_packing(1.0), fx=3.0)
    with Engine(torn) as engine, engine.undamped(2e-3) as dynamics:
        weakening = "fix weaken top weaken/friction 1.0 0 1.0 0 0.5 1e-9"
        engine.lammps.commands_string(f"{weakening}\nvelocity top set 1.0 0.0 0.0\nrun 1 post no")
        assert engine.lammps.extract_fix("weaken", 0, 0) == 0.0
        engine.lammps.commands_string("velocity all set 0.0 0.0 0.0\nrun 0 post no")
        assert engine.lammps.extract_fix("weaken", 0, 0) == 1.0
        assert not engine.packing.contacts.slip.any()
        dynamics.advance(20)
        contacts = engine.packing.contacts
        assert contacts.slip[contacts.floor].any()
        assert contacts.slip[~contacts.floor].any()
