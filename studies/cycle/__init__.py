"""The spectrum along the cycles of a layer that sticks and slips: `compute` has the physics, `study` writes files."""
