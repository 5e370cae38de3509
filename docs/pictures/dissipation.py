"""The picture of docs/dissipation.md, from the tables in docs/dissipation.

python docs/pictures/dissipation.py
"""

import json
from pathlib import Path
from typing import Any

import numpy as np

from faultgouge.analysis.motion.power_law import fit_power_law
from faultgouge.figures.dissipation import GainCurve, OnsetCurve, dissipation_figure
from faultgouge.figures.style import save_as

TABLES = Path(__file__).parents[1] / "dissipation"

KINDS = {
    (0.0, 0.0): "no dissipation",
    (0.0, 0.01): r"drag, $1/\tau = 0.01$",
    (0.0, 0.1): r"drag, $1/\tau = 0.1$",
    (1.0, 0.0): "dashpots, $C_N = 1$",
}


def table(name: str) -> list[dict[str, Any]]:
    """The records of a table."""
    return [json.loads(line) for line in (TABLES / f"{name}.jsonl").read_text().splitlines()]


def onsets(name: str) -> OnsetCurve:
    """A table of onsets over the strength."""
    rows = sorted(table(name), key=lambda row: row["strength"])
    strength, onset, predicted = (
        np.array([np.nan if row[key] is None else row[key] for row in rows])
        for key in ("strength", "onset", "predicted")
    )
    return OnsetCurve(strength, onset, predicted, rows[0]["undamped"])


def gains() -> list[GainCurve]:
    """The table of gains, a curve for each kind of dissipation."""
    rows, curves = sorted(table("gain"), key=lambda row: row["distance"]), []
    for kind, label in KINDS.items():
        chosen = [row for row in rows if (row["cn"], row["drag"]) == kind]
        values = np.array([np.nan if row["gain"] is None else row["gain"] for row in chosen])
        curves.append(GainCurve(label, np.array([row["distance"] for row in chosen]), values))
    return curves


if __name__ == "__main__":
    curves = gains()
    near = curves[0].distance <= 1e-2
    print("gain without dissipation:", fit_power_law(curves[0].distance[near], curves[0].gain[near]))
    save_as(dissipation_figure(onsets("cn"), onsets("drag"), curves), Path(__file__).with_suffix(".png"))
