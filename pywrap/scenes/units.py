r"""Real units: the physical values of the numbers in a scene for grains of a given size and material.

A scene has three units that its numbers do not fix. The grains fix them: the unit of length is the diameter
:math:`2 R_1` of the smallest disks, and the unit of mass is the mass of a smallest grain, a sphere or (with a thickness
h) a cylinder,

.. math:: M = \tfrac43 \pi R_1^3 \rho \quad\text{or}\quad M = \pi R_1^2 h \rho ,

and the unit of time follows from Hertz's contact of two such spheres (K. L. Johnson, *Contact Mechanics*, 1985, section
4.2),

.. math:: F = \tfrac43 E^* \sqrt{R_1/2}\, \delta^{3/2}, \qquad E^* = \frac{E}{2 (1 - \nu^2)},
    \qquad\text{so}\qquad k = \frac{E \sqrt{2 R_1}}{3 (1 - \nu^2)} ,

which is the scene's k_n: :math:`T^2 = k_n M / (k \sqrt{2 R_1})`. A cylinder has no contact law with the exponent 3/2;
its thickness changes only the mass and the area.

**Stress.** The upper layer has n disks above the area W h, W the width of the box and h the thickness, or :math:`2
R_1`. The force F_y on each of them is the overburden :math:`n F_y / (W h)`, F_x the shear stress, and F_x/F_y their
ratio. The ratio k_n/F_y of a scene therefore corresponds to a depth, and a given overburden must agree with that of the
scene.

**Waves.** A force a on each disk of the upper layer is a stress :math:`\sigma = n a/(W h)`. A plane shear wave in the
rock, with the modulus :math:`G = E/2(1 + \nu)`, has this stress at the strain :math:`\sigma/G` and the ground velocity
:math:`\sigma/\sqrt{G\rho}`. An acceleration A of the floor at the angular frequency omega is a ground velocity A/omega.

**Dissipation.** The restitution e of two smallest grains that collide head on at a given velocity follows from
:math:`\tfrac12 M \ddot\delta = -k \delta^{3/2} - C_N \delta^{1/2} \dot\delta`; the restitution falls as the velocity
grows (N. V. Brilliantov et al., Phys. Rev. E 53, 5382, 1996), so that a restitution needs a velocity. The ratio
:math:`Q = \omega/2|\mathrm{Re}\,s|` is the quality factor of a motion :math:`e^{st}`.

**Quantities.** A scene with a section [units] may give each of its numbers as a text with a unit. The text is converted
to the scene's own units before the scene is checked, and rounded to `DIGITS`, so that two scenes that say the same in
other units have the same numbers. A stress on the layer ("10 MPa") is a force on each disk
of the upper layer. A frequency in hertz is the angular frequency, 2 pi times that.

If radii have units, the unit of length is the diameter of the smallest disks. If law.kn is left out, or is a text, it
is the stiffness that fixes the unit of time: 2e5 where the smallest disks have diameter and mass one, as in the paper.
If load.fy is left out, it is the overburden on the area of a disk of the upper layer.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any, NamedTuple, TypeAlias

import numpy as np
from pydantic import Field, ValidationError, field_validator, model_validator

from ...analysis import MindlinLaw, PackingFileError
from ...analysis.files.formats.tables import unit_registry
from .packing_section import GeneratedPacking, StoredPacking, kind_of_packing
from .validation import (
    FORCE,
    HERTZ_EXPONENT,
    LENGTH,
    MASS,
    STIFFNESS,
    STRESS,
    VELOCITY,
    Powers,
    SceneError,
    Section,
    is_number,
    refusal_sentence,
    sections_in,
)

MISMATCH = 0.01
"""Relative difference of the overburden from that of the scene up to which the two count as one."""


SI = {
    "grain_diameter": "m",
    "density": "kg/m^3",
    "youngs_modulus": "Pa",
    "thickness": "m",
    "overburden": "Pa",
    "impact_velocity": "m/s",
}


@lru_cache  # the scenes of a sweep have the same texts, and pint reads each in milliseconds
def to_si(text: str, unit: str) -> float:
    """A quantity such as "100 um" as a number of SI units.

    Raises ValueError if it is no quantity, or one of another dimension: half a sentence with the reason.
    """
    from pint import PintError

    try:
        return float(unit_registry().Quantity(text).to(unit).magnitude)
    except (PintError, ValueError, TypeError, AttributeError, AssertionError, OverflowError) as error:
        reason = str(error).splitlines()[0].rstrip(".") if str(error) else "it is no quantity"
        raise ValueError(f"does not convert to {unit} ({reason})") from None


def quantity(place: str, text: str, unit: str) -> float:
    """A quantity somewhere in a scene as a number of SI units; a frequency in hertz as an angular frequency.

    Raises ValueError if it is no quantity, or one of another dimension: a sentence without its full stop.
    """
    try:
        number = to_si(text, unit)
    except ValueError as error:
        raise ValueError(f'{place} = "{text}" {error}: give a number with a unit of that kind') from None
    return number * (2 * np.pi if re.search(r"[Hh]ertz|Hz", text) else 1.0)


def is_stress(text: str) -> bool:
    """Whether a text is a quantity such as "10 MPa"."""
    try:
        to_si(text, "Pa")
    except ValueError:
        return False
    return True


class Units(Section):
    """[units] of length, mass and time, from grains. Quantities are strings with a unit, such as "100 um".

    Attributes
    ----------
    grain_diameter : str
        Diameter of the smallest disks.
    density : str
        Of the grains' material.
    youngs_modulus : str
        Of the grains' material, and of the rock about the layer.
    poisson_ratio : float
        Of both.
    thickness : str or None
        Of the layer of disks; None: the grains are spheres, and the layer as thick as one.
    overburden : str or None
        Normal stress on the layer; None: whatever the scene has.
    restitution : float or None
        Of two grains that meet head on at `impact_velocity`; None: not known.
    impact_velocity : str or None
        At which the restitution is meant.
    """

    grain_diameter: str
    density: str
    youngs_modulus: str
    poisson_ratio: Annotated[float, Field(gt=-1, lt=0.5, allow_inf_nan=False)]
    thickness: str | None = None
    overburden: str | None = None
    restitution: Annotated[float, Field(gt=0, le=1, allow_inf_nan=False)] | None = None
    impact_velocity: str | None = None

    @field_validator(*SI)
    @classmethod
    def _converts(cls, text: str | None, info: Any) -> str | None:
        if text is None:
            return None
        unit = SI[info.field_name]
        try:
            number = to_si(text, unit)
        except ValueError as error:
            raise refusal_sentence("", f'= "{text}" {error}: give a number with a unit of that kind') from None
        if not 0 < number < np.inf:
            raise refusal_sentence("", f'= "{text}" is refused: give a quantity above 0')
        return text

    @model_validator(mode="after")
    def _complete(self) -> Units:
        if (self.restitution is None) != (self.impact_velocity is None):
            key = "impact_velocity" if self.impact_velocity is None else "restitution"
            raise refusal_sentence(
                key, "is missing: the restitution of such contacts depends on the velocity, so give both"
            )
        return self

    @property
    def grain_mass(self) -> float:
        """Mass of a smallest grain, a sphere, or a cylinder with a thickness, kg."""
        diameter = self.si("grain_diameter")
        sphere = np.pi * diameter**3 / 6
        volume = sphere if self.thickness is None else np.pi * diameter**2 / 4 * self.si("thickness")
        return float(self.si("density") * volume)

    def si(self, key: str) -> float:
        """A quantity as a number of SI units."""
        return to_si(getattr(self, key), SI[key])


@dataclass(frozen=True)
class RealUnits:
    """The units of a scene in SI, and the quantities that follow from them.

    Attributes
    ----------
    length, mass, time : float
        Metres, kilograms and seconds in one unit of the scene.
    area : float
        Area of the layer per disk of the upper layer, m^2.
    shear_modulus, density : float
        Of the rock, Pa and kg/m^3.
    fy : float
        Force on each disk of the upper layer, in units of the scene.
    """

    length: float
    mass: float
    time: float
    area: float
    shear_modulus: float
    density: float
    fy: float

    @property
    def force(self) -> float:
        """Newtons in one unit of the scene."""
        return self.mass * self.length / self.time**2

    @property
    def overburden(self) -> float:
        """Normal stress, Pa."""
        return self.stress(self.fy)

    @property
    def shear_wave(self) -> float:
        """Velocity of shear waves in the rock, m/s; a plane wave's strain is its ground velocity over this."""
        return float(np.sqrt(self.shear_modulus / self.density))

    def stress(self, force: float) -> float:
        """Stress of a force on each disk of the upper layer, Pa."""
        return force * self.force / self.area

    def frequency(self, omega: float) -> float:
        """Hertz of an angular frequency."""
        return omega / (2 * np.pi * self.time)

    def velocity(self, velocity: float) -> float:
        """m/s of a velocity."""
        return velocity * self.length / self.time

    def displacement(self, msd: float) -> float:
        """Root of a mean square displacement, m."""
        return float(np.sqrt(msd)) * self.length

    def ground_velocity(self, amplitude: float, omega: float, on: str) -> float:
        """m/s of the ground in a wave: a force on each disk of the upper layer, or an acceleration of the floor."""
        if on == "floor":
            return amplitude * self.length / self.time**2 / (omega / self.time)
        return self.stress(amplitude) / (self.density * self.shear_wave)

    def onset(self, fx: float, omega: float) -> dict[str, float]:
        """For JSON: the shear stress of F_x, its share of the overburden, and the frequency of the growing motion."""
        return {
            "shear_stress_Pa": self.stress(fx),
            "stress_ratio": fx / self.fy,
            "frequency_Hz": self.frequency(omega),
        }

    def as_dict(self) -> dict[str, float]:
        """For JSON: one unit of the scene in SI, and the overburden."""
        return {
            "length_m": self.length,
            "mass_kg": self.mass,
            "time_s": self.time,
            "force_N": self.force,
            "overburden_Pa": self.overburden,
        }


