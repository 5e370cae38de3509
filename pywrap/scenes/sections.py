"""The sections of a scene beside [packing]: their keys, units and defaults.

Defaults are the values of the paper if it gives them; the docstrings say where it does not.
"""

import re
from collections.abc import Iterable, Iterator, Mapping
from itertools import pairwise
from pathlib import Path
from typing import Annotated, ClassVar, Literal, TypeAlias

from pydantic import Field, ValidationInfo, field_validator, model_validator

from ...analysis.files.signal_files import read_signal
from ...analysis.packing.law import EXPONENTS, LEAST_RESCALED, known_exponents
from ...analysis.responses.signals import Signal, SignalError, pulse
from .validation import (
    DASHPOT,
    FORCE,
    FREQUENCY,
    SPRING,
    STIFFNESS,
    TIME,
    VELOCITY,
    VISCOSITY,
    WAVE,
    NamesFile,
    NotNegative,
    Number,
    Positive,
    Section,
    is_number,
    refusal_sentence,
    rule,
)

NUMBER_PATTERN = r"\d+(?:\.\d*)?(?:[eE][-+]?\d+)?"
"""A number without a sign, in text."""

EQUILIBRIA = 10_000_000
"""Increments of a ramp: half a day and 150 GB for 100 disks."""


class Law(Section):
    """[law] of all contacts, floor included.

    Attributes
    ----------
    kn : float
        Normal stiffness, force / length^exponent.
    kt : float
        Tangential stiffness, force / length^exponent. A scene may also say "A/B kn", "A kn" or "kn". The
        default, "2/7 kn", is the paper's.
    mu : float or tuple of float
        Static friction coefficient; 0 means no tangential force at all. Of a list, `onset` and
        `reproduce` take every one and all else the first.
    exponent : float
        p of the repulsion kn overlap^p: 1.5 (Hertz, the paper's) or 1 (harmonic disks).
    history : {"total", "rescaled", "coulomb"}
        What contacts remember: the whole slip, as in the paper, or the slip rescaled while overlaps grow, which creates
        no energy, or the force of a spring behind Coulomb's slider: the law of Cundall and Strack, without the paper's
        smoothing, which creates no energy either (:mod:`~faultgouge.analysis.packing.law`).
    """

    kn: Annotated[Positive, STIFFNESS]
    # the default is of the form that a scene gives, and becomes a number in the validator
    kt: Annotated[NotNegative, STIFFNESS] = Field("2/7 kn")  # type: ignore[assignment]
    mu: Annotated[
        NotNegative | Annotated[tuple[NotNegative, ...], Field(min_length=1, strict=False)],
        rule("give a number of at least 0, or a list of such numbers"),
    ] = 1.0
    exponent: float = 1.5
    history: Literal["total", "rescaled", "coulomb"] = "total"

    @field_validator("kt", mode="before")
    @classmethod
    def _share_of_kn(cls, kt: object, info: ValidationInfo) -> object:
        if not isinstance(kt, str) or "kn" not in kt:
            return kt
        if "kn" not in info.data:
            return 0.0  # kn is missing or refused, and that is what gets reported
        match = re.fullmatch(rf"(?:({NUMBER_PATTERN})(?:/({NUMBER_PATTERN}))? )?kn", kt.strip())
        numerator, denominator = (float(number or 1) for number in match.groups()) if match else (0.0, 0.0)
        if denominator == 0:
            raise refusal_sentence("", f'= "{kt}" is no share of kn: give a number, or a share such as "2/7 kn"')
        return numerator * info.data["kn"] / denominator

    @field_validator("exponent")
    @classmethod
    def _known_exponent(cls, exponent: float) -> float:
        if exponent not in EXPONENTS:
            raise refusal_sentence("", f"= {exponent:g} is refused: give {known_exponents()}")
        return exponent

    @model_validator(mode="after")
    def _something_to_rescale(self) -> "Law":
        if self.history == "rescaled" and self.exponent < LEAST_RESCALED:
            raise refusal_sentence("history", f'= "rescaled" needs a law.exponent of {LEAST_RESCALED} or more')
        return self

    @property
    def mus(self) -> tuple[float, ...]:
        """Every friction coefficient that the scene asks for, in its order."""
        return self.mu if isinstance(self.mu, tuple) else (self.mu,)

    @property
    def in_words(self) -> str:
        """The law of friction, as pages name it."""
        return {
            "total": "the paper's smoothed law",
            "rescaled": "the smoothed law with rescaled slips",
            "coulomb": "the standard law",
        }[self.history]


