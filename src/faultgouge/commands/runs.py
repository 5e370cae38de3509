"""The commands init, settle, ramp and perturb: a scene, its equilibria and its undamped run."""

from __future__ import annotations

from dataclasses import asdict
from math import ceil
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..mpi_rank import is_root
from ..signal_guard import keeps
from .terminal import (
    LAYER,
    Answer,
    Out,
    SceneFile,
    command,
    growth_in,
    lock_output,
    print_line,
    progress,
    report_fallback,
    say,
    say_remark,
    status,
)

if TYPE_CHECKING:
    from faultgouge.analysis import Packing
    from faultgouge.analysis.motion.hysteresis import Hysteresis
    from faultgouge.pywrap import Equilibrium, Record, Scene
    from faultgouge.pywrap.lammps.dynamics import Weakening
    from faultgouge.pywrap.scenes.sections import Ramp

app = typer.Typer()

MOST_LOOSE = 0.1
"""Share of the disks above the upper layer from which the command says so: of 20 seeds of 40 disks two have more."""


@app.command(epilog="Example: faultgouge init -o scene.toml")
def init(
    context: typer.Context,
    output: Annotated[Path, typer.Option("-o", "--output", help="The scene to write.")] = Path("scene.toml"),
) -> None:
    """Write a scene with every section and key, commented."""
    if output.exists():
        raise typer.BadParameter(f"{output} exists: give another name with -o, or delete it")
    from importlib.resources import files

    from faultgouge.analysis.files.atomic_write import write_text

    lock_output(context, output)
    if is_root():
        write_text(output, (files("faultgouge") / "scenes" / "commented.toml").read_text())
        print_line(f"written to {output}; next: faultgouge onset {output}")


@command(app, f"{LAYER} && faultgouge settle scene.toml", reads="settle", task="settle", records=True, as_json=False)
def settle(scene: SceneFile, output: Out = Path("run.h5")) -> Answer:
    """Settle the packing of a scene under its load, at F_x = 0."""
    from faultgouge.pywrap import Record

    with Record(output, scene, saved=keeps) as record:
        say_remark(record)
        last = _settle_or_read(scene, record)
        if last.fx == 0 and not record.complete:  # a ramp has not gone beyond
            record.finish()
    return Answer([f"{last}; written to {output}"])


@command(app, f"{LAYER} && mpiexec -n 2 faultgouge ramp scene.toml", reads="ramp", task="ramp", records=True)
def ramp(scene: SceneFile, output: Out = Path("run.h5")) -> Answer | None:
    """Raise F_x from equilibrium to equilibrium, and store each equilibrium.

    With turning points in ramp.until, F_x goes up, down and below zero. When F_x
    returns to an earlier value, the command prints the remaining displacement of
    the layer and the work of the loads.
    """
    from faultgouge.pywrap import Record
    from faultgouge.pywrap import ramp as ramp_up
    from faultgouge.pywrap.runs.ramp_loads import all_loads, count_behind
    from faultgouge.pywrap.scenes.validation import require_section

    settings = require_section(scene.ramp, "ramp")
    with Record(output, scene, saved=keeps) as record:
        say_remark(record)
        start = _settle_or_read(scene, record)
        loads = all_loads(settings)
        total, done = len(loads), count_behind(settings, record.forces)
        dumps = output.with_suffix("") if scene.output is not None and scene.output.dumps else None
        for equilibrium in progress(ramp_up(scene, start, dumps=dumps, behind=done), "equilibria", total, done):
            report_fallback(equilibrium)
            record.append(equilibrium)
        record.finish()
    assert record.last is not None
    if not is_root():
        return None
    left = _hysteresis(output, settings)
    result = {"equilibria": _equilibria(output), "hysteresis": None if left is None else asdict(left)}
    if record.last.fx != loads[-1]:
        beyond = f"{output} goes on from F_x = {loads[-1]:g}, where ramp.until ends, to F_x = {record.last.fx:g}"
        return Answer([f"{beyond}: nothing is left to compute"], result)
    says = [f"F_x = {record.last.fx:g} reached; residual force {record.last.residual:.2g}; written to {output}"]
    if left is not None:
        says.append(
            f"F_x is back at {left.fx:g}, and so is the upper layer: the path closes, to rounding"
            if left.closes
            else f"F_x is back at {left.fx:g}: since F_x first had this value, the upper layer has moved by "
            f"{left.remaining:.4g}, and the work of the loads is {left.work:.4g}"
        )
    return Answer(says, result)


