"""Read a packing from a file of any kind."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import wraps
from pathlib import Path
from typing import Any, Concatenate, ParamSpec, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from .analysis import BadInputError, Configuration, MindlinLaw, Packing, RunFile, Stability, read_dump
from .analysis import elastic_moduli as moduli_of_packing
from .analysis import spectrum as spectrum_of_packing
from .analysis import stability as stability_of_packing
from .analysis import stress as stress_of_packing
from .analysis import vibrations as vibrations_of_packing
from .analysis.files.configuration_file import holds_configuration, read_configuration
from .analysis.files.formats import Disks, is_hdf5, packing_of, upper_layer
from .analysis.files.formats.lammps_dump import dump_frames
from .analysis.files.runfile import law_of_parameters
from .analysis.has_configuration import HasConfiguration


def load(
    file: str | Path,
    frame: int = -1,
    *,
    law: MindlinLaw | None = None,
    fy: float | None = None,
    fx: float | None = None,
    top: str | int | None = None,
    width: float | None = None,
) -> Packing | Configuration:
    """Read a packing of any file.

    Parameters
    ----------
    file : str or Path
        A run.h5 or a drive.h5; the dumps that decks write (NAME.disks); a LAMMPS deck (NAME.in, in.NAME), which is
        run; or disks of another code (docs/howto_own_packing.md), as they stand, for which law and load are given.
    frame : int
        Number of the equilibrium, or of the dump; negative numbers count from the last.
    law : MindlinLaw, optional
        The contact law of disks of another code; that of the file by default, where `faultgouge export` wrote it.
    fy, fx : float, optional
        Their load on each disk of the upper layer, force; that of the file by default, and fx = 0.
    top : str or int, optional
        Their upper layer, where the file does not say which it is: the number of its disks, 0 for none, or as
        `faultgouge import --top` has it.
    width : float, optional
        Their period along x, length, where the file does not say it; open sides by default.

    Returns
    -------
    Packing or Configuration
        A Configuration of what LAMMPS moved by its own laws.

    Raises
    ------
    BadInputError
        If the file does not say law, load or upper layer, and they are not given.
    PackingFileError
        If the file is missing, damaged, or of no known format.

    Examples
    --------

    >>> from faultgouge.analysis import MindlinLaw
    >>> faultgouge.load("disks.csv", law=MindlinLaw(kn=2e5, kt=6e4, mu=0.5), fy=1.0, top=6, width=6.0)
    <Packing: 18 disks, 22 contacts, 6 in the upper layer, period 6, mu = 0.5, fx = 0, fy = 1>
    """
    path = path_of(file, "load")
    if path.suffix == ".disks":
        return read_dump(path, frame=frame)
    if path.suffix == ".in" or path.name.startswith("in."):
        from .pywrap.granular.run_deck import run_deck

        return run_deck(path)
    if holds_configuration(path):
        return read_configuration(path)
    if path.suffix == ".h5" or (path.is_file() and is_hdf5(path)):
        with RunFile(path) as run:
            return packing_in(run, frame)
    disks = _read_disks(path, frame)
    if width is not None:
        disks = replace(disks, box_length=width)
    given = disks.given
    law = law_of_parameters(given) if law is None and {"kn", "kt", "mu"} <= given.keys() else law
    fy = given.get("fy") if fy is None else fy
    missing = [name for name, value in (("law", law), ("fy", fy)) if value is None]
    if law is None or fy is None:
        raise BadInputError(
            f"{path} does not say {' and '.join(missing)}: load({path.name!r}, law=MindlinLaw(kn, kt, mu), fy=3.0, "
            "top=10) takes the disks as they stand, and `faultgouge import` brings them to rest."
        )
    inertia_factor, drag_time = given.get("inertia_factor", 1.0), given.get("tau")
    load = {"fx": given.get("fx", 0.0) if fx is None else fx, "fy": fy, "inertia_factor": inertia_factor}
    if top == 0:
        layer = np.zeros(len(disks), dtype=np.bool_)
    else:
        layer = disks.top if top is None and disks.top is not None else upper_layer(disks, top)
    return packing_of(disks, law, layer, drag_time=drag_time, **load)


class frames(Sequence["Packing | Configuration"]):  # noqa: N801  # a function to its users, as `range` is
    """The packings of a file, each read when it is asked for.

    Parameters
    ----------
    file : str or Path
        As for `load`.

    Examples
    --------
    >>> found = faultgouge.frames("run.h5")
    >>> len(found), round(found[-1].fx, 3)
    (25, 2.4)
    >>> [round(packing.fx, 3) for packing in found[:3]]
    [0.0, 0.1, 0.2]
    """

    def __init__(self, file: str | Path) -> None:
        self.path = path_of(file, "frames")
        if self.path.suffix == ".disks":
            self._count = sum(1 for _ in dump_frames(self.path))
        elif self.path.suffix == ".h5" and not holds_configuration(self.path):
            with RunFile(self.path) as run:
                self._count = len(run)
        else:
            load(self.path)
            self._count = 1

    def __len__(self) -> int:
        return self._count

    def __getitem__(self, number: Any) -> Any:
        chosen = range(self._count)[number]
        return [load(self.path, each) for each in chosen] if isinstance(number, slice) else load(self.path, chosen)

    def __repr__(self) -> str:
        return f"<frames of {self.path}: {self._count}>"


def path_of(file: object, caller: str) -> Path:
    """The path that a function is given; a BadInputError if it is none."""
    if isinstance(file, (str, Path)):
        return Path(file)
    raise BadInputError(f"{caller} takes the path of a file, and no {type(file).__name__}.")


Options = ParamSpec("Options")
Result = TypeVar("Result")


def takes_file(
    function: Callable[Concatenate[HasConfiguration, Options], Result],
) -> Callable[Concatenate[HasConfiguration | str | Path, Options], Result]:
    """A function of a packing that also takes the path of a stored one, of which it takes the last."""
    name = function.__name__.removesuffix("_packing")

    @wraps(function)
    def opens(packing: Any, *args: Options.args, **options: Options.kwargs) -> Result:
        if isinstance(packing, (str, Path)):
            packing = load(packing)
        elif not hasattr(packing, "configuration"):
            advice = ": give its .packing" if hasattr(packing, "packing") else ""
            raise BadInputError(
                f"{name} takes a Packing, a Configuration, or the path of a stored one, and no "
                f"{type(packing).__name__}{advice}."
            )
        return function(packing, *args, **options)

    return opens


@takes_file
def stability(
    packing: HasConfiguration,
    rise: str | ArrayLike | None = None,
    time: float | None = None,
    *,
    follow: Any = None,
    **known: Any,
) -> Stability:
    """Whether a packing moves; see :func:`faultgouge.analysis.stability`.

    Parameters
    ----------
    packing : Packing, Configuration, str or Path
        The equilibrium, or a file with it.
    rise, time, **known
        As there.
    follow : bool or lammps.lammps, optional
        Whether LAMMPS goes on where motion grows, until it vibrates, creeps or flows (`Stability.follow`): True of a
        Packing, which the plugin moves, or the instance of which a Configuration was taken.

    Examples
    --------

    >>> *_, last = faultgouge.ramp("three_disks.toml")
    >>> found = faultgouge.stability(last.packing)
    >>> found.stable, round(found.growth_rate, 3), found.at_bound
    (False, 7.07, 1)
    >>> print(str(found).splitlines()[0])
    unstable: small motion grows, D as exp(7.07002 t)
    """
    if follow is None or follow is False:
        return stability_of_packing(packing, rise, time, **known)
    from .pywrap.granular.growth_followed import follow_by

    followed = follow_by(packing, None if follow is True else follow)
    return stability_of_packing(packing, rise, time, follow=followed, **known)


spectrum = takes_file(spectrum_of_packing)
stress = takes_file(stress_of_packing)
elastic_moduli = takes_file(moduli_of_packing)
vibrations = takes_file(vibrations_of_packing)


def packing_in(run: RunFile, frame: int = -1) -> Packing:
    """The packing of a frame; of a drive.h5 with the spring that draws its layer."""
    packing = run.packing(frame)
    if run.attributes.get("task") != "drive":
        return packing
    from .pywrap.runs.drive import drive_of

    settings = drive_of(run)
    return packing if settings is None or settings.spring == "rigid" else replace(packing, spring=settings.spring)


def _read_disks(path: Path, frame: int) -> Disks:
    from .pywrap.lammps.restart_file import read_disks

    return read_disks(path, None if frame == -1 else frame)
