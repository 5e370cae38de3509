"""A scene: what is wanted, in TOML, checked in full before any work is done.

    precision = "double"          # of the coordinates
    [packing]   the disks and the box: generated from a seed, or read from a file
    [law]       k_n, k_t and the friction coefficient mu
    [load]      the force F_y that presses each disk of the upper layer down
    [relax]     damped dynamics: friction against the medium and time step
    [ramp]      F_x raised from equilibrium to equilibrium
    [perturb]   an undamped run at one F_x, with or without a forcing a cos(omega t)
    [friction]  mu(v) that falls with the velocity v of the upper layer
    [output]    what is written beside the result

packing, law and load are needed; of the others, one that is absent is a feature that is not in the run. The
units are the user's own: k_n and k_t are force / length^(3/2), and the paper's numbers take the mass of a
disk and the diameter of a small disk as units. Defaults are the paper's values where it gives one; the
docstrings say where it does not.
"""

import re
import reprlib
import sys
from collections.abc import Mapping
from difflib import get_close_matches
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias, TypeGuard

from pydantic import (
    BaseModel,
    ConfigDict,
    Discriminator,
    Field,
    Tag,
    ValidationError,
    ValidationInfo,
    field_validator,
    model_validator,
)
from pydantic_core import ErrorDetails, PydanticCustomError

from ..analysis import MindlinLaw, PackingFileError, read_packing
from .loose import Start, layer_size, loose_start

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

Positive: TypeAlias = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative: TypeAlias = Annotated[float, Field(ge=0, allow_inf_nan=False)]

FLOAT_MAX = sys.float_info.max
HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"


class SceneError(ValueError):
    """A scene that cannot be run: one sentence that says what is wrong, where, and what to do."""


class _Section(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, validate_default=True)


class GeneratedPacking(_Section):
    """[packing] from a seed: a loose start of disks of several sizes in equal shares, settled under the load.

    Attributes
    ----------
    disks : int
        Number of disks N, the upper layer included; at most ten millions, a slip of the pen beyond.
    radii : tuple of float
        Radii, length, each for an equal share of the disks, upper layer included.
    width : float
        Width of the box, length. The paper gives none; this one makes 100 disks about square.
    top : int
        Number of disks in the upper layer: free disks, above all others at the start, the load on each. By default a
        tenth of the disks, and at least as many as fit side by side (`loose.layer_size`). The paper gives no number.
    seed : int
        Seed of the loose start.
    periodic : bool
        Whether x is periodic, which the paper does not say; with false the sides are open and nothing holds
        the disks there.
    settle_friction : bool
        False: settled without friction, which then starts with zero slips, so that K is symmetric at F_x = 0.
        True: settled with friction, so that the packing carries tangential load from the start. The paper
        does not say which.
    """

    disks: int = Field(100, gt=0, le=10_000_000)
    radii: Annotated[tuple[Positive, ...], Field(min_length=1, strict=False)] = (0.5, 0.7)
    width: Positive = 11.9
    # the default becomes a number in the validator, which knows disks, radii and width
    top: int = Field(None, gt=0)  # type: ignore[assignment]
    seed: int = Field(7, ge=0)
    periodic: bool = True
    settle_friction: bool = False

    @field_validator("top", mode="before")
    @classmethod
    def _layer(cls, top: object, info: ValidationInfo) -> object:
        if top is not None:
            return top
        known = {"disks", "radii", "width"} <= info.data.keys()  # else one of them is refused, and that gets reported
        return layer_size(info.data["disks"], info.data["radii"], info.data["width"]) if known else 1

    @model_validator(mode="after")
    def _fits(self) -> "GeneratedPacking":
        if self.top > self.disks:
            raise _refusal("top", f"= {self.top} is more than the {self.disks} disks of the packing: lower it")
        cutoff = 2 * max(self.radii)
        if self.periodic and self.width < 2 * cutoff:
            says = f"= {self.width} is under two cutoffs of one largest diameter, {2 * cutoff}: widen the box"
            raise _refusal("width", says)
        try:
            self.start()
        except ValueError as error:
            raise _refusal("", f"is refused because {error}: widen the box, or take fewer disks") from None
        return self

    def start(self) -> Start:
        """The loose start that this section describes."""
        return loose_start(self.disks, self.radii, self.top, self.width, self.seed, periodic=self.periodic)


