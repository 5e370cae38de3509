"""Arrays as packings keep them: checked, copied and read-only."""

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]


def same_bits(one: Any, other: Any) -> bool:
    """Whether two of a dataclass have the same bits in every field; -0.0 is not 0.0, and a missing array no zeros."""
    for name in one.__dataclass_fields__:
        a, b = getattr(one, name), getattr(other, name)
        if isinstance(a, np.ndarray) and isinstance(b, np.ndarray):
            same = a.shape == b.shape and a.dtype == b.dtype and a.tobytes() == b.tobytes()
        else:
            same = bool((a is None) == (b is None) and a == b)
        if not same:
            return False
    return True


def frozen(array: NDArray) -> NDArray:
    """The array, read-only from now on."""
    array.flags.writeable = False
    return array


def floats(name: str, value: ArrayLike, shape: Iterable[int]) -> Floats:
    """A copy as doubles; a ValueError if it has another shape, or a value that is not finite."""
    array = np.array(value, dtype=np.float64)
    if array.shape != tuple(shape):
        raise ValueError(f"{name} has shape {array.shape}; {tuple(shape)} is needed.")
    if not np.isfinite(array).all():
        raise ValueError(f"{name} holds a value that is not finite.")
    return array


def integers(name: str, value: ArrayLike) -> Indices:
    """A copy as a list of integers; a ValueError if it is none."""
    array = np.array(value)
    if array.ndim != 1 or not (array.size == 0 or np.issubdtype(array.dtype, np.integer)):
        raise ValueError(f"The contact array {name} must be a list of integers.")
    return array.astype(np.int64)
