"""Values of packings and other frozen data: checked, converted, copied and read-only.

If the fields of a frozen dataclass differ from its arguments (arrays for lists, ones for None), the class has its own
constructor, which converts the arguments with the functions here and passes the result to `set_frozen`.
`derive_frozen` makes a new object from another, without repeating checks. Only these two functions set fields, and
only of new objects.
"""

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_array, issparse

from .errors import BadInputError

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Indices = NDArray[np.int64]

Matrix: TypeAlias = Floats | csr_array
"""A dense or a sparse matrix."""

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

Data = TypeVar("Data", bound="DataclassInstance")


def same_bits(one: Any, other: Any) -> bool:
    """`==` of a dataclass: whether every compared field has the same bits; -0.0 differs from 0.0."""
    if type(one) is not type(other):
        return NotImplemented

    def bits(value: Any) -> Any:
        if issparse(value):
            return value.shape, *(each.tobytes() for each in (value.indptr, value.indices, value.data))
        return (value.shape, value.dtype, value.tobytes()) if isinstance(value, np.ndarray) else value

    names = (field.name for field in one.__dataclass_fields__.values() if field.compare)
    return all(bits(getattr(one, name)) == bits(getattr(other, name)) for name in names)


def frozen(array: NDArray) -> NDArray:
    """The array, read-only from now on."""
    array.flags.writeable = False
    return array


def set_frozen(data: object, **values: object) -> None:
    """Give a frozen dataclass that is being made its values, once; arrays are read-only from now on."""
    for name, value in values.items():
        object.__setattr__(data, name, frozen(value) if isinstance(value, np.ndarray) else value)


def derive_frozen(data: Data, **changes: object) -> Data:
    """A frozen dataclass like another, but for values that the caller has checked: `replace` would check all anew.

    Newton's method makes a packing every millisecond, of disks that stay what they are.
    """
    made = object.__new__(type(data))
    for name in data.__dataclass_fields__:
        if name not in changes:
            object.__setattr__(made, name, getattr(data, name))
    set_frozen(made, **changes)
    return made


def number(name: str, value: float, *, positive: bool = False) -> float:
    """The value as a float; ValueError if the value is not finite or, where `positive`, not positive."""
    found = float(value)
    if not np.isfinite(found) or (positive and found <= 0):
        raise ValueError(f"{name} = {found} is not a number that it can have.")
    return found


SMALLEST, LARGEST = 1e-100, 1e100
"""Between these a number of a disk may be: products of three stay finite, and LAMMPS reads no subnormal ones."""


def positive_each(name: str, array: Floats) -> Floats:
    """The array; ValueError if the value of a disk is not positive, or is tiny or huge."""
    if np.any(array <= 0):
        raise BadInputError(f"Every {name} must be positive; disk {np.argmin(array)} has another.")
    odd = np.flatnonzero((array < SMALLEST) | (array > LARGEST))
    if len(odd):
        raise BadInputError(
            f"The {name} of disk {odd[0]} is {array[odd[0]]:g}: give one between {SMALLEST:g} and {LARGEST:g}."
        )
    return array


def booleans(name: str, value: ArrayLike, count: int) -> NDArray[np.bool_]:
    """A copy as booleans, one for each disk; ValueError if there are not `count` booleans."""
    array = np.array(value)
    if array.shape != (count,) or array.dtype != np.bool_:
        raise ValueError(f"{name} must be {count} booleans, one for each disk.")
    return array


def real(name: str, value: ArrayLike) -> Floats:
    """A copy as doubles; a ValueError if values are complex, or masked."""
    if np.iscomplexobj(value) or np.ma.is_masked(value):
        raise ValueError(f"{name} holds {'complex' if np.iscomplexobj(value) else 'masked'} values; give real numbers.")
    return np.array(value, dtype=np.float64)


def floats(name: str, value: ArrayLike, shape: Iterable[int]) -> Floats:
    """A copy as doubles; ValueError if the shape differs, or a value is not finite and real."""
    array = real(name, value)
    if array.shape != tuple(shape):
        raise ValueError(f"{name} has shape {array.shape}; {tuple(shape)} is needed.")
    if not np.isfinite(array).all():
        raise ValueError(f"{name} holds a value that is not finite.")
    return array


def square(name: str, value: csr_array, size: int) -> csr_array:
    """A read-only copy as a sparse matrix; ValueError if the shape differs, or an entry is not finite."""
    matrix = csr_array(value, dtype=np.float64, copy=True)
    matrix.sum_duplicates()
    if matrix.shape != (size, size):
        raise ValueError(f"{name} has shape {matrix.shape}; {(size, size)} is needed.")
    if not np.isfinite(matrix.data).all():
        raise ValueError(f"{name} holds a value that is not finite.")
    for each in (matrix.data, matrix.indices, matrix.indptr):
        frozen(each)
    return matrix


def integers(name: str, value: ArrayLike) -> Indices:
    """A copy as an array of integers; ValueError if the values are no integers."""
    array = np.array(value)
    if array.ndim != 1 or not (array.size == 0 or np.issubdtype(array.dtype, np.integer)):
        raise ValueError(f"The contact array {name} must be a list of integers.")
    return array.astype(np.int64)
