"""Results whose numbers have two spellings: that of Python, and that of their JSON."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np


class FieldsByName(Mapping[str, Any]):
    """A dataclass whose fields are attributes and items: `found.time` is `found["time"]`."""

    def __getitem__(self, name: str) -> Any:
        return vars(self)[name]

    def __iter__(self) -> Iterator[str]:
        return iter(vars(self))

    def __len__(self) -> int:
        return len(vars(self))

    def as_dict(self) -> dict[str, Any]:
        """The fields as JSON has them: None for a number that is not finite, such as a scale without a bound."""
        return {name: _plain(value) for name, value in self.items()}


def _plain(value: Any) -> Any:
    if isinstance(value, FieldsByName):
        return value.as_dict()
    if isinstance(value, tuple):
        return [_plain(each) for each in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value
