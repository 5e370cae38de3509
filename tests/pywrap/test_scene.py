"""A scene says one thing, keeps it to the bit, and refuses what cannot be run, or has no end, in one sentence."""

import json
import math
import re
from copy import deepcopy
from pathlib import Path

import pytest
from reference_layer import REFERENCE, toml
from table_rows import rows_of

from faultgouge import registered
from faultgouge.pywrap.lammps.decks import DECKS
from faultgouge.pywrap.scenes.command_sections import COMMANDS, command_of
from faultgouge.pywrap.scenes.scene import Scene, SceneError

ROOT = Path(__file__).parents[2]

LEAST = {"packing": {}, "law": {"kn": 2e5}, "load": {"fy": 3.0}}
FULL = {
    "precision": "double",
    "packing": {"disks": 40, "radii": [0.4, 0.5, 0.6], "top": 5, "width": 8, "seed": 3, "periodic": True}
    | {"settle_friction": True, "masses": "spheres"},
    "law": {"kn": 1e5, "kt": 0.5, "mu": [1, 0.8], "exponent": 1, "history": "total"},
    "load": {"fy": 2},
    "relax": {"damping": 3.0, "time_step": 0.01},
    "ramp": {"step": 1e-3, "until": 0.02, "method": "overdamped", "force_tolerance": 1e-12},
    "perturb": {"fx": 0.01, "time": 1e3, "amplitude": 1e-12, "omega": 0.01, "target": [3, 4], "time_step": 1e-3}
    | {"inertia_factor": 0.5},
    "friction": {"B": 0.1, "w": 1, "mu_ss": 0.9, "v0": 2e-11, "v_ss": "100 v0"},
    "output": {"trajectory": True, "dumps": True},
}
NEEDED = {"ramp": {"until": 1.0}, "perturb": {"fx": 0.1, "time": 1.0}}
"""What a section needs that a scene may leave out."""


def merge_changes(changes):
    """The least scene with sections, or keys as in "law.mu", added or replaced; None takes a section away."""
    scene = deepcopy(LEAST)
    for name, value in changes.items():
        section, _, key = name.partition(".")
        if key:
            scene.setdefault(section, dict(NEEDED.get(section, {})))[key] = value
        elif value is None:
            scene.pop(section, None)
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


def test_a_stiffness_and_a_velocity_are_numbers_or_a_share_of_another():
    shares = {"2/7 kn": 57142.857142857145, "0.5 kn": 1e5, "1e-1 kn": 2e4, "kn": 2e5, 0: 0.0, 57000: 57000.0}
    assert {kt: Scene.from_mapping(merge_changes({"law.kt": kt})).law.kt for kt in shares} == shares
    assert Scene.from_mapping(LEAST).law.kt == 57142.857142857145
    scales = {"10 v0": 2e-10, "1e4 v0": 2e-7, "v0": 2e-11, 3e-9: 3e-9}
    found = {v_ss: Scene.from_mapping(merge_changes({"friction.v_ss": v_ss})).friction for v_ss in scales}
    # one product: one rounding
    assert {v_ss: each.velocity_scale(2e-11) for v_ss, each in found.items()} == pytest.approx(scales, rel=1e-15)


@pytest.mark.parametrize("path", sorted((ROOT / "scenes").glob("*.toml")), ids=lambda path: path.stem)
def test_shipped_scenes_are_scenes(path):
    scene = Scene.from_toml(path)
    fy = {"quartz": 74.7, "quartz_si": 74.7, "quartz_1MPa": 7.47, "quartz_10MPa": 74.7, "quartz_100MPa": 747}
    length = 1e-4 if path.stem == "quartz_si" else 1.0  # in other units
    assert scene.load.fy / (scene.law.kn * length**1.5) == pytest.approx(fy.get(path.stem, 3.0) / 2e5, rel=1e-14)
    if path.stem == "paper":
        assert (scene.law.mus, scene.law.kt) == ((1.0, 0.8), 2 * 2e5 / 7)
        assert (scene.friction.B, scene.friction.w, scene.friction.mu_ss) == (0.2, 0.4, 0.8)


