"""One line of an explanation: a feature, whether the scene has it, and what it costs."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...pywrap.lammps.dynamics import Motion
from .costs import Cost

FEW = 5
"""Turns of what may take long."""


@dataclass(frozen=True)
class Part:
    """One line of the explanation.

    Attributes
    ----------
    name : str
        The feature.
    included : bool
        Whether the scene has it, as LAMMPS says.
    reason : str
        Why, in a clause.
    adds : tuple of str
        What it loads, or would load.
    cost : Cost or None
        Times without and with it; None where it cannot be measured here.
    same : str
        What both compute.
    identical : bool or None
        Whether that agrees to the bit; None where it cannot be measured here.
    """

    name: str
    included: bool
    reason: str
    adds: tuple[str, ...]
    cost: Cost | None
    same: str
    identical: bool | None

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return vars(self) | {"cost": self.cost.as_dict() if self.cost else None}


def same_motion(one: Motion, other: Motion) -> bool:
    """Whether positions and velocities are the same to the bit."""
    return all(np.array_equal(getattr(one, name), getattr(other, name)) for name in one._fields)
