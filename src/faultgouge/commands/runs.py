"""The commands init and examples, which write a scene; and settle, ramp, perturb and drive, which run it."""

from __future__ import annotations

import json
import re
from dataclasses import asdict
from math import ceil
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..analysis.counted import counted
from ..analysis.table_display import table_of
from ..signal_guard import is_root, keeps
from .terminal import LAYER, Out, Results, SceneFile, command, progress, report_fallback, say, status

if TYPE_CHECKING:
    from faultgouge.analysis import RunFile
    from faultgouge.analysis.responses.growth import GrowthOfRun
    from faultgouge.pywrap import Equilibrium, Record, Scene

SLIP_COLUMNS = [
    "begins", "ends", "force_before", "force_after", "slip", "kinetic_energy", "frame_before", "frame_after",
]  # fmt: skip
"""Columns of the table of slips."""


@command("faultgouge init -o scene.toml", writes="new", alone=True)
def init(
    output: Annotated[Path, typer.Option("-o", "--output", help="The scene to write.")] = Path("scene.toml"),
) -> Results:
    """Write a scene with every section and key, commented."""
    from importlib.resources import files

    from faultgouge.analysis.files.atomic_write import write_text

    write_text(output, (files("faultgouge") / "scenes" / "commented.toml").read_text())
    yield f"written to {output}; next: faultgouge onset {output}"


@command("faultgouge examples pour", alone=True)
def examples(
    name: Annotated[str | None, typer.Argument(help="Which one is copied into this folder.")] = None,
) -> Results:
    """List ten examples that run in seconds each, or copy one into this folder."""
    from importlib.resources import files

    scenes = files("faultgouge") / "scenes"
    shelf = {Path(each.name).stem: each for each in (scenes / "examples").iterdir() if each.is_file()}
    if name is None:
        for key, each in sorted(shelf.items()):
            shows, runs = (line.strip('# "') for line in each.read_text().splitlines()[:2])
            yield f"{key:9} {shows}\n{'':9} {runs}"
        yield "\nfaultgouge examples NAME copies one into this folder."
        return
    # scenes of studies that take minutes are copied, too, with the packing that they name, but not listed
    name = name.rsplit(".", 1)[0]
    if not (chosen := shelf.get(name, scenes / f"{name}.toml")).is_file():
        raise typer.BadParameter(f"there is no example {name}: take one of {', '.join(sorted(shelf))}")
    text = chosen.read_text()
    for each in [chosen, *(scenes / named for named in re.findall(r'^file = "(.+)"', text, re.MULTILINE))]:
        if Path(each.name).exists():
            raise typer.BadParameter(f"{each.name} exists in this folder: move it away, or use another folder")
        Path(each.name).write_bytes(each.read_bytes())
    yield "{}: {}\nnext: {}".format(chosen.name, *(line.strip('# "') for line in text.splitlines()[:2]))


@command(f"{LAYER} && faultgouge settle scene.toml", reads="settle", writes="run")
def settle(scene: SceneFile, output: Out = Path("run.h5")) -> Results:
    """Settle the packing of a scene under its load, at F_x = 0."""
    from faultgouge.pywrap import Record

    with Record(output, scene, saved=keeps) as record:
        last = _settle_or_read(scene, record)
        if last.fx == 0 and not record.complete:  # a ramp has not gone beyond
            record.finish()
    yield f"{last}; written to {output}"


def _settle_or_read(scene: Scene, record: Record) -> Equilibrium:
    """The last equilibrium of a file; in a new one the settled packing, which is then in it."""
    from faultgouge.pywrap import settle

    if record.last is None:
        with status("settling") as show:
            record.append(settle(scene, watch=lambda what: show(f"settling: {what}")))
        assert record.last is not None
    return record.last


