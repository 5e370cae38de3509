"""What LAMMPS refuses, in one sentence before a run: arguments, run styles, and disks that make no sense."""

import re
from contextlib import closing

import pytest
from mpi4py import MPI

from faultgouge.pywrap.lammps.instance import lammps_instance

MODEL = """
units lj
dimension {dimension}
boundary p f p
atom_style sphere
{vel}
region box block 0 {width} -1 10 -0.5 0.5
create_box 1 box
create_atoms 1 single 1 0.499 0
create_atoms 1 single 2 0.499 0
set group all diameter 1.002
set group all mass 1.0
{pair}
{coeff}
{fix}
{run}
"""
GOOD = {
    "dimension": 2,
    "vel": "comm_modify vel yes",
    "width": 8,
    "pair": "pair_style mindlin/smooth 2e5 5e4 1.0",
    "coeff": "pair_coeff * *",
    "fix": "fix 1 all nve/disc 1.0",
    "run": "run 10",
}
PAIR = "pair_style mindlin/smooth 2e5 "
NVE, OVERDAMPED, FLOOR = "fix 1 all nve/disc 1.0 ", "fix 1 all overdamped/disc ", "fix 1 all wall/mindlin/smooth 2e5 "
KNOWN = "knows the keywords exponent, history, damping, energy and compensated, but not "
THIRD = "\ncreate_atoms 1 single {} 0.499 0\nset group all diameter 1.0"
ADAPT = NVE + "\nvariable c equal 1.0\nfix less all adapt 1 pair mindlin/smooth "
MINIMIZE, DELETE = "minimize 0 1e-6 10 10", "run 0\ngroup one id 1\ndelete_atoms group one {}\nrun 10"
NEW = NVE + "\nfix 2 all "


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"pair": PAIR + "5e4"}, "takes three numbers, KN KT MU"),
        ({"pair": PAIR + "5e4 -1"}, "KN must be positive, KT and MU not negative"),
        ({"pair": "pair_style mindlin/smooth nan 5e4 1"}, "instead of 'nan'"),
        ({"pair": PAIR + "5e4 1 exact"}, KNOWN + "exact"),
        ({"pair": PAIR + "5e4 1 compensated"}, "moves disks without the low parts"),
        ({"fix": NVE + "compensated"}, "needs pair_style mindlin/smooth KN KT MU compensated"),
        ({"pair": PAIR + "0 0 compensated", "run": MINIMIZE}, "does not carry the low parts"),
        ({"fix": FLOOR + "5e4 1.0 ylo 0.0 compensated"}, "must both have the keyword"),
        ({"coeff": "pair_coeff 1 1"}, "must start with * *"),
        ({"vel": ""}, "use comm_modify vel yes"),
        ({"dimension": 3}, "use dimension 2"),
        ({"width": 1.99, "fix": NVE + "\nneighbor 0.05 bin"}, "less than two diameters of the largest disk"),
        ({"run": MINIMIZE}, "cannot be minimized"),
        ({"fix": "fix 1 all nve/disc"}, "takes one number, I0"),
        ({"fix": "fix 1 all nve/disc 0.0"}, "I0 must be a positive number"),
        ({"fix": OVERDAMPED + "1.0"}, "takes two numbers, GAMMA and I0"),
        ({"fix": NVE + "turning no"}, "rotation yes|no and compensated, but got turning"),
        ({"fix": NVE + "rotation"}, "rotation takes yes or no"),
        ({"fix": FLOOR + "5e4 1.0 0.0"}, "takes KN KT MU ylo COORD"),
        ({"fix": FLOOR + "5e4 1.0 yhi 0.0"}, "knows a floor only"),
        ({"run": DELETE.format("")}, "use delete_atoms with compress no"),
        ({"fix": NVE + THIRD.format(1)}, "same centre"),
        ({"fix": NVE + THIRD.format(1.2)}, "only 0.19999999999999996 apart, the centre of one inside of the other"),
        ({"fix": FLOOR + "5e4 1.0 ylo 0.6"}, "has its centre at 0.499, below the floor"),
        ({"run": "velocity all set 1e3 0 0\nrun 1000"}, "in one step, farther than its radius 0.501"),
        # exponent, history, energy
        ({"pair": PAIR + "5e4 1 exponent 1.25"}, "exponent must be 1.5 or 1, not 1.25"),
        ({"pair": PAIR + "5e4 1 history half"}, "history must be total, rescaled or coulomb, not half"),
        ({"pair": PAIR + "5e4 1 history rescaled exponent 1"}, "history rescaled needs an exponent of 1.4 or more"),
        ({"pair": PAIR + "5e4 1 energy"}, "energy must be yes or no"),
        ({"pair": PAIR + "5e4 0 energy yes"}, "without friction there is no history to keep the energy of contacts in"),
        # dashpots and drag
        ({"pair": PAIR + "5e4 1 damping 1.0"}, "damping takes two numbers, CN CT"),
        ({"pair": PAIR + "5e4 1 damping -1.0 0.0"}, "damping CN CT must be finite and not negative (got -1.0 0.0)"),
        ({"fix": FLOOR + "5e4 1 ylo 0 damping 1 1"}, "needs pair_style mindlin/smooth KN KT MU damping CN CT"),
        ({"fix": FLOOR + "5e4 1 ylo 0\nfix_modify 1 damping 1"}, "damping takes two numbers, CN CT, or no"),
        ({"fix": NVE + "drag"}, "drag takes a time, TAU"),
        ({"fix": NVE + "drag 0"}, "TAU must be a positive number, not 0"),
        ({"fix": OVERDAMPED + "1.0 1.0 drag 5.0"}, "rotation yes|no and compensated, but got drag"),
        ({"pair": PAIR + "5e4 1 damping 1 1", "fix": OVERDAMPED + "1.0 1.0"}, "leave the keyword damping out"),
        ({"pair": PAIR + "0 0 damping 1 0", "run": MINIMIZE}, "a minimizer has no velocities"),
        ({"fix": ADAPT + "cn * * v_c"}, "param cn not supported"),
        # the spring that draws a layer, the force of a signal, and friction that weakens
        ({"fix": NEW + "drive/spring 10"}, "takes K or rigid, and velocity V or protocol"),
        ({"fix": NEW + "drive/spring 0 velocity 1"}, "K = 0 must be positive"),
        ({"fix": NEW + "drive/spring soft velocity 1"}, "instead of 'soft'"),
        ({"fix": NEW + "drive/spring 10 speed 1"}, "knows velocity and protocol, not speed"),
        ({"fix": NEW + "drive/spring 10 velocity 1 2"}, "velocity takes one number, but got 2"),
        ({"fix": NEW + "drive/spring 10 protocol 1 2 3"}, "takes pairs of a velocity and a time"),
        ({"fix": NEW + "drive/spring 10 protocol 1 0"}, "the time 0 must be above 0"),
        ({"fix": NEW + "addforce/signal"}, "knows cosine, pulse, sweep and record, not nothing"),
        ({"fix": NEW + "addforce/signal square 1 1"}, "knows cosine, pulse, sweep and record, not square"),
        ({"fix": NEW + "addforce/signal cosine 1"}, "cosine takes A OMEGA"),
        ({"fix": NEW + "addforce/signal pulse 1 0"}, "OMEGA = 0 must be above 0"),
        ({"fix": NEW + "addforce/signal sweep 1 1 2 0"}, "TIME = 0 must be above 0"),
        ({"fix": NEW + "addforce/signal cosine 1 1 on roof"}, "on is layer or floor, not roof"),
        ({"fix": NEW + "addforce/signal record nothing.txt"}, "nothing.txt cannot be read"),
        ({"fix": NEW + "addforce/signal record v_nothing"}, "there is no variable nothing"),
        ({"fix": NEW + "weaken/friction 1 0.2 0.4 -1 0 1"}, "must be finite and not negative, but one is -1"),
        ({"fix": NEW + "weaken/friction 1 0.2 0.4 0.8 0 0"}, "MU and V_SS must be above 0"),
    ],
    ids=lambda value: str(next(iter(value.values())))[:40] if isinstance(value, dict) else "",
)
def test_refused(change, says):
    """In this process, which saves the second that another one takes to start."""
    refused = pytest.raises(Exception, match=f"ERROR.*{re.escape(says)}")
    with closing(lammps_instance(MPI.COMM_SELF, None)) as instance, refused:
        instance.commands_string(MODEL.format(**{**GOOD, **change}))


@pytest.mark.parametrize("run", ["run 10", DELETE.format("compress no")])
def test_model_of_the_refusals_runs(lmp, run):
    """Also where disks are deleted that leave the slips of the others."""
    lmp(MODEL.format(**{**GOOD, "run": run}))


@pytest.mark.slow
def test_the_layout_of_another_version_is_refused(lmp, tmp_path):
    """A restart file whose slips have another layout; one of this layout is read."""
    state, mark = tmp_path / "state.restart", (0x4D444C53).to_bytes(4, "little")
    lmp(MODEL.format(**{**GOOD, "run": "run 0\nunfix 1\nwrite_restart state.restart"}))
    lmp("read_restart state.restart\nrun 0\n")
    before, after = state.read_bytes().split(mark)
    state.write_bytes(before + mark + (7).to_bytes(4, "little") + after[4:])
    done = lmp("read_restart state.restart\n", fails=True)
    assert "mindlin/smooth of another version: read the file with" in done.stdout + done.stderr
