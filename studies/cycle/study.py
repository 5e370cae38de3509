"""The eigenvalues of all states of a drive.h5: cycle.json, cycle.csv and a picture in a folder."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

from ...analysis import RunFile
from ...analysis.files.atomic_write import FORMAT_KEY, check_format, check_own, make_folder, write_json
from ...analysis.files.plain_file import read_plain, read_plain_text
from ...figures.style import report_failure, save
from ...pywrap import SceneError
from ...pywrap.runs.drive import SERIES, drive_of, slips_in
from ..executors import Progress, Say
from ..sweep.table import write_csv
from .compute import cycle_state
from .draw import draw_cycle_spectrum

NUMBERS = ("pairs", "undamped", "damped", "lowest", "alone")
CYCLE_COLUMNS = (
    "frame", "time", "force", "displacement", "slips", "rests", "residual", "at_bound",
    *(f"{name}_{branch}" for branch in ("sticking", "sliding") for name in NUMBERS),
)  # fmt: skip


def holds_drive(path: Path) -> bool:
    """Whether a file with the suffix of a run.h5 is a file of `drive`."""
    if path.suffix != ".h5":
        return False
    with RunFile(path) as file:
        if drive_of(file) is None:
            raise SceneError(
                f"{path} is not a file of `faultgouge drive`: give such a file for the eigenvalues along its cycles, "
                "or a scene for those along a ramp"
            )
        return True


def cycle(path: Path, output: Path, say: Say = print, progress: Progress = lambda rows, _: rows) -> dict[str, Any]:
    """Compute the eigenvalues of all states of a driven run, with the stiffness of its spring.

    Parameters
    ----------
    path : Path
        A drive.h5 that a spring has drawn.
    output : Path
        The folder: cycle.json and cycle.csv, which grow with each state, and the picture. States that cycle.json has of
        the same file are not computed again.
    say, progress
        As of :func:`~faultgouge.studies.sweep.run_sweep.run_sweep`.

    Returns
    -------
    dict
        What cycle.json holds.

    Raises
    ------
    SceneError
        If the layer of the run had no spring.
    """
    digest = hashlib.sha256(read_plain(path)).hexdigest()
    with RunFile(path) as file:
        settings = drive_of(file)
        assert settings is not None
        if settings.spring == "rigid":
            raise SceneError(f"{path} is of a rigid drive, whose layer has no spring and no slips: draw with a spring")
        make_folder(output, "cycle.json")
        check_own(output / "cycle.csv", ",".join(CYCLE_COLUMNS))
        spring, slips, times = float(settings.spring), slips_in(file), file.observable("time")
        series, displacement = file.series(SERIES), file.observable("displacement")
        states = _known(output / "cycle.json", digest)
        result = {"file": path.name, "sha256": digest, "spring": spring, "slips": [asdict(slip) for slip in slips]}
        result["states"] = states
        for frame in progress(range(len(states), len(file)), len(file) - len(states)):
            packing, time = file.packing(frame), float(times[frame])
            where = {"frame": frame, "time": time, "force": packing.fx, "displacement": float(displacement[frame])}
            slipping = any(slip.begins < time <= slip.ends for slip in slips)
            states.append(where | {"slips": slipping} | cycle_state(packing, spring))
            write_json(output / "cycle.json", result)
            write_csv(output / "cycle.csv", CYCLE_COLUMNS, states)
    with report_failure("the picture of the cycles", say):
        save(draw_cycle_spectrum(series, slips, states), output / "cycle")
    return result


def _known(path: Path, digest: str) -> list[dict[str, Any]]:
    """States that a cycle.json has of the same file; none of another one."""
    try:
        stored = json.loads(read_plain_text(path))
        check_format(stored.get(FORMAT_KEY), path)
        return list(stored["states"]) if stored["sha256"] == digest else []
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return []
