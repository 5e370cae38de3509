"""How large an eruption is and what ends it: see `compute` for the physics, `study` for what is left in a folder."""

from .study import eruptions

__all__ = ["eruptions"]
