"""A page that shows a ramp, an undamped run or one packing in a browser, without a network: `faultgouge view`.

The page is one file: numbers as JSON, arrays in base64, and the scripts of the folder `view`, which draw them.
:mod:`.followed_pairs` finds the pairs of eigenvalues. Arrays are for drawing: positions are float32, and the shape of a
mode is 8 bits a coordinate.
"""

import base64
import json
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, FunctionLoader, StrictUndefined
from matplotlib.colors import to_hex
from numpy.typing import ArrayLike

from faultgouge.analysis import Packing, Stability
from faultgouge.analysis.arrays import Floats
from faultgouge.analysis.counted import counted
from faultgouge.analysis.files.atomic_write import write_text
from faultgouge.analysis.has_configuration import HasConfiguration
from faultgouge.analysis.motion.hysteresis import layer_displacement, turning_points

from .followed_pairs import SECONDS_OF_1000, FollowedPair, Progress, RampEigenvalues, follow_eigenvalues
from .images import Images
from .packing_artist import LEAST_SHARE, PackingArtist
from .pair import curve_through
from .style import BULK, EDGE, FLOOR, INK, MOBILIZATION, UPPER

BYTES_OF_MODES = 1.2e6
"""Bytes for the shapes of modes: the page of 100 disks and 60 loads has room for 33 pairs, and less than 3 MB."""

FACES = ["#ffffff", BULK, UPPER, FLOOR]
"""Colours of disks: rattlers, others, the upper layer, those that are held."""

FEWEST_ON_PAGE, MOST_ON_PAGE = 4, 40
"""Pairs of a page, at least and at most."""


@dataclass(frozen=True, eq=False)
class Axis:
    """The quantity that changes from one packing of a page to the next.

    Attributes
    ----------
    name : str
        Its symbol.
    meaning : str
        What it is, in words.
    values : ndarray, shape (S,)
        Its value for each packing.
    """

    name: str
    meaning: str
    values: Floats

    @classmethod
    def of_loads(cls, packings: Sequence[HasConfiguration]) -> "Axis":
        """The shear force of a ramp; a load parameter of other codes."""
        values = np.array([packing.fx for packing in packings])
        layer = packings[0].top.any()
        return cls("Fₓ", "force on each disk of the upper layer" if layer else "the load", values)


def equally_spaced(count: int, most: int) -> list[int]:
    """Which of some equilibria a page shows: all, or so many of them, the first and the last among these."""
    return sorted({round(k) for k in np.linspace(count - 1, 0, min(count, most))})


def loads_shown(disks: int) -> int:
    """How many loads a page of so many disks has by default: 60, or as many as take a minute, but six at least."""
    return max(min(60, round(60 / SECONDS_OF_1000 * (1000 / disks) ** 3)), 6)


def write_view(
    packings: Sequence[HasConfiguration],
    path: Path,
    title: str,
    series: dict[str, Any] | None = None,
    progress: Progress = iter,
    axis: Axis | None = None,
) -> None:
    """Write the page.

    Parameters
    ----------
    packings : sequence of Packing or Configuration
        Equilibria along their path, all with the same particles.
    series : dict, optional
        Columns time and msd of an undamped run from the last equilibrium.
    axis : Axis, optional
        What changes from packing to packing; the load by default.
    """
    axis = Axis.of_loads(packings) if axis is None else axis
    followed = follow_eigenvalues(packings, progress)
    opens = _best_frame(followed.verdicts)
    room = BYTES_OF_MODES / (2 * packings[0].coordinates * len(packings))
    pairs = followed.pairs[: int(np.clip(room, FEWEST_ON_PAGE, MOST_ON_PAGE))]
    legs = _legs(axis.values) if len(packings) > 1 else []
    cycle = _cycle([each for each in packings if isinstance(each, Packing)])
    images = [Images.of(packing) for packing in packings]
    data = {
        "axis": {"name": axis.name} if legs else None,
        "legs": [leg.tolist() for leg in legs],
        "opens": opens,
        "dissipative": any(verdict.dissipative for verdict in followed.verdicts),
        "frames": [_frame(packing, axis, images[k], followed, k) for k, packing in enumerate(packings)],
        "pairs": [_pair(pair, axis, legs) for pair in pairs],
        "cycle": cycle,
        "series": None if series is None else _series(series),
        **_scene(packings, images),
    }
    page = _template().render(
        title=title,
        axis=axis if legs else None,
        count=len(packings),
        opens=opens,
        dissipative=data["dissipative"],
        grows=any(verdict.undamped.growth_rate for verdict in followed.verdicts),
        cycle=cycle is not None,
        series=series is not None,
        gradient=", ".join(_colours(8)),
        legend=_legend(packings[0]),
        data=json.dumps(data, separators=(",", ":"), default=_encode, allow_nan=False).replace("<", "\\u003c"),
    )
    write_text(path, page)


