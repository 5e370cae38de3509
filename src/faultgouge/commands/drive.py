"""The command drive: a spring draws the upper layer, which sticks and slips."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from ..analysis.table_display import table_of
from ..mpi_rank import is_root
from ..signal_guard import keeps
from .terminal import (
    Answer,
    Out,
    ScenePath,
    check_output,
    command,
    hold_lock,
    read_scene,
    say,
    say_remark,
    status,
    stored_files,
)

if TYPE_CHECKING:
    from faultgouge.analysis import Packing
    from faultgouge.pywrap import Scene

app = typer.Typer()

SLIP_COLUMNS = (
    "begins", "ends", "force_before", "force_after", "slip", "kinetic_energy", "frame_before", "frame_after",
)  # fmt: skip
"""Columns of the table of slips."""


@command(app, "faultgouge drive drive.toml -o drive.h5")
def drive(scene: ScenePath, output: Out = Path("drive.h5")) -> Answer | None:
    """Draw the upper layer with a spring whose far end moves: the layer sticks and slips.

    The packing settles at F_x = 0; then the spring of [drive] draws, with the dashpots
    of [damping]. The file contains the force on each disk of the layer, the displacement
    and the mean height of the layer and the kinetic energy over time, and states at
    intervals and at both ends of each slip, which spectrum and draw take by --frame.
    The slips are also written as a table beside the file, with the suffix .csv.
    """
    from faultgouge.analysis import OutputError
    from faultgouge.pywrap.scenes.validation import require_section

    wanted = read_scene(scene, "drive", "settle")
    table = output.with_suffix(".csv")
    if table == output:
        raise OutputError(f"{output} is the table of the slips: give the run another name, {output.stem}.h5")
    check_output(output, scene, *stored_files(wanted))
    hold_lock(output)
    check_output(table, scene, output, head=",".join(SLIP_COLUMNS))
    settings = require_section(wanted.drive, "drive")
    others = _others(output, wanted)
    for path, _ in others.values():
        check_output(path, scene, output)
    start = _run(output, wanted, "driving", others=dict(others.values()))
    for name, (path, scene_of_other) in others.items():
        _run(path, scene_of_other, f"driving {name}", start)
    if not is_root():
        return None
    result = _result(output, wanted) | _advances(output, {name: path for name, (path, _) in others.items()})
    _write_table(table, result["slips"])
    if result["strays"]:
        say(
            f"squeezed out of the bed, above the layer, where no force acts: disks "
            f"{', '.join(map(str, result['strays']))}; they were stopped there"
        )
    says = [_in_words(result, settings.spring == "rigid"), *([_advance_in_words(result)] if others else [])]
    files = ", ".join(map(str, [output, *(path for path, _ in others.values())]))
    return Answer(says, result, f"written to {files} and {table}")


def _run(
    output: Path, scene: Scene, what: str, start: Packing | None = None, others: dict[Path, Scene] | None = None
) -> Packing:
    """Run a drive to its end, from a packing or from the settled packing of the scene; returns the packing.

    The files of other scenes, which differ in the signal, begin where the signal does.
    """
    from faultgouge.pywrap import Equilibrium
    from faultgouge.pywrap.runs.drive import DriveRecord, check_drive, settle_for_drive

    with DriveRecord(output, scene, saved=keeps) as record:
        say_remark(record)
        if record.last is None:
            if start is None:
                with status("settling") as show:
                    start = settle_for_drive(scene, watch=lambda words: show(f"settling: {words}"))
                for warning in check_drive(scene, start):
                    say(f"warning: {warning}")
            record.append(Equilibrium.of(start))
        assert record.last is not None
        with status(what) as show:
            slips = record.slips
            for step in record.drive(others):
                slips += step.slip is not None
                sample = step.sample
                show(f"{what}: t = {sample.time:.4g}, F = {sample.force:.3g}, {slips} slip{'s' * (slips != 1)}")
        record.finish()
        return record.last.packing


def _others(output: Path, scene: Scene) -> dict[str, tuple[Path, Scene]]:
    """Of a drive with a signal: the runs without the signal, and with signals as small as noise."""
    settings = scene.drive
    assert settings is not None
    if settings.signal is None:
        return {}
    from faultgouge.pywrap.runs.drive import NOISES

    noises = {f"noise{number}": settings.with_noise(number) for number in range(1, NOISES + 1)}
    changed = {"without": settings.without_signal()} | noises
    return {
        name: (output.with_suffix(f".{name}{output.suffix}"), scene.model_copy(update={"drive": drive}))
        for name, drive in changed.items()
    }


def _advances(output: Path, others: dict[str, Path]) -> dict[str, Any]:
    """How much earlier the next slip is, with the signal and with noise; nothing without a signal."""
    from faultgouge.analysis import RunFile
    from faultgouge.pywrap.runs.drive import SERIES, advance_error, clock_advance

    if not others:
        return {}
    without = others["without"]
    noise = [clock_advance(path, without) for name, path in others.items() if name != "without"]
    with RunFile(output) as file:
        first, second = file.series(SERIES)["time"][:2]
    return {
        "clock_advance": clock_advance(output, without),
        "clock_advance_error": advance_error(noise, float(second - first)),
        "clock_advances_of_noise": noise,
    }


def _advance_in_words(result: dict[str, Any]) -> str:
    advance, error = result["clock_advance"], result["clock_advance_error"]
    if advance is None:
        return "clock advance: not known, since no slip follows the signal, with or without it; let the run be longer"
    side = "earlier" if advance >= 0 else "later"
    earlier = f"the next slip of comparable size is {abs(advance):.4g} {side} than without the signal"
    if error is None:
        return f"{earlier}; with noise none follows in the run"
    alone = ", which noise alone may do" if abs(advance) <= error else ""
    runs = len(result["clock_advances_of_noise"])
    return f"{earlier}, \u00b1 {error:.2g} (95 %, of {runs} runs with noise of 1e-12){alone}"


def _result(path: Path, scene: Scene) -> dict[str, Any]:
    """The content of a drive.h5 for JSON."""
    import numpy as np

    from faultgouge.analysis import RunFile
    from faultgouge.analysis.responses.slips import friction_of
    from faultgouge.pywrap.runs.drive import SERIES, all_slips_in, strays

    with RunFile(path) as file:
        (slips, under_way), series, times = all_slips_in(file), file.series(SERIES), file.observable("time")
        out = np.flatnonzero(strays(file.packing(-1), file.packing(0)))
    frames = [
        {
            "frame_before": int(np.searchsorted(times, slip.begins, side="right") - 1),
            "frame_after": int(np.searchsorted(times, slip.ends)),
        }
        for slip in slips
    ]
    return {
        "slips": [asdict(slip) | frame for slip, frame in zip(slips, frames, strict=True)],
        "under_way": None if under_way is None else asdict(under_way),
        "cycles": max(0, len(slips) - 1),
        "friction": asdict(friction_of(series["time"], series["force"], slips, scene.load.fy)),
        "time": float(series["time"][-1]),
        "states": len(times),
        "strays": out.tolist(),
    }


def _write_table(path: Path, slips: list[dict[str, Any]]) -> None:
    """The slips as rows of numbers with all digits."""
    from faultgouge.analysis.files.atomic_write import write_text

    head = ",".join(SLIP_COLUMNS)
    rows = [",".join(repr(slip[name]) for name in SLIP_COLUMNS) for slip in slips]
    write_text(path, "\n".join([head, *rows]) + "\n", head)


def _in_words(result: dict[str, Any], rigid: bool) -> str:
    friction, slips = result["friction"], result["slips"]
    mean = f"F/F_y is {friction['mean']:.3g} on average"
    under_way = _under_way(result["under_way"])
    if not slips:
        why = ", of a rigid drive, which counts no slips" if rigid else under_way or ": no slip"
        return f"t = {result['time']:.4g}{why}; {mean}, at most {friction['largest']:.3g}"
    headings = ("begins", "ends", "F before", "F after", "slip", "kinetic energy", "frame before", "frame after")
    rows = [[f"{slip[name]:.4g}" for name in SLIP_COLUMNS] for slip in slips]
    recurrence = ""
    if len(slips) > 1:
        recurrence = f", one in {(slips[-1]['begins'] - slips[0]['begins']) / (len(slips) - 1):.4g} units of time"
    return (
        f"{table_of(headings, rows)}\n{len(slips)} slip{'s' * (len(slips) > 1)} up to t = {result['time']:.4g}"
        f"{recurrence}; {mean} from the first slip on, {friction['before']:.3g} before slips, "
        f"{friction['after']:.3g} after them{under_way}"
    )


def _under_way(slip: dict[str, float] | None) -> str:
    """That a slip has not ended with the run."""
    if slip is None:
        return ""
    fell = f"F has fallen from {slip['force_before']:.4g} to {slip['force_after']:.4g}"
    return f": a slip that began at t = {slip['begins']:.4g} is under way, {fell}"
