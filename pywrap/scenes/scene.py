"""A scene: description of a computation in TOML, checked in full before any work starts.

    precision = "double"          # of the coordinates
    [packing]   the disks and the box: generated from a seed, or read from a file
    [law]       k_n, k_t and the friction coefficient mu
    [damping]   dashpots at the contacts, drag on the disks
    [load]      the force F_y that presses each disk of the upper layer down
    [relax]     damped dynamics: friction against the medium and time step
    [ramp]      F_x raised from equilibrium to equilibrium
    [perturb]   an undamped run at one F_x, with or without a forcing a cos(omega t)
    [friction]  mu(v) that falls with the velocity v of the upper layer
    [drive]     a spring that draws the upper layer: stick and slip
    [units]     what the numbers are in SI
    [output]    what is written beside the result
    [NAME]      the section of the study NAME (:mod:`faultgouge.pywrap.scenes.command_sections`)

packing, law and load are required. Each other section switches on a feature; without the section, the run does not have
the feature. The user chooses the units: k_n and k_t are force / length^law.exponent, 3/2 by default. The units of the
paper are the mass of a disk and the diameter of a small disk. Numbers that no packing can bear are refused.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

from pydantic import (
    ConfigDict,
    PrivateAttr,
    ValidationError,
    ValidationInfo,
    create_model,
    field_validator,
    model_validator,
)
from pydantic_core import PydanticCustomError

from ...analysis import MindlinLaw
from ...analysis.files.atomic_write import read_plain
from .command_sections import command_of, study_model, study_models
from .packing_section import GeneratedPacking, PackingSection
from .run_sections import Drive, Inertia, Perturb
from .sections import Damping, Friction, Law, Load, Output, Ramp, Relax
from .units import Units, in_units, real_units
from .validation import (
    SceneError,
    Section,
    files_named,
    read_toml,
    refuse,
    require_section,
    sections_in,
    sentence,
    unknown_key,
)

DOUBLE_ROUNDING = 2.3e-16
"""Relative rounding of a double, rounded up."""

STEPS_OF_A_YEAR = 1e13
"""A year of LAMMPS's steps: 2e-6 s each and more, on a core of 2020."""

ROUNDING_LIMIT = 1e-6
"""Rounding of a force, in units of F_y, beyond which no bed comes to rest: 30 disks do at 1e-7, and fly apart at
5e-7."""

DEFAULT_INCREMENTS = 3e4
"""Increments of F_x up to F_y where a scene does not say: the paper's 1e-4 of 3."""