class Layer(NamedTuple):
    """The quantities that, with the grains, fix the units of a scene; in units of the scene.

    Attributes
    ----------
    diameter, mass : float
        Of the smallest disks.
    width : float
        Of the box.
    top : int
        Disks of the upper layer.
    """

    diameter: float
    mass: float
    width: float
    top: int


def real_units(scene: Any) -> RealUnits | None:
    """The units of a `Scene`; None without a section [units].

    Raises
    ------
    PydanticCustomError
        While the scene is checked: if its layer has no width, if its law is not Hertz's, or if the given overburden
        differs from the overburden of the scene's F_y.
    """
    units = scene.units
    if units is None:
        return None
    check_exponent(scene.law.exponent)
    real = units_of(units, layer_of(scene.packing), scene.law.kn, scene.load.fy)
    if units.overburden is not None:
        wanted = units.si("overburden")
        if abs(real.overburden / wanted - 1) > MISMATCH:
            raise refusal_sentence(
                "units.overburden",
                f"= {units.overburden} is not the load of the scene, which presses with "
                f"{real.overburden:.4g} Pa: leave load.fy out, or set load.fy = "
                f"{scene.load.fy * wanted / real.overburden:.6g}, or leave units.overburden out",
            )
    return real


def units_of(units: Units, layer: Layer, kn: float, fy: float) -> RealUnits:
    """The units of a scene with this layer, stiffness and load."""
    diameter, modulus = units.si("grain_diameter"), units.si("youngs_modulus")
    length = diameter / layer.diameter
    mass = units.grain_mass / layer.mass
    time = float(np.sqrt(kn * mass / (hertz_stiffness(units) * np.sqrt(length))))
    depth = diameter if units.thickness is None else units.si("thickness")
    area = layer.width * length * depth / layer.top
    shear_modulus = modulus / (2 * (1 + units.poisson_ratio))
    return RealUnits(length, mass, time, area, shear_modulus, units.si("density"), fy)


