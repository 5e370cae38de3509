"""The section [packing] of a scene: disks from a seed, or from a file."""

import os
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias

import numpy as np
from pydantic import Discriminator, Field, Tag, ValidationInfo, field_validator, model_validator

from ...analysis import BadInputError, MindlinLaw, Packing, PackingFileError, RunFile
from ...analysis.arrays import Floats
from ...analysis.files.formats import Disks, is_hdf5, packing_of, upper_layer
from ..lammps.restart_file import read_disks
from .random_start import layer_size, random_start
from .validation import FORCE, LENGTH, MASS, STIFFNESS, NamesFile, Positive, Section, refusal_sentence, refuse


class SettlingLoad(Section):
    """packing.settle_at: F_y and k_n under which a packing settles; what is left out is the scene's.

    Only the ratio of k_n to F_y matters.
    """

    fy: Annotated[Positive | None, FORCE] = None
    kn: Annotated[Positive | None, STIFFNESS] = None


class GeneratedPacking(Section):
    """[packing] from a seed: a loose start of disks of several sizes in equal shares, settled under the load.

    Attributes
    ----------
    disks, radii, seed : int, tuple of float, int
        Number of disks, the upper layer included; radii, each of an equal share; seed of the loose start, and of
        further ones, should the disks not come to rest from the first.
    width : float
        Width of the box. The paper gives none; this one makes 100 disks about square.
    top : int
        Disks of the upper layer: free disks, above all others at the start, the load on each. By default a tenth, and
        at least as many as fit side by side (`layer_size`). The paper gives no number.
    periodic : bool
        Whether x is periodic, which the paper does not say. With false the sides are open, and nothing holds the disks
        there: that is refused, unless the packing is one row of disks, all of the upper layer.
    settle_friction : bool
        False: settled without friction, which then starts with zero slips, so that K is symmetric at F_x = 0. True:
        with friction, so that the packing carries tangential load from the start. The paper does not say which.
    settle_at : SettlingLoad or None
        The load under which the packing settles, before it is carried to the scene's: scenes that differ in their load
        or their stiffness then have one packing.
    masses, mass : {"equal", "spheres"}, float or None
        Equal masses, as in the paper, or as the cube of the radius; mass of the smallest disks, by default one.
    """

    disks: int = Field(100, gt=0, le=10_000_000)
    radii: Annotated[tuple[Positive, ...], Field(min_length=1, strict=False), LENGTH] = (0.5, 0.7)
    width: Annotated[Positive, LENGTH] = 11.9
    # the default becomes a number in the validator, which knows disks, radii and width
    top: int = Field(None, gt=0)  # type: ignore[assignment]  # see above
    seed: int = Field(7, ge=0, lt=2**63)
    periodic: bool = True
    settle_friction: bool = False
    settle_at: SettlingLoad | None = None
    masses: Literal["equal", "spheres"] = "equal"
    mass: Annotated[Positive | None, MASS] = None

    @field_validator("top", mode="before")
    @classmethod
    def _layer(cls, top: object, info: ValidationInfo) -> object:
        if top is not None:
            return top
        known = {"disks", "radii", "width"} <= info.data.keys()  # else one of them is refused, and that gets reported
        return layer_size(info.data["disks"], info.data["radii"], info.data["width"]) if known else 1

    @model_validator(mode="after")
    def _fits(self) -> "GeneratedPacking":
        refuse(self.top > self.disks, "top", f"= {self.top} is more than all {self.disks} disks: lower it")
        cutoff = 2 * max(self.radii)
        says = f"= {self.width} is under two cutoffs of one largest diameter, {2 * cutoff}: widen the box"
        refuse(self.periodic and self.width < 2 * cutoff, "width", says)
        open_ = not self.periodic and (self.top < self.disks or self.disks * cutoff > self.width)
        says = "leaves the sides open, and nothing holds the disks there: leave it out, or give packing.file"
        refuse(open_, "periodic", f"= false {says}")
        return self

    def start(self, draw: int = 0) -> Disks:
        """The loose start that this section describes, or a later one of its seed."""
        return random_start(self.disks, self.radii, self.top, self.width, self.seed, periodic=self.periodic, draw=draw)

    def mass_of(self, radius: Floats) -> Floats:
        """Masses of disks, shape (N,)."""
        power = 3 if self.masses == "spheres" else 0
        return np.asarray((self.mass or 1.0) * (radius / min(self.radii)) ** power)


class StoredPacking(Section):
    """[packing] from a file.

    Attributes
    ----------
    file : Path
        A run.h5, of which the first frame is taken, or a file of another code as `faultgouge import` takes it. Relative
        to the folder of the scene's file in a scene; here it is absolute.
    top, frame : int or str, int
        Not of a run.h5: the upper layer, where the file does not say it, or other than it says (a count of the highest,
        "type:2", "ids:1,4,7-9", or a region such as "y>10"), and which of several frames, by default the last.
    """

    file: Annotated[Path, Field(strict=False), NamesFile()]
    top: Annotated[int | str | None, NamesFile()] = None
    frame: int | None = None

    @field_validator("file")
    @classmethod
    def _absolute(cls, file: Path, info: ValidationInfo) -> Path:
        folder: Path = (info.context or {}).get("folder", Path())
        return Path(os.path.realpath(folder / file))  # Path.resolve fails on a loop of links

    @model_validator(mode="after")
    def _readable(self) -> "StoredPacking":
        try:
            if not is_hdf5(self.file):
                upper_layer(read_disks(self.file, self.frame), self.top, "packing.top = ")
            elif self.top is not None or self.frame is not None:
                raise BadInputError("a run.h5 is taken as it is, with its first frame: leave top and frame out")
        except (OSError, PackingFileError, BadInputError) as error:
            cause = getattr(error, "strerror", None)
            says = f"cannot be read at {self.file} ({cause}): correct the name"
            says = says if cause else f"is refused: {str(error).rstrip('.')}"
            raise refusal_sentence("file", f'= "{self.file.name}" {says}') from None
        return self

    def packing(self, law: MindlinLaw, **more: Any) -> Packing:
        """The packing of the file under a law; `more` are its fy, inertia_factor and drag_time.

        Contacts of which the file has no slips begin without, by definition of the scene. Slips that the file itself
        calls unknown remain unknown. Raises PackingFileError if the file has no equilibrium, or no packing.
        """
        if not is_hdf5(self.file):
            disks = read_disks(self.file, self.frame)
            found = packing_of(disks, law, upper_layer(disks, self.top), **more)
            return replace(found, slips_known=bool(disks.given.get("slips_known", True)))
        with RunFile(self.file) as run:
            if len(run) == 0:
                raise PackingFileError(f"{self.file} has no equilibrium in it")
            return replace(run.packing(0), law=law, spring=0.0, **more)

    @property
    def disks(self) -> int:
        """Number of disks."""
        return len(self.packing(MindlinLaw(kn=1.0, kt=0.0, mu=0.0)))


def _kind(section: Any) -> str:
    """The tag of a section [packing]."""
    stored = "file" in section if isinstance(section, Mapping) else isinstance(section, StoredPacking)
    return "stored" if stored else "generated"


PackingSection: TypeAlias = Annotated[
    Annotated[GeneratedPacking, Tag("generated")] | Annotated[StoredPacking, Tag("stored")], Discriminator(_kind)
]
"""[packing], from a seed or from a file."""
