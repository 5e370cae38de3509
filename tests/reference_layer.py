"""The reference packing as a scene of the command line, and where the command lies."""

import json
import sys
from pathlib import Path

BIN = Path(sys.executable).parent


def on_ranks(ranks: int) -> list[str | Path]:
    """What comes before a program on several ranks; nothing on one.

    Each rank has a core of its own. Ranks give their core away while they wait, and of two on one core, beside another
    process, each waits a slice of time for each message: a run of a second then takes twenty.
    """
    return [BIN / "mpiexec", "-bind-to", "core", "-n", str(ranks)] if ranks > 1 else []


REFERENCE = Path(__file__).parent / "reference" / "packing7.json"


def parted(path):
    """A JSON file without its numbers, and these: logarithms and sums differ by the processor, by 4e-14 at the most."""
    numbers = []
    return json.loads(path.read_text(), parse_float=lambda number: numbers.append(float(number))), numbers


def toml(scene, prefix=""):
    """A scene as the text of a TOML file, each section with a prefix to its name."""
    return "".join(
        f"[{prefix}{name}]\n" + "".join(f"{key} = {json.dumps(value)}\n" for key, value in section.items())
        for name, section in scene.items()
    )


LAYER = f"""
[packing]
file = "{REFERENCE}"
[law]
kn = 2e5
[load]
fy = 3.0
"""
"""Under its load; sections follow."""

UNITS = """
[units]
grain_diameter = "100 um"
density = "2650 kg/m^3"
youngs_modulus = "95 GPa"
poisson_ratio = 0.08
restitution = 0.9
impact_velocity = "1 m/s"
"""
"""Of quartz spheres."""

SMALL = {
    "packing": {"disks": 30, "top": 5, "width": 6.0},
    "law": {"kn": 2e5},
    "load": {"fy": 3.0},
    "ramp": {"step": 5e-3, "until": 0.025},
}
"""A scene whose onset takes a second."""


def store(path, *packings, about=None, times=(), **scalars):
    """A run.h5 of packings, with attributes, and with times or other numbers of each; returns its path."""
    from faultgouge.analysis import RunFile

    with RunFile.create(path, packings[0], about or {}) as file:
        for k, packing in enumerate(packings):
            file.append(packing, **({"time": times[k]} if times else {}), **scalars)
        file.complete = True
    return path