def hertz_stiffness(units: Units) -> float:
    """k of two smallest grains, N/m^(3/2)."""
    modulus, diameter = units.si("youngs_modulus"), units.si("grain_diameter")
    return float(modulus * np.sqrt(diameter) / (3 * (1 - units.poisson_ratio**2)))


def check_exponent(exponent: float) -> None:
    """Refuse a law that is not Hertz's, which has no stiffness from the moduli of its grains."""
    if exponent != HERTZ_EXPONENT:
        raise refusal_sentence("units", f"takes k_n from Hertz's contact, and law.exponent = {exponent}: leave one out")


def layer_of(section: GeneratedPacking | StoredPacking) -> Layer:
    """The layer that a section [packing] describes; refused if the section gives no width."""
    if isinstance(section, GeneratedPacking):
        diameter, mass = 2 * min(section.radii), section.mass or 1.0
        width, top = section.width if section.periodic else None, section.top
    else:
        try:
            packing = section.packing(MindlinLaw(kn=1.0, kt=0.0, mu=0.0))
        except PackingFileError as error:
            says = f'= "{section.file.name}" is refused: {str(error).rstrip(".")}'
            raise refusal_sentence("packing.file", says) from None
        k, width, top = packing.radius.argmin(), packing.box_length, int(packing.top.sum())
        diameter, mass = 2 * float(packing.radius[k]), float(packing.mass[k])
    if width is None:
        raise refusal_sentence("units", "has no stress without the width of the layer: take a periodic packing")
    return Layer(diameter, mass, width, top)


