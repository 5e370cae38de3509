"""What LAMMPS refuses, in one sentence before a run: arguments, run styles, and disks that make no sense."""

import re
from contextlib import closing
from pathlib import Path

import pytest
from mpi4py import MPI
from table_rows import rows_of

from faultgouge.pywrap.lammps.instance import lammps_instance

MODEL = Path(__file__).with_name("inputs").joinpath("refused.in").read_text()
NVE = "fix 1 all nve/disc 1.0 "
GOOD = {"pair": "pair_style mindlin/smooth 2e5 5e4 1.0", "coeff": "pair_coeff * *", "fix": NVE, "run": "run 10"}
GOOD |= {"dimension": 2, "vel": "comm_modify vel yes", "width": 8}
DELETE = "run 0\ngroup one id 1\ndelete_atoms group one {}\nrun 10"
WORDS = {
    "PAIR": "pair_style mindlin/smooth 2e5 ",
    "NVE": NVE,
    "OVERDAMPED": "fix 1 all overdamped/disc ",
    "FLOOR": "fix 1 all wall/mindlin/smooth 2e5 ",
    "THIRD": "\ncreate_atoms 1 single {} 0.499 0\nset group all diameter 1.0",
    "ADAPT": NVE + "\nvariable c equal 1.0\nfix less all adapt 1 pair mindlin/smooth ",
    "MINIMIZE": "minimize 0 1e-6 10 10",
    "DELETE": DELETE,
    "NEW": NVE + "\nfix 2 all ",
}
"""Parts of the inputs in the table."""


@pytest.mark.parametrize(
    ("change", "says"),
    rows_of("plugin/refused_commands.txt", **WORDS),
    ids=lambda value: str(next(iter(value.values())))[:40] if isinstance(value, dict) else "",
)
def test_refused(change, says):
    """In this process, which saves the second that another one takes to start."""
    refused = pytest.raises(Exception, match=f"ERROR.*{re.escape(says)}")
    with closing(lammps_instance(MPI.COMM_SELF, None)) as instance, refused:
        instance.commands_string(MODEL.format(**{**GOOD, **change}))


@pytest.mark.slow
def test_the_layout_of_another_version_is_refused(lmp, tmp_path):
    """A restart file whose slips have another layout; one of this layout is read. The model of the refusals runs, and
    disks may be deleted that leave the slips of the others."""
    lmp(MODEL.format(**{**GOOD, "run": DELETE.format("compress no")}))
    state, mark = tmp_path / "state.restart", (0x4D444C53).to_bytes(4, "little")
    lmp(MODEL.format(**{**GOOD, "run": "run 0\nunfix 1\nwrite_restart state.restart"}))
    lmp("read_restart state.restart\nrun 0\n")
    before, after = state.read_bytes().split(mark)
    state.write_bytes(before + mark + (7).to_bytes(4, "little") + after[4:])
    done = lmp("read_restart state.restart\n", fails=True)
    assert "mindlin/smooth of another version: read the file with" in done.stdout + done.stderr
