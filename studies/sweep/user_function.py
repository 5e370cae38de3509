"""A function of the user as the task of a sweep: "file.py:function" or "package.module:function".

The function takes a scene and returns one row, a dict of numbers, words, lists and dicts of these:

    def task(scene): ...
    def task(scene, settled): ...

With a second parameter the function also receives the packing settled with the scene's first friction coefficient, an
:class:`~faultgouge.pywrap.Equilibrium`. Scenes that settle to the same packing share it.

A row is identified by the scene and by the code of the function: its file, and the modules in the folder of this file
that it imports, or that these import. Of "package.module:function" these are the modules of the package. After a change
of the code, the sweep computes its rows again; comments, docstrings and the layout of a file do not count as code.
"""

from __future__ import annotations

import importlib.util
import inspect
import json
import re
import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

from ...analysis import FaultgougeError
from ...analysis.errors import place_in_user_code
from ...pywrap import Scene, SceneError
from ..packing_tools import Start
from .imported_code import code_digest


class UserFunctionError(FaultgougeError):
    """A function of the user's fails, or returns no row."""


@dataclass(frozen=True)
class UserFunction:
    """A function that is named in a sweep.

    Attributes
    ----------
    name : str
        "file.py:function" with the path of the file from the root, or "package.module:function".
    function : callable
        Takes a scene, and the settled packing if `takes_settled`.
    takes_settled : bool
        Whether the function has a second parameter.
    code : str
        Sixteen hexadecimal digits: a hash of the code of its file, and of its own modules that the file imports.
    """

    name: str
    function: Callable[..., Any]
    takes_settled: bool
    code: str

    def run(self, scene: Scene, start: Start) -> dict[str, Any]:
        """The row of a scene; UserFunctionError if the function fails, or returns something else."""
        given = (scene, start(scene.law.mus[0])) if self.takes_settled else (scene,)
        try:
            row = self.function(*given)
        except FaultgougeError:
            raise
        except (Exception, SystemExit) as error:  # whatever it is, the other scenes are computed
            raise UserFunctionError(
                f"{self.function.__name__} failed with {type(error).__name__}: {error}{place_in_user_code(error)}"
            ) from error
        return _as_row(row, self.function.__name__)


def is_user_function(task: str) -> bool:
    """Whether a task is named as a function of the user's."""
    return ":" in task


def locate(task: str, folder: Path) -> str:
    """The name with the path of its file from the root; a relative path counts from the folder of the sweep."""
    file, _, function = task.rpartition(":")
    return f"{(folder / file).resolve()}:{function}" if file.endswith(".py") else task


@cache
def user_function(name: str) -> UserFunction:
    """The function of a located name.

    Raises SceneError if there is no such file, module or function, or it cannot be called with a scene.
    """
    place, _, wanted = name.rpartition(":")
    module = _module(place, name)
    function = getattr(module, wanted, None)
    if not callable(function):
        raise SceneError(f'task = "{name}": {place} has no function {wanted}: name one that it defines')
    count = _parameters(function)
    if count not in (1, 2):
        raise SceneError(
            f'task = "{name}": {wanted} takes {count} arguments: a task is {wanted}(scene) or {wanted}(scene, settled)'
        )
    return UserFunction(name, function, count == 2, code_digest(*_own_modules(module, place)))


def _own_modules(module: ModuleType, place: str) -> tuple[Path, Path, str | None]:
    """The file of a task, the folder in which its own modules are, and their package; None for all of the folder."""
    file = Path(str(module.__file__))
    if place.endswith(".py"):
        return file, file.parent, None
    above = len(place.split(".")) - (file.name != "__init__.py")
    return file, file.parents[above], place.partition(".")[0]


def _module(place: str, name: str) -> ModuleType:
    """The module of a file, or of a dotted name, imported."""
    try:
        if not place.endswith(".py"):
            return importlib.import_module(place)
        path = Path(place)
        if not path.is_file():
            raise SceneError(f'task = "{name}": there is no file {place}: correct its path')
        # a name that no other file has; workers unpickle nothing of it
        own = "faultgouge_task_" + re.sub(r"\W", "_", place)
        spec = importlib.util.spec_from_file_location(own, path)
        assert spec is not None
        assert spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        sys.modules[own] = module  # dataclasses of the file look themselves up there
        sys.path.insert(0, str(path.parent))  # what lies beside the file can be imported by it
        try:
            spec.loader.exec_module(module)
        finally:
            sys.path.remove(str(path.parent))
    except SceneError:
        raise
    except (Exception, SystemExit) as error:
        raise SceneError(f'task = "{name}": {place} cannot be imported ({type(error).__name__}: {error})') from None
    return module


def _parameters(function: Callable[..., Any]) -> int:
    """How many arguments a call must have."""
    kinds = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)
    parameters = inspect.signature(function).parameters.values()
    return sum(each.kind in kinds and each.default is inspect.Parameter.empty for each in parameters)


def _as_row(row: Any, name: str) -> dict[str, Any]:
    """The result of a function as JSON stores it."""
    if not isinstance(row, dict):
        raise UserFunctionError(f"{name} returned {type(row).__name__}: return a dict of numbers, words and lists")
    try:
        plain: dict[str, Any] = json.loads(json.dumps(row, default=_plain))
    except (TypeError, ValueError) as error:
        raise UserFunctionError(
            f"{name} returned what JSON cannot hold ({error}): give numbers, words, lists"
        ) from None
    return plain


def _plain(value: Any) -> Any:
    """Numbers and arrays of NumPy as Python's."""
    if hasattr(value, "tolist"):
        return value.tolist()
    raise TypeError(f"a {type(value).__name__}")
