"""All keys of a scene, section by section, each section checked by itself."""

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Discriminator, PrivateAttr, Tag, ValidationInfo, field_validator, model_validator

from .drive_section import Drive
from .packing_section import GeneratedPacking, StoredPacking, kind_of_packing
from .sections import Damping, Friction, Inertia, Law, Load, Output, Perturb, Ramp, Relax
from .study_sections import check_study_section
from .units_section import Units
from .validation import Section

DEFAULT_INCREMENTS = 3e4
"""Increments of F_x up to F_y where a scene does not say: the paper's 1e-4 of 3."""


class SceneKeys(Section):
    """All keys of a scene, beside the sections of studies (:mod:`~faultgouge.pywrap.scenes.study_sections`).

    Attributes
    ----------
    precision : {"double", "compensated"}
        Arithmetic of coordinates, slips and forces: doubles, or doubles with low parts, for forces that balance to
        1e-17 instead of 1e-11.
    packing, law, load, relax
        Sections that every scene has; relax may be left out in TOML.
    ramp, perturb, friction, drive, damping, units, output
        Sections or None, which means that the feature is not in the run.
    """

    model_config = ConfigDict(extra="allow")

    precision: Literal["double", "compensated"] = "double"
    packing: Annotated[
        Annotated[GeneratedPacking, Tag("generated")] | Annotated[StoredPacking, Tag("stored")],
        Discriminator(kind_of_packing),
    ]
    law: Law
    load: Load
    relax: Relax = Relax()
    ramp: Ramp | None = None
    perturb: Perturb | None = None
    friction: Friction | None = None
    drive: Drive | None = None
    units: Units | None = None
    damping: Damping | None = None
    output: Output | None = None

    @model_validator(mode="before")
    @classmethod
    def _sections_of_studies(cls, sections: Any, info: ValidationInfo) -> Any:
        if not isinstance(sections, Mapping):
            return sections
        others = sections.keys() - cls.model_fields.keys()
        checked = {
            name: check_study_section(str(name), sections[name], info.context) for name in sorted(others, key=str)
        }
        return {**sections, **checked}

    @field_validator("ramp", mode="before")
    @classmethod
    def _step_of_the_load(cls, ramp: object, info: ValidationInfo) -> object:
        if isinstance(ramp, Mapping) and "step" not in ramp and "load" in info.data:
            return {**ramp, "step": info.data["load"].fy / DEFAULT_INCREMENTS}
        return ramp

    _inertia: Inertia = PrivateAttr(Inertia())

    def model_post_init(self, context: Any) -> None:
        """Keep the key of [perturb] that is read where the section is not."""
        self._inertia = (context or {}).get("inertia", self._inertia)

    @property
    def inertia_factor(self) -> float:
        """I_0 in I = I_0 m R^2, for dynamics, spectrum and onset alike: the key of [perturb], or the paper's 1."""
        return (self.perturb or self._inertia).inertia_factor
