"""Input decks: on two ranks, on one page each, in another LAMMPS; and what LAMMPS refuses, in one sentence."""

import os
import re
import subprocess
from contextlib import closing

import numpy as np
import pytest
from mpi4py import MPI
from reference_layer import BIN

from faultgouge.analysis import read_dump, spectrum
from faultgouge.pywrap.lammps.decks import DECKS
from faultgouge.pywrap.lammps.instance import lammps_instance

SOON = {"force_tolerance": 1e-3}
"""A relaxation ends after some thousand steps: ranks that wait for each other in every step are slow."""
SHORT = {
    "settle": {},
    "ramp": {"until": 1e-3},
    "perturb": {"time": 0.2},
    "perturb, damped": {"fx": 0.01, "time": 0.5, "amplitude": 1e-6, "v_ss": 2e-9, "cn": 2.0, "ct": 1.0, "tau": 20.0},
    "perturb, signal": {"time": 0.2, "signal": "record.txt", "scale": 1e-6, "on": "floor"},
}


@pytest.mark.ranks
@pytest.mark.parametrize("precision", ["double", pytest.param("compensated", marks=pytest.mark.long)])
@pytest.mark.parametrize("run", SHORT)
@pytest.mark.slow
def test_deck_runs_alone_and_the_same_on_two_ranks(lmp, tmp_path, run, precision):
    (tmp_path / "record.txt").write_text("# time value\n0 0\n0.1 1\n0.2 -1\n")
    written, given = [], SHORT[run]
    for ranks in (1, 2):
        done = lmp(DECKS / f"{run.split(',')[0]}.in", ranks=ranks, decks=DECKS, precision=precision, **SOON, **given)
        assert "WARNING" not in done.stdout
        written.append({path: path.read_text() for path in tmp_path.glob("*.disks")})
    assert written[0]
    assert written[0] == written[1]
    damping = {(each.law.cn, each.law.ct, each.drag_time) for each in map(read_dump, written[0])}
    assert (given.get("cn", 0.0), given.get("ct", 0.0), given.get("tau")) in damping


@pytest.mark.ranks
@pytest.mark.slow
def test_ranks_share_the_disks_evenly(lmp):
    """The box is three times as high as the disks, and LAMMPS cuts its height first."""
    done = lmp(f"include {DECKS}/system.in\nrun 0", ranks=2, decks=DECKS)
    assert "1 by 2 by 1 MPI processor grid" in done.stdout
    (share,) = (line.split() for line in done.stdout.splitlines() if line.startswith("Nlocal:"))
    assert float(share[3]) <= 1.1 * float(share[1])  # the most beside the mean


TEACHING = {
    "settle": ("loose100.data", "settled", "settled", {}),
    "ramp": ("packing100.data", "ramp.2", "ramp.2", {"until": 2e-3}),
    "perturb": ("packing100.data", "perturb", "perturb.end", {"time": 5, "amplitude": 1e-9}),
}


def positions(dump):
    """ID, x and y of each disk, as they stand in a dump."""
    header, rows = dump.read_text().split("ITEM: ATOMS ")[1].split("\n", 1)
    columns = [header.split().index(name) for name in ("id", "x", "y")]
    return np.array([row.split() for row in rows.splitlines()])[:, columns]


@pytest.mark.parametrize("stage", TEACHING)
@pytest.mark.slow
def test_teaching_deck_of_one_page_is_to_the_bit_the_deck_of_parts(lmp, tmp_path, stage):
    data, taught, composed, variables = TEACHING[stage]
    done = lmp(DECKS / "teaching" / f"{stage}.in", data=DECKS / data)
    assert "WARNING" not in done.stdout
    lmp(DECKS / f"{stage}.in", decks=DECKS, force_tolerance=1e-9, **variables)
    assert np.array_equal(positions(tmp_path / f"{taught}.dump"), positions(tmp_path / f"{composed}.disks"))


RAMP = ("-var", "decks", str(DECKS), "-var", "until", "2e-3")


