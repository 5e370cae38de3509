"""The sections of a scene beside [packing], [perturb] and [drive]; defaults are the paper's values if it gives them."""

import re
from itertools import pairwise
from typing import Annotated, Literal

from pydantic import Field, ValidationInfo, field_validator, model_validator

from ...analysis.packing.law import EXPONENTS, LEAST_RESCALED, known_exponents
from .validation import (
    DASHPOT,
    FORCE,
    LIST,
    STIFFNESS,
    TIME,
    VELOCITY,
    VISCOSITY,
    NotNegative,
    Number,
    Positive,
    Section,
    is_number,
    refuse,
    rule,
)

NUMBER_PATTERN = r"\d+(?:\.\d*)?(?:[eE][-+]?\d+)?"
"""A number without a sign, in text."""

EQUILIBRIA = 10_000_000
"""Increments of a ramp: half a day and 150 GB for 100 disks."""


def multiple_of(unit: str, value: float, text: str) -> float | None:
    """ "2/7 kn" or "10 v0" as a number, where the unit has this value; None for a text that is no multiple of it."""
    match = re.fullmatch(rf"(?:({NUMBER_PATTERN})(?:/({NUMBER_PATTERN}))? )?{unit}", text.strip())
    above, below = (float(number or 1) for number in match.groups()) if match else (0.0, 0.0)
    return above * value / below if below and is_number(above) else None


class Law(Section):
    """[law] of all contacts, floor included.

    Attributes
    ----------
    kn, kt : float
        Normal and tangential stiffness, force / length^exponent. A scene may also say "A/B kn", "A kn" or "kn" for kt;
        the default, "2/7 kn", is the paper's.
    mu : float or tuple of float
        Static friction coefficient; 0 means no tangential force at all. Of a list, `onset` and `reproduce` take every
        one and all else the first.
    exponent : float
        p of the repulsion kn overlap^p: 1.5 (Hertz, the paper's) or 1 (harmonic disks).
    history : {"total", "rescaled", "coulomb"}
        What contacts remember: the whole slip, as in the paper; the slip rescaled while overlaps grow, which creates no
        energy; or the force of a spring behind Coulomb's slider, the law of Cundall and Strack
        (:mod:`~faultgouge.analysis.packing.law`).
    """

    kn: Annotated[Positive, STIFFNESS]
    # the default is of the form that a scene gives, and becomes a number in the validator
    kt: Annotated[NotNegative, STIFFNESS] = Field("2/7 kn")  # type: ignore[assignment]  # see above
    mu: Annotated[NotNegative | Annotated[tuple[NotNegative, ...], LIST], rule("give one or more, of at least 0")] = 1.0
    exponent: float = 1.5
    history: Literal["total", "rescaled", "coulomb"] = "total"

    @field_validator("kt", mode="before")
    @classmethod
    def _share_of_kn(cls, kt: object, info: ValidationInfo) -> object:
        if not isinstance(kt, str) or "kn" not in kt:
            return kt
        if "kn" not in info.data:
            return 0.0  # kn is missing or refused, and that is what gets reported
        share = multiple_of("kn", info.data["kn"], kt)
        refuse(share is None, "", f'= "{kt}" is no share of kn: give a number, or a share such as "2/7 kn"')
        return share

    @model_validator(mode="after")
    def _known(self) -> "Law":
        refuse(self.exponent not in EXPONENTS, "exponent", f"= {self.exponent:g} is refused: give {known_exponents()}")
        flat = self.history == "rescaled" and self.exponent < LEAST_RESCALED
        refuse(flat, "history", f'= "rescaled" needs a law.exponent of {LEAST_RESCALED} or more')
        return self

    @property
    def mus(self) -> tuple[float, ...]:
        """Every friction coefficient that the scene asks for, in its order."""
        return self.mu if isinstance(self.mu, tuple) else (self.mu,)

    @property
    def in_words(self) -> str:
        """The law of friction, as pages name it."""
        smoothed = {"total": "the paper's smoothed law", "rescaled": "the smoothed law with rescaled slips"}
        return smoothed.get(self.history, "the standard law")


class Damping(Section):
    """[damping] of dynamics; none in a scene without this section. Equilibria do not depend on it.

    Dashpots cn and ct at the contacts, force time / length^exponent; tau, the time of the drag -(m/tau) v and -(I/tau)
    omega on every disk, which is the paper's damping. None: no drag.
    """

    cn: Annotated[NotNegative, DASHPOT] = 0.0
    ct: Annotated[NotNegative, DASHPOT] = 0.0
    tau: Annotated[Positive | None, TIME] = None

    @model_validator(mode="after")
    def _not_empty(self) -> "Damping":
        refuse(not self.model_fields_set, "", "has nothing in it: give cn, ct or tau, or leave the section out")
        return self


class Load(Section):
    """[load] on the upper layer: the force F_y on each of its disks, downwards."""

    fy: Annotated[Positive, FORCE]


