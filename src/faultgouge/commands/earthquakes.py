"""What is run for the question that the paper ends with: which waves trigger, and how large what follows is."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Annotated, TypeVar

import typer

from ..guard import keeps
from .terminal import AsJson, ScenePath, print_json, progress, read_scene, say

T = TypeVar("T")

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

    def bar(results: Iterable[T], count: int) -> Iterator[T]:
        return progress(results, "bisections", count)

    wanted = read_scene(scene)
    keeps(f"{output}/trigger.jsonl has what was found so far; the same command goes on from there")
    result = trigger_map(wanted, output, say, bar)
    say(f"written: {output}/trigger.md")
    if as_json:
        print_json(result)


@app.command(epilog="Example: mpiexec -n 3 faultgouge eruptions eruptions.toml -o eruptions")
def eruptions(scene: ScenePath, output: Folder = Path("eruptions"), as_json: AsJson = False) -> None:
    """How large: undamped runs from rest at each load of \\[eruptions], until they are over, and what ended the growth.

    Of several ranks one hands out the loads.
    """
    from faultgouge.studies.eruptions import eruptions as run_all

    def bar(results: Iterable[T], count: int) -> Iterator[T]:
        return progress(results, "runs", count)

    wanted = read_scene(scene)
    keeps(f"{output}/eruptions.jsonl has the runs that were over; the same command goes on from there")
    result = run_all(wanted, output, say, bar)
    say(f"written: {output}/eruptions.md")
    if as_json:
        print_json(result)