def restitution(kn: float, cn: float, mass: float, velocity: float) -> float:
    """Restitution of two grains that meet head on.

    Parameters
    ----------
    kn : float
        Normal stiffness, force / length^(3/2).
    cn : float
        Dashpot C_N, force / (velocity length^(1/2)).
    mass : float
        Mass of each grain.
    velocity : float
        Relative velocity with which the grains meet.

    Returns
    -------
    float
        Relative velocity after the collision over the velocity before it.
    """
    from scipy.integrate import solve_ivp

    # in units of the largest overlap and of the time to it without a dashpot, up to factors of one
    length = (mass * velocity**2 / kn) ** 0.4
    damping = cn * np.sqrt(length) * length / (mass * velocity)

    def course(_: float, state: np.ndarray) -> list[float]:
        overlap = max(state[0], 0.0)
        return [state[1], -2 * (overlap**1.5 + damping * np.sqrt(overlap) * state[1])]

    def disks_part(_: float, state: np.ndarray) -> float:
        # the disks part where the force would pull, before the overlap is gone
        return state[0] + damping * state[1] if state[1] < 0 else 1.0

    disks_part.terminal = True  # type: ignore[attr-defined]  # what solve_ivp looks for
    path = solve_ivp(course, (0.0, 100.0), [0.0, 1.0], events=disks_part, rtol=1e-10, atol=1e-12, max_step=0.05)
    return float(max(0.0, -path.y[1, -1]))


def dashpot(kn: float, wanted: float, mass: float, velocity: float) -> float:
    """The dashpot with which two grains that meet head on have a restitution.

    Parameters
    ----------
    kn : float
        Normal stiffness, force / length^(3/2).
    wanted : float
        The restitution, above 0 and up to 1.
    mass : float
        Mass of each grain.
    velocity : float
        Relative velocity with which the grains meet.

    Returns
    -------
    float
        C_N, force / (velocity length^(1/2)); 0 for the restitution 1.
    """
    from scipy.optimize import brentq

    if wanted == 1:
        return 0.0
    length = (mass * velocity**2 / kn) ** 0.4
    unit = mass * velocity / length**1.5
    return float(brentq(lambda c: restitution(kn, c * unit, mass, velocity) - wanted, 0.0, 50.0, xtol=1e-10)) * unit


def quality_factor(rate: complex) -> float:
    """Q = |Im s| / 2 |Re s| of a motion exp(s t); infinite without dissipation."""
    return float(abs(rate.imag) / (2 * abs(rate.real))) if rate.real != 0 else float("inf")


WAVES = {"perturb": "amplitude", "drive": "scale"}
"""Sections with a wave, and their keys that are a velocity where the wave is on the floor."""

OWN_WORDS = {"law.kt": "kn", "friction.v_ss": "v0", "friction.v0": "calibrated", "drive.spring": "rigid"}
"""Texts of a scene that are no quantities, by a word in them."""

DIGITS = 12
"""Decimal digits of numbers that are converted: more than anybody gives, and fewer than a change of units leaves
right."""

STIFFNESS_OF_ONE = 2e5
"""k_n where the smallest disks have diameter and mass one: the paper's."""

RawScene: TypeAlias = Mapping[str, Any]
"""A scene as TOML contains it."""