class Damping(Section):
    """[damping] of dynamics; none in a scene without this section. Equilibria do not depend on it.

    Attributes
    ----------
    cn, ct : float
        Dashpots at the contacts, normal and tangential, force time / length^exponent.
    tau : float or None
        Time of the drag -(m/tau) v and -(I/tau) omega on every disk, the paper's damping. None: no drag.
    """

    cn: Annotated[NotNegative, DASHPOT] = 0.0
    ct: Annotated[NotNegative, DASHPOT] = 0.0
    tau: Annotated[Positive | None, TIME] = None

    @model_validator(mode="after")
    def _not_empty(self) -> "Damping":
        if not self.model_fields_set:
            raise refusal_sentence("", "has nothing in it: give cn, ct or tau, or leave the section out")
        return self


class Load(Section):
    """[load] on the upper layer.

    Attributes
    ----------
    fy : float
        Force F_y on each disk of the upper layer, downwards.
    """

    fy: Annotated[Positive, FORCE]


class Relax(Section):
    """[relax] damped dynamics, v = F / damping, of the ramp's method "overdamped".

    Attributes
    ----------
    damping : float
        Friction against the medium, mass / time. It sets the unit of the relaxation's time and leaves the
        equilibria as they are; the paper gives none.
    time_step : float or None
        Step, time. None: a third of the stable step of a disk whose contacts carry ten times F_y.
    """

    damping: Annotated[Positive, VISCOSITY] = 1.0
    time_step: Annotated[Positive | None, TIME] = None


class Ramp(Section):
    """[ramp] of the force F_x on each disk of the upper layer, from 0.

    Attributes
    ----------
    step : float
        Size of the increments of F_x. A scene may leave it out: a 30,000th of F_y, the paper's 1e-4 of 3.
    until : float or tuple of float
        Last F_x; or turning points, to which F_x goes one after the other, up, down and below zero. `onset` seeks on
        the way to the first one.
    method : {"newton", "overdamped"}
        How each equilibrium is found. The paper's is overdamped dynamics.
    force_tolerance : float or None
        Largest net force, and torque over radius, on a disk of an equilibrium, the paper's f_min; a force in
        the scene's units. None: what the rounding of the coordinates allows.
    """

    step: Annotated[Positive, FORCE]
    until: Annotated[
        Number | Annotated[tuple[Number, ...], Field(min_length=1, strict=False)],
        rule("give a force, or a list of forces between which F_x goes"),
        FORCE,
    ]
    method: Literal["newton", "overdamped"] = "newton"
    force_tolerance: Annotated[Positive | None, FORCE] = None

    @field_validator("until")
    @classmethod
    def _turning_points(cls, until: float | tuple[float, ...]) -> float | tuple[float, ...]:
        points = until if isinstance(until, tuple) else (until,)
        for here, there in pairwise((0.0, *points)):
            if here == there:
                raise refusal_sentence("", f"= {until!r} leaves F_x at {here:g}: give a force at which F_x turns round")
        return points if len(points) > 1 else points[0]

    @model_validator(mode="after")
    def _one_step_at_least(self) -> "Ramp":
        if self.step > abs(self.first):
            raise refusal_sentence("step", f"= {self.step} is larger than until = {self.first}: take a smaller step")
        count = self.length / self.step
        if not count < EQUILIBRIA:
            says = f"= {self.step:g} makes {count:.2g} equilibria up to until = {self.turning_points[-1]:g}"
            raise refusal_sentence("step", f"{says}, and {EQUILIBRIA:.0e} are the most: take a larger step")
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


class Inertia(Section):
    """The key of [perturb] that spectra and onsets read, too.

    Attributes
    ----------
    inertia_factor : float
        I_0 in I = I_0 m R^2: 1 in the paper, 1/2 for a uniform disk. `Scene.inertia_factor` hands it to
        spectra and onsets as well.
    """

    inertia_factor: Positive = 1.0


def refuse_first(cases: Iterable[tuple[str, object, str]]) -> None:
    """Refuse the first key of (key, whether it is wrong, advice) that is wrong."""
    for key, wrong, advice in cases:
        if wrong:
            raise refusal_sentence(key, advice)


SignalKeys: TypeAlias = Mapping[str, tuple[tuple[str, ...], tuple[str, ...]]]


