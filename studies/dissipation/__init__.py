"""What dissipation does to onset and transient gain: see `compute` for the physics; docs/dissipation has the tables."""
