"""The section [drive] of a scene: the spring that draws the upper layer, and a signal on the way."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, ValidationInfo, field_validator, model_validator

from ...analysis.files.signal_files import read_signal
from ...analysis.responses.signals import Signal, pulse
from .signal_keys import absolute_signal, check_signal
from .validation import (
    FORCE,
    FREQUENCY,
    SPRING,
    TIME,
    VELOCITY,
    NamesFile,
    NotNegative,
    Number,
    Positive,
    Section,
    refusal_sentence,
    rule,
)

LOADINGS = 2.0
"""Time for each slip of a run that ends after a number of slips, in units of the time in which the spring loads a layer
at rest to mu F_y: the run ends then, whether it has slipped or not."""

PROBE_SCALE = 1e-12
"""Scale of a signal that shows by how much any small disturbance moves the next slip: far above the rounding of forces,
and far below every force."""


class Drive(Section):
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

    spring: Annotated[Positive | Literal["rigid"], SPRING, rule('give a stiffness above 0, or "rigid"')]
    velocity: Annotated[Number | None, VELOCITY] = None
    protocol: Annotated[
        Annotated[
            tuple[Annotated[tuple[Number, Positive], Field(strict=False)], ...], Field(min_length=1, strict=False)
        ]
        | None,
        (VELOCITY, TIME),
        rule("give pairs of a velocity and a time above 0, as in [[1e-3, 100], [0, 50]]"),
    ] = None
    until: Annotated[Positive | None, TIME] = None
    slips: Annotated[int, Field(ge=1)] | None = None
    states: Annotated[Positive | None, TIME] = None
    signal: Annotated[str | None, NamesFile()] = None
    at: Annotated[NotNegative | None, TIME] = None
    omega: Annotated[Positive | None, FREQUENCY] = None
    scale: Annotated[Number, FORCE] = 1.0
    on: Literal["layer", "floor"] = "layer"

    @field_validator("signal")
    @classmethod
    def _absolute(cls, signal: str | None, info: ValidationInfo) -> str | None:
        return absolute_signal(signal, ("pulse",), info)

    @model_validator(mode="after")
    def _complete(self) -> Drive:
        wrong = self._wrong()
        if wrong:
            raise refusal_sentence(*wrong)
        check_signal(self.forcing)
        return self

    def _wrong(self) -> tuple[str, str] | None:
        """The first key that is missing or does not belong here, and the advice."""
        if (self.velocity is None) == (self.protocol is None):
            return "velocity", "or drive.protocol says how the far end of the spring moves: give one of the two"
        if self.fastest * (1.0 if self.spring == "rigid" else self.spring) == 0:
            return "protocol" if self.protocol else "velocity", "moves nothing: give a velocity other than 0"
        if self.until is None and self.slips is None and self.protocol is None:
            return "until", "is missing: give the length of the run, or drive.slips, after which it ends"
        if self.until is None and self.protocol is None and self.spring == "rigid":
            return "until", "is missing: a rigid drive counts no slips, and needs the length of the run"
        if self.spring == "rigid" and self.slips is not None:
            return "slips", "needs a spring: a rigid drive moves the layer at its velocity, and counts no slips"
        if self.signal is None:
            for key in ("at", "omega"):
                if getattr(self, key) is not None:
                    return key, 'stands without signal: give signal = "pulse" or a file'
        elif self.at is None:
            return "at", "is missing: give the time at which the signal begins"
        elif (self.signal == "pulse") != (self.omega is not None):
            return "omega", 'is the frequency of signal = "pulse": give both or neither'
        return None

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

    def without_signal(self) -> Drive:
        """The same drive without its signal."""
        return self.model_copy(update={"signal": None, "at": None, "omega": None, "scale": 1.0, "on": "layer"})

    def with_noise(self, number: int = 1) -> Drive:
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
