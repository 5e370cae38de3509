"""Remote triggering: what is computed, drawn and said of it. See `compute` for the physics."""
