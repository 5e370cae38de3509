"""Libraries for single formats, imported only when a file of the format is used."""

from importlib import import_module
from pathlib import Path
from typing import Any

from ...errors import BadInputError


def needed_library(module: str, path: Path) -> Any:
    """A module of a dependency, or of the extra `export`. Raises BadInputError if it is not installed."""
    try:
        return import_module(module)
    except ImportError:
        library = module.split(".")[0]
        raise BadInputError(
            f"{path} needs the library {library}, which is not installed: pip install 'faultgouge[export]'."
        ) from None
