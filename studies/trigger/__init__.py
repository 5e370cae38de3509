"""Which waves trigger how critical a layer: see `compute` for the physics, `study` for what is left in a folder."""

from .study import trigger_map

__all__ = ["trigger_map"]
