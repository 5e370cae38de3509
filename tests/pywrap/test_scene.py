"""A scene says one thing, keeps it to the bit, and refuses what cannot be run, or has no end, in one sentence."""

import json
import math
import re
from copy import deepcopy
from pathlib import Path

import pytest
from reference_layer import REFERENCE

from faultgouge import registered
from faultgouge.pywrap.lammps.decks import DECKS
from faultgouge.pywrap.scenes.command_sections import COMMANDS, command_of
from faultgouge.pywrap.scenes.scene import Scene, SceneError, refuse_endless

SHIPPED = str(DECKS / "packing100.data")

ROOT = Path(__file__).parents[2]

LEAST = {"packing": {}, "law": {"kn": 2e5}, "load": {"fy": 3.0}}
FULL = {
    "precision": "double",
    "packing": {
        "disks": 40,
        "radii": [0.4, 0.5, 0.6],
        "top": 5,
        "width": 8,
        "seed": 3,
        "periodic": True,
        "settle_friction": True,
        "masses": "spheres",
    },
    "law": {"kn": 1e5, "kt": 0.5, "mu": [1, 0.8], "exponent": 1, "history": "total"},
    "load": {"fy": 2},
    "relax": {"damping": 3.0, "time_step": 0.01},
    "ramp": {"step": 1e-3, "until": 0.02, "method": "overdamped", "force_tolerance": 1e-12},
    "perturb": {
        "fx": 0.01,
        "time": 1e3,
        "amplitude": 1e-12,
        "omega": 0.01,
        "target": [3, 4],
        "time_step": 1e-3,
        "inertia_factor": 0.5,
    },
    "friction": {"B": 0.1, "w": 1, "mu_ss": 0.9, "v0": 2e-11, "v_ss": "100 v0"},
    "output": {"trajectory": True, "dumps": True},
}
NEEDED = {"ramp": {"until": 1.0}, "perturb": {"fx": 0.1, "time": 1.0}}
"""What a section needs that a scene may leave out."""


def merge_changes(changes: dict) -> dict:
    """The least scene with sections, or keys as in "law.mu", added or replaced; None takes a section away."""
    scene = deepcopy(LEAST)
    for name, value in changes.items():
        section, _, key = name.partition(".")
        if key:
            scene.setdefault(section, dict(NEEDED.get(section, {})))[key] = value
        elif value is None:
            del scene[section]
        else:
            scene[section] = deepcopy(value)
    return scene


DAMPED = {"damping": {"cn": 1.5, "ct": 0.5, "tau": 100.0}}


@pytest.mark.parametrize(
    ("changes", "top"), [(FULL, 5), (DAMPED, 10), ({"packing.disks": 1000, "packing.width": 37.7}, 100)]
)
def test_every_key_reaches_the_scene_and_the_resolved_scene_gives_the_same(changes, top):
    scene = Scene.from_mapping(merge_changes(changes))
    resolved = json.loads(json.dumps(scene.resolved()))
    sections = {name: section for name, section in changes.items() if "." not in name}
    assert resolved == resolved | sections
    assert resolved["packing"]["top"] == top
    assert Scene.from_mapping(resolved) == scene


@pytest.mark.parametrize(
    ("kt", "number"),
    [("2/7 kn", 57142.857142857145), ("0.5 kn", 1e5), ("1e-1 kn", 2e4), ("kn", 2e5), (0, 0.0), (57000, 57000.0)],
)
def test_kt_is_a_number_or_a_share_of_kn(kt, number):
    assert Scene.from_mapping(merge_changes({"law.kt": kt})).law.kt == number
    assert Scene.from_mapping(LEAST).law.kt == 57142.857142857145


@pytest.mark.parametrize(("v_ss", "scale"), [("10 v0", 2e-10), ("1e4 v0", 2e-7), ("v0", 2e-11), (3e-9, 3e-9)])
def test_velocity_scale_is_a_number_or_a_multiple_of_the_threshold(v_ss, scale):
    friction = Scene.from_mapping(merge_changes({"friction.v_ss": v_ss})).friction
    assert friction.velocity_scale(2e-11) == pytest.approx(scale, rel=1e-15)  # one product: one rounding


@pytest.mark.parametrize("path", sorted((ROOT / "scenes").glob("*.toml")), ids=lambda path: path.stem)
def test_shipped_scenes_are_scenes(path):
    scene = Scene.from_toml(path)
    if path.stem == "quartz_si":  # in other units
        assert scene.load.fy / (scene.law.kn * 1e-4**1.5) == pytest.approx(74.7 / 2e5, rel=1e-14)
        return
    assert scene.law.kn == 2e5
    quartz = {"quartz": 74.7, "quartz_1MPa": 7.47, "quartz_10MPa": 74.7, "quartz_100MPa": 747}
    assert scene.load.fy == quartz.get(path.stem, 3.0)