def _template() -> Any:
    folder = files(__package__ or "") / "view"
    loader = FunctionLoader(lambda name: (folder / name).read_text(encoding="utf-8"))
    environment = Environment(loader=loader, undefined=StrictUndefined, autoescape=True, trim_blocks=True)
    return environment.get_template("page.html.j2")


def _best_frame(verdicts: Sequence[Stability]) -> int:
    """Where the page opens: the fastest growth of a packing that rests, else of any; the last one if nothing grows."""
    unstable = [verdict.growth_rate if verdict.stable is False else 0.0 for verdict in verdicts]
    not_stable = [0.0 if verdict.stable else verdict.growth_rate for verdict in verdicts]
    without = [verdict.undamped.growth_rate for verdict in verdicts]
    for rates in (unstable, not_stable, without):
        if max(rates) > 0:
            return int(np.argmax(rates))
    return len(verdicts) - 1


SINGLE = np.finfo(np.float32)


def _legs(values: Floats) -> list[np.ndarray]:
    """Numbers of the packings on each part of the path on which the axis rises, or falls."""
    ends = [0, *turning_points(values), len(values) - 1]
    return [np.arange(a, b + 1) for a, b in pairwise(ends)]


def _array(values: ArrayLike, kind: str) -> dict[str, str]:
    """An array as `page.js` decodes it; in doubles where single precision overflows or loses it, in any units."""
    size = np.abs(np.asarray(values))[np.isfinite(values)] if kind == "f4" else np.zeros(0)
    if np.any(size > SINGLE.max) or np.any((size > 0) & (size < SINGLE.tiny)):
        kind = "f8"
    return {"type": kind, "base64": base64.b64encode(np.asarray(values, dtype=f"<{kind}").tobytes()).decode()}


