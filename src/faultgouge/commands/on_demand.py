"""Commands that are made when they are called: to make all takes a fifth of the time of ``faultgouge --help``."""

import inspect
import re
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import typer
from typer.core import TyperGroup
from typer.models import CommandInfo


class CommandsByName(Mapping[str, Any]):
    """Commands by name, each of which is made of its function when it is asked for.

    Parameters
    ----------
    described : list of CommandInfo
        Functions with their names.
    names : callable
        The names of further commands, in the order of the help after the others.
    find : callable
        The description of one of these; None of another name.
    """

    def __init__(
        self, described: list[CommandInfo], names: Callable[[], list[str]], find: Callable[[str], CommandInfo | None]
    ) -> None:
        self._described = {info.name or _function(info).__name__: info for info in described}
        self._names, self._find = names, find
        self._made: dict[str, Any] = {}

    def __getitem__(self, name: str) -> Any:
        if name not in self._made:
            alone = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)
            alone.registered_commands.append(self._info(name))
            self._made[name] = typer.main.get_command(alone)
        return self._made[name]

    def _info(self, name: str) -> CommandInfo:
        info = self._described.get(name) or self._find(name)
        if info is None:
            raise KeyError(name)
        return info

    def __iter__(self) -> Iterator[str]:
        yield from self._described
        yield from self._names()

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def summaries(self) -> list[tuple[str, str]]:
        """Each command that is not hidden, with the first sentence of its docstring."""
        described = [(name, self._info(name)) for name in self]
        return [(name, _first_sentence(info)) for name, info in described if not info.hidden]


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
