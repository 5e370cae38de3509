"""Ways of running LAMMPS that the styles do not serve: one sentence before the run."""

import re
from contextlib import closing

import numpy as np
import pytest
from mpi4py import MPI

from faultgouge.pywrap.lammps.decks import DECKS
from faultgouge.pywrap.lammps.instance import lammps_instance

FRICTIONLESS = "variable mu index 0.0\n"
MODEL = f"variable decks index {DECKS}\ninclude {DECKS}/system.in\ntimestep 1e-3\n"
ALONE = """
units lj
dimension 2
boundary p p p
atom_style sphere
region box block 0 4 0 4 -0.1 0.1
create_box 1 box
create_atoms 1 single 1 1 0
set group all diameter 1.0 mass 1.0
pair_style zero 1.0 nocoeff
pair_coeff * *
run_style respa 2 2
"""
# a growing radius needs ghosts whose radii are sent in every step
GROWING = MODEL.replace("system.in", "growing.in")
DUMP = "fix still all displace/disc\nrun 0\nwrite_dump all custom seen.dump id x y\nunfix still\n"
RERUN = f"{MODEL}{DUMP}rerun seen.dump dump x y\n"
REFUSED = {
    "pair style": (f"{MODEL}run_style respa 2 2\nrun 0\n", "pair mindlin/smooth does not work under run_style respa"),
    "nve/disc": (f"{ALONE}fix move all nve/disc 1.0\nrun 10\n", "fix nve/disc does not work under run_style respa"),
    "overdamped/disc": (
        f"{ALONE}fix move all overdamped/disc 1.0 1.0\nrun 10\n",
        "fix overdamped/disc does not work under run_style respa",
    ),
    "addforce/signal": (
        f"{ALONE}fix push all addforce/signal cosine 1.0 1.0\nrun 10\n",
        "fix addforce/signal does not work under run_style respa",
    ),
    "a signal in a minimization": (
        f"{FRICTIONLESS}{MODEL}fix push top addforce/signal cosine 1.0 1.0\nminimize 0 1e-3 10 10\n",
        "a minimizer has no time",
    ),
    "weakening in a minimization": (
        f"{FRICTIONLESS}{MODEL}comm_modify vel yes\nfix weaken top weaken/friction 1 0 0 1 0 1\n"
        "minimize 0 1e-3 10 10\n",
        "cannot be minimized, since its forces depend on the path",
    ),
    "a minimization with friction": (
        f"{MODEL}minimize 0 1e-3 10 10\n",
        "pair mindlin/smooth with friction cannot be minimized, since its forces depend on the path",
    ),
    "renumbered by delete_atoms": (
        f"{MODEL}fix still all displace/disc\nrun 0\ngroup gone id 50\ndelete_atoms group gone\nrun 0\n",
        "Atom IDs were renumbered, so that the slip history no longer belongs to its contacts",
    ),
    "renumbered by reset_atoms": (
        f"{MODEL}fix still all displace/disc\nrun 0\nreset_atoms id sort yes\nrun 0\n",
        "Atom IDs were renumbered",
    ),
    "replicate": (f"{MODEL}replicate 2 1 1\n", "Cannot replicate with fixes that store per-atom quantities"),
    "rerun": (RERUN, "pair mindlin/smooth with friction cannot serve rerun"),
    "radii that change": (
        f"{GROWING}variable d equal 1.0+step*dt\nfix grow all adapt 1 atom diameter v_d\n"
        "fix move all nve/disc 1.0\nrun 1\n",
        "fix grow of style adapt changes radii within a run",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_it_is_refused_in_a_sentence(tmp_path, monkeypatch, case):
    """In this process, which saves the start of another one."""
    script, says = REFUSED[case]
    text = (DECKS / "system.in").read_text().replace("atom_style      sphere", "atom_style sphere 1")
    (tmp_path / "growing.in").write_text(text)
    monkeypatch.chdir(tmp_path)
    refused = pytest.raises(Exception, match=re.escape(says))
    with closing(lammps_instance(MPI.COMM_SELF, None)) as instance, refused:
        instance.commands_string(script.replace(f"{DECKS}/growing.in", "growing.in"))


SERVED = {
    "change_box": "change_box all x scale 1.001 remap units box",
    "displace_atoms": "displace_atoms top move 0.001 0 0",
    "delete_atoms": "group gone id 50\ndelete_atoms group gone compress no",
    "set diameter": "set atom 5 diameter 1.01",
    "minimize": "unfix move\nminimize 0 1e-8 20 200\nfix move all nve/disc 1.0",
}
MOVES = f"{FRICTIONLESS}{MODEL}fix move all nve/disc 1.0\n"


def dumped(path):
    return np.loadtxt(path, skiprows=9)


@pytest.mark.parametrize("case", SERVED)
@pytest.mark.slow
def test_after_a_command_forces_are_those_of_a_new_instance(lmp, tmp_path, case):
    """To the bit, in what LAMMPS itself writes of the disks that the command has left."""
    write = "run 0\nwrite_dump all custom {}.dump id x y fx fy modify sort id format float %.17g\n"
    lmp(f"{MOVES}run 20\n{SERVED[case]}\n{write.format('one')}write_data left.data\n")
    lmp(MOVES + write.format("new"), data="left.data")
    one, new = (dumped(tmp_path / f"{name}.dump") for name in ("one", "new"))
    assert np.array_equal(one, new)
    assert len(one) == (99 if case == "delete_atoms" else 100)
    assert np.abs(one[:, 3:]).max() > (0 if case == "minimize" else 1e-3)  # the command has changed something


@pytest.mark.slow
def test_velocities_of_the_command_velocity_move_disks(lmp, tmp_path):
    write = "write_dump all custom {}.dump id x y modify sort id format float %.17g\n"
    lmp(f"{MOVES}{write.format('before')}velocity all set 0.1 0 NULL\nrun 1\n{write.format('after')}")
    before, after = (dumped(tmp_path / f"{name}.dump") for name in ("before", "after"))
    # forces at rest are 1e-10, and the step is 1e-3
    np.testing.assert_allclose(after[:, 1] - before[:, 1], 0.1 * 1e-3, rtol=0, atol=1e-13)


@pytest.mark.slow
def test_without_friction_a_rerun_is_served(lmp):
    lmp(FRICTIONLESS + RERUN)
