r"""Real units: the physical values of the numbers in a scene for grains of a given size and material.

A scene has three units that its numbers do not fix. The grains fix them: the unit of length is the diameter
:math:`2 R_1` of the smallest disks, and the unit of mass is the mass of a smallest grain, a sphere,

.. math:: M = \tfrac43 \pi R_1^3 \rho ,

and the unit of time follows from Hertz's contact of two such spheres (K. L. Johnson, *Contact Mechanics*, 1985, section
4.2),

.. math:: F = \tfrac43 E^* \sqrt{R_1/2}\, \delta^{3/2}, \qquad E^* = \frac{E}{2 (1 - \nu^2)},
    \qquad\text{so}\qquad k = \frac{E \sqrt{2 R_1}}{3 (1 - \nu^2)} ,

which is the scene's k_n: :math:`T^2 = k_n M / (k \sqrt{2 R_1})`.

**Stress.** The upper layer has n disks above the area :math:`2 W R_1`, W the width of the box: the layer is as thick as
a smallest grain. The force F_y on each of them is the overburden :math:`n F_y / (2 W R_1)`, F_x the shear stress, and
F_x/F_y their ratio. The ratio k_n/F_y of a scene therefore corresponds to a depth, and a given overburden must agree
with that of the scene.

**Waves.** A force a on each disk of the upper layer is a stress :math:`\sigma = n a/(2 W R_1)`. A plane shear wave in
the rock, with the modulus :math:`G = E/2(1 + \nu)`, has this stress at the strain :math:`\sigma/G` and the ground
velocity :math:`\sigma/\sqrt{G\rho}`. An acceleration A of the floor at the angular frequency omega is a ground
velocity A/omega.

**Dissipation.** The restitution e of two smallest grains that collide head on at a given velocity follows from
:math:`\tfrac12 M \ddot\delta = -k \delta^{3/2} - C_N \delta^{1/2} \dot\delta`; the restitution falls as the velocity
grows (N. V. Brilliantov et al., Phys. Rev. E 53, 5382, 1996), so that a restitution needs a velocity.

**Quantities.** A scene with a section [units] may give each of its numbers as a text with a unit, which its key
converts to the scene's own units and rounds to twelve digits, so that two scenes that say the same in other units have
the same numbers. A stress on the layer ("10 MPa") is a force on each disk of the upper layer. A frequency in hertz is
the angular frequency, 2 pi times that. If radii have units, the unit of length is the diameter of the smallest disks.
If law.kn is left out, or is a text, it is the stiffness that fixes the unit of time: 2e5 where the smallest disks have
diameter and mass one, as in the paper. If load.fy is left out, it is the overburden on the area of a disk of the upper
layer.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, Field, ValidationInfo, field_validator, model_validator

from ...analysis import MindlinLaw
from .packing_section import GeneratedPacking, PackingSection, StoredPacking
from .validation import HERTZ_EXPONENT, Section, is_number, refuse, rounded, to_si

MISMATCH = 0.01
"""Relative difference of the overburden from that of the scene up to which the two count as one."""

STIFFNESS_OF_ONE = 2e5
"""k_n where the smallest disks have diameter and mass one: the paper's."""

SI = {"grain_diameter": "m", "density": "kg/m^3", "youngs_modulus": "Pa", "overburden": "Pa", "impact_velocity": "m/s"}


