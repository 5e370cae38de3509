"""A function of the user as the task of a sweep: "file.py:function" or "package.module:function".

The function takes a scene and returns one row, a dict of numbers, words, lists and dicts of these:

    def task(scene): ...
    def task(scene, settled): ...

With a second parameter the function also receives the packing settled with the scene's first friction coefficient, an
:class:`~faultgouge.pywrap.Equilibrium`. Scenes that settle to the same packing share it.

A row is identified by the scene and by the code of the function: its file, and the modules in the folder of this file,
or of its package, that it imports, or that these import. After a change of the code, the sweep computes its rows again;
comments and the layout of a file do not count as code. Modules imported by a computed name, and data that a program
reads, are not found.
"""

from __future__ import annotations

import ast
import hashlib
import inspect
import json
import re
import sys
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from importlib import import_module
from importlib.machinery import SourceFileLoader
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

from ...analysis import FaultgougeError
from ...analysis.errors import place_in_user_code
from ...pywrap import Scene, SceneError
from ..packing_tools import Start

POSITIONAL = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)


class UserFunctionError(FaultgougeError):
    """A function of the user's fails, or returns no row."""


class UserFunction(NamedTuple):
    """A function that is named in a sweep; `code` is a hash of its file and of its own modules that the file imports,
    sixteen hexadecimal digits."""

    function: Callable[..., Any]
    takes_settled: bool
    code: str

    def run(self, scene: Scene, start: Start) -> dict[str, Any]:
        """The row of a scene as JSON holds it; UserFunctionError if the function fails, or returns something else."""
        given, name = (scene, start(scene.law.mus[0])) if self.takes_settled else (scene,), self.function.__name__
        try:
            row = self.function(*given)
        except FaultgougeError:
            raise
        except (Exception, SystemExit) as error:  # whatever it is, the other scenes are computed
            says = f"{name} failed with {type(error).__name__}: {error}{place_in_user_code(error)}"
            raise UserFunctionError(says) from error
        plain = None
        with suppress(AttributeError, TypeError, ValueError):
            plain = json.loads(json.dumps(row, default=lambda value: value.tolist()))
        if not isinstance(plain, dict):
            raise UserFunctionError(f"{name} returned {row!r:.60}: return a dict of numbers, words and lists")
        return plain


def locate(task: str, folder: Path) -> str:
    """The name with the path of its file from the root; a relative path counts from the folder of the sweep."""
    file, _, function = task.rpartition(":")
    return f"{(folder / file).resolve()}:{function}" if file.endswith(".py") else task


@cache
def user_function(name: str) -> UserFunction:
    """The function of a located name; SceneError if there is none, or it cannot be called with a scene."""
    place, _, wanted = name.rpartition(":")
    try:
        module = _import_file(Path(place)) if place.endswith(".py") else import_module(place)
        code = code_digest(module, place)
    except (Exception, SystemExit) as error:
        raise SceneError(f'task = "{name}": {place} cannot be imported ({type(error).__name__}: {error})') from None
    function = getattr(module, wanted, None)
    if not callable(function):
        raise SceneError(f'task = "{name}": {place} has no function {wanted}: name one that it defines')
    parameters = inspect.signature(function).parameters.values()
    count = sum(each.kind in POSITIONAL and each.default is inspect.Parameter.empty for each in parameters)
    if count not in (1, 2):
        cure = f"a task is {wanted}(scene) or {wanted}(scene, settled)"
        raise SceneError(f'task = "{name}": {wanted} takes {count} arguments: {cure}')
    return UserFunction(function, count == 2, code)


def _import_file(path: Path) -> ModuleType:
    """The module of a file, which can import what lies beside it."""
    own = "faultgouge_task_" + re.sub(r"\W", "_", str(path))  # a name that no other file has
    module = sys.modules[own] = ModuleType(own)  # dataclasses of the file look themselves up there
    module.__file__ = str(path)
    sys.path.insert(0, str(path.parent))
    try:
        SourceFileLoader(own, str(path)).exec_module(module)
    finally:
        sys.path.remove(str(path.parent))
    return module


def code_digest(module: ModuleType, place: str) -> str:
    """Sixteen hexadecimal digits that stand for the code of a module and of its own modules that it imports, directly
    or not, and wherever in a function; they are read from the text, and nothing is run."""
    file, package = Path(str(module.__file__)), "" if place.endswith(".py") else place.partition(".")[0]
    root = file.parents[len(place.split(".")) - (file.name != "__init__.py") if package else 0]
    code, waiting = dict[str, str](), [file]
    while waiting:
        each = waiting.pop()
        if not each.is_file() or (name := str(each.relative_to(root))) in code:
            continue
        tree = ast.parse(each.read_bytes())
        code[name] = ast.dump(tree)
        for node in ast.walk(tree):
            at, dotted = root, list[str]()
            if isinstance(node, ast.Import):
                dotted = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom):
                at = each.parents[node.level - 1] if node.level else root
                dotted = [f"{node.module or ''}.{alias.name}".strip(".") for alias in node.names]
            for names in (each.split(".") for each in dotted):
                if at.is_relative_to(root) and (at != root or not package or names[0] == package):
                    # an import of a.b.c runs a, a.b and a.b.c
                    paths = [at.joinpath(*names[: count + 1]) for count in range(len(names))]
                    waiting += [found for path in paths for found in (Path(f"{path}.py"), path / "__init__.py")]
    return hashlib.sha256(repr(sorted(code.items())).encode()).hexdigest()[:16]