class StoredPacking(_Section):
    """[packing] from a file.

    Attributes
    ----------
    file : Path
        JSON as `analysis.read_packing` takes it, or a run.h5. In a scene, a relative path counts from the
        folder of the scene's file; here it is absolute.
    """

    file: Annotated[Path, Field(strict=False)]

    @field_validator("file")
    @classmethod
    def _readable(cls, file: Path, info: ValidationInfo) -> Path:
        folder: Path = (info.context or {}).get("folder", Path())
        path = (folder / file).resolve()
        try:
            with path.open("rb") as stream:
                head = stream.read(len(HDF5_SIGNATURE))
            if path.suffix == ".json":
                any_law = MindlinLaw(kn=1.0, kt=0.0, mu=0.0)  # the file says nothing about forces
                read_packing(path, any_law)
        except OSError as error:
            says = f"cannot be read at {path} ({error.strerror}): correct the name"
            raise _refusal("", f'= "{file}" {says}') from None
        except PackingFileError as error:
            raise _refusal("", f'= "{file}" is refused: {str(error).rstrip(".")}') from None
        if path.suffix != ".json" and head != HDF5_SIGNATURE:
            raise _refusal("", f'= "{file}" is neither HDF5 nor named .json: give a run.h5 or a packing.json')
        return path


class Law(_Section):
    """[law] of all contacts, floor included.

    Attributes
    ----------
    kn : float
        Normal stiffness, force / length^(3/2).
    kt : float
        Tangential stiffness, force / length^(3/2). A scene may also say "A/B kn", "A kn" or "kn". The
        default, "2/7 kn", is the paper's.
    mu : float or tuple of float
        Static friction coefficient; 0 means no tangential force at all. Of a list, `onset` and
        `reproduce` take every one and all else the first.
    """

    kn: Positive
    # the default is of the form that a scene gives, and becomes a number in the validator
    kt: NotNegative = Field("2/7 kn")  # type: ignore[assignment]
    mu: float | tuple[float, ...] = 1.0

    @model_validator(mode="before")
    @classmethod
    def _kt_has_kn(cls, section: Any) -> Any:
        if isinstance(section, Mapping) and "kt" in section and "kn" not in section:
            raise _refusal("kt", "stands without kn: give kn, in force / length^(3/2), as well")
        return section

    @field_validator("kt", mode="before")
    @classmethod
    def _share_of_kn(cls, kt: object, info: ValidationInfo) -> object:
        if not isinstance(kt, str):
            return kt
        if "kn" not in info.data:
            return 0.0  # kn is missing or refused, and that is what gets reported
        match = re.fullmatch(r"(?:(\d+(?:\.\d+)?)(?:/(\d+(?:\.\d+)?))? )?kn", kt.strip())
        numerator, denominator = (float(number or 1) for number in match.groups()) if match else (0.0, 0.0)
        if denominator == 0:
            raise _refusal("", f'= "{kt}" is no share of kn: give a number, or a share such as "2/7 kn"')
        return numerator * info.data["kn"] / denominator

    @field_validator("mu", mode="before")
    @classmethod
    def _one_or_several(cls, mu: object) -> object:
        several = tuple(mu) if isinstance(mu, (list, tuple)) else (mu,)
        if not several or not all(_is_number(value) and value >= 0 for value in several):
            raise _refusal("", f"= {mu!r} is refused: give a number of at least 0, or a list of such numbers")
        if len(set(several)) < len(several):
            raise _refusal("", f"= {mu!r} names one value twice: give each once")
        return several if isinstance(mu, (list, tuple)) else mu

    @property
    def mus(self) -> tuple[float, ...]:
        """Every friction coefficient that the scene asks for, in its order."""
        return self.mu if isinstance(self.mu, tuple) else (self.mu,)


class Load(_Section):
    """[load] on the upper layer.

    Attributes
    ----------
    fy : float
        Force F_y on each disk of the upper layer, downwards.
    """

    fy: Positive


class Relax(_Section):
    """[relax] damped dynamics, v = F / damping, of the ramp's method "overdamped".

    Attributes
    ----------
    damping : float
        Friction against the medium, mass / time. It sets the unit of the relaxation's time and leaves the
        equilibria as they are; the paper gives none.
    time_step : float or None
        Step, time. None: a third of the stable step of a disk whose contacts carry ten times F_y.
    """

    damping: Positive = 1.0
    time_step: Positive | None = None


