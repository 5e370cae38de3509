"""The size of eruptions and how they end: see `compute` for the physics, `study` for the files written."""

from .compute import growth_rate
from .study import eruptions

__all__ = ["eruptions", "growth_rate"]
