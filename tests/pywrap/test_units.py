"""Real units, against numbers worked out by hand, and quantities that do not convert."""

import json

import numpy as np
import pytest
from table_rows import rows_of

from faultgouge import load
from faultgouge.analysis import MindlinLaw
from faultgouge.analysis.files.formats import write_packing
from faultgouge.pywrap import Scene
from faultgouge.pywrap.scenes.command_sections import study_models
from faultgouge.pywrap.scenes.packing_section import SettlingLoad
from faultgouge.pywrap.scenes.scene import SECTIONS
from faultgouge.pywrap.scenes.units import dashpot, real_units, restitution

QUARTZ = {"grain_diameter": "0.1 mm", "density": "2.65 g/cm^3", "youngs_modulus": "95 GPa", "poisson_ratio": 0.08}
LEAST = {"packing": {"disks": 100, "width": 11.9, "top": 10}, "law": {"kn": 2e5}, "load": {"fy": 3.0}}
SIZED = {"packing": {"radii": ["50 um", "70 um"], "width": "1.19 mm", "top": 10}, "units": QUARTZ}


def sized(**sections):
    return Scene.from_mapping({**SIZED, **sections})


def test_units_are_those_of_hertz_and_of_the_grains():
    real = real_units(Scene.from_mapping({**LEAST, "units": QUARTZ}))
    assert (real.length, real.mass) == pytest.approx((1e-4, 2650 * np.pi / 6 * 1e-12), rel=1e-12)
    # two spheres of radius R press with (4/3) E* sqrt(R/2) delta^(3/2), E* = E/2(1 - nu^2)
    stiffness = 4 / 3 * 95e9 / 2 / (1 - 0.08**2) * np.sqrt(0.5e-4 / 2)
    assert stiffness * real.length**1.5 / real.force == pytest.approx(2e5, rel=1e-12)
    assert real.overburden == pytest.approx(10 * 3.0 * real.force / (11.9 * 1e-4 * 1e-4), rel=1e-12)
    assert real.frequency(2 * np.pi) == pytest.approx(1 / real.time, rel=1e-12)
    # sigma = rho c v of a plane shear wave
    velocity = real.stress(0.01) / np.sqrt(95e9 / 2 / 1.08 * 2650)
    assert real.ground_velocity(0.01, 5.0, "layer") == pytest.approx(velocity, rel=1e-12)
    assert real.ground_velocity(0.01, 5.0, "floor") == pytest.approx(0.01 / 5.0 * real.velocity(1.0), rel=1e-12)
    heavy = real_units(Scene.from_mapping(LEAST | {"packing": LEAST["packing"] | {"mass": 4.0}, "units": QUARTZ}))
    assert (heavy.mass, heavy.time) == pytest.approx((real.mass / 4, real.time / 2), rel=1e-12)


def test_units_of_a_file_are_those_of_its_smallest_disk_whatever_the_format(tmp_path):
    disks = {"x": [1.0, 3.0], "y": [0.49, 0.69], "radius": [0.5, 0.7], "top": [1], "box_length": 4.0}
    (tmp_path / "disks.json").write_text(json.dumps(disks))
    write_packing(tmp_path / "disks.xyz", load(tmp_path / "disks.json", law=MindlinLaw(2e5, 0.0, 0.0), fy=0.0))
    scenes = [LEAST | {"packing": {"file": name}, "units": QUARTZ} for name in ("disks.json", "disks.xyz")]
    own, other = (real_units(Scene.from_mapping(each, tmp_path)) for each in scenes)
    assert own.length == pytest.approx(1e-4, rel=1e-12)
    assert own.overburden == pytest.approx(3.0 * own.force / (4.0 * 1e-4 * 1e-4), rel=1e-12)
    assert other == own


@pytest.mark.parametrize(("keys", "says"), rows_of("pywrap/refused_units.txt"))
def test_units_that_do_not_convert_are_refused_in_one_sentence(refused_scene, keys, says):
    assert says in refused_scene({**LEAST, "units": {**QUARTZ, **keys}})


@pytest.mark.parametrize("wanted", [0.99, 0.9, 0.5])
def test_restitution_falls_with_the_velocity_and_a_dashpot_gives_it(wanted):
    assert restitution(2e5, 0.0, 1.0, 0.1) == pytest.approx(1.0, abs=1e-8)
    # for weak damping 1 - e grows as v^(1/5) (Brilliantov et al. 1996)
    slow, fast = (1 - restitution(2e5, 1.0, 1.0, v) for v in (1e-3, 32e-3))
    assert fast / slow == pytest.approx(2.0, rel=2e-3)
    assert restitution(2e5, dashpot(2e5, wanted, 2.0, 0.03), 2.0, 0.03) == pytest.approx(wanted, rel=1e-8)


