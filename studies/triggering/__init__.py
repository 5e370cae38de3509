"""Remote triggering: computation, figures and text. See `compute` for the physics."""
