"""The picture of docs/dissipation.md, from the tables.

python -m research.dissipation.picture
"""

from pathlib import Path
from typing import Any

from faultgouge.analysis import fit_power_law
from faultgouge.figures import save_as
from research.dissipation.draw import dissipation_figure
from research.tables import read_rows

TABLES = Path(__file__).parent / "tables"

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
    save_as(
        dissipation_figure(table("cn", "strength"), table("drag", "strength"), curves),
        Path(__file__).parents[2] / "docs" / "pictures" / "dissipation.png",
    )
