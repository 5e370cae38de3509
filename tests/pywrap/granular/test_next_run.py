"""The next run of a LAMMPS instance after looks at its packing: the same to the bit as without them."""

import gzip
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from granular_packings import command, instance, start, state, with_law
from reference_layer import on_ranks


def test_a_look_changes_nothing(tmp_path):
    """The run that follows is the same to the bit, while particles still collide and slide."""
    from faultgouge.pywrap import from_lammps

    ends = []
    for looks in (0, 2):
        lmp = instance(tmp_path / f"log{looks}")
        start(lmp, 3, 12)
        with_law(lmp, "mindlin_rescale/force", 3, "100", "100", ("", ""))
        command(lmp, f"""
fix load all gravity 1.0 vector 0.8 0 -1
fix move all nve/sphere
timestep 0.004
dump 1 all custom 100 {tmp_path}/dump{looks} id x
fix mean all ave/time 10 1 10 c_thermo_temp file {tmp_path}/mean{looks}
run 1950
""")  # fmt: skip
        before = state(lmp)
        for _ in range(looks):
            found = from_lammps(lmp, balance=np.inf)
            assert found.contacts.at_bound.any()
        assert np.array_equal(state(lmp), before)
        lmp.command("run 500")
        ends.append(state(lmp))
        lmp.close()
    assert np.array_equal(*ends)
    for name in ("dump", "mean"):
        assert (tmp_path / f"{name}0").read_bytes() == (tmp_path / f"{name}2").read_bytes()
    one, other = ((tmp_path / f"log{looks}").read_text().count("run ") for looks in (0, 2))
    assert one == other


@pytest.mark.parametrize("style", ["custom/gz", "atom/gz", "xyz/gz"])
def test_a_look_leaves_compressed_dumps_whole(tmp_path, style):
    """zlib writes the rest of a file when it is closed, as a copy of the process would at the place that both share."""
    from faultgouge.pywrap import from_lammps

    lmp = instance(tmp_path / "log.lammps")
    start(lmp, 3, 18)
    with_law(lmp, "gran/hertz/history", 3, "100", "100", ("", ""))
    columns = " id x y z vx vy vz fx fy fz" if style == "custom/gz" else ""
    command(lmp, f"""
fix load all gravity 1.0 vector 0.2 0 -1
fix move all nve/sphere
timestep 0.002
dump 1 all {style} 10 {tmp_path}/dump.gz{columns}
run 1995
""")  # fmt: skip
    own = (tmp_path / "own.txt").open("w")
    own.write("what a user's script has written")
    for _ in range(2):
        from_lammps(lmp, balance=np.inf)
        lmp.command("run 1000")
    lmp.close()
    own.close()
    text = gzip.decompress((tmp_path / "dump.gz").read_bytes()).decode()
    assert len(re.findall(r"(?m)^(ITEM: TIMESTEP$| ?Atoms\. Timestep)", text)) == 400
    assert text.count("\n") == 400 * (18 + (2 if style == "xyz/gz" else 9))
    assert (tmp_path / "own.txt").read_text() == "what a user's script has written"


def run_script(folder: Path, *arguments: object, script: str = "next_run.py", ranks: int = 1) -> None:
    """Run a script, whose threads sleep while they wait, since other processes want the cores."""
    words = [*on_ranks(ranks), sys.executable, Path(__file__).with_name(script), *map(str, arguments)]
    passive = os.environ | {"OMP_WAIT_POLICY": "passive"}
    done = subprocess.run(words, cwd=folder, env=passive, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr


@pytest.mark.ranks
@pytest.mark.parametrize(
    ("law", "ranks"),
    [
        pytest.param("coulomb", 2, marks=pytest.mark.slow),
        *(pytest.param(law, 2, marks=pytest.mark.long) for law in ("mindlin_rescale/force", "total", "rescaled")),
        *(pytest.param("gran/hertz/history", ranks, marks=pytest.mark.long) for ranks in (2, 4)),
    ],
)
def test_on_several_ranks(tmp_path, law, ranks):
    """All contacts are in the configuration, whichever rank has them, and the next run is the same to the bit."""
    run_script(tmp_path, law, 1, ranks=ranks)


@pytest.mark.ranks
@pytest.mark.long
def test_with_two_threads(tmp_path):
    """With the styles of LAMMPS's package OPENMP, for which a process with threads cannot be copied."""
    run_script(tmp_path, "gran/hertz/history", 2)


@pytest.mark.ranks
@pytest.mark.parametrize(
    ("ranks", "threads"), [(2, 1), *(pytest.param(1, each, marks=pytest.mark.long) for each in (1, 2))]
)
def test_runs_that_end_early_and_restarts(tmp_path, ranks, threads):
    """LAMMPS skips the runs that follow, and the look has its zero steps all the same; no restart loses histories."""
    run_script(tmp_path, threads, script="after_a_look.py", ranks=ranks)
