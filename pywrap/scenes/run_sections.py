"""The sections [perturb] and [drive] of a scene: undamped and driven runs, and the signals in them."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, ClassVar, Literal, TypeAlias

from pydantic import Field, ValidationInfo, field_validator, model_validator

from ...analysis.files.signal_files import read_signal
from ...analysis.responses.signals import Signal, SignalError, pulse
from .validation import (
    FORCE,
    FREQUENCY,
    LIST,
    SPRING,
    TIME,
    VELOCITY,
    WAVE,
    NamesFile,
    NotNegative,
    Number,
    Positive,
    Section,
    refusal_sentence,
    refuse,
    rule,
)


class Inertia(Section):
    """The key of [perturb] that spectra and onsets read, too.

    I_0 in I = I_0 m R^2 is 1 in the paper, and 1/2 for a uniform disk.
    """

    inertia_factor: Positive = 1.0


class WithSignal(Section):
    """A section with a signal, "pulse" or a file; `TAKES` has the keys of each kind, with "!" those that it needs."""

    TAKES: ClassVar[Mapping[str | None, str]] = {}

    signal: Annotated[str | None, NamesFile()] = None

    @field_validator("signal")
    @classmethod
    def _absolute(cls, signal: str | None, info: ValidationInfo) -> str | None:
        if signal in (None, "pulse"):
            return signal
        return str(((info.context or {}).get("folder", Path()) / str(signal)).resolve())

    @model_validator(mode="after")
    def _complete(self) -> "WithSignal":
        kind = self.signal if self.signal in (None, "pulse") else "file"
        of = {None: "a section without signal", "pulse": 'signal = "pulse"', "file": "a signal from a file"}[kind]
        for key in dict.fromkeys(" ".join(self.TAKES.values()).replace("!", "").split()):
            value, default = getattr(self, key), type(self).model_fields[key].default
            absent = value is None or not (value or key == "at")
            refuse(f"{key}!" in self.TAKES[kind].split() and absent, key, f"is missing: {of} needs it, above 0")
            belongs = key in self.TAKES[kind].replace("!", "").split()
            refuse(not belongs and value != default, key, f"does not belong to {of}: leave it out")
        try:
            self.forcing()
        except SignalError as error:
            raise refusal_sentence("signal", f"is refused: {str(error).rstrip('.')}") from None
        return self

    def forcing(self) -> Signal | None:
        """The signal as LAMMPS takes it, the force on a disk or the acceleration of the floor."""
        raise NotImplementedError


class Perturb(WithSignal, Inertia):
    """[perturb] an undamped run from an equilibrium, and its forcing: a cos(omega t), a pulse, or a signal of a file.

    Attributes
    ----------
    fx : float or None
        F_x of the equilibrium. None: chosen by the onset (:func:`~faultgouge.pywrap.onset.load_at_onset`).
    time, time_step : float
        Length of the run, and step of velocity Verlet; None: from the largest eigenvalue of K.
    target : {"top", "all"} or tuple of int
        The forced disks: the upper layer, all, or those of the list, counted from 0. The paper does not say which.
    amplitude, omega : float
        Force on each forced disk along x, or largest velocity of the floor (0: no forcing; the paper's is 1e-12), and
        angular frequency; of a pulse that at which its spectrum peaks. The paper's is 0.01.
    signal : str or None
        "pulse", or a file: two columns (time, value), or a record that ObsPy reads. None: a cos(omega t).
    channel : str or None
        Which trace of a record with several: the end of its id, such as "EHZ".
    scale, stretch : float or None
        Factors of a file's values and of its times; None is 1.
    on : {"layer", "floor"} or None
        What the signal is: the force on each forced disk along x (None as well), or a motion of the floor along x.
    quantity : {"velocity", "acceleration", "displacement"} or None
        What of the floor's motion the signal gives; None is its velocity.
    """

    TAKES: ClassVar = {None: "amplitude omega", "pulse": "amplitude! omega! on quantity"}
    TAKES |= {"file": "on quantity channel scale stretch"}

    fx: Annotated[NotNegative | None, FORCE] = None
    time: Annotated[Positive, TIME]
    time_step: Annotated[Positive | None, TIME] = None
    target: Annotated[
        Literal["top", "all"] | Annotated[tuple[Annotated[int, Field(ge=0)], ...], LIST],
        rule('give "top", "all" or a list of disks, counted from 0'),
    ] = "top"
    on: Literal["layer", "floor"] | None = None
    amplitude: Annotated[NotNegative, WAVE] = 0.0
    omega: Annotated[NotNegative | None, FREQUENCY] = None
    channel: str | None = None
    scale: Number | None = None
    stretch: Positive | None = None
    quantity: Literal["velocity", "acceleration", "displacement"] | None = None

    @model_validator(mode="after")
    def _fits(self) -> "Perturb":
        refuse(self.quantity and self.on != "floor", "quantity", 'belongs to on = "floor", whose motion it is')
        refuse(self.amplitude > 0 and self.omega is None, "omega", "is missing: an amplitude needs its frequency")
        return self

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
            slower = f"raise perturb.stretch to {(self.stretch or 1) * dt / signal.shortest:.3g}"
            rows = f"perturb.signal has rows that are {signal.shortest:.3g} apart, and the time step is {dt:.3g}"
            raise SignalError(f"{rows}, too long to follow it: lower perturb.time_step, or {slower}")


LOADINGS = 2.0
"""Time for each slip of a run that ends after a number of slips, in units of the time in which the spring loads a layer
at rest to mu F_y: the run ends then, whether it has slipped or not."""

PROBE_SCALE = 1e-12
"""Scale of a signal that shows by how much any small disturbance moves the next slip: far above the rounding of forces,
and far below every force."""


Stage: TypeAlias = Annotated[tuple[Annotated[Number, VELOCITY], Annotated[Positive, TIME]], Field(strict=False)]


class Drive(WithSignal):
    """[drive] a spring whose far end moves along x draws the upper layer.

    Attributes
    ----------
    spring : float or "rigid"
        Stiffness for each disk of the upper layer, force / length. "rigid": the disks of the layer have the velocity of
        the far end along x, and are free along y and in rotation.
    velocity, protocol : float, or tuple of (float, float)
        Of the far end; or velocities one after the other, each with its time; 0 holds the far end. The last one goes
        on.
    until : float or None
        Length of the run; by default that of the protocol, or twice the time in which the spring loads the layer to
        mu F_y for each of `slips`, after which the run ends.
    states : float or None
        Time between two stored states; by default that in which the spring loads the layer by 0.016 mu F_y, or a rigid
        drive moves by 0.01 of the smallest diameter.
    signal, at, omega : str, float, float
        A force, or a motion of the floor, that comes on the way: "pulse", or a file as in [perturb]; when it begins;
        and at which angular frequency the spectrum of a pulse peaks.
    scale, on : float, {"layer", "floor"}
        Height of a pulse, or factor of the values of a file: of the force on each disk of the upper layer along x, or
        of the velocity of the floor.
    """

    TAKES: ClassVar = {None: "", "pulse": "at! omega! scale on", "file": "at! scale on"}

    spring: Annotated[Positive | Literal["rigid"], rule('give a stiffness above 0, or "rigid"'), SPRING]
    velocity: Annotated[Number | None, VELOCITY] = None
    protocol: Annotated[
        Annotated[tuple[Stage, ...], LIST] | None,
        rule("give pairs of a velocity and a time above 0, as in [[1e-3, 100], [0, 50]]"),
    ] = None
    until: Annotated[Positive | None, TIME] = None
    slips: Annotated[int, Field(ge=1)] | None = None
    states: Annotated[Positive | None, TIME] = None
    at: Annotated[NotNegative | None, TIME] = None
    omega: Annotated[Positive | None, FREQUENCY] = None
    on: Literal["layer", "floor"] = "layer"
    scale: Annotated[Number, WAVE] = 1.0

    @model_validator(mode="after")
    def _moves(self) -> "Drive":
        rigid, both = self.spring == "rigid", (self.velocity is None) == (self.protocol is None)
        refuse(both, "velocity", "or drive.protocol says how the far end of the spring moves: give one of the two")
        moves = "protocol" if self.protocol else "velocity"
        refuse(self.fastest == 0, moves, "moves nothing: give a velocity other than 0")
        no_end = f"is missing: give the length of the run{'' if rigid else ', or drive.slips, after which it ends'}"
        refuse(self.until is self.protocol is None and (rigid or self.slips is None), "until", no_end)
        refuse(rigid and self.slips is not None, "slips", "needs a spring: a rigid drive counts no slips")
        return self

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
