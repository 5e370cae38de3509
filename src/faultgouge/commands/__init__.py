"""The commands, one module for each family.

Each module of this folder has its own `app` (``app = typer.Typer()``). Its commands are functions with the decorator
``@app.command(epilog="Example: ...")``. `FAMILIES` names the modules in the order of ``faultgouge --help``. Heavy
packages (numpy, LAMMPS, matplotlib) are imported inside the command that needs them. `terminal` has the parts that
commands share: the options SCENE, -o and --json, and `say`, `status` and `progress`, which print on the first rank
only. Commands raise errors and never print them: :mod:`faultgouge.exit_status` prints errors.
"""

from collections.abc import Callable
from importlib import import_module
from typing import Annotated

import typer

from .on_demand import CommandGroup, CommandsByName
from .studies import find_command, names_of_commands

FAMILIES = (
    "runs", "drive", "stability", "spectrum", "onset", "pictures", "vibrations", "import_command", "export_command",
    "studies", "sweeps", "examples",
)  # fmt: skip
"""Modules with commands."""


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
    group = typer.main.get_command(app)
    assert isinstance(group, CommandGroup)
    apps = [import_module(f".{family}", __name__).app for family in FAMILIES]
    described = [each for app in apps for each in app.registered_commands]
    group.commands = CommandsByName(described, names_of_commands, find_command)
    return group


QUESTION = "Does a packing of frictional grains move, and what happens when it does?"

TO_TRY = f"""\
{QUESTION} Two things to try:

  faultgouge stability deck.in      runs a LAMMPS deck: does its packing rest, or which motion grows, and how fast?
  faultgouge init -o scene.toml && faultgouge onset scene.toml
                                    the shear force at which a layer of 100 disks becomes unstable

A deck and a scene to try: faultgouge examples. All commands: faultgouge --help. Each has an example: faultgouge
stability --help.
"""


def _options(
    context: typer.Context,
    version: Annotated[
        bool, typer.Option("--version", callback=lambda asked: _version(asked), is_eager=True, help="Show versions.")
    ] = False,
) -> None:
    if context.invoked_subcommand is None:
        print(TO_TRY, end="")


def _version(asked: bool) -> None:
    """Versions of the package and of the LAMMPS that it was built for."""
    if asked:
        from importlib.metadata import version

        print(f"faultgouge {version('faultgouge')} (LAMMPS {version('lammps')})")
        raise typer.Exit()
