"""The names of a package, imported when they are used: a short command does not import what it does not need."""

from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any


def names_on_use(package: str, offers: Mapping[str, str]) -> Callable[[str], Any]:
    """The function `__getattr__` of a package; `offers` has the module of each name, relative to the package."""

    def get(name: str) -> Any:
        if name in offers:
            return getattr(import_module(offers[name], package), name)
        raise AttributeError(f"module {package!r} has no attribute {name!r}")

    return get