class Scene(Section):
    """A complete and consistent description of a computation: its sections agree with each other.

    Beside these keys it has the sections of studies (:mod:`~faultgouge.pywrap.scenes.command_sections`).

    Attributes
    ----------
    precision : {"double", "compensated"}
        Arithmetic of coordinates, slips and forces: doubles, or doubles with low parts, for forces that balance to
        1e-17 instead of 1e-11.
    packing, law, load, relax
        Sections that every scene has; relax may be left out in TOML.
    ramp, perturb, friction, drive, damping, units, output
        Sections or None, which means that the feature is not in the run.

    Examples
    --------

    Three disks, of which the upper one is drawn:

    >>> scene = faultgouge.Scene.from_toml("three_disks.toml")
    >>> scene.packing.disks, scene.law.kn, scene.ramp.until
    (3, 200000.0, 2.4)
    >>> faultgouge.Scene.from_mapping({"packing": {"disks": 40}, "law": {"kn": 2e5}, "load": {"fy": 3.0}}).packing.seed
    7
    """

    model_config = ConfigDict(extra="allow")

    precision: Literal["double", "compensated"] = "double"
    packing: PackingSection
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

    @model_validator(mode="after")
    def _consistent(self) -> Scene:
        """Refuse keys that do not agree with others, or that no packing can bear."""
        packing, fy, kn, ramp, perturb = self.packing, self.load.fy, self.law.kn, self.ramp, self.perturb
        repulsion = MindlinLaw(kn, kt=0.0, mu=0.0, exponent=self.law.exponent)
        overlap = float(repulsion.overlap_of_force(fy))
        stiffness = float(repulsion.normal_stiffness(overlap))
        if perturb is not None:
            refuse(perturb.fx is ramp is None, "perturb.fx", "is missing: give it, or [ramp], to seek the onset")
            lightest = min(1.0, self.inertia_factor) * (getattr(packing, "mass", None) or 1.0)
            steps = perturb.time / (perturb.time_step or 0.1 * math.sqrt(lightest / (6 * stiffness)))
            says = f"= {perturb.time:g} takes {steps:.2g} time steps, a year and more: lower it, or raise the time_step"
            refuse(steps > STEPS_OF_A_YEAR, "perturb.time", says)
            if ramp and perturb.fx is not None:
                says = f"= {perturb.fx} lies beyond the last equilibrium, ramp.until = {ramp.first}: ramp further"
                refuse(perturb.fx > max(0.0, ramp.first), "perturb.fx", says)
            if isinstance(perturb.target, tuple):
                last = max(perturb.target)
                says = f"names disk {last}: name disks from 0 to {packing.disks - 1}"
                refuse(last >= packing.disks, "perturb.target", says)
        if isinstance(packing, GeneratedPacking):
            smallest, rounding = min(packing.radii), DOUBLE_ROUNDING * packing.width * stiffness / fy
            says = f"= {fy:g} presses two disks {overlap:.2g} into each other, beyond the smallest radius {smallest:g}"
            refuse(not overlap < smallest, "load.fy", f"{says}: lower it, or raise law.kn = {kn:g}")
            says = f"= {kn:g} is too stiff for load.fy = {fy:g}: the last digit of coordinates is {rounding:.1g} of F_y"
            rests = "and no packing comes to rest: lower it or packing.width, or raise load.fy"
            refuse(not rounding < ROUNDING_LIMIT, "law.kn", f"{says}, {rests}")
        says = 'acts in dynamics, and no equilibrium depends on it: set ramp.method = "newton", or leave [damping] out'
        refuse(self.damping and ramp and ramp.method == "overdamped", "damping", says)
        if (drive := self.drive) is not None:
            strength, at = self.law.mus[0] * fy, drive.at or 0.0
            refuse(strength == 0, "drive", "needs friction, which holds the layer: give law.mu a value above 0")
            end = drive.length(strength) if drive.at is not None else math.inf
            refuse(at >= end, "drive.at", f"= {at} is after the end of the run, {end:g}: let the signal begin before")
            says = "would slow down a layer that is moved rigidly: leave it out, or give drive.spring a stiffness"
            refuse(drive.spring == "rigid" and self.damping and self.damping.tau, "damping.tau", says)
        real_units(self)
        return self

    @classmethod
    def from_toml(cls, path: str | Path, packing: Mapping[str, Any] | None = None, command: str | None = None) -> Scene:
        """Read a scene.

        Parameters
        ----------
        path : str or Path
            A TOML file. A relative packing.file in it counts from its folder.
        packing : mapping, optional
            A section [packing] in place of that of the file, which may name a file that does not exist yet.
        command : str, optional
            The command, or the task of a sweep, that reads the scene: the scene then has the sections that it reads
            (:mod:`faultgouge.pywrap.scenes.command_sections`). By default all.

        Raises
        ------
        SceneError
            If the file cannot be read, is not TOML, or does not describe a scene that can be run.
        """
        path = Path(path)
        mapping = read_toml(path, "scene")
        whole = mapping if packing is None else mapping | {"packing": packing}
        return cls.from_mapping(whole, path.parent, command, str(path))

    @classmethod
    def from_mapping(
        cls, mapping: Mapping[str, Any], folder: str | Path = ".", command: str | None = None, name: str = "scene"
    ) -> Scene:
        """Make a scene from a mapping with the contents of a TOML file; errors as those of `from_toml`.

        Parameters
        ----------
        mapping : mapping
            Sections by name, keys and values in them as in TOML; `resolved` gives such a mapping.
        folder : str or Path
            The folder to which a relative packing.file refers.
        command, name : str, optional
            As in `from_toml`, and what errors call the scene.
        """
        if not isinstance(mapping, Mapping):
            raise SceneError(f"{name}: a scene maps the names of sections to their keys: give a dict.")
        wanted, context = command_of(command), dict[str, Any](folder=Path(folder))
        alone = {key: model for key in mapping if key not in SECTIONS and (model := study_model(str(key)))}
        sections = SECTIONS | {key: (model,) for key, model in alone.items()}
        # keys of all sections are checked, and first: a misspelled name makes the right one missing, too
        for section, keys in mapping.items():
            path = [] if section in sections or section in cls.model_fields else [str(section)]
            if section in sections and isinstance(keys, Mapping):
                known = {key for model in sections[section] for key in model.model_fields}
                path = next(([section, str(key)] for key in keys if key not in known), [])
            if path:
                raise SceneError(f"{name}: {unknown_key(path, SECTIONS | study_models())}.")
        try:
            mapping = mapping if wanted is None else wanted.part(mapping)
            if "units" in mapping:
                mapping = in_units(mapping, context)
            if wanted is not None and "perturb" not in wanted.reads:
                alone["perturb"] = Inertia
            # sections that a scene has of others: of keywords that are known at run time alone, which no overload has
            models = {key: (model, ...) for key, model in alone.items() if key in mapping}
            found = dict(create_model("Part", **models).model_validate(mapping, context=context))  # type: ignore[call-overload]  # see above
            context["inertia"] = found.pop("perturb", Inertia())
            own = {key: section for key, section in mapping.items() if key not in alone}
            scene = cls.model_validate(own | found, context=context)
        except PydanticCustomError as error:
            raise SceneError(f"{name}: {error}.") from None
        except ValidationError as error:
            first = min(error.errors(), key=lambda each: each["type"] != "extra_forbidden")
            raise SceneError(f"{name}: {sentence(first, sections)}.") from None
        for need in wanted.needs if wanted else ():
            require_section(getattr(scene, need, None), need)
        return scene

    @property
    def files(self) -> dict[str, tuple[Path, ...]]:
        """The files that the scene names, by section.key; of a dump also those beside it."""
        sections = ((name, getattr(self, name)) for name in type(self).model_fields)
        named = ((name, files_named(each)) for name, each in sections if isinstance(each, Section))
        return {f"{name}.{key}": paths for name, found in named for key, paths in found.items()}

    def digests(self) -> dict[str, str]:
        """SHA-256 of the contents of these files, by section.key."""
        texts = {key: b"".join(map(read_plain, paths)) for key, paths in self.files.items()}
        return {key: hashlib.sha256(text).hexdigest() for key, text in texts.items()}

    def resolved(self) -> dict[str, Any]:
        """Every key with its value, defaults included, as plain numbers, strings, lists and dicts; without what is
        None.

        `Scene.from_mapping(scene.resolved())` equals the scene: k_t is a number and packing.file an absolute path.
        """
        sections: dict[str, Any] = self.model_dump(mode="json", exclude_none=True)
        inertia = self._inertia.model_dump(exclude_defaults=True)
        return {**({"perturb": inertia} if inertia else {}), **sections}


SECTIONS = {name: models for name, field in Scene.model_fields.items() if (models := sections_in(field.annotation))}


def scene_of(scene: object, command: str) -> Scene:
    """The scene that a function is given, or that of a file, of which it reads what the command of its name reads."""
    if isinstance(scene, Scene):
        return scene
    if isinstance(scene, (str, Path)):
        return Scene.from_toml(scene, command=command)
    raise SceneError(f"{command} takes a Scene, or the path of its .toml file, and no {type(scene).__name__}.")
