"""Real units, against numbers worked out by hand, and quantities that do not convert."""

import json

import numpy as np
import pytest

from faultgouge.analysis import MindlinLaw, read_packing
from faultgouge.pywrap import Scene
from faultgouge.pywrap.exchange import write_packing
from faultgouge.pywrap.scenes.units import dashpot, quality_factor, real_units, restitution

QUARTZ = {
    "grain_diameter": "0.1 mm",
    "density": "2.65 g/cm^3",
    "youngs_modulus": "95 GPa",
    "poisson_ratio": 0.08,
}
LEAST = {"packing": {"disks": 100, "width": 11.9, "top": 10}, "law": {"kn": 2e5}, "load": {"fy": 3.0}}


def scene(**units):
    return Scene.from_mapping({**LEAST, "units": {**QUARTZ, **units}})


def test_units_are_those_of_hertz_and_of_the_grains():
    real = real_units(scene())
    assert real.length == pytest.approx(1e-4, rel=1e-12)
    assert real.mass == pytest.approx(2650 * np.pi / 6 * 1e-12, rel=1e-12)
    # two spheres of radius R press with (4/3) E* sqrt(R/2) delta^(3/2), E* = E/2(1 - nu^2)
    stiffness = 4 / 3 * 95e9 / 2 / (1 - 0.08**2) * np.sqrt(0.5e-4 / 2)
    in_units_of_the_scene = stiffness * real.length**1.5 / real.force
    assert in_units_of_the_scene == pytest.approx(2e5, rel=1e-12)
    assert real.overburden == pytest.approx(10 * 3.0 * real.force / (11.9 * 1e-4 * 1e-4), rel=1e-12)
    # the force scales with k_n alone, so that the stress falls as the area grows
    thin, thick = (real_units(scene(thickness=t)) for t in ("0.1 mm", "1 mm"))
    assert thick.mass == pytest.approx(10 * thin.mass, rel=1e-12)
    assert thick.overburden == pytest.approx(thin.overburden / 10, rel=1e-12)
    assert real.frequency(2 * np.pi) == pytest.approx(1 / real.time, rel=1e-12)
    # sigma = rho c v of a plane shear wave
    shear = 95e9 / 2 / 1.08
    assert real.ground_velocity(0.01, 5.0, "layer") == pytest.approx(
        real.stress(0.01) / np.sqrt(shear * 2650), rel=1e-12
    )
    assert real.ground_velocity(0.01, 5.0, "floor") == pytest.approx(0.01 / 5.0 * real.velocity(1.0), rel=1e-12)


def test_units_of_a_file_are_those_of_its_smallest_disk_whatever_the_format(tmp_path):
    disks = {"x": [1.0, 3.0], "y": [0.49, 0.69], "radius": [0.5, 0.7], "top": [1], "box_length": 4.0}
    (tmp_path / "disks.json").write_text(json.dumps(disks))
    write_packing(tmp_path / "disks.xyz", read_packing(tmp_path / "disks.json", MindlinLaw(2e5, 0.0, 0.0)))
    scenes = [LEAST | {"packing": {"file": name}, "units": QUARTZ} for name in ("disks.json", "disks.xyz")]
    own, other = (real_units(Scene.from_mapping(each, tmp_path)) for each in scenes)
    assert own.length == pytest.approx(1e-4, rel=1e-12)
    assert own.overburden == pytest.approx(3.0 * own.force / (4.0 * 1e-4 * 1e-4), rel=1e-12)
    assert other == own


@pytest.mark.parametrize(
    ("keys", "says"),
    [
        ({"density": "5 m"}, 'units.density = "5 m" does not convert to kg/m^3'),
        ({"grain_diameter": "ten"}, "units.grain_diameter"),
        ({"grain_diameter": "3"}, "does not convert to m"),
        ({"youngs_modulus": "-3 GPa"}, "give a quantity above 0"),
        ({"youngs_modulus": "1e999 GPa"}, "give a quantity above 0"),
        ({"poisson_ratio": 0.5}, "give a number below 0.5"),
        ({"restitution": 0.9}, "units.impact_velocity is missing"),
        ({"overburden": "10 MPa"}, "set load.fy = 74.6"),
    ],
)
def test_units_that_do_not_convert_are_refused_in_one_sentence(refused_scene, keys, says):
    assert says in refused_scene({**LEAST, "units": {**QUARTZ, **keys}})


def test_restitution_is_one_without_dashpot_and_falls_with_the_velocity_as_it_should():
    assert restitution(2e5, 0.0, 1.0, 0.1) == pytest.approx(1.0, abs=1e-8)
    # for weak damping 1 - e grows as v^(1/5) (Brilliantov et al. 1996)
    slow, fast = (1 - restitution(2e5, 1.0, 1.0, v) for v in (1e-3, 32e-3))
    assert fast / slow == pytest.approx(2.0, rel=2e-3)


@pytest.mark.parametrize("wanted", [0.99, 0.9, 0.5])
def test_dashpot_of_a_restitution_gives_it(wanted):
    assert restitution(2e5, dashpot(2e5, wanted, 2.0, 0.03), 2.0, 0.03) == pytest.approx(wanted, rel=1e-8)


def test_quality_factor():
    assert quality_factor(-0.1 + 10j) == pytest.approx(50.0)
    assert quality_factor(3j) == float("inf")