def test_a_file_counts_from_the_folder_of_the_scene(tmp_path):
    (data := tmp_path / "data").mkdir()
    (data / "packing.json").write_bytes(REFERENCE.read_bytes())
    (tmp_path / "scene.toml").write_text(toml(LEAST | {"packing": {"file": "data/packing.json"}}))
    scene = Scene.from_toml(tmp_path / "scene.toml")
    assert scene.packing.file == (data / "packing.json").resolve()
    assert Scene.from_mapping(scene.resolved()) == scene


@pytest.mark.parametrize(
    ("changes", "says"),
    rows_of("pywrap/refused_scenes.txt", nan=math.nan, REFERENCE=str(REFERENCE), SHIPPED=f"{DECKS}/packing100.data"),
    ids=lambda value: str(value)[:60],
)
def test_what_cannot_be_run_is_refused_in_one_sentence(refused_scene, changes, says):
    assert says in refused_scene(merge_changes(changes))


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("missing.json", None, "cannot be read at"),
        ("broken.json", b"{", "is not read as packing.json"),
        ("run.h5", b"no HDF5", "is of no format that is read: give"),
        ("deep.json", b"[" * 100_000, ""),
        ("long.json", b'{"x": [' + b"9" * 400 + b'], "y": [1.0], "radius": [0.5]}', ""),
    ],
)
def test_a_packing_file_is_looked_at_before_any_work(refused_scene, tmp_path, name, content, says):
    if content is not None:
        (tmp_path / name).write_bytes(content)
    sentence = refused_scene(merge_changes({"packing": {"file": name}}), tmp_path)
    assert re.search(rf'scene: packing.file = ".*{name}" .*{says}', sentence)


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("none.toml", b"", r"cannot be read \(No such file or directory\): correct its path"),
        ("scene.toml", b"[law]\nkn = 2e5\nkt =\n", "is not valid TOML: .*line 3"),
        ("scene.toml", b"\xff\xfe", "is not valid TOML: .*decode"),
        ("scene.toml", b"[law]\nkn = 2e5\n", "packing is missing: add the section .packing."),
    ],
)
def test_a_refused_file_is_named(tmp_path, name, content, says):
    (tmp_path / "scene.toml").write_bytes(content)
    with pytest.raises(SceneError, match=f"^{tmp_path / name}.*{says}"):
        Scene.from_toml(tmp_path / name)


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
    enough = FULL | {"eruptions": {"load": [0.01]}, "ramp": {"until": 0.02}, "damping": {"cn": 1.0}}
    enough |= {"drive": {"spring": 10.0, "velocity": 1e-3, "until": 1.0}}
    enough |= {"perturb": {"fx": 0.01, "time": 1.0, "inertia_factor": 0.5}}
    read = {name: enough[name] for name in needs}
    scene = Scene.from_mapping(merge_changes(read | unread), command=command)
    assert all(getattr(scene, name, None) is None for name in unread.keys() - {"relax"})
    assert scene.inertia_factor == (1.0 if command in ("reproduce", "triggering") else 0.5)
    assert Scene.from_mapping(scene.resolved(), command=command) == scene
    refused = [(read | unread | {f"{name}.wrong": 1}, rf"{name}\.wrong is no key of \[{name}\]") for name in unread]
    refused += [(read | {name: None}, rf"has no section \[{name}\]") for name in needs]
    for changes, says in refused:
        with pytest.raises(SceneError, match=says):
            Scene.from_mapping(merge_changes(changes), command=command)


def test_a_key_that_a_command_reads_of_a_section_that_it_does_not_read_is_checked():
    with pytest.raises(SceneError, match=r"perturb\.inertia_factor = -1"):
        Scene.from_mapping(merge_changes({"perturb": {"inertia_factor": -1.0}}), command="settle")
