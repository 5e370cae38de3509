"""The command stability: whether a packing moves, of a file or of a deck; and the old name of extremes."""

from __future__ import annotations

from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..mpi_rank import is_root
from ..signal_guard import keeps
from .studies import TRIED, try_cases
from .terminal import Answer, Frame, command, lock_folder, refuse_scene, say, status, stored_packing

if TYPE_CHECKING:
    from ..analysis import Stability
    from ..analysis.has_configuration import HasConfiguration

app = typer.Typer()

Follow = Annotated[
    bool, typer.Option("--follow", help="Where motion grows, let LAMMPS go on until it vibrates, creeps or flows.")
]


@command(app, "faultgouge examples pour && faultgouge stability pour.in --follow")
def stability(
    file: Annotated[
        Path | None,
        typer.Argument(metavar="FILE|DECK", help="run.h5, NAME.disks, or a LAMMPS deck (.in).", show_default=False),
    ] = None,
    rise: Annotated[
        str | None,
        typer.Option(metavar="fx", help="Also the motion while F_x rises slowly: drift and vibration over its rate."),
    ] = None,
    followed: Annotated[
        float | None,
        typer.Option("--time", metavar="T", help="How long motion is followed; until it has settled by default."),
    ] = None,
    follow: Follow = False,
    relax: Annotated[bool, typer.Option("--relax", help="Bring the last state of a deck to rest first.")] = False,
    frame: Frame = -1,
    output: Annotated[Path, typer.Option("-o", "--output", hidden=True)] = Path("stability"),
    quick: Annotated[bool, typer.Option("--quick", hidden=True)] = False,
) -> Answer | None:
    """Say whether a packing is stable: with its own dashpots and drag, and its contacts at Coulomb's bound as they are.

    The first sentence is the verdict. A deck is run as LAMMPS runs it, and its last
    state is looked at. Without a file this is the old name of `faultgouge extremes`.
    """
    if file is None:
        return _extremes(output, quick)
    if rise not in (None, "fx"):
        raise typer.BadParameter(f"--rise {rise}: the load rises along fx")
    if followed is not None and not 0 < followed < inf:
        raise typer.BadParameter(f"--time {followed:g}: the time that motion is followed is a positive number")
    if file.suffix == ".in" or file.name.startswith("in."):
        return _of_deck(file, rise, followed, follow, relax)
    if relax:
        raise typer.BadParameter(f"--relax: {file} is no deck; a deck's last state may move")
    packing = stored_packing(refuse_scene(file), frame)
    if rise and not packing.configuration.top.any():
        raise typer.BadParameter(f"--rise: {file} has no upper layer that a load could push; leave it out")
    return _answer(verdict_of(packing, rise, followed, follow=follow)) if is_root() else None


def verdict_of(packing: HasConfiguration, *given: Any, **options: Any) -> Stability:
    """The verdict on a packing, with progress."""
    from faultgouge import stability as stability_of
    from faultgouge.analysis.progress import show_progress

    with status("stability") as show, show_progress(show):
        return stability_of(packing, *given, **options)


def first_sentence(packing: HasConfiguration) -> str:
    """The first sentence of the verdict, and the remarks on the packing: what `import` ends with."""
    told = verdict_of(packing)
    return "\n".join([told.sentences[0], *told.remarks])


def _of_deck(file: Path, rise: str | None, time: float | None, follow: bool, relax: bool) -> Answer | None:
    """Run a deck, and say whether its last state is stable; to follow its motion, while LAMMPS is there."""
    from faultgouge.pywrap.granular.run_deck import run_deck

    found: list[Answer] = []

    def use(lmp: Any, packing: HasConfiguration) -> None:
        if is_root():
            found.append(_answer(verdict_of(packing, rise, time, follow=lmp)))

    with status(f"{file}: LAMMPS runs") as show:
        packing = run_deck(file, relaxes=relax, show=show, use=use if follow else None)
    if not follow and is_root():
        found.append(_answer(verdict_of(packing, rise, time)))
    return found[0] if found else None


def _answer(verdict: Stability) -> Answer:
    return Answer([str(verdict)], verdict.as_dict())


def _extremes(output: Path, quick: bool) -> Answer:
    """The stiff and extreme cases under their name until version 1, with the JSON under its old name, too."""
    say("faultgouge stability without a file is called faultgouge extremes now")
    keeps(TRIED.format(output=output), output)
    with lock_folder(output):
        try:
            return try_cases(output, quick)
        finally:
            if is_root() and (output / "extremes.json").exists():
                from faultgouge.analysis.files.atomic_write import write_whole

                write_whole(output / "stability.json", (output / "extremes.json").read_bytes())