def test_the_paper_scene_holds_the_papers_numbers():
    scene = Scene.from_toml(ROOT / "scenes" / "paper.toml")
    assert (scene.law.mus, scene.law.kt) == ((1.0, 0.8), 2 * 2e5 / 7)
    assert (scene.friction.B, scene.friction.w, scene.friction.mu_ss) == (0.2, 0.4, 0.8)


def test_a_file_counts_from_the_folder_of_the_scene(tmp_path):
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "packing.json").write_bytes(REFERENCE.read_bytes())
    toml = tmp_path / "scene.toml"
    toml.write_text('[packing]\nfile = "data/packing.json"\n[law]\nkn = 2e5\n[load]\nfy = 3\n')
    scene = Scene.from_toml(toml)
    assert scene.packing.file == (tmp_path / "data" / "packing.json").resolve()
    assert Scene.from_mapping(scene.resolved()) == scene


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        # law and damping
        ({"law.exponent": 1.25}, "law.exponent = 1.25 is refused: give 1.5 or 1"),
        ({"law.history": "whole"}, "law.history = 'whole' is refused"),
        (
            {"law.history": "rescaled", "law.exponent": 1},
            'law.history = "rescaled" needs a law.exponent of 1.4 or more',
        ),
        ({"damping.tau": 0.0}, "damping.tau = 0.0 is refused: give a number above 0"),
        ({"damping": {}}, "damping has nothing in it: give cn, ct or tau, or leave the section out"),
        ({"damping.cm": 1.0}, "damping.cm is no key of [damping]: the nearest is damping.c"),
        ({"damping.ct": 1.0, "law.mu": 0.0}, "damping.ct = 1 has no friction to damp"),
        (
            {"damping.cn": 1.0, "ramp.method": "overdamped"},
            "damping acts in dynamics ([perturb]) and no equilibrium depends on it, so that an overdamped ramp has no",
        ),
        # names
        ({"packing.dsks": 10}, "packing.dsks is no key of [packing]: the nearest is packing.disks."),
        ({"law.friction": 0.5}, "law.friction is no key of [law]: the nearest is law.mu."),
        ({"packing.kn": 1.0}, "packing.kn is no key of [packing]: the nearest is law.kn."),
        ({"kn": 200000.0}, "kn stands outside of its section: move it below [law]."),
        ({"precison": "double"}, "precison is no key of a scene: the nearest is precision."),
        ({"law": None}, "law is missing: add the section [law]."),
        ({"ramp": {}}, "ramp.until is missing: add until to [ramp]."),
        ({"load": 3.0}, "load is not a section: write [load] and its keys below."),
        # numbers
        ({"packing.disks": 0}, "packing.disks = 0 is refused: give a number above 0."),
        ({"packing.disks": 1.5}, "packing.disks = 1.5 is refused: give a whole number."),
        ({"packing.disks": True}, "packing.disks = True is refused: give a whole number."),
        ({"packing.disks": 10**9}, "packing.disks = 1000000000 is refused: give a number of at most 10000000."),
        ({"packing.seed": -1}, "packing.seed = -1 is refused: give a number of at least 0."),
        ({"packing.radii": []}, "packing.radii = [] is refused: give at least one number."),
        ({"packing.radii": [0.5, 0.0]}, "packing.radii.1 = 0.0 is refused: give a number above 0."),
        ({"packing.radii": 0.5}, "packing.radii = 0.5 is refused: give a list of numbers."),
        ({"packing.periodic": 1}, "packing.periodic = 1 is refused: give true or false."),
        ({"law.kn": math.nan}, "law.kn = nan is refused: give a finite number."),
        ({"law.kn": -1.0, "law.kt": "2/7 kn"}, "law.kn = -1.0 is refused: give a number above 0."),
        (
            {"law.kn": "2e5"},
            "law.kn = '2e5' is refused: give a number; a number with a unit needs the section [units].",
        ),
        ({"law.kt": -1.0}, "law.kt = -1.0 is refused: give a number of at least 0."),
        ({"law.mu": [1.0, math.nan]}, "law.mu = [1.0, nan] is refused"),
        ({"law.mu": 10**400}, "is refused: give a number of at least 0, or a list"),
        ({"law.mu": [1.0, 1]}, "law.mu = [1, 1] names one value twice: give each once."),
        # what no packing bears
        ({"law.kn": 5e-324}, "law.kn = 5e-324 is refused: give a number between 1e-100 and 1e+100"),
        ({"law.kt": 1e-320}, "law.kt"),
        ({"load.fy": 1e9}, "presses two disks 2.9e+02 into each other, deeper than the smallest radius 0.5"),
        ({"law.kn": 1e14}, "no packing comes to rest"),
        ({"packing.width": 1e10}, "packing.width = 1e+10 is"),
        ({"packing.seed": 2**64}, "packing.seed"),
        ({"ramp.step": 1e-12}, "ramp.step = 1e-12 makes 1e+12 equilibria"),
        ({"friction.v_ss": "1e400 v0"}, "friction.v_ss"),
        # choices
        ({"precision": "single"}, "precision = 'single' is refused: give 'double' or 'compensated'."),
        ({"ramp.method": "fire"}, "ramp.method = 'fire' is refused: give 'newton' or 'overdamped'."),
        ({"perturb.target": "floor"}, "perturb.target = 'floor' is refused"),
        ({"perturb.target": [-1]}, "perturb.target = [-1] is refused"),
        ({"law.kt": "2/0 kn"}, 'law.kt = "2/0 kn" is no share of kn'),
        ({"friction.v_ss": "0 v0"}, "friction.v_ss = '0 v0' is refused"),
        ({"friction.v_ss": 1.0, "friction.v0": "measured"}, "friction.v0 = 'measured' is refused"),
        # what does not go together
        ({"packing.top": 101}, "packing.top = 101 is more than the 100 disks of the packing: lower it."),
        ({"packing.width": 2.7}, "packing.width = 2.7 is under two cutoffs of one largest diameter, 2.8: widen"),
        ({"packing.width": 1.0, "packing.periodic": False}, "packing.periodic = false leaves the sides open"),
        ({"ramp.step": 0.2, "ramp.until": 0.1}, "ramp.step = 0.2 is larger than until = 0.1: take a smaller step."),
        ({"perturb.time_step": 2.0}, "perturb.time = 1.0 is shorter than one step, 2.0"),
        ({"perturb.amplitude": 1e-09}, "perturb.omega is missing: an amplitude needs"),
        ({"perturb.target": [100]}, "perturb.target names disk 100: name disks from 0 to 99."),
        (
            {"ramp.until": 0.05, "perturb.fx": 0.1},
            "perturb.fx = 0.1 lies beyond the last equilibrium, ramp.until = 0.05",
        ),
        ({"friction": {}}, "friction.v_ss is missing, and the paper gives no value: give a velocity, or a multiple"),
        ({"friction.v0": 0.0, "friction.v_ss": "10 v0"}, 'friction.v_ss = "10 v0" is no velocity because v0 = 0'),
        ({"law.mu": 0.0, "friction.v_ss": 1.0}, "friction has no mu to weaken"),
        ({"law": {"kt": 1.0}}, "law.kt stands without kn: give kn"),
        ({"packing": {"file": str(REFERENCE), "seed": 1}}, "packing.seed cannot stand beside packing.file"),
        # of a scene, and not of `import`
        ({"packing": {"file": SHIPPED}}, "which disks are the upper layer: add packing.top, 12 (the highest"),
        ({"packing": {"file": SHIPPED, "top": "y>1000"}}, "is refused: packing.top = y>1000: this layer of"),
    ],
    ids=lambda value: str(value)[:60],
)
def test_what_cannot_be_run_is_refused_in_one_sentence(refused_scene, changes, says):
    assert says in refused_scene(merge_changes(changes))


