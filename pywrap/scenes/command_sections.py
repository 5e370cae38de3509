"""The sections of a scene that each command reads.

A command receives a scene with only the sections that it reads: other sections cannot make it fail, and are not part of
its output. Of these only the keys are checked, because a misspelled key is always a mistake.

A section such as [trigger] belongs to one study, which registers its model in its file, ``faultgouge/studies/NAME.py``;
a scene with the section [NAME] imports this file. Numbers of a section that may have a unit say so in their annotation:
``Annotated[Positive, TIME]`` (:mod:`~faultgouge.pywrap.scenes.units`).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

from ... import registered
from .validation import Section

S = TypeVar("S", bound=Section)

BED = ("precision", "packing", "law", "load", "damping", "units", "perturb.inertia_factor")
"""Sections that determine the settled packing and its masses. Every command reads them, and of [perturb] one key."""
PATH = (*BED, "relax", "ramp")
"""Sections that determine the equilibria along F_x."""
UNDAMPED_SECTIONS = (*PATH, "perturb", "friction")
"""Sections that determine undamped runs."""


@dataclass(frozen=True)
class Command:
    """Sections of a scene that a command reads, or single keys as in "perturb.inertia_factor", and what it needs."""

    reads: tuple[str, ...]
    needs: tuple[str, ...] = ()

    def part(self, scene: Mapping[str, Any]) -> dict[str, Any]:
        """The sections of a scene, as TOML holds it, that this command reads; of some sections single keys alone."""
        read = {name: value for name, value in scene.items() if name in self.reads}
        for section, key in (name.split(".") for name in self.reads if "." in name):
            value = scene.get(section)
            if section not in read and isinstance(value, Mapping) and key in value:
                read[section] = {key: value[key]}
        return read


COMMANDS: Mapping[str, Command] = {
    "settle": Command(BED),
    "ramp": Command((*PATH, "output"), ("ramp",)),
    "perturb": Command((*UNDAMPED_SECTIONS, "output"), ("perturb",)),
    "drive": Command((*BED, "drive"), ("drive", "damping")),
    "onset": Command(PATH, ("ramp",)),
    "reproduce": Command(UNDAMPED_SECTIONS, ("ramp",)),
}
"""Commands by name. Studies, and tasks of sweeps, register theirs."""


def command_of(name: str | None) -> Command | None:
    """What a command, a study or the task of a sweep reads; None of one that reads every section."""
    study = None if name is None or name in COMMANDS else registered.study_of(name)
    return COMMANDS.get(name or "") if study is None else Command(study.sections, study.needs)


def study_model(name: str) -> type[Section] | None:
    """The section that a study has registered; None if there is no such study, or it has no section."""
    model: type[Section] | None = getattr(registered.study_of(name), "section", None)
    return model


def study_models() -> dict[str, tuple[type[Section], ...]]:
    """The sections of all studies by name."""
    return {name: (model,) for name in registered.names() if (model := study_model(name)) is not None}


def section_of(scene: Any, model: type[S]) -> S | None:
    """The section of a study in a scene; None of a scene without it."""
    return next((each for each in (scene.model_extra or {}).values() if isinstance(each, model)), None)
