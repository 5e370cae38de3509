"""What a run does not need is not there: deck parts, fixes, computes, arrays, imports; and no number changes."""

import json
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from reference_layer import LAYER, toml

from faultgouge.analysis import MindlinLaw, PackingFileError, RunFile, read_dump
from faultgouge.analysis.files.formats.lammps_dump import dump_frames
from faultgouge.assessment.explain import contents, everything
from faultgouge.pywrap import Engine
from faultgouge.pywrap.lammps.decks import DECKS


def with_law(packing, mu, kt=2e5 * 2 / 7):
    return replace(packing, law=MindlinLaw(2e5, kt, mu))


SMOOTH = {"part system.in", "part undamped.in", "fix floor", "fix load", "fix move", "array f_floor (7 columns)"}
SMOOTH |= {"periodic x"}
ROUGH = SMOOTH | {"part friction.in", "fix angle", "fix slips", "array f_slips (17 columns)", "array d_theta"}
ROUGH |= {"velocities of ghosts"}


@pytest.mark.parametrize(
    ("law", "holds"),
    [({"mu": 1.0}, ROUGH), ({"mu": 0.0}, SMOOTH), ({"mu": 1.0, "kt": 0.0}, SMOOTH)],
    ids=["friction", "mu = 0", "kt = 0"],
)
def test_a_run_holds_what_it_needs_and_nothing_else(reference_packing, tmp_path, law, holds):
    packing, log = with_law(reference_packing(1.0), **law), tmp_path / "log"
    with Engine(packing, log=log) as engine, engine.undamped(1e-4):
        assert set(everything(contents(engine, log))) == holds


def same_motion(one, other):
    """Whether positions and velocities are the same to the bit."""
    return all(np.array_equal(getattr(one, name), getattr(other, name)) for name in one._fields)


def motion_of(packing, commands=()):
    """Where an undamped run ends that starts out of balance, so that disks move and contacts change."""
    torn = replace(packing, fx=3.0)
    with Engine(torn) as engine, engine.undamped(2e-3) as dynamics:
        for command in commands:
            engine.lammps.command(command)
        if commands:
            engine.lammps.command("run 0 post no")
        return dynamics.advance(400)


TURNING = ("unfix move", "comm_modify vel yes", "fix move mobile nve/disc 1.0 rotation yes")
NO_PUSH = ("variable amplitude index 0.0", "variable omega index 1.0", f'include "{DECKS / "push.in"}"')


@pytest.mark.parametrize(
    ("law", "other_law", "commands"),
    [
        ({"mu": 0.0}, {"mu": 1.0, "kt": 0.0}, ()),
        ({"mu": 0.0}, {"mu": 0.0}, TURNING),
        ({"mu": 1.0}, {"mu": 1.0}, NO_PUSH),
    ],
    ids=["mu = 0, kt = 0", "rotations", "amplitude 0"],
)
def test_the_same_motion_with_and_without(reference_packing, law, other_law, commands):
    packing = reference_packing(1.0)
    one, other = motion_of(with_law(packing, **law)), motion_of(with_law(packing, **other_law), commands)
    assert np.abs(one.position - packing.position).max() > 0.1
    assert same_motion(one, other._replace(friction=one.friction))


def test_dumps_without_friction_have_no_slips_and_no_angles(reference_packing, tmp_path):
    packing = with_law(reference_packing(1.0), mu=0.0)
    with Engine(packing) as engine:
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


SCENE = LAYER + toml({"ramp": {"step": 1e-3, "until": 2e-3}, "perturb": {"fx": 1e-3, "time": 0.2}})
RUN = ["numpy", "scipy", "h5py", "mpi4py", "lammps"]
SEARCH = ["numpy", "scipy", "mpi4py", "lammps"]


@pytest.mark.long
@pytest.mark.parametrize(
    ("words", "imported"),
    [
        pytest.param(["ramp", "scene.toml"], RUN, marks=pytest.mark.slow),
        pytest.param(["onset", "onset.toml"], SEARCH, marks=pytest.mark.slow),
        pytest.param(["spectrum", "stored.h5"], ["numpy", "scipy", "h5py"], marks=pytest.mark.slow),
    ],
    ids=lambda value: value[0] if value else "",
)
def test_a_command_imports_what_it_needs(tmp_path, reference_packing, words, imported):
    """In a process of its own; no figures and no trajectory library, and LAMMPS where something moves."""
    (tmp_path / "scene.toml").write_text(SCENE)
    (tmp_path / "onset.toml").write_text(LAYER + toml({"ramp": {"step": 5.5e-3, "until": 0.022}}))
    with RunFile.create(tmp_path / "stored.h5", reference_packing(1.0)) as run:
        run.append(reference_packing(1.0), floor=1e-11, evaluations=1)
    code = (
        "import json, sys\n"
        "from faultgouge.cli import main\n"
        f"sys.argv = ['faultgouge', *{words!r}]\n"
        "try:\n    main()\nexcept SystemExit as stop:\n    assert not stop.code, stop.code\n"
        "names = ('numpy', 'scipy', 'h5py', 'mpi4py', 'lammps', 'matplotlib', 'MDAnalysis', 'threadpoolctl', 'rich')\n"
        "print(json.dumps([name for name in names if name in sys.modules]))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout.splitlines()[-1]) == imported