class WithSignal(Section):
    """A section with a signal, "pulse" or a file: of each kind the keys that it needs, and those that it takes."""

    TAKES: ClassVar[SignalKeys] = {}

    @field_validator("signal", check_fields=False)
    @classmethod
    def _absolute(cls, signal: str | None, info: ValidationInfo) -> str | None:
        if signal in (None, "pulse"):
            return signal
        return str(((info.context or {}).get("folder", Path()) / str(signal)).resolve())

    @model_validator(mode="after")
    def _complete(self) -> "WithSignal":
        signal = getattr(self, "signal", None)
        kind = signal if signal in (None, "pulse") else "file"
        of = {None: "a section without signal", "pulse": 'signal = "pulse"', "file": "a signal from a file"}[kind]
        needs, takes = self.TAKES[kind or ""]
        for key in dict.fromkeys(key for keys in self.TAKES.values() for each in keys for key in each):
            value = getattr(self, key)
            if key in needs and (value is None or not (value or key == "at")):
                raise refusal_sentence(key, f"is missing: {of} needs it, above 0")
            if key not in (*needs, *takes) and value != type(self).model_fields[key].default:
                raise refusal_sentence(key, f"does not belong to {of}: leave it out")
        refuse_first(self._cases())
        try:
            self.forcing()
        except SignalError as error:
            raise refusal_sentence("signal", f"is refused: {str(error).rstrip('.')}") from None
        return self

    def _cases(self) -> Iterator[tuple[str, object, str]]:
        """Keys that are missing or do not fit, for `refuse_first`."""
        raise NotImplementedError

    def forcing(self) -> Signal | None:
        """The signal as LAMMPS takes it, the force on a disk or the acceleration of the floor."""
        raise NotImplementedError


class Perturb(WithSignal, Inertia):
    """[perturb] an undamped run from an equilibrium, and its forcing: a cos(omega t), a pulse, or a signal of a file.

    Its keys are that of `Inertia`, and these.

    Attributes
    ----------
    fx : float or None
        F_x of the equilibrium. None: chosen by the onset (:func:`~faultgouge.pywrap.onset.load_at_onset`).
    time : float
        Length of the run, time.
    time_step : float or None
        Step of velocity Verlet, time. None: from the largest eigenvalue of K.
    target : {"top", "all"} or tuple of int
        The forced disks: the upper layer, all, or those of the list, counted from 0. The paper does not say
        which.
    amplitude : float
        a, force on each forced disk along x, or, on the floor, largest velocity of the floor; 0 means no forcing. The
        paper's is 1e-12.
    omega : float or None
        Angular frequency of the forcing, 1 / time; of a pulse that at which its spectrum peaks. The paper's is 0.01.
    signal : str or None
        "pulse", or a file: two columns (time, value), or a record that ObsPy reads. In a scene, a relative path counts
        from the folder of the scene's file. None: a cos(omega t).
    channel : str or None
        Which trace of a record with several: the end of its id, such as "EHZ".
    scale, stretch : float or None
        Factors of a file's values and of its times; None is 1.
    on : {"layer", "floor"} or None
        What the signal is: the force on each forced disk along x (None as well), or a motion of the floor along x.
    quantity : {"velocity", "acceleration", "displacement"} or None
        What of the floor's motion the signal gives; None is its velocity.
    """

    TAKES: ClassVar[SignalKeys] = {
        "": ((), ("amplitude", "omega")),
        "pulse": (("amplitude", "omega"), ("on", "quantity")),
        "file": ((), ("on", "quantity", "channel", "scale", "stretch")),
    }

    fx: Annotated[NotNegative | None, FORCE] = None
    time: Annotated[Positive, TIME]
    time_step: Annotated[Positive | None, TIME] = None
    target: Annotated[
        Literal["top", "all"] | Annotated[tuple[Annotated[int, Field(ge=0)], ...], Field(min_length=1, strict=False)],
        rule('give "top", "all" or a list of disks, counted from 0'),
    ] = "top"
    on: Literal["layer", "floor"] | None = None
    amplitude: Annotated[NotNegative, WAVE] = 0.0
    omega: Annotated[NotNegative | None, FREQUENCY] = None
    signal: Annotated[str | None, NamesFile()] = None
    channel: str | None = None
    scale: Number | None = None
    stretch: Positive | None = None
    quantity: Literal["velocity", "acceleration", "displacement"] | None = None

    def _cases(self) -> Iterator[tuple[str, object, str]]:
        of_floor = 'belongs to on = "floor": the signal is the force on the layer otherwise'
        yield "quantity", self.quantity and self.on != "floor", of_floor
        forced = self.amplitude > 0 and self.omega is None
        yield "omega", forced, "is missing: an amplitude needs the frequency of its forcing"
        short = self.time_step is not None and self.time < self.time_step
        yield "time", short, f"= {self.time} is shorter than one step, {self.time_step}: run longer"

    @property
    def cosine(self) -> tuple[float, float]:
        """Amplitude and frequency of a forcing a cos(omega t); (0, 0) if there is none."""
        return (self.amplitude, self.omega or 0.0) if self.signal is None else (0.0, 0.0)

    def forcing(self) -> Signal | None:
        """The signal as LAMMPS takes it, the force on a disk or the acceleration of the floor; None for a cosine."""
        if self.signal is None:
            return None
        if self.signal == "pulse":
            signal = pulse(self.omega or 0.0).scale_by(self.amplitude)
        else:
            scale = 1.0 if self.scale is None else self.scale
            signal = read_signal(self.signal, self.channel).scale_by(scale, self.stretch or 1.0)
        derivatives = {"displacement": 2, "velocity": 1, "acceleration": 0}[self.quantity or "velocity"]
        for _ in range(derivatives if self.on == "floor" else 0):
            signal = signal.derivative()
        return signal

    def check_samples(self, dt: float) -> None:
        """Refuse a signal from a file that a run with the time step dt cannot follow.

        Raises SignalError if rows of the file are closer than the time step, or the whole signal is.
        """
        signal = None if self.signal == "pulse" else self.forcing()
        if signal is not None and signal.shortest < dt:
            raise SignalError(
                f"perturb.signal has rows that are {signal.shortest:.3g} apart, and the time step is {dt:.3g}: a run "
                f"with too few samples would not follow it, so lower perturb.time_step or raise perturb.stretch to "
                f"{(self.stretch or 1) * dt / signal.shortest:.3g}"
            )


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
    v0: Annotated[
        NotNegative | Literal["calibrated"], rule('give a velocity of at least 0, or "calibrated"'), VELOCITY
    ] = "calibrated"
    v_ss: Annotated[Positive | str, rule('give a velocity above 0, or a multiple of v0 such as "10 v0"'), VELOCITY]

    @field_validator("v_ss")
    @classmethod
    def _multiple(cls, v_ss: float | str, info: ValidationInfo) -> float | str:
        if isinstance(v_ss, str) and not _multiple_of_v0(v_ss):
            advice = 'give a velocity above 0, or a multiple of v0 such as "10 v0"'
            raise refusal_sentence("", f"= {v_ss!r} is refused: {advice}")
        if isinstance(v_ss, str) and info.data.get("v0") == 0:
            raise refusal_sentence("", f'= "{v_ss}" is no velocity because v0 = 0: give a velocity above 0')
        return v_ss

    def velocity_scale(self, v0: float) -> float:
        """v_ss for a threshold v0, velocity."""
        return _multiple_of_v0(self.v_ss) * v0 if isinstance(self.v_ss, str) else self.v_ss


