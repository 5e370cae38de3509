"""What a run does not need is not there: deck parts, fixes, computes, arrays, imports; and no number changes."""

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from faultgouge.analysis import MindlinLaw, PackingFileError, read_dump, touching
from faultgouge.analysis.files.dumps import dump_frames
from faultgouge.assessment.left_out.switches import Loaded
from faultgouge.pywrap import Engine, EngineError
from faultgouge.pywrap.lammps.decks import DECKS, Decks
from faultgouge.pywrap.lammps.dynamics import Weakening

BIN = Path(sys.executable).parent
REFERENCE = Path(__file__).parents[1] / "reference" / "packing7.json"

MODEL = {"decks", "data", "sides", "kn", "kt", "mu", "fx", "fy", "inertia", "precision", "compensated", "rotation"}
MODEL |= {"dt", "mobile", "exponent", "history", "stiffness"}
PUSH = {"amplitude", "omega", "target", "push"}
WEAKEN = {"B", "w", "mu_ss", "v0", "v_ss", "friction"}

UNREACHED = Weakening(B=0.2, w=0.4, mu_ss=0.8, v0=1e3, v_ss=1.0)


def opened(packing):
    """The same disks with open sides."""
    position = np.column_stack([packing.position[:, 0] % packing.box_length, packing.position[:, 1]])
    contacts = touching(position, packing.radius)
    return replace(packing, position=position, contacts=contacts, box_length=None)


def with_law(packing, mu, kt=2e5 * 2 / 7):
    return replace(packing, law=MindlinLaw(2e5, kt, mu))


def held(packing, tmp_path, **run):
    log = tmp_path / "log"
    with Engine(packing, log=log) as engine, engine.undamped(1e-4, **run):
        return Loaded.of(engine, log)


SMOOTH = {
    "parts": ("system.in", "undamped.in"),
    "fixes": ["floor", "load", "move"],
    "computes": (),
    "dumps": (),
    "arrays": ["f_floor"],
    "settings": ("periodic x",),
    "variables": MODEL,
}
ROUGH = SMOOTH | {
    "parts": ("system.in", "friction.in", "undamped.in"),
    "fixes": ["angle", "floor", "load", "move", "slips"],
    "arrays": ["f_floor", "f_slips", "d_theta"],
    "settings": ("periodic x", "velocities of ghosts"),
}
PUSHED = {
    "parts": (*ROUGH["parts"], "push.in"),
    "fixes": ["angle", "floor", "load", "move", "push", "slips"],
    "variables": MODEL | PUSH,
}
WEAKENED = {
    "parts": (*ROUGH["parts"], "weaken.in"),
    "fixes": ["angle", "floor", "load", "move", "slips", "weaken"],
    "computes": ("velocity",),
    "variables": MODEL | WEAKEN,
}


@pytest.mark.parametrize(
    ("change", "run", "expected"),
    [
        (lambda p: p, {}, ROUGH),
        (lambda p: with_law(p, mu=0.0), {}, SMOOTH),
        (lambda p: with_law(p, mu=1.0, kt=0.0), {}, SMOOTH),
        (lambda p: with_law(opened(p), mu=0.0), {}, SMOOTH | {"settings": ()}),
        (lambda p: p, {"amplitude": 1e-9, "omega": 0.01}, ROUGH | PUSHED),
        (lambda p: p, {"weakening": UNREACHED}, ROUGH | WEAKENED),
    ],
    ids=["friction", "mu = 0", "kt = 0", "open", "push", "weakening"],
)
def test_a_run_holds_what_it_needs_and_nothing_else(reference_packing, tmp_path, change, run, expected):
    here = held(change(reference_packing(1.0)), tmp_path, **run)
    found = {name: getattr(here, name) for name in expected}
    found["arrays"] = [array.split()[0] for array in here.arrays]
    assert found | {"fixes": sorted(here.fixes), "variables": set(here.variables)} == expected


def test_settling_and_relaxing_take_their_parts_away_again(reference_packing, tmp_path):
    log = tmp_path / "log"
    with Engine(with_law(reference_packing(1.0), mu=0.0), log=log) as engine:
        engine.settle(1e-8)
        here = Loaded.of(engine, log)
    assert set(here.parts) == {"system.in", "bed.in", "damp.in", "balance.in"}
    assert (set(here.fixes), here.computes) == ({"floor", "load"}, ())
    with Engine(reference_packing(1.0), log=log) as engine:
        engine.relax(1e-3)
        here = Loaded.of(engine, log)
    assert set(here.parts) == {"system.in", "friction.in", "relax.in", "balance.in"}
    assert (set(here.fixes), here.computes) == ({"angle", "floor", "load", "slips"}, ())


def motion_of(packing, steps=400, commands=(), **run):
    """Where an undamped run ends that starts out of balance, so that disks move and contacts change."""
    torn = replace(packing, fx=3.0)
    with Engine(torn) as engine, engine.undamped(2e-3, **run) as dynamics:
        for command in commands:
            engine.lammps.command(command)
        if commands:
            engine.lammps.command("run 0 post no")
        return dynamics.advance(steps)


def assert_same_motion(one, other):
    for name in ("position", "velocity", "spin"):
        assert np.array_equal(getattr(one, name), getattr(other, name)), name