@command(f"{LAYER} && mpiexec -n 2 faultgouge ramp scene.toml", reads="ramp", writes="run", as_json=True)
def ramp(scene: SceneFile, output: Out = Path("run.h5")) -> Results:
    """Raise F_x from equilibrium to equilibrium, and store each equilibrium.

    With turning points in ramp.until, F_x goes up, down and below zero. When F_x
    returns to an earlier value, the command prints the remaining displacement of
    the layer and the work of the loads.
    """
    from faultgouge.analysis import RunFile
    from faultgouge.analysis.responses.hysteresis import hysteresis
    from faultgouge.pywrap import Record
    from faultgouge.pywrap import ramp as ramp_up
    from faultgouge.pywrap.runs.ramp_loads import all_loads, count_behind
    from faultgouge.pywrap.runs.run_recorder import fallbacks

    assert scene.ramp is not None
    loads = all_loads(scene.ramp)
    with Record(output, scene, saved=keeps) as record:
        start = _settle_or_read(scene, record)
        done = count_behind(scene.ramp, record.forces)
        dumps = output.with_suffix("") if scene.output is not None and scene.output.dumps else None
        for equilibrium in progress(ramp_up(scene, start, dumps=dumps, behind=done), "equilibria", len(loads), done):
            report_fallback(equilibrium)
            record.append(equilibrium)
        record.finish()
    if not is_root():
        return
    with RunFile(output) as file:
        columns = {name: file.observable(name).tolist() for name in ("fx", "residual", "floor", "evaluations")}
        numbers, turns = range(len(file)), len(scene.ramp.turning_points) > 1
        columns["contacts"] = [len(file.packing(k).contacts) for k in numbers]
        columns["way"] = [*map(fallbacks(file).get, numbers)]
        left = hysteresis([file.packing(k) for k in numbers]) if turns else None
    fx = columns["fx"][-1]
    if fx == loads[-1]:
        yield f"F_x = {fx:g} reached; residual force {columns['residual'][-1]:.2g}; written to {output}"
    else:
        beyond = f"from F_x = {loads[-1]:g}, where ramp.until ends, to F_x = {fx:g}"
        yield f"{output} goes on {beyond}: nothing is left to compute"
    if left is not None and left.closes:
        yield f"F_x is back at {left.fx:g}, and so is the upper layer: the path closes, to rounding"
    elif left is not None:
        moved = f"the upper layer has moved by {left.remaining:.4g}, and the work of the loads is {left.work:.4g}"
        yield f"F_x is back at {left.fx:g}: since F_x first had this value, {moved}"
    rows = [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]
    yield {"equilibria": rows, "hysteresis": None if left is None else asdict(left)}


@command(
    "faultgouge examples eruption && faultgouge perturb eruption.toml", reads="perturb", writes="run", as_json=True
)
def perturb(scene: SceneFile, output: Out = Path("perturb.h5")) -> Results:
    """Run the dynamics from the equilibrium at perturb.fx, and record D(t).

    Without perturb.fx the load is just beyond the onset, which is found first; with
    [friction] it is between the onsets of the weakened and of the static friction.
    The run may have a perturbation. The command prints whether D grew, the growth
    rate, the rate that the spectrum of the equilibrium predicts, and whether the run
    was long enough. With several friction coefficients, the run uses the first.
    """
    from faultgouge.analysis import RunFile
    from faultgouge.pywrap import Record, reach
    from faultgouge.pywrap.onset import load_at_onset
    from faultgouge.pywrap.runs.ramp import step_of
    from faultgouge.pywrap.runs.undamped import sample_steps, weakening_of, without_perturbation

    mus, settings = scene.law.mus, scene.perturb
    assert settings is not None
    if len(mus) > 1:
        say(f"the run uses mu = {mus[0]:g}, the first of the {len(mus)} friction coefficients of the scene")
    with Record(output, scene, task="perturb", saved=keeps) as record:
        if (start := record.last) is None:
            if (fx := settings.fx) is None:
                fx = load_at_onset(scene)
                say(f"the scene has no perturb.fx: the run starts at F_x = {fx:.10g}, chosen by the onset")
            for start in progress(reach(scene, fx), "equilibria", ceil(fx / step_of(scene) * (1 - 1e-9)) + 1):
                report_fallback(start)
            assert start is not None
            sample_steps(settings, start.packing)  # refuses what the packing does not allow, before anything is written
            record.append(start)
        lines, weakening = len(sample_steps(settings, start.packing)[1]), None
        if scene.friction is not None:
            threshold, why = scene.friction.v0, ""
            if isinstance(threshold, str):
                run = record.undamped(without_perturbation(scene), start, "calibration")
                threshold = max(abs(sample.layer_velocity) for sample in progress(run, "calibrating v0", lines))
                why = " (the largest velocity of the upper layer in an unforced run of this length: rounding noise)"
            weakening = weakening_of(scene.friction, float(threshold))
            say(f"v0 = {threshold:.3g}{why}, v_ss = {weakening.v_ss:.3g}")
        for _ in progress(record.undamped(scene, start, weakening=weakening), "samples", lines):
            pass
        record.finish()
    if not is_root():
        return
    with RunFile(output) as file:
        growth, fx = growth_in(file), file.packing().fx
        columns = {name: column.tolist() for name, column in file.series("undamped").items()}
    assert growth is not None
    moved = f"D = {columns['msd'][-1]:.3g} after t = {columns['time'][-1]:g}, at most {max(columns['msd']):.3g}"
    yield f"F_x = {fx:g}, mu = {mus[0]:g}: {moved}"
    yield growth.says
    yield {"mu": mus[0], "fx": fx} | growth.as_dict() | columns
    yield f"written to {output}"


