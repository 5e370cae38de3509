"""The keys of [perturb] that describe the forcing, and the signal that they define."""

from __future__ import annotations

from collections.abc import Callable, Collection
from pathlib import Path
from typing import Annotated, Literal

from pydantic import ValidationInfo, field_validator, model_validator

from ...analysis.files.signal_files import read_signal
from ...analysis.responses.signals import Signal, SignalError, pulse, sweep
from .validation import FORCE, FREQUENCY, TIME, NamesFile, NotNegative, Number, Positive, Section, refusal_sentence

KINDS = ("pulse", "sweep")
OF_FILES = ("channel", "scale", "stretch")
DERIVATIVES = {"displacement": 2, "velocity": 1, "acceleration": 0}


def absolute_signal(signal: str | None, kinds: Collection[str], info: ValidationInfo) -> str | None:
    """The key signal, whose path, if it is none of some kinds, counts from the folder of the scene's file."""
    if signal is None or signal in kinds:
        return signal
    folder: Path = (info.context or {}).get("folder", Path())
    return str((folder / signal).resolve())


def check_signal(forcing: Callable[[], object]) -> None:
    """Refuse a section whose signal cannot be made."""
    try:
        forcing()
    except SignalError as error:
        raise refusal_sentence("signal", f"is refused: {str(error).rstrip('.')}") from None


class SignalKeys(Section):
    """Of [perturb]: a force a cos(omega t), a pulse, a sweep of frequency, or a signal from a file.

    Attributes
    ----------
    time : float
        Length of the run, time.
    amplitude : float
        a, force on each forced disk along x, or, on the floor, largest velocity of the floor; 0 means no forcing. The
        paper's is 1e-12.
    omega : float or None
        Angular frequency of the forcing, 1 / time; of a pulse that at which its spectrum peaks, of a sweep the first
        one. The paper's is 0.01.
    omega_end : float or None
        The last frequency of a sweep, at the end of the run, 1 / time.
    signal : str or None
        "pulse", "sweep", or a file: two columns (time, value), or a record that ObsPy reads. In a scene, a relative
        path counts from the folder of the scene's file. None: a cos(omega t).
    channel : str or None
        Which trace of a record with several: the end of its id, such as "EHZ".
    scale, stretch : float or None
        Factors of a file's values and of its times; None is 1.
    on : {"layer", "floor"} or None
        What the signal is: the force on each forced disk along x (None as well), or a motion of the floor along x.
    quantity : {"velocity", "acceleration", "displacement"} or None
        What of the floor's motion the signal gives; None is its velocity.
    """

    time: Annotated[Positive, TIME]
    amplitude: Annotated[NotNegative, FORCE] = 0.0
    omega: Annotated[NotNegative | None, FREQUENCY] = None
    omega_end: Annotated[Positive | None, FREQUENCY] = None
    signal: Annotated[str | None, NamesFile()] = None
    channel: str | None = None
    scale: Number | None = None
    stretch: Positive | None = None
    on: Literal["layer", "floor"] | None = None
    quantity: Literal["velocity", "acceleration", "displacement"] | None = None

    @field_validator("signal")
    @classmethod
    def _absolute(cls, signal: str | None, info: ValidationInfo) -> str | None:
        return absolute_signal(signal, KINDS, info)

    @model_validator(mode="after")
    def _forcing(self) -> SignalKeys:
        wrong = self._unfit() or self._missing_key()
        if wrong:
            raise refusal_sentence(*wrong)
        check_signal(self.forcing)
        return self

    @property
    def _from_file(self) -> bool:
        return self.signal is not None and self.signal not in KINDS

    def _unfit(self) -> tuple[str, str] | None:
        """The first key that does not belong here, and the advice."""
        given = [key for key in ("amplitude", "omega", "omega_end", *OF_FILES, "on", "quantity") if getattr(self, key)]
        for key in given:
            if self._from_file and key in ("amplitude", "omega", "omega_end"):
                return key, "cannot stand beside a signal from a file: scale and stretch take its place"
            if not self._from_file and key in OF_FILES:
                return key, "belongs to a signal from a file: a forcing without one has amplitude and omega"
            if key == "omega_end" and self.signal != "sweep":
                return key, 'belongs to signal = "sweep": leave it out'
            if key == "quantity" and self.on != "floor":
                return key, 'belongs to on = "floor": the signal is the force on the layer otherwise'
            if key == "on" and self.signal is None:
                return key, 'stands without signal: give signal = "pulse", "sweep" or a file'
        return None

    def _missing_key(self) -> tuple[str, str] | None:
        """The first key that is missing, and the reason."""
        if self.amplitude > 0 and self.omega is None:
            return "omega", "is missing: an amplitude needs the frequency of its forcing"
        if self.signal in KINDS:
            for key in ("amplitude", "omega", *(["omega_end"] if self.signal == "sweep" else [])):
                if not getattr(self, key):
                    return key, f"is missing: a {self.signal} needs one above 0"
        return None

    @property
    def cosine(self) -> tuple[float, float]:
        """Amplitude and frequency of a forcing a cos(omega t); (0, 0) if there is none."""
        return (self.amplitude, self.omega or 0.0) if self.signal is None else (0.0, 0.0)

    def forcing(self) -> Signal | None:
        """The signal as LAMMPS takes it, the force on a disk or the acceleration of the floor; None for a cosine."""
        if self.signal is None:
            return None
        if self.signal in KINDS:
            assert self.omega is not None
            wave = pulse(self.omega) if self.signal == "pulse" else sweep(self.omega, self.omega_end or 0.0, self.time)
            signal = wave.scale_by(self.amplitude)
        else:
            signal = read_signal(self.signal, self.channel).scale_by(
                1.0 if self.scale is None else self.scale, self.stretch or 1.0
            )
        for _ in range(DERIVATIVES[self.quantity or "velocity"] if self.on == "floor" else 0):
            signal = signal.derivative()
        return signal

    def check_samples(self, dt: float) -> None:
        """Refuse a signal from a file that a run with the time step dt cannot follow.

        Raises SignalError if rows of the file are closer than the time step, or the whole signal is.
        """
        signal = self.forcing() if self._from_file else None
        if signal is not None and signal.shortest < dt:
            raise SignalError(
                f"perturb.signal has rows that are {signal.shortest:.3g} apart, and the time step is {dt:.3g}: a run "
                f"with too few samples would not follow it, so lower perturb.time_step or raise perturb.stretch to "
                f"{(self.stretch or 1) * dt / signal.shortest:.3g}"
            )
