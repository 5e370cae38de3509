"""What a run does not need is not there: deck parts, fixes, computes, arrays, imports; and no number changes."""

import json
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from reference_layer import LAYER, store, toml

from faultgouge.analysis import MindlinLaw, PackingFileError, read_dump
from faultgouge.analysis.files.formats.lammps_dump import dump_frames
from faultgouge.assessment.explain import contents, everything
from faultgouge.pywrap import Engine
from faultgouge.pywrap.lammps.decks import DECKS

SMOOTH = "part system.in, part undamped.in, fix floor, fix load, fix move, array f_floor (7 columns), periodic x"
FRICTION = "part friction.in, fix angle, fix slips, array f_slips (17 columns), array d_theta, velocities of ghosts"


@pytest.mark.parametrize(
    ("law", "holds"),
    [({"mu": 1.0}, f"{SMOOTH}, {FRICTION}"), ({"mu": 0.0}, SMOOTH), ({"mu": 1.0, "kt": 0.0}, SMOOTH)],
    ids=["friction", "mu = 0", "kt = 0"],
)
def test_a_run_holds_what_it_needs_and_nothing_else(reference_packing, tmp_path, law, holds):
    packing, log = reference_packing(**law), tmp_path / "log"
    with Engine(packing, log=log) as engine, engine.undamped(1e-4):
        assert set(everything(contents(engine, log))) == set(holds.split(", "))


def motion_of(packing, commands=""):
    """Where an undamped run ends that starts out of balance, so that disks move and contacts change."""
    torn = replace(packing, fx=3.0)
    with Engine(torn) as engine, engine.undamped(2e-3) as dynamics:
        engine.lammps.commands_string(commands)
        return dynamics.advance(400)


TURNING = "unfix move\ncomm_modify vel yes\nfix move mobile nve/disc 1.0 rotation yes\nrun 0 post no"
NO_PUSH = f'variable amplitude index 0.0\nvariable omega index 1.0\ninclude "{DECKS}/push.in"\nrun 0 post no'


@pytest.mark.parametrize(
    ("law", "other_law", "commands"),
    [
        ({"mu": 0.0}, {"mu": 1.0, "kt": 0.0}, ""),
        ({"mu": 0.0}, {"mu": 0.0}, TURNING),
        ({"mu": 1.0}, {"mu": 1.0}, NO_PUSH),
    ],
    ids=["mu = 0, kt = 0", "rotations", "amplitude 0"],
)
def test_the_same_motion_with_and_without(reference_packing, law, other_law, commands):
    packing = reference_packing(**law)
    one, other = motion_of(packing), motion_of(reference_packing(**other_law), commands)
    assert np.abs(one.position - packing.position).max() > 0.1
    assert all(np.array_equal(getattr(one, name), getattr(other, name)) for name in one._fields if name != "friction")


def test_dumps_without_friction_have_no_slips_and_no_angles(reference_packing, tmp_path):
    with Engine(reference_packing(0.0)) as engine:
        engine.dump(tmp_path / "smooth")
        packing = engine.packing  # disks in the periodic box
    disks, contacts = (next(dump_frames(tmp_path / f"smooth.{kind}")).columns for kind in ("disks", "contacts"))
    assert disks == ("id", "type", "x", "y", "radius", "mass", "fx", "fy", "floor_overlap")
    assert contacts == ("id1", "id2", "f_n")
    again = read_dump(tmp_path / "smooth.disks")
    assert np.array_equal(again.position, packing.position)
    assert (again.contacts, again.law) == (packing.contacts, packing.law)
    with pytest.raises(PackingFileError, match="no column angle"):
        read_dump(tmp_path / "smooth.disks", law=MindlinLaw(2e5, 1e5, 1.0))


@pytest.mark.long
@pytest.mark.parametrize(
    ("words", "imported"),
    [
        (["ramp", "scene.toml"], ["numpy", "scipy", "h5py", "mpi4py", "lammps"]),
        (["onset", "onset.toml"], ["numpy", "scipy", "mpi4py", "lammps"]),
        (["spectrum", "stored.h5"], ["numpy", "scipy", "h5py"]),
    ],
    ids=["ramp", "onset", "spectrum"],
)
def test_a_command_imports_what_it_needs(tmp_path, reference_packing, words, imported):
    """In a process of its own; no figures and no trajectory library, and LAMMPS where something moves."""
    (tmp_path / "scene.toml").write_text(LAYER + toml({"ramp": {"step": 1e-3, "until": 2e-3}}))
    (tmp_path / "onset.toml").write_text(LAYER + toml({"ramp": {"step": 5.5e-3, "until": 0.022}}))
    store(tmp_path / "stored.h5", reference_packing(1.0), floor=1e-11, evaluations=1)
    code = f"""
import json, sys
from faultgouge.cli import main
sys.argv = ['faultgouge', *{words!r}]
try:
    main()
except SystemExit as stop:
    assert not stop.code, stop.code
names = ('numpy', 'scipy', 'h5py', 'mpi4py', 'lammps', 'matplotlib', 'MDAnalysis', 'threadpoolctl', 'rich')
print(json.dumps([name for name in names if name in sys.modules]))
"""
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout.splitlines()[-1]) == imported
