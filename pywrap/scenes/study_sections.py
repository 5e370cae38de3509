"""Sections of a scene that belong to one study each, such as [trigger]: the study registers its section in its file.

A scene with the section [NAME] imports ``faultgouge/studies/NAME.py``, if there is such a study, and its section is
checked by the model that the study registers. Numbers of the section that may have a unit say so in their annotation:
``Annotated[Positive, TIME]`` (:mod:`~faultgouge.pywrap.scenes.quantities`).
"""

from collections.abc import Mapping
from typing import Any, TypeVar

from pydantic import ValidationError
from pydantic_core import ErrorDetails, PydanticCustomError

from ... import registered
from .validation import SceneError, Section

S = TypeVar("S", bound=Section)


def study_model(name: str) -> type[Section] | None:
    """The section that a study has registered; None if there is no such study, or it has no section."""
    model: type[Section] | None = getattr(registered.study_of(name), "section", None)
    return model


def study_models() -> dict[str, tuple[type[Section], ...]]:
    """The sections of all studies by name."""
    return {name: (model,) for name in registered.names() if (model := study_model(name)) is not None}


def check_study_section(name: str, given: object, context: Any) -> object:
    """A section of a study, checked; the error of a section that no study has, or that is refused, has its place."""
    model = study_model(name)
    if model is None:
        errors: list[Any] = [{"type": "extra_forbidden", "loc": (), "input": given, "msg": "unknown"}]
    else:
        try:
            return model.model_validate(given, context=context)
        except ValidationError as error:
            errors = [*error.errors(include_url=False)]
    placed = [{**each, "loc": (name, *each["loc"])} for each in errors]
    raise PydanticCustomError("study_section", "[{name}] is refused", {"name": name, "errors": placed})


def errors_in(error: ValidationError) -> list[ErrorDetails]:
    """The errors of a scene, those of its studies' sections with the others."""
    found: list[ErrorDetails] = []
    for each in error.errors():
        found += each["ctx"]["errors"] if each["type"] == "study_section" else [each]
    return found


def section_of(scene: Any, model: type[S]) -> S | None:
    """The section of a study in a scene; None of a scene without it."""
    return next((each for each in (scene.model_extra or {}).values() if isinstance(each, model)), None)


def require_sections(scene: Any, needs: tuple[str, ...], advice: Mapping[str, str]) -> None:
    """Raise SceneError if the scene lacks a section; `advice` has the keys to add, or the model of the study says."""
    for name in needs:
        if getattr(scene, name, None) is None:
            model = study_model(name)
            fields = {} if model is None else model.model_fields
            keys = [field.description or key for key, field in fields.items() if field.is_required()]
            raise SceneError(f"the scene has no section [{name}]: add it, with {advice.get(name, ', '.join(keys))}")