class Relax(Section):
    """[relax] damped dynamics, v = F / damping, of the ramp's method "overdamped".

    damping, mass / time, sets the unit of the relaxation's time and leaves the equilibria as they are; the paper gives
    none. time_step is by default a third of the stable step of a disk whose contacts carry ten times F_y.
    """

    damping: Annotated[Positive, VISCOSITY] = 1.0
    time_step: Annotated[Positive | None, TIME] = None


class Ramp(Section):
    """[ramp] of the force F_x on each disk of the upper layer, from 0.

    Attributes
    ----------
    step : float
        Size of the increments of F_x; by default a 30,000th of F_y, the paper's 1e-4 of 3.
    until : float or tuple of float
        Last F_x; or turning points, to which F_x goes one after the other. `onset` seeks on the way to the first one.
    method : {"newton", "overdamped"}
        How each equilibrium is found. The paper's is overdamped dynamics.
    force_tolerance : float or None
        Largest net force, and torque over radius, on a disk of an equilibrium, the paper's f_min. None: what the
        rounding of the coordinates allows.
    """

    step: Annotated[Positive, FORCE]
    until: Annotated[Number | Annotated[tuple[Number, ...], LIST], rule("give a force, or a list of forces"), FORCE]
    method: Literal["newton", "overdamped"] = "newton"
    force_tolerance: Annotated[Positive | None, FORCE] = None

    @field_validator("until")
    @classmethod
    def _turning_points(cls, until: float | tuple[float, ...]) -> float | tuple[float, ...]:
        points = until if isinstance(until, tuple) else (until,)
        for here, there in pairwise((0.0, *points)):
            refuse(here == there, "", f"= {until!r} leaves F_x at {here:g}: give a force at which F_x turns round")
        return points if len(points) > 1 else points[0]

    @model_validator(mode="after")
    def _one_step_at_least(self) -> "Ramp":
        says = f"= {self.step} is larger than until = {self.first}: take a smaller step"
        refuse(self.step > abs(self.first), "step", says)
        count = self.length / self.step
        says = f"= {self.step:g} makes {count:.2g} equilibria up to until = {self.turning_points[-1]:g}"
        refuse(not count < EQUILIBRIA, "step", f"{says}, and {EQUILIBRIA:.0e} are the most: take a larger step")
        return self

    @property
    def turning_points(self) -> tuple[float, ...]:
        """Forces to which F_x goes, one after the other."""
        return self.until if isinstance(self.until, tuple) else (self.until,)

    @property
    def first(self) -> float:
        """The first of them."""
        return self.turning_points[0]

    @property
    def length(self) -> float:
        """Length of the whole path of F_x, force."""
        return sum(abs(there - here) for here, there in pairwise((0.0, *self.turning_points)))


class Friction(Section):
    """[friction] mu(v) = mu (B exp(-w (v - v_0)/v_ss) + mu_ss) for v > v_0, and mu below.

    Attributes
    ----------
    B, w, mu_ss : float
        Numbers of the law; mu(v) is continuous at v_0 if B + mu_ss = 1.
    v0 : float or "calibrated"
        Threshold of the mean velocity v of the upper layer. "calibrated": from an undamped run of the stable
        packing without forcing, as in the paper.
    v_ss : float or str
        Velocity over which mu falls, or a multiple of v_0 such as "10 v0". It has no default: the paper gives
        no value.
    """

    B: NotNegative = 0.2
    w: Positive = 0.4
    mu_ss: NotNegative = 0.8
    v0: Annotated[NotNegative | Literal["calibrated"], rule('give a velocity or "calibrated"'), VELOCITY] = "calibrated"
    v_ss: Annotated[Positive | str, rule('give a velocity above 0, or a multiple of v0 such as "10 v0"'), VELOCITY]

    @field_validator("v_ss")
    @classmethod
    def _multiple(cls, v_ss: float | str, info: ValidationInfo) -> float | str:
        if isinstance(v_ss, str):
            advice = 'give a velocity above 0, or a multiple of v0 such as "10 v0"'
            refuse(not multiple_of("v0", 1.0, v_ss), "", f"= {v_ss!r} is refused: {advice}")
            says = f'= "{v_ss}" is no velocity because v0 = 0: give a velocity above 0'
            refuse(info.data.get("v0") == 0, "", says)
        return v_ss

    def velocity_scale(self, v0: float) -> float:
        """v_ss for a threshold v0, velocity."""
        return multiple_of("v0", v0, self.v_ss) or 0.0 if isinstance(self.v_ss, str) else self.v_ss


class Output(Section):
    """[output] beside run.h5.

    trajectory: whether undamped runs store the positions at every sample; None: a film's worth of them, in a small
    packing. dumps: whether LAMMPS writes its own per-disk and per-contact dumps.
    """

    trajectory: bool | None = None
    dumps: bool = False
