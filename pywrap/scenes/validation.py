"""Errors of a scene in one sentence: what is wrong, where, and what to do.

pydantic finds the errors in a section; `sentence` describes them in the terms of the scene.
"""

import math
import re
import reprlib
import sys
from collections.abc import Mapping
from contextlib import suppress
from difflib import get_close_matches
from functools import cache, lru_cache
from pathlib import Path
from typing import Annotated, Any, TypeAlias, TypeGuard, TypeVar, get_args

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationError,
    ValidationInfo,
    WrapValidator,
)
from pydantic_core import ErrorDetails, PydanticCustomError

from ...analysis import BadInputError
from ...analysis.arrays import LARGEST, SMALLEST
from ...analysis.files.atomic_write import read_plain_text

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib


def refusal_sentence(key: str, says: str) -> PydanticCustomError:
    """An error of `key` of the section (or of the field, if empty) that is being checked."""
    return PydanticCustomError("refused", "{key} {says}", {"key": key, "says": says})


def refuse(wrong: object, key: str, says: str) -> None:
    """Refuse a key where it is wrong."""
    if wrong:
        raise refusal_sentence(key, says)


def is_number(value: object) -> TypeGuard[float]:
    """Whether a value of a scene is a number with which one can compute."""
    # A comparison, because math.isfinite overflows on whole numbers, which TOML may hold of any size.
    number = isinstance(value, (int, float)) and not isinstance(value, bool)
    return number and (value == 0 or SMALLEST <= abs(value) <= LARGEST)  # type: ignore[arg-type]


def check_number(value: float) -> float:
    """The number; refused if it is neither 0 nor of a size with which one can compute."""
    between = f"give a number between {SMALLEST:g} and {LARGEST:g}"
    refuse(not is_number(value), "", f"= {reprlib.repr(value)} is refused: {between}")
    return value


Number: TypeAlias = Annotated[float, Field(allow_inf_nan=False), AfterValidator(check_number)]
Positive: TypeAlias = Annotated[float, Field(gt=0, allow_inf_nan=False), AfterValidator(check_number)]
NotNegative: TypeAlias = Annotated[float, Field(ge=0, allow_inf_nan=False), AfterValidator(check_number)]

LIST = Field(min_length=1, strict=False)
"""Of a key that is a list in TOML."""

HERTZ_EXPONENT = 1.5
"""Exponent of Hertz's contact."""

DIGITS = 12
"""Decimal digits of numbers that are converted: more than anybody gives, and fewer than a change of units leaves
right."""

OWN_WORDS = re.compile(r"\b(kn|v0|calibrated|rigid)\b")
"""Words of texts that are no quantities: "2/7 kn", "10 v0"."""


@cache
def _unit_registry() -> Any:
    from pint import UnitRegistry

    return UnitRegistry()


@lru_cache  # the scenes of a sweep have the same texts, and pint reads each in milliseconds
def to_si(text: str, unit: str, key: str = "") -> float:
    """A quantity such as "100 um" as a number of SI units; refused if it is none, or one of another dimension."""
    from pint import PintError

    try:
        return float(_unit_registry().Quantity(text).to(unit).magnitude)
    except (PintError, ValueError, TypeError, AttributeError, AssertionError, OverflowError) as error:
        reason = str(error).splitlines()[0].rstrip(".") if str(error) else "it is no quantity"
        says = f'= "{text}" does not convert to {unit} ({reason}): give a number with a unit of that kind'
        raise refusal_sentence(key, says) from None


def rounded(number: float) -> float:
    """A number that was converted, to `DIGITS`."""
    return float(f"{number:.{DIGITS}g}")


def _dimension(*powers: float, floor: tuple[float, ...] = ()) -> BeforeValidator:
    """Marks the dimension of a number, or of each in a list: a text with a unit becomes a number in units of the scene.

    The dimension is given by powers of mass, length and time; `floor` is that where the key `on` of the section, which
    stands before, has this value. The units are in the context of the validation; without them a text stays. A force
    may also be a stress on the layer, and a frequency in hertz is an angular frequency.
    """

    def number_of(value: Any, info: ValidationInfo) -> Any:
        if isinstance(value, (list, tuple)):
            return [number_of(each, info) for each in value]
        real = (info.context or {}).get("units")
        if real is None or not isinstance(value, str) or OWN_WORDS.search(value):
            return value
        own = floor if floor and info.data.get("on") == "floor" else powers
        if own == (1, 1, -2):
            with suppress(PydanticCustomError):
                return rounded(to_si(value, "Pa") / real.stress(1.0))
        turns = 2 * math.pi if re.search(r"[Hh]ertz|Hz", value) else 1.0
        unit = " * ".join(f"{name}**({power:g})" for name, power in zip(("kg", "m", "s"), own, strict=True) if power)
        size = real.mass ** own[0] * real.length ** own[1] * real.time ** own[2]
        return rounded(to_si(value, unit) * turns / size)

    return BeforeValidator(number_of)


