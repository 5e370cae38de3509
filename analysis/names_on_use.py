"""The names of a package, imported when they are used: a short command does not import what it does not need."""

import ast
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any


def names_on_use(package: str, file: str) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """The functions `__getattr__` and `__dir__` of a package; its names are those under its `if TYPE_CHECKING:`.

    `dir` lists what the package offers, `__all__`, and not what its file imports.

    A type checker reads these imports as they stand, and Python makes each of them when its name is used.
    """
    tests = (each for each in ast.parse(Path(file).read_text(encoding="utf-8")).body if isinstance(each, ast.If))
    block = next(each for each in tests if ast.unparse(each.test) == "TYPE_CHECKING")
    imports = [each for each in block.body if isinstance(each, ast.ImportFrom)]
    module_of = {alias.name: "." * each.level + (each.module or "") for each in imports for alias in each.names}

    def get(name: str) -> Any:
        if name in module_of:
            return getattr(import_module(module_of[name], package), name)
        raise AttributeError(f"module {package!r} has no attribute {name!r}")

    return get, lambda: sorted(import_module(package).__all__)