class Ramp(_Section):
    """[ramp] of the force F_x on each disk of the upper layer, from 0.

    Attributes
    ----------
    step : float
        Increment of F_x.
    until : float
        Last F_x.
    method : {"newton", "overdamped"}
        How each equilibrium is found. The paper's is overdamped dynamics.
    force_tolerance : float or None
        Largest net force, and torque over radius, on a disk of an equilibrium, the paper's f_min; a force in
        the scene's units. None: what the rounding of the coordinates allows.
    """

    step: Positive = 1e-4
    until: Positive
    method: Literal["newton", "overdamped"] = "newton"
    force_tolerance: Positive | None = None

    @model_validator(mode="after")
    def _one_step_at_least(self) -> "Ramp":
        if self.step > self.until:
            raise _refusal("step", f"= {self.step} is larger than until = {self.until}: take a smaller step")
        return self


class Perturb(_Section):
    """[perturb] an undamped run from an equilibrium, and the forcing a cos(omega t) in it.

    Attributes
    ----------
    fx : float
        F_x of the equilibrium.
    time : float
        Length of the run, time.
    amplitude : float
        a, force on each forced disk along x; 0 means no forcing. The paper's is 1e-12.
    omega : float or None
        Angular frequency of the forcing, 1 / time. The paper's is 0.01.
    target : {"top", "all"} or tuple of int
        The forced disks: the upper layer, all, or those of the list, counted from 0. The paper does not say
        which.
    time_step : float or None
        Step of velocity Verlet, time. None: from the largest eigenvalue of K.
    inertia_factor : float
        I_0 in I = I_0 m R^2: 1 in the paper, 1/2 for a uniform disk. `Scene.inertia_factor` hands it to
        spectra and onsets as well.
    """

    fx: NotNegative
    time: Positive
    amplitude: NotNegative = 0.0
    omega: NotNegative | None = None
    target: Literal["top", "all"] | tuple[int, ...] = "top"
    time_step: Positive | None = None
    inertia_factor: Positive = 1.0

    @field_validator("target", mode="before")
    @classmethod
    def _group_or_disks(cls, target: object) -> object:
        if target in ("top", "all"):
            return target
        disks = tuple(target) if isinstance(target, (list, tuple)) else ()
        if not disks or not all(type(disk) is int and disk >= 0 for disk in disks):
            rule = 'give "top", "all" or a list of disks, counted from 0'
            raise _refusal("", f"= {target!r} is refused: {rule}")
        return disks

    @model_validator(mode="after")
    def _complete(self) -> "Perturb":
        if self.amplitude > 0 and self.omega is None:
            raise _refusal("omega", "is missing: an amplitude needs the frequency of its forcing")
        if self.time_step is not None and self.time < self.time_step:
            raise _refusal("time", f"= {self.time} is shorter than one step, {self.time_step}: run longer")
        return self


class Friction(_Section):
    """[friction] mu(v) = mu (B exp(-w (v - v_0)/v_ss) + mu_ss) for v > v_0, and mu below.

    Attributes
    ----------
    B, w, mu_ss : float
        Numbers of the law; mu(v) is continuous at v_0 if B + mu_ss = 1.
    v0 : float or "calibrated"
        Threshold of the mean velocity v of the upper layer. "calibrated": from an undamped run of the stable
        packing without forcing, as in the paper.
    v_ss : float or str
        Velocity over which mu falls, or a multiple of v_0 such as "10 v0". It has no default: the paper gives
        no value.
    """

    B: NotNegative = 0.2
    w: Positive = 0.4
    mu_ss: NotNegative = 0.8
    v0: NotNegative | Literal["calibrated"] = "calibrated"
    v_ss: Positive | str

    @model_validator(mode="before")
    @classmethod
    def _has_scale(cls, section: Any) -> Any:
        if isinstance(section, Mapping) and "v_ss" not in section:
            rule = 'give a velocity, or a multiple such as "10 v0"'
            raise _refusal("v_ss", f"is missing, and the paper gives no value: {rule}")
        return section

    @field_validator("v0", mode="before")
    @classmethod
    def _threshold(cls, v0: object) -> object:
        if v0 != "calibrated" and not (_is_number(v0) and v0 >= 0):
            raise _refusal("", f'= {v0!r} is refused: give a velocity of at least 0, or "calibrated"')
        return v0

    @field_validator("v_ss", mode="before")
    @classmethod
    def _scale(cls, v_ss: object, info: ValidationInfo) -> object:
        if not (_multiple_of_v0(v_ss) if isinstance(v_ss, str) else _is_number(v_ss) and v_ss > 0):
            rule = 'give a velocity above 0, or a multiple of v0 such as "10 v0"'
            raise _refusal("", f"= {v_ss!r} is refused: {rule}")
        if isinstance(v_ss, str) and info.data.get("v0") == 0:
            raise _refusal("", f'= "{v_ss}" is no velocity because v0 = 0: give a velocity above 0')
        return v_ss

    def velocity_scale(self, v0: float) -> float:
        """v_ss for a threshold v0, velocity."""
        return _multiple_of_v0(self.v_ss) * v0 if isinstance(self.v_ss, str) else self.v_ss