@pytest.mark.skipif("LAMMPS_PROGRAM" not in os.environ, reason="LAMMPS_PROGRAM names no LAMMPS")
def test_same_eigenvalues_and_forces_in_a_lammps_of_ones_own(lmp, tmp_path):
    """A ramp in that of the environment, and in the one that tests/with_lammps.sh names and builds the plugin for."""
    environment = tmp_path / "environment"
    environment.mkdir()
    wheel = {key: value for key, value in os.environ.items() if key not in ("LAMMPS_PLUGIN_PATH", "LD_LIBRARY_PATH")}
    command = [BIN / "lmp", "-in", DECKS / "ramp.in", "-log", "none", *RAMP]
    subprocess.run(command, cwd=environment, env=wheel, check=True, capture_output=True, timeout=300)
    lmp(DECKS / "ramp.in", *RAMP)
    names = sorted(path.name for path in tmp_path.glob("*.disks"))
    assert len(names) > 1
    for name in names:
        here, there = read_dump(tmp_path / name), read_dump(environment / name)
        # one arithmetic, compiled twice
        np.testing.assert_allclose(here.net_force, there.net_force, rtol=0, atol=1e-12 * np.abs(here.fy))
        ours, others = (spectrum(each).eigenvalues for each in (here, there))
        np.testing.assert_allclose(ours, others, rtol=1e-12)


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
        ({"fix": FLOOR + "-5e4 1.0 ylo 0.0"}, "KT and MU not negative"),
        ({"run": DELETE.format("")}, "use delete_atoms with compress no"),
        ({"fix": NVE + THIRD.format(1)}, "same centre"),
        ({"fix": NVE + THIRD.format(1.2)}, "only 0.19999999999999996 apart, the centre of one inside of the other"),
        ({"fix": FLOOR + "5e4 1.0 ylo 0.6"}, "has its centre at 0.499, below the floor"),
        ({"run": "velocity all set 1e3 0 0\nrun 1000"}, "in one step, farther than its radius 0.501"),
        # exponent, history, energy
        ({"pair": PAIR + "5e4 1 exponent 1.25"}, "exponent must be 1.5 or 1, not 1.25"),
        ({"pair": PAIR + "5e4 1 exponent"}, "exponent must be 1.5 or 1, not left out"),
        ({"pair": PAIR + "5e4 1 history half"}, "history must be total, rescaled or coulomb, not half"),
        ({"pair": PAIR + "5e4 1 history"}, "history must be total, rescaled or coulomb, not left out"),
        ({"pair": PAIR + "5e4 1 history rescaled exponent 1"}, "history rescaled needs an exponent of 1.4 or more"),
        ({"fix": FLOOR + "5e4 1 ylo 0 exponent 1.6"}, "exponent must be 1.5 or 1, not 1.6"),
        ({"fix": FLOOR + "5e4 1 ylo 0 history half"}, "history must be total, rescaled or coulomb, not half"),
        (
            {"fix": FLOOR + "5e4 1 ylo 0 exponent 1 history rescaled"},
            "history rescaled needs an exponent of 1.4 or more",
        ),
        ({"fix": FLOOR + "5e4 1 ylo 0 rubber"}, KNOWN + "rubber"),
        ({"pair": PAIR + "5e4 1 energy"}, "energy must be yes or no"),
        ({"pair": PAIR + "5e4 0 energy yes"}, "without friction there is no history to keep the energy of contacts in"),
        # dashpots and drag
        ({"pair": PAIR + "5e4 1 damping 1.0"}, "damping takes two numbers, CN CT"),
        ({"pair": PAIR + "5e4 1 damping -1.0 0.0"}, "damping CN CT must be finite and not negative (got -1.0 0.0)"),
        ({"pair": PAIR + "5e4 1 damping 1.0 inf"}, "inf"),
        ({"pair": PAIR + "5e4 1 dampin 1.0 1.0"}, KNOWN + "dampin"),
        ({"fix": FLOOR + "5e4 1 ylo 0 damping 1.0"}, "damping takes two numbers, CN CT"),
        ({"fix": FLOOR + "5e4 1 ylo 0 damping 0.0 -2"}, "damping CN CT must be finite and not negative (got 0.0 -2)"),
        ({"fix": FLOOR + "5e4 1 ylo 0 damping 1 1"}, "needs pair_style mindlin/smooth KN KT MU damping CN CT"),
        ({"fix": FLOOR + "5e4 1 ylo 0\nfix_modify 1 damping 1"}, "damping takes two numbers, CN CT, or no"),
        ({"fix": NVE + "drag"}, "drag takes a time, TAU"),
        ({"fix": NVE + "drag 0"}, "TAU must be a positive number, not 0"),
        ({"fix": OVERDAMPED + "1.0 1.0 drag 5.0"}, "rotation yes|no and compensated, but got drag"),
        ({"pair": PAIR + "5e4 1 damping 1 1", "fix": OVERDAMPED + "1.0 1.0"}, "leave the keyword damping out"),
        ({"pair": PAIR + "0 0 damping 1 0", "run": MINIMIZE}, "a minimizer has no velocities"),
        ({"fix": ADAPT + "cn * * v_c"}, "param cn not supported"),
        ({"fix": ADAPT + "nonsense * * v_c"}, "param nonsense not supported"),
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