def growth_in(file: RunFile) -> GrowthOfRun | None:
    """Growth of D in the undamped run of a perturb.h5, beside the spectrum's prediction at the time step of the run;
    None of another file, or where the run has not begun."""
    from faultgouge.analysis.responses.growth import growth_of_run
    from faultgouge.pywrap.runs.undamped import time_step

    if file.attributes.get("task") != "perturb" or "undamped" not in file.names_of_series:
        return None
    series, packing = file.series("undamped"), file.packing()
    if len(series["time"]) < 2:
        return None
    settings = json.loads(file.attributes.get("scene", "{}")).get("perturb") or {}
    dt = time_step(packing, settings.get("time_step"))
    return growth_of_run(packing, series["time"], series["msd"], series["friction"], dt)


@command("faultgouge examples drive && faultgouge drive drive.toml", reads="drive", writes="run", as_json=True)
def drive(scene: SceneFile, output: Out = Path("drive.h5")) -> Results:
    """Draw the upper layer with a spring whose far end moves: the layer sticks and slips.

    The packing settles at F_x = 0; then the spring of [drive] draws, with the dashpots
    of [damping]. The file contains the force on each disk of the layer, the displacement
    and the mean height of the layer and the kinetic energy over time, and states at
    intervals and at both ends of each slip, which spectrum and draw take by --frame.
    The slips are also written as a table beside the file, with the suffix .csv.
    """
    from faultgouge.analysis import OutputError
    from faultgouge.analysis.files.atomic_write import check_output
    from faultgouge.pywrap import Equilibrium, Record
    from faultgouge.pywrap.runs.drive import NOISES, check_drive, settle_for_drive

    settings, table, runs = scene.drive, output.with_suffix(".csv"), {output: scene}
    assert settings is not None
    if table == output:
        raise OutputError(f"{output} is the table of the slips: give the run another name, {output.stem}.h5")
    check_output(table, output, head=",".join(SLIP_COLUMNS))
    if settings.signal is not None:  # runs without the signal, and with signals as small as noise
        noises = {f"noise{number}": settings.with_noise(number) for number in range(1, NOISES + 1)}
        for name, changed in ({"without": settings.without_signal()} | noises).items():
            path = output.with_suffix(f".{name}{output.suffix}")
            check_output(path, output)
            runs[path] = scene.model_copy(update={"drive": changed})
    others, start = dict(list(runs.items())[1:]), None
    for path, each in runs.items():  # the first makes the files of the others where the signal begins
        with Record(path, each, task="drive", saved=keeps) as record:
            if record.last is None:
                if start is None:
                    with status("settling") as show:
                        start = settle_for_drive(scene, watch=lambda words: show(f"settling: {words}"))
                    for warning in check_drive(scene, start):
                        say(f"warning: {warning}")
                record.append(Equilibrium.of(start))
            assert record.last is not None
            slips, start = record.slips, record.last.packing
            what = "driving" if path == output else f"driving {path.name}"
            with status(what) as show:
                for step in record.drive(others if path == output else None):
                    slips += step.slip is not None
                    show(f"{what}: t = {step.sample.time:.4g}, F = {step.sample.force:.3g}, {counted(slips, 'slip')}")
            record.finish()
            start = record.last.packing
    if is_root():
        yield from _slips(scene, output, table, [*others])
        yield f"written to {', '.join(map(str, runs))} and {table}"


