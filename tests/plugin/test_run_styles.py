"""Ways of running LAMMPS that the styles do not serve: one sentence before the run."""

import re
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI
from table_rows import rows_of

from faultgouge.pywrap.lammps.decks import DECKS
from faultgouge.pywrap.lammps.instance import lammps_instance

FRICTIONLESS = "variable mu index 0.0\n"
MODEL = f"variable decks index {DECKS}\ninclude {DECKS}/system.in\ntimestep 1e-3\n"
ALONE = Path(__file__).with_name("inputs").joinpath("one_disk.in").read_text()
# a growing radius needs ghosts whose radii are sent in every step
GROWING = MODEL.replace("system.in", "growing.in")
DUMP = "fix still all displace/disc\nrun 0\nwrite_dump all custom seen.dump id x y\nunfix still\n"
RERUN = f"{MODEL}{DUMP}rerun seen.dump dump x y\n"
MINIMIZE, STILL = "minimize 0 1e-3 10 10\n", "fix still all displace/disc\nrun 0\n"
GROWS = "variable d equal 1.0+step*dt\nfix grow all adapt 1 atom diameter v_d\nfix move all nve/disc 1.0\nrun 1\n"
REFUSED = rows_of("plugin/refused_run_styles.txt", **{name: each for name, each in globals().items() if name.isupper()})


@pytest.mark.parametrize(("parts", "says"), REFUSED, ids=[says[:40] for _, says in REFUSED])
def test_it_is_refused_in_a_sentence(tmp_path, monkeypatch, parts, says):
    """In this process, which saves the start of another one."""
    text = (DECKS / "system.in").read_text().replace("atom_style      sphere", "atom_style sphere 1")
    (tmp_path / "growing.in").write_text(text)
    monkeypatch.chdir(tmp_path)
    refused = pytest.raises(Exception, match=re.escape(says))
    with closing(lammps_instance(MPI.COMM_SELF, None)) as instance, refused:
        instance.commands_string("".join(parts).replace(f"{DECKS}/growing.in", "growing.in"))


SERVED = {
    "change_box": "change_box all x scale 1.001 remap units box",
    "displace_atoms": "displace_atoms top move 0.001 0 0",
    "delete_atoms": "group gone id 50\ndelete_atoms group gone compress no",
    "set diameter": "set atom 5 diameter 1.01",
    "minimize": "unfix move\nminimize 0 1e-8 20 200\nfix move all nve/disc 1.0",
}
MOVES = f"{FRICTIONLESS}{MODEL}fix move all nve/disc 1.0\n"


@pytest.mark.parametrize("case", SERVED)
@pytest.mark.slow
def test_after_a_command_forces_are_those_of_a_new_instance(lmp, tmp_path, case):
    """To the bit, in what LAMMPS itself writes of the disks that the command has left."""
    write = "run 0\nwrite_dump all custom {}.dump id x y fx fy modify sort id format float %.17g\n"
    lmp(f"{MOVES}run 20\n{SERVED[case]}\n{write.format('one')}write_data left.data\n")
    lmp(MOVES + write.format("new"), data="left.data")
    one, new = (np.loadtxt(tmp_path / f"{name}.dump", skiprows=9) for name in ("one", "new"))
    assert np.array_equal(one, new)
    assert len(one) == (99 if case == "delete_atoms" else 100)
    assert np.abs(one[:, 3:]).max() > (0 if case == "minimize" else 1e-3)  # the command has changed something


@pytest.mark.slow
def test_without_friction_a_rerun_is_served(lmp):
    lmp(FRICTIONLESS + RERUN)
