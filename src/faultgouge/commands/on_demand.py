"""Commands that are made when they are called: to make all takes a fifth of the time of ``faultgouge --help``."""

import inspect
import re
from collections.abc import Iterator, Mapping
from typing import Any

import typer
from typer.core import TyperGroup
from typer.models import CommandInfo


class CommandsByName(Mapping[str, Any]):
    """The commands of a family of modules by name, each of which is made of its function when it is asked for."""

    def __init__(self, described: list[CommandInfo]) -> None:
        self.described = {info.name or _function(info).__name__: info for info in described}
        self._made: dict[str, Any] = {}

    def __getitem__(self, name: str) -> Any:
        if name not in self._made:
            alone = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)
            alone.registered_commands.append(self.described[name])
            self._made[name] = typer.main.get_command(alone)
        return self._made[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.described)

    def __len__(self) -> int:
        return len(self.described)

    def summaries(self) -> list[tuple[str, str]]:
        """Each command that is not hidden, with the first sentence of its docstring."""
        return [(name, _first_sentence(info)) for name, info in self.described.items() if not info.hidden]


class CommandGroup(TyperGroup):
    """A group whose commands are `CommandsByName`; its help needs their names and docstrings alone."""

    commands: Any  # a mapping, which nobody changes

    def list_commands(self, ctx: Any) -> list[str]:
        return list(self.commands)

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        with formatter.section("Commands"):
            formatter.write_dl(self.commands.summaries())


def _function(info: CommandInfo) -> Any:
    assert info.callback is not None
    return info.callback


def _first_sentence(info: CommandInfo) -> str:
    first, *_ = (inspect.getdoc(_function(info)) or "").split("\n\n")
    return re.split(r"(?<=\.)\s", " ".join(first.split()))[0]
