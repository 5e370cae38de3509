"""A scene: description of a computation in TOML, checked in full before any work starts; its real units and its cost.

May import: `exchange`, which reads packings from files.
"""
