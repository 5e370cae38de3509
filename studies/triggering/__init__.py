"""Remote triggering: what is computed, drawn and said of it. See `compute` for the physics."""

from .compute import (
    ABOVE_NOISE,
    GROWTH_FACTOR,
    Sensitivity,
    Triggering,
    calibrated,
    column,
    equilibrium_at,
    jump,
    sensitivity,
    summary,
    trigger,
)

__all__ = [
    "ABOVE_NOISE",
    "GROWTH_FACTOR",
    "Sensitivity",
    "Triggering",
    "calibrated",
    "column",
    "equilibrium_at",
    "jump",
    "sensitivity",
    "summary",
    "trigger",
]
