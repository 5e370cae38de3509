"""Results whose numbers have two spellings: that of Python, and that of their JSON."""

from typing import Any

import numpy as np


class FieldsByName(dict[str, Any]):
    """Numbers by name: `found.time` is `found["time"]`."""

    def __getattr__(self, name: str) -> Any:
        if name not in self:
            raise AttributeError(f"there is no {name!r}: {', '.join(self)}")
        return self[name]

    def as_dict(self) -> dict[str, Any]:
        """The numbers as JSON has them: None for one that is not finite, such as a scale without a bound."""
        return {name: _plain(value) for name, value in self.items()}


def _plain(value: Any) -> Any:
    if isinstance(value, FieldsByName):
        return value.as_dict()
    if isinstance(value, tuple):
        return [_plain(each) for each in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value
