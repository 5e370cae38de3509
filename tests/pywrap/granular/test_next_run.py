"""The next run of a LAMMPS instance after looks at its packing: the same to the bit as without them."""

import gzip
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from granular_packings import command, instance, start, with_law
from reference_layer import on_ranks

import faultgouge


def sliding(log, count: int, slope: float, law: str, timestep: float, more: str):
    """LAMMPS with spheres that collide and slide."""
    lmp = instance(log)
    start(lmp, 3, count)
    with_law(lmp, law, 3, "100", "100", ("", ""))
    command(lmp, f"fix load all gravity 1.0 vector {slope} 0 -1\nfix move all nve/sphere\ntimestep {timestep}\n{more}")
    return lmp


def state(lmp) -> np.ndarray:
    """All that moves, in the order of the IDs."""
    count = lmp.extract_setting("nlocal")
    names = ("id", "x", "v", "omega", "f", "torque")
    rows = np.column_stack([lmp.numpy.extract_atom(name)[:count] for name in names])
    return rows[np.argsort(rows[:, 0])]


def test_a_look_changes_nothing(tmp_path):
    """The run that follows is the same to the bit, while particles still collide and slide."""
    ends = []
    for looks in (0, 2):
        dump = f"dump 1 all custom 100 {tmp_path}/dump{looks} id x"
        mean = f"fix mean all ave/time 10 1 10 c_thermo_temp file {tmp_path}/mean{looks}"
        lmp = sliding(tmp_path / f"log{looks}", 12, 0.8, "mindlin_rescale/force", 0.004, f"{dump}\n{mean}\nrun 1950")
        before = state(lmp)
        for _ in range(looks):
            assert faultgouge.from_lammps(lmp, balance=np.inf).contacts.at_bound.any()
        assert np.array_equal(state(lmp), before)
        lmp.command("run 500")
        ends.append(state(lmp))
        lmp.close()
    assert np.array_equal(*ends)
    one, other = ([(tmp_path / f"{name}{looks}").read_text() for name in ("dump", "mean", "log")] for looks in (0, 2))
    assert one[:2] == other[:2]
    assert one[2].count("run ") == other[2].count("run ")


@pytest.mark.parametrize(("style", "columns"), [("custom/gz", "id x y z vx vy vz fx fy fz"), ("xyz/gz", "")])
def test_a_look_leaves_compressed_dumps_whole(tmp_path, style, columns):
    """zlib writes the rest of a file when it is closed, as a copy of the process would at the place that both share."""
    dump = f"dump 1 all {style} 10 {tmp_path}/dump.gz {columns}\nrun 1995"
    lmp = sliding(tmp_path / "log.lammps", 18, 0.2, "gran/hertz/history", 0.002, dump)
    with (tmp_path / "own.txt").open("w") as own:
        own.write("what a user's script has written")
        for _ in range(2):
            faultgouge.from_lammps(lmp, balance=np.inf)
            lmp.command("run 1000")
        lmp.close()
    text = gzip.decompress((tmp_path / "dump.gz").read_bytes()).decode()
    assert len(re.findall(r"(?m)^(ITEM: TIMESTEP$| ?Atoms\. Timestep)", text)) == 400
    assert text.count("\n") == 400 * (18 + (9 if columns else 2))
    assert (tmp_path / "own.txt").read_text() == "what a user's script has written"


@pytest.mark.ranks
def test_several_ranks_are_refused(tmp_path):
    """Their process cannot be copied; a deck is carried out all the same, and its state is kept."""
    script = "from granular_packings import instance; from faultgouge import from_lammps; from_lammps(instance())"
    words = [*on_ranks(2), sys.executable, "-c", script]
    done = subprocess.run(words, cwd=Path(__file__).parent, capture_output=True, text=True, timeout=600)
    assert "which several ranks or threads cannot have: use one rank and one thread" in done.stderr
