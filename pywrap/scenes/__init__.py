"""A scene: what is wanted, in TOML, checked in full before any work is done; its real units, and what it will cost.

May import: `exchange`, which reads packings from files.
"""