MASS, LENGTH, TIME = _dimension(1, 0, 0), _dimension(0, 1, 0), _dimension(0, 0, 1)
FREQUENCY, VELOCITY, FORCE = _dimension(0, 0, -1), _dimension(0, 1, -1), _dimension(1, 1, -2)
STIFFNESS, DASHPOT = (_dimension(1, 1 - HERTZ_EXPONENT, power) for power in (-2, -1))
VISCOSITY, SPRING = _dimension(1, 0, -1), _dimension(1, 0, -2)
WAVE = _dimension(1, 1, -2, floor=(0, 1, -1))
"""A force on the layer, or a velocity of the floor."""

T = TypeVar("T")


class SceneError(BadInputError):
    """The scene cannot be run; the text is one sentence: what is wrong, where, and what to do."""


def read_toml(path: Path, what: str) -> dict[str, Any]:
    """The contents of the TOML file of a scene or sweep; SceneError if the file cannot be read, or is no TOML."""
    try:
        return tomllib.loads(read_plain_text(path))
    except OSError as error:
        raise SceneError(f"{path}: the {what} cannot be read ({error.strerror}): correct its path.") from None
    except ValueError as error:  # bytes that are not UTF-8, or text that is not TOML
        raise SceneError(f"{path}: the {what} is not valid TOML: {error}.") from None
    except RecursionError:
        raise SceneError(f"{path}: the {what} is nested too deeply: give sections, keys, numbers and lists.") from None


class Section(BaseModel):
    """A section of a scene: no key is changed, unknown or of another type than its own."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, validate_default=True)


def sections_in(annotation: Any) -> tuple[type[Section], ...]:
    """The sections that an annotation allows."""
    if isinstance(annotation, type):
        return (annotation,) if issubclass(annotation, Section) else ()
    return tuple(model for part in get_args(annotation) for model in sections_in(part))


class NamesFile:
    """Marks, in the annotation of a key, that its value may be the path of a file: from the root, or behind "ids:@"."""


def files_named(section: BaseModel) -> dict[str, tuple[Path, ...]]:
    """The files that a section names, by key; of a dump also those of contacts and parameters beside it."""
    found = {}
    for key, field in type(section).model_fields.items():
        given = str(getattr(section, key))
        path = Path(given.removeprefix("ids:@"))
        if any(isinstance(mark, NamesFile) for mark in field.metadata) and (path.is_absolute() or given[:5] == "ids:@"):
            beside = [path.with_suffix(each) for each in (".contacts", ".params")] if path.suffix == ".disks" else []
            found[key] = (path, *filter(Path.exists, beside))
    return found


def rule(advice: str) -> WrapValidator:
    """For a key of several types, or of a list: whatever its types refuse is refused with this advice."""

    def check(value: Any, types: Any) -> Any:
        try:
            return types(value)
        except ValidationError:
            raise refusal_sentence("", f"= {value!r} is refused: {advice}") from None

    return WrapValidator(check)


def sentence(error: ErrorDetails, sections: Mapping[str, tuple[type[Section], ...]]) -> str:
    """An error of pydantic as: where, what is wrong, what to do; `sections` has the model of each section."""
    kind, context = error["type"], error.get("ctx", {})
    path = [str(part) for part in error["loc"] if part not in ("generated", "stored")]
    place = ".".join([*path, *filter(None, [context.get("key")])])
    if kind == "extra_forbidden":
        return unknown_key(path, sections, "stored" in error["loc"])
    if kind == "refused":
        return f"{place} {context['says']}"
    if kind == "missing":
        what = f"{path[1]} to [{path[0]}]" if len(path) > 1 else f"the section [{place}]"
        return f"{place} is missing: add {what}"
    if kind in ("model_type", "model_attributes_type", "dict_type"):
        return f"{place} is not a section: write [{place}] and its keys below"
    advice = error["msg"].replace("Input", "it").replace("Tuple", "the list").replace("tuple", "list")
    if kind == "float_type" and isinstance(error["input"], str):
        advice += "; a number with a unit needs the section [units]"
    return f"{place} = {reprlib.repr(error['input'])} is refused: {advice}"


def unknown_key(path: list[str], sections: Mapping[str, tuple[type[Section], ...]], stored: bool = False) -> str:
    """The key that nobody knows, and the nearest one, or the place where it belongs."""
    *above, key = path
    homes = [name for name, models in sections.items() if any(key in model.model_fields for model in models)]
    if homes and not above:
        return f"{key} stands outside of its section: move it below [{homes[0]}]"
    section, where = (f"{above[0]}.", f"[{above[0]}]") if above else ("", "a scene")
    if stored and "packing" in homes:
        return f"packing.{key} cannot stand beside packing.file, which decides it: leave one of them out"
    keys = [name for model in sections[above[0]] for name in model.model_fields] if above else ["precision", *sections]
    nearest = f"{section}{get_close_matches(key, keys, 1, cutoff=0)[0]} of {', '.join(keys)}"
    return f"{section}{key} is no key of {where}: the nearest is {f'{homes[0]}.{key}' if homes else nearest}"


def require_section(section: T | None, name: str) -> T:
    """A section of a scene that a task cannot do without."""
    if section is None:
        raise SceneError(f"the scene has no section [{name}]: add it; `faultgouge init` writes a scene with every key")
    return section