def test_a_list_is_no_scene(refused_scene):
    assert "this one is no mapping: give a dict" in refused_scene([])


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("missing.json", None, "cannot be read at"),
        ("broken.json", b"{", "is not read as packing.json"),
        ("other.json", b'{"x": [1]}', "lacks .y."),
        ("run.h5", b"no HDF5", "is of no format that is read: give"),
        ("deep.json", b"[" * 100_000, ""),
        ("long.json", b'{"x": [' + b"9" * 400 + b'], "y": [1.0], "radius": [0.5]}', ""),
    ],
    ids=["missing", "broken", "other", "no HDF5", "nested too deeply", "a number that is too long"],
)
def test_a_packing_file_is_looked_at_before_any_work(refused_scene, tmp_path, name, content, says):
    if content is not None:
        (tmp_path / name).write_bytes(content)
    sentence = refused_scene(merge_changes({"packing": {"file": name}}), tmp_path)
    assert re.search(rf'scene: packing.file = ".*{name}" .*{says}', sentence)


def test_a_loop_of_links_is_refused(refused_scene, tmp_path):
    (tmp_path / "a.json").symlink_to("a.json")
    assert "a.json" in refused_scene(merge_changes({"packing": {"file": "a.json"}}), tmp_path)


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (None, r"cannot be read \(No such file or directory\): correct its path"),
        (b"[law]\nkn = 2e5\nkt =\n", "is not valid TOML: .*line 3"),
        (b"\xff\xfe", "is not valid TOML: .*decode"),
        (b"[law]\nkn = 2e5\n", "scene.toml: packing is missing: add the section .packing."),
    ],
)
def test_a_refused_file_is_named(tmp_path, content, says):
    path = tmp_path / "scene.toml"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(SceneError, match=says) as refusal:
        Scene.from_toml(path)
    assert str(refusal.value).startswith(str(path))