class Output(_Section):
    """[output] beside run.h5.

    Attributes
    ----------
    trajectory : bool
        Whether undamped runs store configurations along the way.
    dumps : bool
        Whether LAMMPS writes its own per-disk and per-contact dumps.
    """

    trajectory: bool = False
    dumps: bool = False


def _kind_of_packing(section: Any) -> str:
    stored = "file" in section if isinstance(section, Mapping) else isinstance(section, StoredPacking)
    return "stored" if stored else "generated"


class Scene(_Section):
    """What is wanted, complete and consistent.

    Attributes
    ----------
    precision : {"double", "compensated"}
        Arithmetic of coordinates, slips and forces: doubles, or doubles with low parts, for forces that balance to
        1e-17 instead of 1e-11.
    packing, law, load, relax
        Sections that every scene has; relax may be left out in TOML.
    ramp, perturb, friction, output
        Sections or None, which means that the feature is not in the run.
    """

    precision: Literal["double", "compensated"] = "double"
    packing: Annotated[
        Annotated[GeneratedPacking, Tag("generated")] | Annotated[StoredPacking, Tag("stored")],
        Discriminator(_kind_of_packing),
    ]
    law: Law
    load: Load
    relax: Relax = Relax()
    ramp: Ramp | None = None
    perturb: Perturb | None = None
    friction: Friction | None = None
    output: Output | None = None

    @model_validator(mode="after")
    def _consistent(self) -> "Scene":
        perturb, ramp = self.perturb, self.ramp
        if perturb and ramp and perturb.fx > ramp.until:
            says = f"= {perturb.fx} lies beyond the last equilibrium, ramp.until = {ramp.until}: ramp further"
            raise _refusal("perturb.fx", says)
        if perturb and isinstance(perturb.target, tuple) and isinstance(self.packing, GeneratedPacking):
            beyond = [disk for disk in perturb.target if disk >= self.packing.disks]
            if beyond:
                says = f"names disk {beyond[0]}: name disks from 0 to {self.packing.disks - 1}"
                raise _refusal("perturb.target", says)
        if self.friction and self.law.mus[0] == 0:
            raise _refusal("friction", "has no mu to weaken: leave it out or give law.mu a value above 0")
        return self

    @classmethod
    def from_toml(cls, path: str | Path) -> "Scene":
        """Read a scene.

        Parameters
        ----------
        path : str or Path
            A TOML file. A relative packing.file in it counts from its folder.

        Returns
        -------
        Scene

        Raises
        ------
        SceneError
            If the file cannot be read, is no TOML, or does not describe a scene that can be run.
        """
        path = Path(path)
        try:
            mapping = tomllib.loads(path.read_text(encoding="utf-8"))
        except OSError as error:
            raise SceneError(f"{path}: the scene cannot be read ({error.strerror}): correct its path.") from None
        except ValueError as error:  # bytes that are not UTF-8, or text that is not TOML
            raise SceneError(f"{path}: the scene is not valid TOML: {error}.") from None
        return cls._checked(mapping, path.parent, str(path))

    @classmethod
    def from_mapping(cls, mapping: Mapping[str, Any], folder: str | Path = ".") -> "Scene":
        """Make a scene from what a TOML file would hold.

        Parameters
        ----------
        mapping : mapping
            Sections by name, keys and values in them as in TOML; `resolved` gives such a mapping.
        folder : str or Path
            The folder from which a relative packing.file counts.

        Returns
        -------
        Scene

        Raises
        ------
        SceneError
            If the mapping does not describe a scene that can be run.
        """
        return cls._checked(mapping, Path(folder), "scene")

    @classmethod
    def _checked(cls, mapping: Mapping[str, Any], folder: Path, name: str) -> "Scene":
        try:
            return cls.model_validate(mapping, context={"folder": folder})
        except ValidationError as error:
            # A misspelled name makes the right one missing, too: the misspelling is the cause.
            errors = sorted(error.errors(), key=lambda each: each["type"] != "extra_forbidden")
            raise SceneError(f"{name}: {_sentence(errors[0])}.") from None

    def resolved(self) -> dict[str, Any]:
        """Every key with its value, defaults included, as plain numbers, strings, lists and dicts.

        k_t is a number and packing.file an absolute path. What is None is left out, so that
        `Scene.from_mapping(scene.resolved())` equals the scene.
        """
        return self.model_dump(mode="json", exclude_none=True)

    @property
    def inertia_factor(self) -> float:
        """I_0 in I = I_0 m R^2 of dynamics, spectrum and onset alike: that of [perturb], or the paper's 1."""
        return self.perturb.inertia_factor if self.perturb else 1.0


