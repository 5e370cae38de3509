"""The section [units] of a scene: size and material of the grains, as quantities with units."""

from __future__ import annotations

import re
from functools import lru_cache
from typing import Annotated, Any

import numpy as np
from pydantic import Field, field_validator, model_validator

from ...analysis.files.formats.tables import unit_registry
from .validation import Section, refusal_sentence

DIMENSIONS = {
    "grain_diameter": "m",
    "density": "kg/m^3",
    "youngs_modulus": "Pa",
    "thickness": "m",
    "overburden": "Pa",
    "impact_velocity": "m/s",
}


def to_si(text: str, unit: str) -> float:
    """A quantity such as "100 um" as a number of SI units.

    Raises ValueError if it is no quantity, or one of another dimension: half a sentence with the reason.
    """
    from pint import PintError

    try:
        return _magnitude(text, unit)
    except (PintError, ValueError, TypeError, AttributeError, AssertionError, OverflowError) as error:
        reason = str(error).splitlines()[0].rstrip(".") if str(error) else "it is no quantity"
        raise ValueError(f"does not convert to {unit} ({reason})") from None


@lru_cache  # the scenes of a sweep have the same texts, and pint reads each in milliseconds
def _magnitude(text: str, unit: str) -> float:
    return float(unit_registry().Quantity(text).to(unit).magnitude)


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

    @field_validator(*DIMENSIONS)
    @classmethod
    def _converts(cls, text: str | None, info: Any) -> str | None:
        if text is None:
            return None
        unit = DIMENSIONS[info.field_name]
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
        return to_si(getattr(self, key), DIMENSIONS[key])
