"""The next run of a LAMMPS instance after looks at its packing: the same to the bit as without them."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from granular_packings import command, instance, start, state, with_law
from reference_layer import BIN


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


def run_script(folder: Path, law: str, ranks: int = 1, threads: int = 1) -> None:
    """Run next_run.py, whose threads sleep while they wait, since other processes want the cores."""
    launcher = [BIN / "mpiexec", "-n", str(ranks)] if ranks > 1 else []
    words = [*launcher, sys.executable, Path(__file__).with_name("next_run.py"), law, str(threads)]
    passive = os.environ | {"OMP_WAIT_POLICY": "passive"}
    done = subprocess.run(words, cwd=folder, env=passive, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr


@pytest.mark.ranks
@pytest.mark.parametrize(
    ("law", "ranks"),
    [
        pytest.param("gran/hertz/history", 2, marks=pytest.mark.slow),
        pytest.param("coulomb", 2, marks=pytest.mark.slow),
        *(pytest.param(law, 2, marks=pytest.mark.long) for law in ("mindlin_rescale/force", "total", "rescaled")),
        pytest.param("gran/hertz/history", 4, marks=pytest.mark.long),
    ],
)
def test_on_several_ranks(tmp_path, law, ranks):
    """All contacts are in the snapshot, whichever rank has them, and the next run is the same to the bit."""
    run_script(tmp_path, law, ranks=ranks)


@pytest.mark.ranks
@pytest.mark.slow
def test_with_two_threads(tmp_path):
    """With the styles of LAMMPS's package OPENMP, for which a process with threads cannot be copied."""
    run_script(tmp_path, "gran/hertz/history", threads=2)