class Units(Section):
    """[units] of length, mass and time, from grains. Quantities are strings with a unit, such as "100 um".

    Attributes
    ----------
    grain_diameter : str
        Of the smallest disks.
    density, youngs_modulus, poisson_ratio : str, str, float
        Of the grains' material; the latter two also of the rock about the layer.
    overburden : str or None
        Normal stress on the layer; None: whatever the scene has.
    restitution, impact_velocity : float, str, or None
        Of two grains that meet head on at this velocity; None: not known.
    """

    grain_diameter: str
    density: str
    youngs_modulus: str
    poisson_ratio: Annotated[float, Field(gt=-1, lt=0.5, allow_inf_nan=False)]
    overburden: str | None = None
    restitution: Annotated[float, Field(gt=0, le=1, allow_inf_nan=False)] | None = None
    impact_velocity: str | None = None

    @field_validator(*SI)
    @classmethod
    def _converts(cls, text: str | None, info: ValidationInfo) -> str | None:
        wrong = text is not None and not 0 < to_si(text, SI[str(info.field_name)]) < math.inf
        refuse(wrong, "", f'= "{text}" is refused: give a quantity above 0')
        return text

    @model_validator(mode="after")
    def _complete(self) -> Units:
        for key, other in (("impact_velocity", self.restitution), ("restitution", self.impact_velocity)):
            alone = other is not None and getattr(self, key) is None
            refuse(alone, key, "is missing: the restitution depends on the velocity, so give both")
        return self

    def si(self, key: str) -> float:
        """A quantity as a number of SI units."""
        return to_si(getattr(self, key), SI[key])

    @property
    def grain_mass(self) -> float:
        """Mass of a smallest grain, kg."""
        return float(self.si("density") * (np.pi * self.si("grain_diameter") ** 3 / 6))

    @property
    def stiffness(self) -> float:
        """k of two smallest grains, N/m^(3/2)."""
        modulus, diameter = self.si("youngs_modulus"), self.si("grain_diameter")
        return modulus * math.sqrt(diameter) / (3 * (1 - self.poisson_ratio**2))


@dataclass(frozen=True)
class RealUnits:
    """The units of a scene in SI, and the quantities that follow from them.

    Attributes
    ----------
    length, mass, time, area : float
        Metres, kilograms and seconds in one unit of the scene; area of the layer per disk of the upper layer, m^2.
    shear_modulus, density : float
        Of the rock, Pa and kg/m^3.
    kn, fy : float
        Stiffness, and force on each disk of the upper layer, in units of the scene.
    """

    length: float
    mass: float
    time: float
    area: float
    shear_modulus: float
    density: float
    kn: float
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

    def ground_velocity(self, amplitude: float, omega: float, on: str) -> float:
        """m/s of the ground in a wave: a force on each disk of the upper layer, or an acceleration of the floor."""
        if on == "floor":
            return amplitude * self.length / self.time**2 / (omega / self.time)
        return self.stress(amplitude) / (self.density * self.shear_wave)

    def onset(self, fx: float, omega: float) -> dict[str, float]:
        """For JSON: the shear stress of F_x, its share of the overburden, and the frequency of the growing motion."""
        stress, hertz = self.stress(fx), self.frequency(omega)
        return {"shear_stress_Pa": stress, "stress_ratio": fx / self.fy, "frequency_Hz": hertz}

    def as_dict(self) -> dict[str, float]:
        """For JSON: one unit of the scene in SI, and the overburden."""
        own = {"length_m": self.length, "mass_kg": self.mass, "time_s": self.time}
        return own | {"force_N": self.force, "overburden_Pa": self.overburden}


class Grains(BaseModel):
    """The sections that fix the units of a scene; without packing.settle_at, whose units they fix."""

    units: Units
    packing: PackingSection

    @field_validator("packing", mode="before")
    @classmethod
    def _in_diameters(cls, packing: Any, info: ValidationInfo) -> Any:
        if "units" not in info.data or not isinstance(packing, Mapping):
            return packing
        units, radii = info.data["units"], packing.get("radii", GeneratedPacking.model_fields["radii"].default)
        numbers = [each for each in radii if is_number(each) and each > 0] if isinstance(radii, (list, tuple)) else []
        says = "has numbers beside quantities: give all of them a unit, or none"
        refuse(numbers and any(isinstance(each, str) for each in radii), "radii", says)
        length = units.si("grain_diameter") / (2 * min(numbers, default=0.5))
        assert info.context is not None
        info.context["units"] = SimpleNamespace(length=length, mass=units.grain_mass, time=math.nan)
        return {key: value for key, value in packing.items() if key != "settle_at"}


