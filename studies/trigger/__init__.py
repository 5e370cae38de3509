"""The critical amplitude of waves that trigger a layer: `compute` has the physics, `study` writes the files."""

from .study import trigger_map

__all__ = ["trigger_map"]