def _slips(scene: Scene, output: Path, table: Path, others: list[Path]) -> Results:
    """The slips of a drive as a table, their friction, and the advance of the next slip by a signal; as JSON, too."""
    import numpy as np

    from faultgouge.analysis import RunFile
    from faultgouge.analysis.responses.slips import friction_of
    from faultgouge.pywrap.runs.drive import SERIES, advance_error, clock_advance, slips_in, strays
    from faultgouge.studies.result_rows import write_csv

    assert scene.drive is not None
    with RunFile(output) as file:
        (slips, under_way), series, times = slips_in(file), file.series(SERIES), file.observable("time")
        out = np.flatnonzero(strays(file.packing(-1), file.packing(0))).tolist()
    before = (np.searchsorted(times, [slip.begins for slip in slips], side="right") - 1).tolist()
    after = np.searchsorted(times, [slip.ends for slip in slips]).tolist()
    frames = zip(slips, before, after, strict=True)
    rows = [asdict(slip) | {"frame_before": begin, "frame_after": end} for slip, begin, end in frames]
    write_csv(table, SLIP_COLUMNS, rows)
    friction = friction_of(series["time"], series["force"], slips, scene.load.fy)
    result = {"slips": rows, "under_way": None if under_way is None else asdict(under_way), "strays": out}
    result |= {"cycles": max(0, len(slips) - 1), "friction": asdict(friction), "states": len(times)}
    result["time"] = float(series["time"][-1])
    if out:
        squeezed = f"squeezed out of the bed, above the layer, where no force acts: disks {', '.join(map(str, out))}"
        say(f"{squeezed}; they were stopped there")
    time, mean, unended = f"t = {result['time']:.4g}", f"F/F_y is {friction.mean:.3g} on average", ""
    if under_way is not None:
        fallen = f"F has fallen from {under_way.force_before:.4g} to {under_way.force_after:.4g}"
        unended = f": a slip that began at t = {under_way.begins:.4g} is under way, {fallen}"
    if slips:
        headings = [key.replace("force", "F").replace("_", " ") for key in SLIP_COLUMNS]
        yield table_of(headings, [[f"{row[key]:.4g}" for key in SLIP_COLUMNS] for row in rows])
        apart = (slips[-1].begins - slips[0].begins) / max(1, len(slips) - 1)
        each = f", one in {apart:.4g} units of time" if slips[1:] else ""
        many = f"{counted(len(slips), 'slip')} up to {time}{each}"
        around = f"{friction.before:.3g} before slips, {friction.after:.3g} after them"
        yield f"{many}; {mean} from the first slip on, {around}{unended}"
    else:
        why = ", of a rigid drive, which counts no slips" if scene.drive.spring == "rigid" else unended or ": no slip"
        yield f"{time}{why}; {mean}, at most {friction.largest:.3g}"
    if others:
        without, *noisy = others
        noise, advance = [clock_advance(path, without) for path in noisy], clock_advance(output, without)
        error = advance_error(noise, float(series["time"][1] - series["time"][0]))
        result |= {"clock_advance": advance, "clock_advance_error": error, "clock_advances_of_noise": noise}
        said = "clock advance: not known, since no slip follows the signal, with or without it; let the run be longer"
        if advance is not None:
            side = "earlier" if advance >= 0 else "later"
            said = f"the next slip of comparable size is {abs(advance):.4g} {side} than without the signal"
            within = f", \u00b1 {error or 0.0:.2g} (95 %, of {len(noise)} runs with noise of 1e-12)"
            said += "; with noise none follows in the run" if error is None else within
            said += ", which noise alone may do" if error is not None and abs(advance) <= error else ""
        yield said
    yield result