class Output(Section):
    """[output] beside run.h5.

    Attributes
    ----------
    trajectory : bool or None
        Whether undamped runs store the positions at every sample; None: a film's worth of them, in a small packing.
    dumps : bool
        Whether LAMMPS writes its own per-disk and per-contact dumps.
    """

    trajectory: bool | None = None
    dumps: bool = False


def _multiple_of_v0(text: str) -> float:
    """10 for "10 v0"; 0 for any other text."""
    match = re.fullmatch(rf"(?:({NUMBER_PATTERN}) )?v0", text.strip())
    factor = float(match[1] or 1) if match else 0.0
    return factor if is_number(factor) else 0.0


LOADINGS = 2.0
"""Time for each slip of a run that ends after a number of slips, in units of the time in which the spring loads a layer
at rest to mu F_y: the run ends then, whether it has slipped or not."""

PROBE_SCALE = 1e-12
"""Scale of a signal that shows by how much any small disturbance moves the next slip: far above the rounding of forces,
and far below every force."""


Stage: TypeAlias = tuple[Annotated[Number, VELOCITY], Annotated[Positive, TIME]]


class Drive(WithSignal):
    """[drive] a spring whose far end moves along x draws the upper layer.

    Attributes
    ----------
    spring : float or "rigid"
        Stiffness for each disk of the upper layer, force / length. "rigid": the disks of the layer have the velocity of
        the far end along x, and are free along y and in rotation.
    velocity : float or None
        Of the far end, length / time.
    protocol : tuple of (float, float) or None
        In place of `velocity`: velocities one after the other, each with its time; 0 holds the far end. The last
        velocity goes on if the run is longer.
    until : float or None
        Length of the run, time; by default that of the protocol, or twice the time in which the spring loads the layer
        to mu F_y for each of `slips`.
    slips : int or None
        The run ends after so many slips. None: it goes on until `until`.
    states : float or None
        Time between two stored states; by default that in which the spring loads the layer by 0.016 mu F_y, or a rigid
        drive moves by 0.01 of the smallest diameter.
    signal : str or None
        A force, or a motion of the floor, that comes on the way: "pulse", or a file as in [perturb]. In a scene, a
        relative path counts from the folder of the scene's file.
    at : float or None
        When the signal begins, time.
    omega : float or None
        Angular frequency at which the spectrum of a pulse peaks, 1 / time.
    scale : float
        Height of a pulse, or factor of the values of a file.
    on : {"layer", "floor"}
        What the signal is: the force on each disk of the upper layer along x, or the velocity of the floor.
    """

    TAKES: ClassVar[SignalKeys] = {
        "": ((), ()),
        "pulse": (("at", "omega"), ("scale", "on")),
        "file": (("at",), ("scale", "on")),
    }

    spring: Annotated[Positive | Literal["rigid"], rule('give a stiffness above 0, or "rigid"'), SPRING]
    velocity: Annotated[Number | None, VELOCITY] = None
    protocol: Annotated[
        Annotated[tuple[Annotated[Stage, Field(strict=False)], ...], Field(min_length=1, strict=False)] | None,
        rule("give pairs of a velocity and a time above 0, as in [[1e-3, 100], [0, 50]]"),
    ] = None
    until: Annotated[Positive | None, TIME] = None
    slips: Annotated[int, Field(ge=1)] | None = None
    states: Annotated[Positive | None, TIME] = None
    signal: Annotated[str | None, NamesFile()] = None
    at: Annotated[NotNegative | None, TIME] = None
    omega: Annotated[Positive | None, FREQUENCY] = None
    on: Literal["layer", "floor"] = "layer"
    scale: Annotated[Number, WAVE] = 1.0

    def _cases(self) -> Iterator[tuple[str, object, str]]:
        rigid, endless = self.spring == "rigid", self.until is None and self.protocol is None
        both = (self.velocity is None) == (self.protocol is None)
        yield "velocity", both, "or drive.protocol says how the far end of the spring moves: give one of the two"
        moves = "protocol" if self.protocol else "velocity"
        yield moves, self.fastest == 0, "moves nothing: give a velocity other than 0"
        no_end = "is missing: give the length of the run, or drive.slips, after which it ends"
        yield "until", endless and self.slips is None, no_end
        no_slips = "is missing: a rigid drive counts no slips, and needs the length of the run"
        yield "until", endless and rigid, no_slips
        no_spring = "needs a spring: a rigid drive moves the layer at its velocity, and counts no slips"
        yield "slips", rigid and self.slips is not None, no_spring

    @property
    def stages(self) -> tuple[tuple[float, float], ...]:
        """Velocities of the far end and their times; one alone has no end."""
        return self.protocol or ((self.velocity or 0.0, float("inf")),)

    @property
    def fastest(self) -> float:
        """The largest velocity of the far end, taken positive."""
        return max(abs(velocity) for velocity, _ in self.stages)

    def length(self, strength: float) -> float:
        """Length of the run, time, where friction bears up to mu F_y = `strength` on each disk of the layer."""
        if self.until is not None:
            return self.until
        if self.protocol is not None:
            return sum(time for _, time in self.protocol)
        assert self.slips is not None
        assert self.spring != "rigid"
        return LOADINGS * self.slips * strength / (self.spring * self.fastest)

    def without_signal(self) -> "Drive":
        """The same drive without its signal."""
        return self.model_copy(update={"signal": None, "at": None, "omega": None, "scale": 1.0, "on": "layer"})

    def with_noise(self, number: int = 1) -> "Drive":
        """The same drive with its signal as small as noise; each number is another noise."""
        return self.model_copy(update={"scale": number * PROBE_SCALE})

    def forcing(self) -> Signal | None:
        """The signal as LAMMPS takes it, the force on a disk or the acceleration of the floor, by time of the run."""
        if self.signal is None:
            return None
        signal = pulse(self.omega or 0.0) if self.signal == "pulse" else read_signal(self.signal)
        signal = signal.scale_by(self.scale)
        if self.on == "floor":
            signal = signal.derivative()
        return Signal(signal.time - signal.time[0] + (self.at or 0.0), signal.value)