SECTIONS: dict[str, tuple[type[BaseModel], ...]] = {
    "packing": (GeneratedPacking, StoredPacking),
    "law": (Law,),
    "load": (Load,),
    "relax": (Relax,),
    "ramp": (Ramp,),
    "perturb": (Perturb,),
    "friction": (Friction,),
    "output": (Output,),
}

RULES = {
    "greater_than": "give a number above {gt}",
    "greater_than_equal": "give a number of at least {ge}",
    "less_than_equal": "give a number of at most {le}",
    "finite_number": "give a finite number",
    "float_type": "give a number",
    "int_type": "give a whole number",
    "int_from_float": "give a whole number",
    "bool_type": "give true or false",
    "literal_error": "give {expected}",
    "path_type": "give the name of a file, in quotes",
    "tuple_type": "give a list of numbers",
    "too_short": "give at least one number",
}


def _refusal(key: str, says: str) -> PydanticCustomError:
    """An error of `key` of the section (or of the field, if empty) that is being checked."""
    return PydanticCustomError("refused", "{key} {says}", {"key": key, "says": says})


def _sentence(error: ErrorDetails) -> str:
    """One error of pydantic as: where, what is wrong, what to do."""
    kind, context = error["type"], error.get("ctx", {})
    path = [str(part) for part in error["loc"] if part not in ("generated", "stored")]
    if kind == "extra_forbidden":
        return _unknown_key(path, "stored" in error["loc"])
    place = ".".join([*path, *filter(None, [context.get("key")])])
    if kind == "refused":
        return f"{place} {context['says']}"
    if kind == "missing":
        what = f"{path[1]} to [{path[0]}]" if len(path) > 1 else f"the section [{place}]"
        return f"{place} is missing: add {what}"
    if not path:
        return "a scene maps the names of sections to their keys, and this one is no mapping: give a dict"
    if kind in ("model_type", "model_attributes_type", "dict_type"):
        return f"{place} is not a section: write [{place}] and its keys below"
    rule = RULES[kind].format(**context) if kind in RULES else error["msg"]
    return f"{place} = {reprlib.repr(error['input'])} is refused: {rule}"


def _unknown_key(path: list[str], stored: bool) -> str:
    *above, key = path
    homes = [name for name, models in SECTIONS.items() if any(key in model.model_fields for model in models)]
    if not above:
        if homes:
            return f"{key} stands outside of its section: move it below [{homes[0]}]"
        (nearest,) = get_close_matches(key, ["precision", *SECTIONS], 1, cutoff=0)
        return f"{key} is no key of a scene: the nearest is {nearest}"
    section = above[0]
    if section in homes and stored:
        return f"packing.{key} cannot stand beside packing.file, which decides it: leave one of them out"
    if homes:
        return f"{section}.{key} is no key of [{section}]: the nearest is {homes[0]}.{key}"
    keys = [name for model in SECTIONS[section] for name in model.model_fields]
    (nearest,) = get_close_matches(key, keys, 1, cutoff=0)
    return f"{section}.{key} is no key of [{section}]: the nearest is {section}.{nearest}"


def _is_number(value: object) -> TypeGuard[float]:
    # A comparison, because math.isfinite overflows on whole numbers, which TOML may hold of any size.
    return isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) < FLOAT_MAX


def _multiple_of_v0(text: str) -> float:
    """10 for "10 v0"; 0 for what is no multiple."""
    match = re.fullmatch(r"(?:(\d+(?:\.\d+)?(?:e\d+)?) )?v0", text.strip())
    return float(match[1] or 1) if match else 0.0
