"""Studies by name: the study NAME is the file ``studies/NAME.py``, where the decorator `study` or `task` registers it.

Nothing is imported to know the names of all studies and their help: the texts of the files say both. A file is imported
when its study is asked for: by its command, as the task of a sweep, or by a scene with its section.
"""

from __future__ import annotations

import ast
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

FOLDER = Path(__file__).with_name("studies")


class Description(NamedTuple):
    """What the text of a file says of its study: the decorator, "study" of one scene or "task" of each scene of a
    sweep, with its keywords (None for what is no constant), and the docstring, which is the help of the command."""

    kind: str
    given: dict[str, Any]
    says: str


@cache
def description(name: str) -> Description | None:
    """The description of a study; None if there is no study of this name."""
    path = FOLDER / f"{name}.py"
    text = path.read_text(encoding="utf-8") if name.isidentifier() and path.is_file() else ""
    begin = max(text.find("\n@study("), text.find("\n@task("))
    if begin < 0:
        return None
    # the decorated function alone: to parse whole files takes a fifth of the time of `faultgouge --help`
    (node,) = ast.parse(text[begin:].split("\n\n\n")[0]).body
    if not isinstance(node, ast.FunctionDef) or node.name != name:
        return None
    (decorator,) = node.decorator_list
    assert isinstance(decorator, ast.Call)
    given = {str(key.arg): getattr(key.value, "value", None) for key in decorator.keywords}
    return Description(getattr(decorator.func, "id", ""), given, ast.get_docstring(node) or "")


def names() -> list[str]:
    """Names of all studies."""
    return [path.stem for path in sorted(FOLDER.glob("*.py")) if description(path.stem)]


def tasks() -> list[str]:
    """Names of the studies that a sweep may run for each of its scenes."""
    known = {name: description(name) for name in names()}
    return [name for name, each in known.items() if each and (each.kind == "task" or "row" in each.given)]


def study_of(name: str) -> Any:
    """The study of this name; None if there is none."""
    return None if description(name) is None else getattr(import_module(f"faultgouge.studies.{name}"), name)
