"""Quantities with units anywhere in a scene, such as ``width = "1.19 mm"``, and the values that the grains determine.

A scene with a section [units] may give each of its numbers as a text with a unit. The text is converted to the scene's
own units (:mod:`~faultgouge.pywrap.scenes.units`) before the scene is checked, and rounded to `DIGITS`, so that two
scenes that say the same in other units have the same numbers. A stress on the layer ("10 MPa") is a force on each disk
of the upper layer. A frequency in hertz is the angular frequency, 2 pi times that.

If radii have units, the unit of length is the diameter of the smallest disks. If law.kn is left out, or is a text, it
is the stiffness that fixes the unit of time: 2e5 where the smallest disks have diameter and mass one, as in the paper.
If load.fy is left out, it is the overburden on the area of a disk of the upper layer.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from pydantic import ValidationError

from .packing_section import GeneratedPacking, StoredPacking, kind_of_packing
from .units import (
    MISMATCH,
    Layer,
    RealUnits,
    Units,
    check_exponent,
    hertz_stiffness,
    is_stress,
    layer_of,
    quantity,
    units_of,
)
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
    sections_in,
)

WAVES = {"perturb": "amplitude", "drive": "scale"}
"""Sections with a wave, and their keys that are a velocity where the wave is on the floor."""

OWN_WORDS = {"law.kt": "kn", "friction.v_ss": "v0", "friction.v0": "calibrated", "drive.spring": "rigid"}
"""Texts of a scene that are no quantities, by a word in them."""

DIGITS = 12
"""Decimal digits of numbers that are converted: more than anybody gives, and fewer than a change of units leaves
right."""

STIFFNESS_OF_ONE = 2e5
"""k_n where the smallest disks have diameter and mass one: the paper's."""

Scene: TypeAlias = Mapping[str, Any]


Dimensions: TypeAlias = Mapping[str, Mapping[str, Powers | tuple[Powers, Powers]]]
"""Dimensions of the numbers of each section, or table in a section, by its path and by key."""


def as_numbers(scene: Scene, folder: Path, name: str, models: Mapping[str, tuple[type[Section], ...]]) -> Scene:
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
        if _is_plain(scene, dimensions):
            return scene
        check_exponent(_section(scene, "law").get("exponent", HERTZ_EXPONENT))
        converted = {**scene, "packing": _packing_in_numbers(units, _section(scene, "packing"))}
    except ValidationError:
        return scene
    except ValueError as error:
        raise SceneError(f"{name}: {error}.") from None
    try:
        return _convert(converted, units, layer_of(_checked_packing(converted["packing"], folder)), dimensions)
    except ValidationError:
        return converted
    except ValueError as error:
        raise SceneError(f"{name}: {error}.") from None


def _is_plain(scene: Scene, dimensions: Dimensions) -> bool:
    """Whether every number is one already, and none is left to the grains."""
    given = "kn" in _section(scene, "law") and "fy" in _section(scene, "load")
    return given and not any(_texts(path, key, scene) for path, keys in dimensions.items() for key in keys)


def dimensions_of(models: Mapping[str, tuple[type[Section], ...]]) -> Dimensions:
    """The dimension of each number, or of each pair of numbers, of some sections; all others have none."""
    found: dict[str, dict[str, Any]] = {}
    for path, each in models.items():
        fields = [field for model in each for field in model.model_fields.items()]
        found[path] = {key: mark for key, field in fields for mark in field.metadata if isinstance(mark, tuple)}
        tables = {f"{path}.{key}": inner for key, field in fields if (inner := sections_in(field.annotation))}
        found |= {name: {**keys} for name, keys in dimensions_of(tables).items()}
    return found


def _section(scene: Scene, path: str) -> Mapping[str, Any]:
    """A section, or a table in a section, by its path; empty if there is none."""
    found: Any = scene
    for name in path.split("."):
        found = found.get(name) if isinstance(found, Mapping) else None
    return found if isinstance(found, Mapping) else {}


def _texts(path: str, key: str, scene: Scene) -> bool:
    """Whether a key, or a number in its list, is a quantity with a unit."""
    value, own = _section(scene, path).get(key), OWN_WORDS.get(f"{path}.{key}")
    return any(isinstance(each, str) and not (own and own in each) for each in _flat(value))


def _flat(value: Any) -> list[Any]:
    """A value, or all values of a list of lists."""
    return [each for one in value for each in _flat(one)] if isinstance(value, (list, tuple)) else [value]


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


def _checked_packing(section: Mapping[str, Any], folder: Path) -> GeneratedPacking | StoredPacking:
    model = StoredPacking if kind_of_packing(section) == "stored" else GeneratedPacking
    own = {key: value for key, value in section.items() if key != "settle_at"}  # whose units come later
    return model.model_validate(own, context={"folder": folder})


def _convert(scene: Scene, units: Units, layer: Layer, dimensions: Dimensions) -> Scene:
    """A scene whose packing has numbers."""
    law, load = dict(_section(scene, "law")), dict(_section(scene, "load"))
    if isinstance(law.get("kn", ""), str):
        law["kn"] = _stiffness(law.get("kn"), units, layer)
    if not is_number(law["kn"]) or law["kn"] <= 0:
        return scene
    real = units_of(units, layer, law["kn"], fy=1.0)
    if "fy" not in load and units.overburden is not None:
        load["fy"] = _round(units.si("overburden") / real.overburden)
    found: Scene = {**scene, "law": law, "load": load}
    for path, keys in dimensions.items():
        texts = {key: powers for key, powers in keys.items() if _texts(path, key, found)}
        if texts:
            found = _put(found, path, _section_in_numbers(path, _section(found, path), texts, real))
    return found


def _section_in_numbers(
    path: str, section: Mapping[str, Any], texts: Mapping[str, Powers | tuple[Powers, Powers]], real: RealUnits
) -> dict[str, Any]:
    if section.get("on") == "floor":
        texts = {key: VELOCITY if key == WAVES.get(path) else powers for key, powers in texts.items()}
    return {**section, **{key: _numbers(f"{path}.{key}", section[key], of, real) for key, of in texts.items()}}


def _put(scene: Scene, path: str, section: Mapping[str, Any]) -> dict[str, Any]:
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
