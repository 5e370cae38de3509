"""The deck of a small pile, of disks or of spheres, that users import."""

from pathlib import Path

DECK = (Path(__file__).parent / "pile.in").read_text()

FLAT = {"d": 2, "z": "p", "box": "0 4 -0.5 0.5", "a": "0.5 0", "b": "1.3 0", "plane": "yplane 0 NULL", "down": "0 -1 0"}

ROUND = {"d": 3, "z": "f", "box": "-2 2 0 4", "a": "0 0.5", "b": "0 1.3", "plane": "zplane 0 NULL", "down": "0 0 -1"}
