"""`examples`: a shelf of decks, scenes and a script, each of which runs in seconds."""

import re
from pathlib import Path
from typing import Annotated

import typer

from .terminal import print_line

app = typer.Typer()


@app.command(epilog="Example: faultgouge examples pour")
def examples(
    name: Annotated[
        str | None, typer.Argument(help="Which one is copied into this folder.", show_default=False)
    ] = None,
) -> None:
    """List ten examples that run in seconds each, or copy one into this folder."""
    from importlib.resources import files

    scenes = files("faultgouge") / "scenes"
    shelf = {Path(each.name).stem: each for each in (scenes / "examples").iterdir() if each.is_file()}
    if name is None:
        for each in sorted(shelf):
            what, command = _head(shelf[each].read_text())
            print_line(f"{each:9} {what}\n{'':9} {command}")
        print_line("\nfaultgouge examples NAME copies one into this folder.")
        return
    # scenes of studies that take minutes are copied, too, with the packing that they name, but not listed
    name = name.rsplit(".", 1)[0]
    if not (chosen := shelf.get(name, scenes / f"{name}.toml")).is_file():
        raise typer.BadParameter(f"there is no example {name}: take one of {', '.join(sorted(shelf))}")
    what, command = _head(text := chosen.read_text())
    for each in [chosen, *(scenes / named for named in re.findall(r'^file = "(.+)"', text, re.MULTILINE))]:
        if Path(each.name).exists():
            raise typer.BadParameter(f"{each.name} exists in this folder: move it away, or use another folder")
        Path(each.name).write_bytes(each.read_bytes())
    print_line(f"{chosen.name}: {what}\nnext: {command}")


def _head(text: str) -> tuple[str, str]:
    """What an example shows, and the command that runs the example: its first two lines."""
    what, command, *_ = text.splitlines()
    return what.strip('# "'), command.strip('# "')
