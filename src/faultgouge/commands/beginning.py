"""Where to begin: init."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path
from typing import Annotated

import typer

from ..ranks import is_root
from .terminal import say

app = typer.Typer()


@app.command(epilog="Example: faultgouge init -o scene.toml")
def init(
    output: Annotated[Path, typer.Option("-o", "--output", help="The scene to write.")] = Path("scene.toml"),
) -> None:
    """Write a scene with every section and key commented, to be changed."""
    if output.exists():
        raise typer.BadParameter(f"{output} exists: give another name with -o, or delete it")
    if is_root():
        output.write_text((files("faultgouge") / "scenes" / "commented.toml").read_text())
        say(f"written to {output}; next: faultgouge onset {output}")