SHORT = {
    "packing": {"disks": 30, "top": 6, "width": 6.5, "seed": 3},
    "law": {"kn": 2e5},
    "load": {"fy": 3.0},
    "ramp": {"step": 1e-3, "until": 0.01},
    "perturb": {"fx": 2e-3, "time": 1.0},
}


def with_key(section, key, value):
    return SHORT | {section: SHORT[section] | {key: value}}


@pytest.mark.parametrize(
    ("key", "value"), [("time", 2.0**63), ("time_step", 1e-30), ("inertia_factor", 1e-50), ("time", 1e13)]
)
def test_runs_without_end_are_refused(key, value):
    scene = Scene.from_mapping(with_key("perturb", key, value))
    with pytest.raises(SceneError, match=r"the scene asks perturb for .* time steps, a year and more: lower perturb"):
        refuse_endless(scene, "perturb")
    refuse_endless(scene, "settle")


def test_what_no_machine_holds_is_refused(monkeypatch):
    packing = {"disks": 10**6, "top": 10**4, "width": 1.2e3, "seed": 3}
    scene = Scene.from_mapping(SHORT | {"packing": packing, "ramp": {"step": 2e-9, "until": 0.01}})
    refuse_endless(scene, "onset")
    with pytest.raises(SceneError, match=r"the scene asks ramp for a file of 7.5e.02 TB: take a larger ramp.step"):
        refuse_endless(scene, "ramp")
    monkeypatch.setattr("os.sysconf", lambda name: 1024)
    with pytest.raises(SceneError, match=r"the scene asks onset for 4 GB of memory, and this machine has 0.001: take"):
        refuse_endless(scene, "onset")


WRONG = {
    "relax": {"damping": -1.0},
    "ramp": {"step": 1.0, "until": 0.5},
    "perturb": {"fx": 7.0, "time": "long", "inertia_factor": 0.5},
    "friction": {"B": 0.3},
    "drive": {"spring": -1.0},
    "trigger": {"distance": []},
    "eruptions": {"load": -1.0},
    "modes": {"fx_over_fy": "all"},
    "output": {"dumps": 3},
}
"""Sections in which every one is refused by what its keys say."""


@pytest.mark.parametrize("command", dict.fromkeys([*COMMANDS, *registered.names()]))
def test_what_a_command_does_not_read_is_checked_for_its_keys_alone(command):
    reads, needs = command_of(command).reads, command_of(command).needs
    unread = {name: section for name, section in WRONG.items() if name not in reads}
    perturb = {"fx": 0.01, "time": 1.0, "inertia_factor": 0.5}
    enough = FULL | {"eruptions": {"load": [0.01]}, "ramp": {"until": 0.02}, "perturb": perturb}
    enough |= {"drive": {"spring": 10.0, "velocity": 1e-3, "until": 1.0}, "damping": {"cn": 1.0}}
    read = {name: enough[name] for name in needs}
    scene = Scene.from_mapping(merge_changes(read | unread), command=command)
    assert all(getattr(scene, name, None) is None for name in unread.keys() - {"relax"})
    assert scene.inertia_factor == (1.0 if command in ("reproduce", "triggering") else 0.5)
    assert Scene.from_mapping(scene.resolved(), command=command) == scene
    for name in unread:
        with pytest.raises(SceneError, match=rf"{name}\.wrong is no key of \[{name}\]"):
            Scene.from_mapping(merge_changes(read | unread | {f"{name}.wrong": 1}), command=command)
    for name in needs:
        with pytest.raises(SceneError, match=rf"has no section \[{name}\]"):
            Scene.from_mapping(merge_changes({each: read[each] for each in needs if each != name}), command=command)


def test_a_key_that_a_command_reads_of_a_section_that_it_does_not_read_is_checked():
    with pytest.raises(SceneError, match=r"perturb\.inertia_factor = -1"):
        Scene.from_mapping(merge_changes({"perturb": {"inertia_factor": -1.0}}), command="settle")


def test_a_target_beyond_the_disks_of_a_file_is_refused_with_the_scene(tmp_path):
    section = {"fx": 0.0, "time": 1.0, "target": [100]}
    with pytest.raises(SceneError, match="names disk 100: name disks from 0 to 99"):
        Scene.from_mapping(merge_changes({"packing": {"file": str(REFERENCE)}, "perturb": section}), command="perturb")
