"""Values of packings and other frozen data: checked, converted, copied and read-only.

A frozen dataclass whose fields differ from its arguments (arrays for lists, ones for None) converts them with the
functions here and passes the result to `set_frozen`. `derive_frozen` makes a new object from another, without repeating
checks. Only these two functions set fields, and only of new objects.
"""

from dataclasses import Field
from typing import TYPE_CHECKING, Any, ClassVar, TypeAlias, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_array, issparse

from .errors import BadInputError

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Indices = NDArray[np.int64]
Booleans = NDArray[np.bool_]

Matrix: TypeAlias = Floats | csr_array
"""A dense or a sparse matrix."""

BY_DEFAULT: Any = None
"""What an argument is whose value follows from the others."""

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

Data = TypeVar("Data", bound="DataclassInstance")


class EqualToTheBit:
    """A dataclass that is equal to another if every compared field has the same bits; -0.0 differs from 0.0."""

    __dataclass_fields__: ClassVar[dict[str, "Field[Any]"]]

    def __eq__(self, other: object) -> bool:
        if type(self) is not type(other):
            return NotImplemented

        def bits(value: Any) -> Any:
            if issparse(value):
                return value.shape, *(each.tobytes() for each in (value.indptr, value.indices, value.data))
            return (value.shape, value.dtype, value.tobytes()) if isinstance(value, np.ndarray) else value

        names = (field.name for field in self.__dataclass_fields__.values() if field.compare)
        return all(bits(getattr(self, name)) == bits(getattr(other, name)) for name in names)

    def __hash__(self) -> int:
        return hash(type(self))


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
    set_frozen(made, **{name: getattr(data, name) for name in data.__dataclass_fields__} | changes)
    return made


def ratio(part: Floats, whole: Floats) -> Floats:
    """part / whole, zero where the whole is not positive; of the shape of the part."""
    zeros = np.zeros(np.shape(part), np.result_type(part, whole))
    return np.divide(part, whole, out=zeros, where=whole > 0)


def number(name: str, value: float, *, positive: bool = False) -> float:
    """The value as a float; ValueError if the value is not finite or, where `positive`, not positive."""
    found = float(value)
    if not np.isfinite(found) or (positive and found <= 0):
        raise ValueError(f"{name} = {found} is not a number that it can have.")
    return found


def floats(name: str, value: ArrayLike, shape: tuple[int, ...], *, infinite: bool = False) -> Floats:
    """A copy as doubles; ValueError if the shape differs, or a value is not real and finite, or infinite if allowed."""
    if np.iscomplexobj(value) or np.ma.is_masked(value):
        raise ValueError(f"{name} holds {'complex' if np.iscomplexobj(value) else 'masked'} values; give real numbers.")
    array = np.array(value, dtype=np.float64)
    if array.shape != shape:
        raise ValueError(f"{name} has shape {array.shape}; {shape} is needed.")
    if not np.all(np.isfinite(array) | (infinite & (array == np.inf))):
        raise ValueError(f"{name} holds a value that is not finite.")
    return array


SMALLEST, LARGEST = 1e-100, 1e100
"""Between these a number of a disk may be: products of three stay finite, and LAMMPS reads no subnormal ones."""


def positive_each(name: str, value: ArrayLike, shape: tuple[int, ...]) -> Floats:
    """The same of numbers that are positive, and neither tiny nor huge."""
    array = floats(name, value, shape)
    odd = np.flatnonzero(~((array >= SMALLEST) & (array <= LARGEST)))
    if len(odd):
        k, between = int(odd[0]), f"between {SMALLEST:g} and {LARGEST:g}"
        raise BadInputError(f"The {name} of disk {k} is {array[k]:g} and must be positive: give one {between}.")
    return array


def exactly(name: str, value: ArrayLike, count: int, kind: type[np.bool_] | type[np.integer]) -> NDArray:
    """A copy of so many booleans or integers; ValueError if they are others."""
    array = np.array(value)
    if array.shape != (count,) or (count and not np.issubdtype(array.dtype, kind)):
        raise ValueError(f"{name} must be a list of {count} {'booleans' if kind is np.bool_ else 'integers'}.")
    return array.astype(np.bool_ if kind is np.bool_ else np.int64)


def square(name: str, value: csr_array, size: int) -> csr_array:
    """A read-only copy as a sparse matrix; ValueError if the shape differs, or an entry is not finite."""
    matrix = csr_array(value, dtype=np.float64, copy=True)
    matrix.sum_duplicates()
    if matrix.shape != (size, size):
        raise ValueError(f"{name} has shape {matrix.shape}; {(size, size)} is needed.")
    floats(name, matrix.data, matrix.data.shape)
    for each in (matrix.data, matrix.indices, matrix.indptr):
        frozen(each)
    return matrix
