"""Compute the sweeps of the study, round by round; each in a folder of its own."""

from __future__ import annotations

import json
import subprocess
from importlib.metadata import version
from pathlib import Path

from mpi4py import MPI

from ...analysis.files.wholefile import write_json
from ..hands import Progress, Say
from ..sweep.compute import LINES, run_sweep, stored
from .sets import SHARES, sets


def compute(
    output: Path,
    say: Say = print,
    progress: Progress = lambda rows, _: rows,
    share: float = 1.0,
    workers: int | None = 1,
) -> None:
    """Compute what is missing of all sweeps, with this share of the packings of each; the rest as of `run_sweep`."""
    for part in [*(each for each in SHARES if each < share), share]:
        for name, sweep in sets(part).items():
            say(f"{name}: {100 * part:.3g} % of the packings")
            run_sweep(sweep, output / name.replace(" ", "_"), say=say, progress=progress, workers=workers)
        if MPI.COMM_WORLD.rank == 0:
            record(output)


def record(output: Path) -> None:
    """made.json: with which version and at which commits the tables were made, and what they cost."""
    rows = [row for path in output.glob(f"*/{LINES}") for row in stored(path).values()]
    path = output / "made.json"
    before = json.loads(path.read_text()) if path.exists() else {}
    if len(rows) == before.get("rows"):
        return
    made = {
        "version": version("faultgouge"),
        "commits": list(dict.fromkeys([*before.get("commits", []), _commit()])),
        "rows": len(rows),
        "cpu_seconds": round(sum(row["cpu_seconds"] for row in rows)),
    }
    write_json(path, made)


def _commit() -> str:
    """The commit of the sources; "unknown" outside of a repository."""
    command = ["git", "-C", str(Path(__file__).resolve().parent), "describe", "--always", "--dirty"]
    try:
        return subprocess.run(command, capture_output=True, text=True, timeout=20, check=True).stdout.strip()
    except (OSError, subprocess.SubprocessError):
        return "unknown"
