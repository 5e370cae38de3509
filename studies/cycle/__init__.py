"""The spectrum along the cycles of a layer that sticks and slips: `compute` has the physics, `study` writes files."""

from .compute import cycle_state, with_spring

__all__ = ["cycle_state", "with_spring"]