def test_stiffness_and_load_follow_from_the_grains_and_the_overburden():
    found = sized(units={**QUARTZ, "overburden": "10 MPa"})
    given = {fy: sized(load={"fy": fy}).load.fy for fy in ("10 MPa", "100 bar", "0.119 N", "119 mN")}
    assert given == dict.fromkeys(given, found.load.fy)  # a force on a disk or a stress on the layer
    assert (found.packing.radii, found.packing.width, found.law.kn) == ((0.5, 0.7), 11.9, 2e5)
    # ten disks on 1.19 mm by 0.1 mm, and k of two spheres, 4/3 E* sqrt(R/2)
    force, stiffness = 10e6 * 1.19e-3 * 1e-4 / 10, 4 / 3 * 95e9 / 2 / (1 - 0.08**2) * np.sqrt(0.25e-4)
    assert found.law.kn / found.load.fy == pytest.approx(stiffness * 1e-6 / force, rel=1e-11)
    assert real_units(found).overburden == pytest.approx(10e6, rel=1e-11)
    assert Scene.from_mapping(found.resolved()) == found


def test_any_number_of_a_scene_may_have_its_unit():
    sections = {
        "law": {"kn": "3.187e8 N/m^1.5", "kt": "1e8 N/m^1.5"},
        "load": {"fy": "10 MPa"},
        "packing": {**SIZED["packing"], "mass": "1.39 ug", "settle_at": {"fy": "1 MPa"}},
        "ramp": {"step": "1 kPa", "until": ["1 MPa", "0 Pa"]},
        "perturb": {"fx": "0 N", "time": "1 ms", "amplitude": "1 nN", "omega": "1 kHz", "time_step": "1 ns"},
        "damping": {"tau": "1 s", "cn": "1 N s / m^1.5"},
        "friction": {"v0": "1 mm/s", "v_ss": "10 v0"},
        "eruptions": {"load": ["1 MPa", "2 MPa"], "time": "10 ms"},
        "trigger": {"omega": ["1 MHz", "1e6 rad/s"], "time": "1 ms"},
        "relax": {"damping": "1 kg/s"},
    }
    found = sized(**sections)
    real, perturb = real_units(found), found.perturb
    stresses = (found.packing.settle_at.fy, *found.ramp.until, found.ramp.step, *found.eruptions.load)
    assert [real.stress(each) for each in stresses] == pytest.approx([1e6, 1e6, 0.0, 1e3, 1e6, 2e6])
    assert found.law.kt / found.law.kn == pytest.approx(1e8 / 3.187e8, rel=1e-3)  # as is kn, given to four digits
    moved = (perturb.amplitude * real.force, real.frequency(perturb.omega), perturb.time * real.time)
    assert (*moved, real.velocity(found.friction.v0)) == pytest.approx((1e-9, 1e3, 1e-3, 1e-3))
    assert np.array(found.trigger.omega) / real.time == pytest.approx([2e6 * np.pi, 1e6])
    damped = [found.damping.tau * real.time, found.damping.cn * real.force * real.time / real.length**1.5]
    assert [*damped, found.relax.damping * real.mass / real.time] == pytest.approx([1.0] * 3)


def test_a_drive_and_a_moving_floor_may_have_units():
    protocol = [["1 mm/s", "1 ms"], [0.0, "2 ms"]]
    drive = {"spring": "10 N/m", "protocol": protocol, "signal": "pulse", "at": "1 us", "omega": "1 MHz"}
    drive |= {"scale": "2 mm/s", "on": "floor", "states": "1 us"}
    perturb = {"fx": 0.0, "time": 1.0, "signal": "pulse", "on": "floor", "omega": 1.0, "amplitude": "2 mm/s"}
    found = sized(load={"fy": 3.0}, drive=drive, perturb=perturb)
    real, (first, second) = real_units(found), found.drive.protocol
    assert found.drive.spring * real.force / real.length == pytest.approx(10)
    times = [real.velocity(first[0]), first[1] * real.time, second[0], second[1] * real.time]
    assert times == pytest.approx([1e-3, 1e-3, 0.0, 2e-3])
    assert [real.velocity(each) for each in (found.drive.scale, found.perturb.amplitude)] == pytest.approx([2e-3] * 2)
    rigid = {"spring": "rigid", "velocity": "1 mm/s", "until": "1 s"}
    assert sized(load={"fy": 3.0}, drive=rigid).drive.spring == "rigid"


def test_every_number_of_a_scene_has_its_dimension_or_none():
    """A number of a section says its dimension in its annotation, or has none and stands here."""
    plain = {"disks", "top", "seed", "frame", "mu", "exponent", "inertia_factor", "target", "stretch"}
    plain |= {"B", "w", "mu_ss", "distance", "runs", "fx_over_fy", "slips", "perturb.scale"}
    models = {name: each for name, each in (SECTIONS | study_models()).items() if name not in ("units", "output")}
    models["packing.settle_at"] = (SettlingLoad,)
    for name, each in models.items():
        for key, field in (pair for model in each for pair in model.model_fields.items()):
            text = str(field.annotation)
            if ("float" in text or "int" in text) and not {key, f"{name}.{key}"} & plain:
                assert "BeforeValidator" in f"{field.metadata}{text}", f"{name}.{key}"


@pytest.mark.parametrize(("sections", "says"), rows_of("pywrap/refused_quantities.txt", QUARTZ=QUARTZ))
def test_quantities_that_do_not_fit_are_refused_in_one_sentence(refused_scene, sections, says):
    assert says in refused_scene({**SIZED, **sections})