def in_units(scene: Mapping[str, Any], context: dict[str, Any]) -> Mapping[str, Any]:
    """A scene as TOML contains it, with what its grains fix: k_n and F_y, where these are left out, and the mass.

    The units are in the context from then on, in which keys convert their texts.
    """
    grains = Grains.model_validate(scene, context=context)
    units, section, packing = grains.units, grains.packing, dict(scene["packing"])
    law, load = scene.get("law", {}), scene.get("load", {})
    if not (isinstance(law, Mapping) and isinstance(load, Mapping)):
        return scene  # which is refused
    if isinstance(section, GeneratedPacking):
        smallest = 2 * min(section.radii) * context["units"].length
        says = f'has smallest disks of {smallest:.6g} m, and units.grain_diameter = "{units.grain_diameter}" is another'
        refuse(abs(smallest / units.si("grain_diameter") - 1) > 1e-9, "packing.radii", f"{says}: make them agree")
        if isinstance(packing.get("mass"), str):
            _agree("packing.mass", packing["mass"], "kg", units.grain_mass, "the mass of a smallest grain")
            packing["mass"], section = 1.0, section.model_copy(update={"mass": 1.0})
    kn = law.get("kn", "")
    if isinstance(kn, str) and kn:
        _agree("law.kn", kn, "N/m**1.5", units.stiffness, "the stiffness of Hertz's contact of these grains")
    given = kn if is_number(kn) and kn > 0 else None
    context["units"] = real = units_of(units, section, law.get("exponent", HERTZ_EXPONENT), given, fy=1.0)
    if isinstance(kn, str):
        law = {**law, "kn": real.kn}
    if "fy" not in load and units.overburden is not None:
        load = {**load, "fy": rounded(units.si("overburden") / real.overburden)}
    return {**scene, "packing": packing, "law": law, "load": load}


def _agree(key: str, text: str, unit: str, grains: float, what: str) -> None:
    """Refuse a quantity that is not the one that the grains have."""
    says = f'= "{text}" is not {what}, {grains:.6g} {unit}: leave {key} out, or correct the keys of [units]'
    refuse(abs(to_si(text, unit, key) / grains - 1) > MISMATCH, key, says)


def real_units(scene: Any) -> RealUnits | None:
    """The units of a `Scene`; None without a section [units].

    Refused, while the scene is checked, if the layer has no width, if the law is not Hertz's, or if the overburden
    differs from that of F_y.
    """
    if (units := scene.units) is None:
        return None
    real = units_of(units, scene.packing, scene.law.exponent, scene.law.kn, scene.load.fy)
    wanted = real.overburden if units.overburden is None else units.si("overburden")
    way = f"leave load.fy out, or set load.fy = {scene.load.fy * wanted / real.overburden:.6g}"
    says = f"= {units.overburden} is not the load of the scene, which presses with {real.overburden:.4g} Pa: {way}"
    refuse(abs(real.overburden / wanted - 1) > MISMATCH, "units.overburden", says)
    return real


def units_of(
    units: Units, section: GeneratedPacking | StoredPacking, exponent: float, kn: float | None, fy: float
) -> RealUnits:
    """The units of a scene with this packing, law and load; without k_n that of grains of diameter and mass one."""
    says = f"takes k_n from Hertz's contact, and law.exponent = {exponent}: leave one out"
    refuse(exponent != HERTZ_EXPONENT, "units", says)
    if isinstance(section, GeneratedPacking):
        diameter, mass, top = 2 * min(section.radii), section.mass or 1.0, section.top
        width = section.width if section.periodic else None
    else:
        packing = section.packing(MindlinLaw(kn=1.0, kt=0.0, mu=0.0))
        k, width, top = packing.radius.argmin(), packing.box_length, int(packing.top.sum())
        diameter, mass = 2 * float(packing.radius[k]), float(packing.mass[k])
    refuse(width is None, "units", "has no stress without the width of the layer: take a periodic packing")
    kn = kn or rounded(STIFFNESS_OF_ONE * mass * diameter ** (1 - HERTZ_EXPONENT))
    length, mass_of_one = units.si("grain_diameter") / diameter, units.grain_mass / mass
    time = math.sqrt(kn * mass_of_one / (units.stiffness * math.sqrt(length)))
    area = (width or 0.0) * length * units.si("grain_diameter") / top
    shear_modulus = units.si("youngs_modulus") / (2 * (1 + units.poisson_ratio))
    return RealUnits(length, mass_of_one, time, area, shear_modulus, units.si("density"), kn, fy)


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
