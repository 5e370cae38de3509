"""What is run for the question that the paper ends with: which waves trigger, and how large what follows is."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer

from ..guard import keeps
from .terminal import AsJson, ScenePath, print_json, progress, read_scene, say

Folder = Annotated[
    Path, typer.Option("-o", "--output", help="The folder for numbers, pictures and page; an interrupted one goes on.")
]

app = typer.Typer()


@app.command(epilog="Example: mpiexec -n 3 faultgouge trigger trigger.toml -o trigger")
def trigger(scene: ScenePath, output: Folder = Path("trigger"), as_json: AsJson = False) -> None:
    """Which waves trigger how critical a layer: the critical amplitude over frequency and distance from the onset.

    Predicted from the stiffness, the damping and the masses, and measured by
    bisection in LAMMPS for some pairs. The scene says friction.v0, the velocity
    above which friction weakens. Of several ranks one hands out the runs.
    """
    from faultgouge.studies.trigger import trigger_map

    _into_folder(trigger_map, scene, output, "trigger", "bisections", "what was found so far", as_json)


@app.command(epilog="Example: mpiexec -n 3 faultgouge eruptions eruptions.toml -o eruptions")
def eruptions(scene: ScenePath, output: Folder = Path("eruptions"), as_json: AsJson = False) -> None:
    """How large: undamped runs from rest at each load of \\[eruptions], until they are over, and what ended the growth.

    Of several ranks one hands out the loads.
    """
    from faultgouge.studies.eruptions import eruptions as run_all

    _into_folder(run_all, scene, output, "eruptions", "runs", "the runs that were over", as_json)


def _into_folder(
    study: Callable[..., dict[str, Any]], scene: Path, output: Path, name: str, what: str, kept: str, as_json: bool
) -> None:
    """Run a study of a scene that goes on in its folder; `what` is counted, and `kept` is what an interrupt leaves."""
    wanted = read_scene(scene)
    keeps(f"{output}/{name}.jsonl has {kept}; the same command goes on from there")
    result = study(wanted, output, say, lambda results, count: progress(results, what, count))
    say(f"written: {output}/{name}.md")
    if as_json:
        print_json(result)