Dimensions: TypeAlias = Mapping[str, Mapping[str, Powers | tuple[Powers, Powers]]]
"""Dimensions of the numbers of each section, or table in a section, by its path and by key."""


def as_numbers(scene: RawScene, folder: Path, name: str, models: Mapping[str, tuple[type[Section], ...]]) -> RawScene:
    """A scene as TOML contains it, with numbers in place of quantities, and with the values that its grains determine.

    Parameters
    ----------
    scene : mapping
        Sections by name, with [units].
    folder : Path
        From which a relative packing.file counts.
    name : str
        Of the scene, for messages.
    models : mapping
        The models of each section.

    Returns
    -------
    mapping
        The same mapping if it has nothing to convert. A scene that is refused anyway comes back
        as it is: its check has the words for that.

    Raises
    ------
    SceneError
        If a quantity does not convert, or disagrees with the grains.
    """
    try:
        units = Units.model_validate(scene["units"])
        dimensions = dimensions_of(models)
        given = "kn" in _section(scene, "law") and "fy" in _section(scene, "load")
        if given and not any(_texts(path, key, scene) for path, keys in dimensions.items() for key in keys):
            return scene
        check_exponent(_section(scene, "law").get("exponent", HERTZ_EXPONENT))
        converted = {**scene, "packing": _packing_in_numbers(units, _section(scene, "packing"))}
    except ValidationError:
        return scene
    except ValueError as error:
        raise SceneError(f"{name}: {error}.") from None
    try:
        own = {
            key: value for key, value in converted["packing"].items() if key != "settle_at"
        }  # whose units come later
        model = StoredPacking if kind_of_packing(own) == "stored" else GeneratedPacking
        layer = layer_of(model.model_validate(own, context={"folder": folder}))
        return _convert(converted, units, layer, dimensions)
    except ValidationError:
        return converted
    except ValueError as error:
        raise SceneError(f"{name}: {error}.") from None


def dimensions_of(models: Mapping[str, tuple[type[Section], ...]]) -> Dimensions:
    """The dimension of each number, or of each pair of numbers, of some sections; all others have none."""
    found: dict[str, dict[str, Any]] = {}
    for path, each in models.items():
        fields = [field for model in each for field in model.model_fields.items()]
        found[path] = {key: mark for key, field in fields for mark in field.metadata if isinstance(mark, tuple)}
        tables = {f"{path}.{key}": inner for key, field in fields if (inner := sections_in(field.annotation))}
        found |= {name: {**keys} for name, keys in dimensions_of(tables).items()}
    return found


def _section(scene: RawScene, path: str) -> Mapping[str, Any]:
    """A section, or a table in a section, by its path; empty if there is none."""
    found: Any = scene
    for name in path.split("."):
        found = found.get(name) if isinstance(found, Mapping) else None
    return found if isinstance(found, Mapping) else {}


def _texts(path: str, key: str, scene: RawScene) -> bool:
    """Whether a key, or a number in its list, is a quantity with a unit."""
    own, values = OWN_WORDS.get(f"{path}.{key}"), [_section(scene, path).get(key)]
    while any(isinstance(each, (list, tuple)) for each in values):
        values = [each for one in values for each in (one if isinstance(one, (list, tuple)) else [one])]
    return any(isinstance(each, str) and not (own and own in each) for each in values)


def _packing_in_numbers(units: Units, section: Mapping[str, Any]) -> dict[str, Any]:
    """[packing] with numbers for its lengths and its mass."""
    if "file" in section:
        return dict(section)
    converted = dict(section)
    diameter, radii = units.si("grain_diameter"), section.get("radii", GeneratedPacking.model_fields["radii"].default)
    if not isinstance(radii, (list, tuple)) or not radii:
        return converted
    if any(isinstance(radius, str) for radius in radii):
        if not all(isinstance(radius, str) for radius in radii):
            raise ValueError("packing.radii has numbers beside quantities: give all of them a unit, or none")
        length = diameter
        converted["radii"] = radii = [_number("packing.radii", each, LENGTH, length=length) for each in radii]
        if abs(2 * min(radii) - 1) > 1e-9:
            raise ValueError(
                f"packing.radii has smallest disks of {2 * min(radii) * diameter:.6g} m, and units.grain_diameter = "
                f'"{units.grain_diameter}" is their diameter: make them agree'
            )
    elif not all(map(is_number, radii)) or min(radii) <= 0:
        return converted
    else:
        length = diameter / (2 * min(radii))
    if isinstance(section.get("width"), str):
        converted["width"] = _number("packing.width", section["width"], LENGTH, length=length)
    if isinstance(section.get("mass"), str):
        own, given = units.grain_mass, quantity("packing.mass", section["mass"], _unit(MASS))
        if abs(given / own - 1) > MISMATCH:
            raise ValueError(
                f'packing.mass = "{section["mass"]}" is not the mass of a smallest grain of units.density, '
                f"{own:.6g} kg: leave packing.mass out, or correct one of them"
            )
        converted["mass"] = 1.0
    return converted