@command(
    app,
    "faultgouge examples eruption && faultgouge perturb eruption.toml",
    reads="perturb",
    task="perturb",
    records=True,
)
def perturb(scene: SceneFile, output: Out = Path("perturb.h5")) -> Answer | None:
    """Run the dynamics from the equilibrium at perturb.fx, and record D(t).

    Without perturb.fx the load is just beyond the onset, which is found first; with
    [friction] it is between the onsets of the weakened and of the static friction.
    The run may have a perturbation. The command prints whether D grew, the growth
    rate, the rate that the spectrum of the equilibrium predicts, and whether the run
    was long enough. With several friction coefficients, the run uses the first.
    """
    from faultgouge.analysis import RunFile
    from faultgouge.pywrap import Record
    from faultgouge.pywrap.scenes.validation import require_section

    require_section(scene.perturb, "perturb")
    mus = scene.law.mus
    if len(mus) > 1:
        say(f"the run uses mu = {mus[0]:g}, the first of the {len(mus)} friction coefficients of the scene")
    with Record(output, scene, task="perturb", saved=keeps) as record:
        say_remark(record)
        if record.last is None:
            record.append(_start(scene))
        assert record.last is not None
        weakening = _weakening(scene, record)
        run = record.undamped(scene, record.last, weakening=weakening)
        largest = 0.0
        for sample in progress(run, "samples", _lines(scene, record.last)):
            last, largest = sample, max(largest, sample.msd)
        record.finish()
    if not is_root():
        return None
    with RunFile(output) as file:
        series, packing = file.series("undamped"), file.packing()
    growth, columns = growth_in(output, series), {name: column.tolist() for name, column in series.items()}
    reached = f"D = {last.msd:.3g} after t = {last.time:g}, at most {largest:.3g}"
    return Answer(
        [f"F_x = {packing.fx:g}, mu = {mus[0]:g}: {reached}", growth.says],
        {"mu": mus[0], "fx": packing.fx} | growth.as_dict() | columns,
        f"written to {output}",
    )


def _start(scene: Scene) -> Equilibrium:
    """The equilibrium at perturb.fx, or just beyond the onset."""
    from faultgouge.pywrap import reach
    from faultgouge.pywrap.onset import load_at_onset
    from faultgouge.pywrap.runs.ramp import step_of

    assert scene.perturb is not None
    fx = scene.perturb.fx
    if fx is None:
        fx = load_at_onset(scene)
        say(f"the scene has no perturb.fx: the run starts at F_x = {fx:.10g}, chosen by the onset")
    total = ceil(fx / step_of(scene) * (1 - 1e-9)) + 1
    for start in progress(reach(scene, fx), "equilibria", total):
        report_fallback(start)
    _lines(scene, start)  # refuses what the packing does not allow, before anything is written
    return start


def _lines(scene: Scene, start: Equilibrium) -> int:
    """Lines of the series of an undamped run; a time step or a time that the packing does not allow is refused."""
    from faultgouge.pywrap.runs.undamped import sample_steps

    assert scene.perturb is not None
    return len(sample_steps(scene.perturb, start.packing)[1])


def _weakening(scene: Scene, record: Record) -> Weakening | None:
    """The friction that falls with velocity, its threshold v_0 calibrated if the scene says so."""
    from faultgouge.pywrap.runs.undamped import weakening_of, without_perturbation

    if scene.friction is None:
        return None
    assert record.last is not None
    threshold, why = scene.friction.v0, ""
    if isinstance(threshold, str):
        run = record.undamped(without_perturbation(scene), record.last, "calibration")
        samples = progress(run, "calibrating v0", _lines(scene, record.last))
        threshold = float(max(abs(sample.layer_velocity) for sample in samples))
        why = " (the largest velocity of the upper layer in an unforced run of this length: rounding noise)"
    weakening = weakening_of(scene.friction, threshold)
    say(f"v0 = {threshold:.3g}{why}, v_ss = {weakening.v_ss:.3g}")
    return weakening


def _hysteresis(path: Path, settings: Ramp) -> Hysteresis | None:
    """Displacement and work that remain when F_x returns; None on a ramp without turning points."""
    from faultgouge.analysis import RunFile
    from faultgouge.analysis.motion.hysteresis import hysteresis

    if len(settings.turning_points) < 2:
        return None
    with RunFile(path) as file:
        return hysteresis([file.packing(k) for k in range(len(file))])


def _equilibria(path: Path) -> list[dict[str, Any]]:
    from faultgouge.analysis import RunFile
    from faultgouge.pywrap.runs.run_recorder import fallbacks

    with RunFile(path) as file:
        ways = fallbacks(file)
        names = ("fx", "residual", "floor", "evaluations")
        rows = zip(*(file.observable(name).tolist() for name in names), strict=True)
        return [
            dict(zip(names, row, strict=True)) | {"contacts": len(file.packing(k).contacts), "way": ways.get(k)}
            for k, row in enumerate(rows)
        ]


def _settle_or_read(scene: Scene, record: Record) -> Equilibrium:
    """The last equilibrium of a file; in a new one the settled packing, which is then in it."""
    from faultgouge.pywrap import settle

    if record.last is None:
        with status("settling") as show:
            record.append(settle(scene, watch=lambda what: show(f"settling: {what}")))
        assert record.last is not None
        _say_loose(record.last.packing)
    assert record.last is not None
    return record.last


def _say_loose(packing: Packing) -> None:
    """Say that many disks have come to lie above the layer, through which they went while the packing settled."""
    height = packing.position[:, 1]
    loose = int((height[packing.rattlers] > height[packing.top].mean()).sum()) if packing.top.any() else 0
    if loose > MOST_LOOSE * len(packing):
        say(
            f"{loose} of {len(packing)} disks lie above the upper layer, where no force acts on them: another "
            "packing.seed, or more disks in the layer (packing.top), leaves fewer there"
        )