def _encode(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else _array(value, "f4")


def _frame(packing: HasConfiguration, axis: Axis, images: Images, followed: RampEigenvalues, k: int) -> dict[str, Any]:
    """The part of the page's data that belongs to one packing."""
    verdict, contacts, force = followed.verdicts[k], packing.configuration.contacts, packing.normal_force
    share = np.log(np.maximum(packing.mobilised, LEAST_SHARE)) / np.log(LEAST_SHARE)
    faces = PackingArtist.faces(packing)
    return {
        "value": float(axis.values[k]),
        "force": packing.fx if packing.top.any() else None,
        "stable": verdict.stable,
        "sentences": sentences_of(verdict),
        "pairs": verdict.undamped.pairs,
        "rate": verdict.growth_rate,
        "undamped": verdict.undamped.growth_rate,
        "place": _array(images.place, "f4"),
        "disk": _array(images.particle, "u2"),
        "face": _array([FACES.index(to_hex(face)) for face in faces], "u1"),
        "angle": _array(getattr(packing, "angle", np.zeros(len(packing))), "f4"),
        "bars": _array(images.bar, "f4"),
        "i": _array(contacts.i[images.contact], "i2"),
        "j": _array(contacts.j[images.contact], "i2"),
        "width": _array((force / force.max(initial=np.finfo(float).tiny))[images.contact], "f4"),
        "share": _array(np.clip(255 * (1 - share), 0, 255)[images.contact], "u1"),
        "re": _array(followed.values[k].real, "f4"),
        "im": _array(followed.values[k].imag, "f4"),
    }


def sentences_of(verdict: Stability) -> list[str]:
    """Sentences of a page: the verdict, the eigenvalues without dissipation, and contacts at Coulomb's bound."""
    undamped, contacts = verdict.undamped, verdict.at_bound
    kinds = (
        (undamped.pairs, "pair of eigenvalues", "pairs of eigenvalues", "complex"),
        (undamped.negative, "eigenvalue", "eigenvalues", "negative"),
    )
    found = [f"{counted(count, one, many)} {_is(count)} {kind}" for count, one, many, kind in kinds if count]
    says = [verdict.sentences[0], *([" and ".join(found)] if found else [])]
    if found and verdict.dissipative:
        says[1] = f"without dissipation {says[1]}, D would grow as exp({undamped.growth_rate:.3g} t)"
    if contacts:
        says.append(f"{counted(contacts, 'contact')} {_is(contacts)} at Coulomb's bound")
    says += verdict.remarks
    return [f"{each[0].upper()}{each[1:]}." for each in says]


def _is(count: int) -> str:
    return "is" if count == 1 else "are"


def _pair(pair: FollowedPair, axis: Axis, legs: Sequence[np.ndarray]) -> dict[str, Any]:
    """The eigenvalues of a pair at the packings, the curves through them, and the shapes of its modes."""
    mean, square = _mean_and_square(pair.eigenvalues)
    curves = []
    for leg in legs:
        load, values = curve_through(axis.values[leg], pair.eigenvalues[leg])
        along_mean, along_square = _mean_and_square(values)
        curves.append({"load": load, "mean": along_mean, "square": along_square})
    shapes = [_shape(pair, k) if np.isfinite(each) else None for k, each in enumerate(mean)]
    return {"mean": _array(mean, "f4"), "square": _array(square, "f4"), "curves": curves, "shapes": shapes}


def _mean_and_square(eigenvalues: np.ndarray) -> tuple[Floats, Floats]:
    """Mean of both members, and the square of their difference."""
    return eigenvalues.mean(axis=1).real, ((eigenvalues[:, 0] - eigenvalues[:, 1]) ** 2).real


def _shape(pair: FollowedPair, k: int) -> dict[str, Any]:
    """Two rows of 8 bits, with their scales: real and imaginary part of a complex mode, or two real modes."""
    first, second = pair.modes[k]
    rows = np.stack([first.real, first.imag if pair.eigenvalues[k, 0].imag else second.real])
    largest = np.abs(rows).max(axis=(1, 2)) / 127
    whole = np.rint(np.divide(rows, largest[:, None, None], out=np.zeros_like(rows), where=largest[:, None, None] > 0))
    return {"scale": largest.tolist(), "rows": _array(whole, "i1")}


def _cycle(packings: Sequence[Packing]) -> dict[str, list[float]] | None:
    """F_x and the displacement of the upper layer; None of a single packing."""
    if len(packings) < 2:
        return None
    return {"moved": layer_displacement(packings)[:, 0].tolist(), "force": [packing.fx for packing in packings]}


def _series(series: dict[str, Any]) -> dict[str, Any]:
    """The positive D(t) of an undamped run."""
    seen = series["msd"] > 0
    return {name: series[name][seen] for name in ("time", "msd")}


def _colours(count: int) -> list[str]:
    return [to_hex(MOBILIZATION(k / (count - 1))) for k in range(count)]


def _legend(packing: HasConfiguration) -> str:
    """Meaning of the colours of the particles, in words."""
    kinds = ["White: rattlers, which touch nothing."] if len(packing.rattlers) else []
    configuration = packing.configuration
    if packing.top.any():
        kinds.insert(0, "Yellow: upper layer.")
    elif configuration.contacts.wall.any() or not configuration.free.all():
        kinds.insert(0, "Red: walls, and particles that are held.")
    if packing.configuration.dimension == 3:
        kinds.append("Drag to turn.")
    return " ".join([*kinds, "Width of a bar: normal force."])


def _scene(packings: Sequence[HasConfiguration], images: Sequence[Images]) -> dict[str, Any]:
    """The part that all packings of a page share: the particles, the colours and the frame of the picture."""
    return {
        "dimension": images[0].dimension,
        "radius": packings[0].radius,
        "faces": FACES,
        "colours": _colours(256),
        "edge": EDGE,
        "ink": INK,
        "wall": FLOOR,
        **Images.frame(images),
    }
