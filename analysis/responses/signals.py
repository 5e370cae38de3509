r"""Time signals that force the upper layer, or move the floor.

A signal is a table of (time, value) with linear interpolation; before the first row and after the last it is zero. A
pulse is Ricker's wavelet, the second derivative of a Gaussian (N. Ricker, Geophysics 18, 10, 1953), whose spectrum
peaks at omega,

.. math:: s(t) = (1 - 2 x^2) e^{-x^2}, \qquad x = \tfrac12 \omega (t - t_0) .

**Motion of the floor.** In the frame of a rigid floor with the acceleration a(t), the floor is at rest and a force
:math:`-m a(t)` acts on every disk, exactly. Seismometers record velocities; `derivative` computes accelerations
from velocities, by central differences at the samples.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Floats, set_frozen
from ..errors import BadInputError

ONSET_OF_PULSE = 10.0
"""omega t_0 of a pulse: x = 5 at t = 0, where the pulse is 1e-9 of its peak."""

ROWS_A_PERIOD = 256
"""Rows a period of pulses: straight lines between them are off by (2 pi/256)^2/8 = 8e-5 of the amplitude."""


class SignalError(BadInputError):
    """A signal that cannot be used: one sentence that says what is wrong, where, and what to do."""


@dataclass(frozen=True, eq=False)
class Signal:
    """A table of values over time.

    Parameters
    ----------
    time : array_like, shape (T,)
        Increasing times; at least two.
    value : array_like, shape (T,)
        Values: a force, or a displacement, velocity or acceleration of the floor.

    Raises
    ------
    SignalError
        If there are fewer than two rows, a number is not finite, or the times do not increase.
    """

    time: Floats
    value: Floats

    def __post_init__(self) -> None:
        set_frozen(self, time=np.array(self.time, dtype=np.float64), value=np.array(self.value, dtype=np.float64))
        if self.time.ndim != 1 or self.time.shape != self.value.shape or len(self.time) < 2:
            shapes = f"{self.time.shape} and {self.value.shape}"
            raise SignalError(f"a signal has two columns of one length with two rows or more, not the shapes {shapes}")
        for name, column in (("time", self.time), ("value", self.value)):
            for row in np.flatnonzero(~np.isfinite(column))[:1]:
                what = f"row {row + 1} of the signal has the {name} {column[row]}"
                raise SignalError(f"{what}: give finite numbers, and fill gaps or cut them off")
        for row in np.flatnonzero(np.diff(self.time) <= 0)[:1]:
            late = f"the time {self.time[row + 1]:g} in row {row + 2} of the signal is not later than the "
            raise SignalError(f"{late}{self.time[row]:g} before it: sort the rows by time, and leave out double ones")

    def __len__(self) -> int:
        return len(self.time)

    def __repr__(self) -> str:
        most = np.abs(self.value).max()
        return f"Signal({len(self)} rows from t = {self.time[0]:g} to {self.time[-1]:g}, |value| <= {most:g})"

    @property
    def shortest(self) -> float:
        """The least time between two rows."""
        return float(np.diff(self.time).min())

    def at(self, time: ArrayLike) -> Floats:
        """Values at any times, of the shape of `time`."""
        return np.interp(np.asarray(time, dtype=np.float64), self.time, self.value, left=0.0, right=0.0)

    def scale_by(self, scale: float = 1.0, stretch: float = 1.0) -> Signal:
        """The signal with its values times `scale` and its times times `stretch`."""
        return Signal(stretch * self.time, scale * self.value)

    def derivative(self) -> Signal:
        """Its time derivative, by central differences at the rows."""
        return Signal(self.time, np.gradient(self.value, self.time))


def pulse(omega: float) -> Signal:
    """Ricker's wavelet of height 1 whose spectrum peaks at omega, 1 / time; it begins at t = 0."""
    time = np.linspace(0.0, 2 * ONSET_OF_PULSE / omega, int(2 * ONSET_OF_PULSE / (2 * np.pi) * ROWS_A_PERIOD))
    squared = (0.5 * (omega * time - ONSET_OF_PULSE)) ** 2
    return Signal(time, (1 - 2 * squared) * np.exp(-squared))