TURNING = ("unfix move", "comm_modify vel yes", "fix move mobile nve/disc 1.0 rotation yes")
NO_PUSH = ("variable amplitude index 0.0", "variable omega index 1.0", f'include "{DECKS / "push.in"}"')
LOOKS = ("compute contact all pair/local p1 p2 p3 cutoff radius", "thermo_style custom step pe press", "thermo 7")


@pytest.mark.parametrize(
    ("law", "other_law", "options"),
    [
        ({"mu": 0.0}, {"mu": 1.0, "kt": 0.0}, {}),
        ({"mu": 0.0}, {"mu": 0.0}, {"commands": TURNING}),
        ({"mu": 1.0}, {"mu": 1.0}, {"weakening": UNREACHED}),
        ({"mu": 1.0}, {"mu": 1.0}, {"commands": NO_PUSH}),
        ({"mu": 1.0}, {"mu": 1.0}, {"commands": LOOKS}),
    ],
    ids=["mu = 0, kt = 0", "rotations", "threshold never reached", "amplitude 0", "looking on"],
)
def test_the_same_motion_with_and_without(reference_packing, law, other_law, options):
    packing = reference_packing(1.0)
    one, other = motion_of(with_law(packing, **law)), motion_of(with_law(packing, **other_law), **options)
    assert np.abs(one.position - packing.position).max() > 0.1
    assert_same_motion(one, other)


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
    assert np.array_equal(again.contacts.i, packing.contacts.i)
    assert np.array_equal(again.contacts.j, packing.contacts.j)
    assert again.law == packing.law
    with pytest.raises(PackingFileError, match="no column theta or d_theta"):
        read_dump(tmp_path / "smooth.disks", law=MindlinLaw(2e5, 1e5, 1.0))


SCENE = """
[packing]
file = "{file}"
[law]
kn = 2e5
[load]
fy = 3.0
[ramp]
step = 1e-3
until = 2e-3
[perturb]
fx = 1e-3
time = 0.2
"""


def run_command(folder, *arguments):
    """A command in a process that then says which heavy packages it has imported."""
    if not (folder / "scene.toml").exists():
        (folder / "scene.toml").write_text(SCENE.format(file=REFERENCE))
    code = (
        "import json, sys\n"
        "from faultgouge.cli import main\n"
        f"sys.argv = ['faultgouge', *{arguments!r}]\n"
        "try:\n    main()\nexcept SystemExit as stop:\n    assert not stop.code, stop.code\n"
        "names = ('numpy', 'scipy', 'h5py', 'mpi4py', 'lammps', 'matplotlib', 'MDAnalysis', 'threadpoolctl')\n"
        "print(json.dumps([name for name in names if name in sys.modules]))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=folder, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


@pytest.mark.parametrize("command", ["settle", "ramp", "perturb"])
@pytest.mark.slow
def test_a_run_imports_no_figures_and_no_trajectory_library(tmp_path, command):
    assert run_command(tmp_path, command, "scene.toml") == ["numpy", "scipy", "h5py", "mpi4py", "lammps"]


def test_help_imports_nothing_heavy(tmp_path):
    assert run_command(tmp_path, "--help") == []


@pytest.mark.slow
def test_a_spectrum_needs_no_lammps(tmp_path):
    run_command(tmp_path, "settle", "scene.toml", "-o", "run.h5")
    assert run_command(tmp_path, "spectrum", "run.h5") == ["numpy", "scipy", "h5py"]


def datasets(path):
    found = {}
    with h5py.File(path) as file:
        file.visititems(lambda name, item: found.update({name: item[...]}) if isinstance(item, h5py.Dataset) else None)
    return found


@pytest.mark.parametrize(("command", "output"), [("ramp", "dumps"), ("perturb", "trajectory")])
@pytest.mark.slow
def test_output_changes_no_dataset(tmp_path, command, output):
    run_command(tmp_path, command, "scene.toml", "-o", "plain.h5")
    scene = tmp_path / "scene.toml"
    scene.write_text(scene.read_text() + f"[output]\n{output} = true\n")
    run_command(tmp_path, command, "scene.toml", "-o", "rich.h5")
    plain, rich = datasets(tmp_path / "plain.h5"), datasets(tmp_path / "rich.h5")
    more = {name for name in rich if name not in plain}
    assert bool(more) == (output == "trajectory")
    assert all("trajectory" in name for name in more)
    for name, values in plain.items():
        # a trajectory follows the equilibria as further frames
        same = rich[name][: len(values)] if output == "trajectory" and values.ndim else rich[name]
        assert np.array_equal(values, same, equal_nan=values.dtype.kind == "f"), name


def test_what_stops_a_run_is_what_is_said(reference_packing):
    packing = reference_packing(1.0)
    engine = Engine(packing)
    with pytest.raises(EngineError, match="Unknown command: nonsense"), engine.undamped(1e-4):
        Decks(engine.lammps).command("nonsense")


def test_forces_without_friction_are_zero_until_the_first_run(reference_packing):
    """LAMMPS does not set them; with MALLOC_PERTURB_ in the environment they would be numbers of any size."""
    with Engine(with_law(reference_packing(1.0), mu=0.0)) as engine:
        assert not engine.net_force.any()