def _convert(scene: RawScene, units: Units, layer: Layer, dimensions: Dimensions) -> RawScene:
    """A scene whose packing has numbers."""
    law, load = dict(_section(scene, "law")), dict(_section(scene, "load"))
    if isinstance(law.get("kn", ""), str):
        law["kn"] = _stiffness(law.get("kn"), units, layer)
    if not is_number(law["kn"]) or law["kn"] <= 0:
        return scene
    real = units_of(units, layer, law["kn"], fy=1.0)
    if "fy" not in load and units.overburden is not None:
        load["fy"] = _round(units.si("overburden") / real.overburden)
    found: RawScene = {**scene, "law": law, "load": load}
    for path, keys in dimensions.items():
        texts = {key: powers for key, powers in keys.items() if _texts(path, key, found)}
        if texts:
            section = _section(found, path)
            if section.get("on") == "floor":
                texts = {key: VELOCITY if key == WAVES.get(path) else powers for key, powers in texts.items()}
            numbers = {key: _numbers(f"{path}.{key}", section[key], of, real) for key, of in texts.items()}
            found = _put(found, path, {**section, **numbers})
    return found


def _put(scene: RawScene, path: str, section: Mapping[str, Any]) -> dict[str, Any]:
    """The scene with a section, or a table in a section, replaced."""
    name, _, below = path.partition(".")
    return {**scene, name: _put(_section(scene, name), below, section) if below else section}


def _stiffness(given: str | None, units: Units, layer: Layer) -> float:
    """law.kn, if it is left out or is a quantity: a number that fixes the unit of time."""
    hertz = hertz_stiffness(units)
    if given is not None:
        physical = quantity("law.kn", given, _unit(STIFFNESS))
        if abs(physical / hertz - 1) > MISMATCH:
            raise ValueError(
                f'law.kn = "{given}" is not the stiffness of Hertz\'s contact of these grains, {hertz:.6g} N/m^1.5: '
                "leave law.kn out, or correct units.youngs_modulus"
            )
    return _round(STIFFNESS_OF_ONE * layer.mass * layer.diameter ** (1 - HERTZ_EXPONENT))


def _numbers(place: str, value: Any, powers: Powers | tuple[Powers, Powers], real: RealUnits) -> Any:
    """A quantity as a number; of a list, or of a list of pairs, each. Numbers are returned unchanged."""
    if len(powers) == 2:
        pairs = [each for each in value if isinstance(each, (list, tuple)) and len(each) == 2]
        if len(pairs) < len(value):
            return value  # no list of pairs, and refused as such
        return [[_numbers(place, each, of, real) for each, of in zip(pair, powers, strict=True)] for pair in pairs]
    if isinstance(value, (list, tuple)):
        return [_numbers(place, each, powers, real) for each in value]
    if not isinstance(value, str):
        return value
    if powers == FORCE and is_stress(value):
        return _round(quantity(place, value, _unit(STRESS)) / real.stress(1.0))
    return _number(place, value, powers, real.mass, real.length, real.time)


def _number(place: str, text: str, powers: Powers, mass: float = 1.0, length: float = 1.0, time: float = 1.0) -> float:
    a, b, c = powers
    return _round(quantity(place, text, _unit(powers)) / (mass**a * length**b * time**c))


def _unit(powers: Powers) -> str:
    return " * ".join(f"{unit}**({power:g})" for unit, power in zip(("kg", "m", "s"), powers, strict=True) if power)


def _round(number: float) -> float:
    return float(f"{number:.{DIGITS}g}") if np.isfinite(number) else number
