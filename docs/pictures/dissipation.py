"""The picture of docs/dissipation.md, from the tables in docs/dissipation.

python docs/pictures/dissipation.py
"""

from pathlib import Path
from typing import Any

from faultgouge.analysis.motion.power_law import fit_power_law
from faultgouge.figures.style import save_as
from faultgouge.studies.dissipation.draw import dissipation_figure
from faultgouge.studies.rows import read_rows

TABLES = Path(__file__).parents[1] / "dissipation"

KINDS = {
    (0.0, 0.0): "no dissipation",
    (0.0, 0.01): r"drag, $1/\tau = 0.01$",
    (0.0, 0.1): r"drag, $1/\tau = 0.1$",
    (1.0, 0.0): "dashpots, $C_N = 1$",
}


def table(name: str, by: str) -> list[dict[str, Any]]:
    """The records of a table, in the order of one of their numbers."""
    return sorted(read_rows(TABLES / f"{name}.jsonl"), key=lambda record: record[by])


if __name__ == "__main__":
    gains = table("gain", "distance")
    curves = {label: [each for each in gains if (each["cn"], each["drag"]) == kind] for kind, label in KINDS.items()}
    near = [each for each in curves["no dissipation"] if each["distance"] <= 1e-2]
    law = fit_power_law([each["distance"] for each in near], [each["gain"] for each in near])
    print("gain without dissipation:", law)
    onsets = (table(name, "strength") for name in ("cn", "drag"))
    save_as(dissipation_figure(*onsets, curves), Path(__file__).with_suffix(".png"))
