"""A page that shows a ramp, an undamped run or one packing in a browser, without a network: `faultgouge view`.

The page is one file: numbers as JSON, arrays in base64, and the scripts of the folder `view`, which draw them.
:mod:`.followed_pairs` finds the pairs of eigenvalues. Arrays are for drawing: positions are float32, and the shape of a
mode is 8 bits a coordinate.
"""

import base64
import json
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.colors import to_hex
from numpy.typing import ArrayLike

from faultgouge.analysis import Configuration, Stability
from faultgouge.analysis.arrays import Floats
from faultgouge.analysis.counted import counted
from faultgouge.analysis.files.atomic_write import write_text
from faultgouge.analysis.has_configuration import HasConfiguration
from faultgouge.analysis.responses.hysteresis import layer_displacement, turning_points

from .disk_view import View, cut, in_box
from .followed_pairs import SECONDS_OF_1000, FollowedPair, Progress, RampEigenvalues, follow_eigenvalues, members_of
from .mode import displacement
from .packing import LEAST_SHARE, faces_of
from .pages import filled
from .pair import curve_through, mean_and_square
from .spheres import ENDS
from .style import BULK, EDGE, FLOOR, INK, MOBILIZATION, UPPER

BYTES_OF_MODES = 1.2e6
"""Bytes for the shapes of modes: the page of 100 disks and 60 loads has room for 33 pairs, and less than 3 MB."""

FACES = ["#ffffff", BULK, UPPER, FLOOR]
"""Colours of disks: rattlers, others, the upper layer, those that are held."""

FEWEST_ON_PAGE, MOST_ON_PAGE = 4, 40
"""Pairs of a page, at least and at most."""

SINGLE = np.finfo(np.float32)


class Axis(NamedTuple):
    """The quantity that changes from one packing of a page to the next: its symbol, what it is, and its values (S,)."""

    name: str
    meaning: str
    values: Floats


def loads_shown(count: int, disks: int, most: int | None = None) -> list[int]:
    """Which of some equilibria a page shows: all, or so many of them, the first and the last among these; by default
    60 at the most, or as many as take a minute, but six at least."""
    most = max(min(60, round(60 / SECONDS_OF_1000 * (1000 / disks) ** 3)), 6) if most is None else most
    return [round(k) for k in np.linspace(count - 1, 0, min(count, most))]


def write_view(
    packings: Sequence[HasConfiguration], path: Path, title: str, series: dict[str, Any] | None = None,
    progress: Progress = iter, axis: Axis | None = None,
) -> None:  # fmt: skip
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
    first = packings[0]
    meaning = "force on each disk of the upper layer" if first.top.any() else "the load"  # a parameter of other codes
    axis = axis or Axis("Fₓ", meaning, np.array([packing.fx for packing in packings]))
    followed = follow_eigenvalues(packings, progress)
    verdicts = followed.verdicts
    room = BYTES_OF_MODES / (2 * first.coordinates * len(packings))
    pairs = followed.pairs[: int(np.clip(room, FEWEST_ON_PAGE, MOST_ON_PAGE))]
    # on each part of the path the axis rises, or falls
    ends = [0, *turning_points(axis.values), len(packings) - 1] if len(packings) > 1 else []
    legs = [np.arange(a, b + 1) for a, b in pairwise(ends)]
    disks = [each for each in packings if each.law is not None] if len(packings) > 1 else []
    moved = layer_displacement(disks)[:, 0].tolist() if disks else []
    seen = {} if series is None else {name: series[name][series["msd"] > 0] for name in ("time", "msd")}
    images = [(_spheres if first.dimension == 3 else _disks)(packing) for packing in packings]
    # the page opens at the fastest growth of a packing that rests, else of any; at the last one if nothing grows
    rates = [[v.growth_rate if v.stable is False else 0.0 for v in verdicts]]
    rates += [[0.0 if v.stable else v.growth_rate for v in verdicts], [v.undamped.growth_rate for v in verdicts]]
    opens = next((int(np.argmax(each)) for each in rates if max(each) > 0), len(packings) - 1)
    data = {
        "axis": {"name": axis.name, "meaning": axis.meaning} if legs else None,
        "legs": [leg.tolist() for leg in legs],
        "opens": opens,
        "dissipative": any(verdict.dissipative for verdict in verdicts),
        "frames": [_frame(packing, axis, images[k], followed, k) for k, packing in enumerate(packings)],
        "pairs": [_pair(pair, axis, legs) for pair in pairs],
        "cycle": {"moved": moved, "force": [each.fx for each in disks]} if disks else None,
        "series": seen or None,
        "dimension": first.dimension,
        "radius": first.radius,
        "faces": FACES,
        "colours": _colours(256),
        "edge": EDGE,
        "ink": INK,
        "wall": FLOOR,
        "extent": [np.min([e.low for e in images], axis=0).tolist(), np.max([e.high for e in images], axis=0).tolist()],
        "periodic": images[0].periodic,
        "walls": [dict(zip(("axis", "sign", "place"), plane, strict=True)) for plane in first.planes],
        "corners": images[0].corners.tolist(),
    }  # fmt: skip
    walled = bool(first.planes) or not first.configuration.free.all()
    kinds = {
        "Yellow: upper layer.": first.top.any(),
        "Red: walls, and particles that are held.": walled and not first.top.any(),
        "White: rattlers, which touch nothing.": len(first.rattlers),
        "Drag to turn.": first.dimension == 3,
        "Width of a bar: normal force.": True,
    }
    data |= {
        "json": json.dumps(data, separators=(",", ":"), default=_encode, allow_nan=False).replace("<", "\\u003c"),
        "title": title,
        "grows": any(verdict.undamped.growth_rate for verdict in verdicts),
        "gradient": ", ".join(_colours(8)),
        "legend": " ".join(words for words, shown in kinds.items() if shown),
    }
    write_text(path, filled(__package__ or "", "view/page.html.j2", data, autoescape=True))


class _Images(NamedTuple):
    """Every image of a particle and of a contact that the page draws, by the particle and the contact of each.

    `place` (n, 3) has the centres, and `bar` (c, 2, 3) the ends of bars. The picture of disks goes from `low` to
    `high`, and repeats if it is periodic; of spheres all lies between. Bit k of the number of one of the `corners`
    (8, 3) of the box of spheres says on which side along edge k.
    """

    place: Floats
    particle: ArrayLike
    bar: Floats
    contact: Any
    low: Floats
    high: Floats
    corners: Floats
    periodic: bool


def _disks(packing: HasConfiguration) -> _Images:
    view, none = View.of(packing, margin=0.5 * packing.radius.max()), np.zeros((0, 3))
    place, start, end = (np.pad(each, ((0, 0), (0, 1))) for each in (view.place, view.start, view.end))
    room = 1.1 if packing.top.any() else 0.3  # for the arrow of the load
    top = float((packing.position[:, 1] + packing.radius).max()) + room * float(packing.radius.min())
    bars, high = np.stack([start, end], axis=1), np.array([view.high[0], top])
    return _Images(place, view.disk, bars, view.contact, view.low, high, none, bool(len(view.edges)))


def _spheres(packing: HasConfiguration) -> _Images:
    """Spheres within the box; of a contact through a periodic side each partner has half."""
    own: Configuration = packing.configuration
    (cell, place), c, branch, reach = in_box(own), own.contacts, own.branch, own.radius[:, None]
    bars = np.stack([place[c.i], place[c.i] - branch], axis=1)
    apart = np.linalg.norm(bars[:, 1] - place[c.j], axis=1) > 1e-6 * own.radius.max()
    through = np.flatnonzero(~c.wall & apart)
    bars[through, 1] += 0.5 * branch[through]
    again = np.stack([place[c.j[through]] + 0.5 * branch[through], place[c.j[through]]], axis=1)
    low, high = cut(own.planes, (place - reach).min(axis=0), (place + reach).max(axis=0))
    edges = np.where(own.periodic[:, None], cell, np.diag(high - low))
    corners = np.where(own.periodic, own.origin, low) + ENDS[:, ::-1] @ edges
    contact = np.concatenate([np.arange(len(c)), through])
    return _Images(place, np.arange(len(own)), np.concatenate([bars, again]), contact, low, high, corners, False)


def _array(values: ArrayLike, kind: str) -> dict[str, str]:
    """An array as `page.js` decodes it; in doubles where single precision overflows or loses it, in any units."""
    size = np.abs(np.asarray(values))[np.isfinite(values)] if kind == "f4" else np.zeros(0)
    if np.any(size > SINGLE.max) or np.any((size > 0) & (size < SINGLE.tiny)):
        kind = "f8"
    return {"type": kind, "base64": base64.b64encode(np.asarray(values, dtype=f"<{kind}").tobytes()).decode()}


def _encode(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else _array(value, "f4")


def _frame(packing: HasConfiguration, axis: Axis, images: _Images, followed: RampEigenvalues, k: int) -> dict[str, Any]:
    """The part of the page's data that belongs to one packing."""
    verdict, contacts, force = followed.verdicts[k], packing.configuration.contacts, packing.normal_force
    share = np.log(np.maximum(packing.mobilised, LEAST_SHARE)) / np.log(LEAST_SHARE)
    return {
        "value": float(axis.values[k]),
        "force": packing.fx if packing.top.any() else None,
        "stable": verdict.stable,
        "sentences": sentences_of(verdict),
        "pairs": verdict.undamped.pairs,
        "rate": verdict.growth_rate,
        "undamped": verdict.undamped.growth_rate,
        "place": images.place,
        "disk": _array(images.particle, "u2"),
        "face": _array([FACES.index(to_hex(face)) for face in faces_of(packing)], "u1"),
        "angle": _array(getattr(packing, "angle", np.zeros(len(packing))), "f4"),
        "bars": images.bar,
        "i": _array(contacts.i[images.contact], "i2"),
        "j": _array(contacts.j[images.contact], "i2"),
        "width": (force / force.max(initial=np.finfo(float).tiny))[images.contact],
        "share": _array(np.clip(255 * (1 - share), 0, 255)[images.contact], "u1"),
        "re": followed.values[k].real,
        "im": followed.values[k].imag,
    }


def sentences_of(verdict: Stability) -> list[str]:
    """Sentences of a page: the verdict, the eigenvalues without dissipation, and contacts at Coulomb's bound."""
    u, at = verdict.undamped, verdict.at_bound
    counts = {"complex pair": u.pairs, "negative eigenvalue": u.negative}
    found = " and ".join(counted(count, noun) for noun, count in counts.items() if count)
    if found and verdict.dissipative:
        found = f"without dissipation {found}, D would grow as exp({u.growth_rate:.3g} t)"
    bound = f"{counted(at, 'contact')} at Coulomb's bound" if at else ""
    return [f"{each[0].upper()}{each[1:]}." for each in (verdict.sentences[0], found, bound, *verdict.remarks) if each]


def _pair(pair: FollowedPair, axis: Axis, legs: Sequence[np.ndarray]) -> dict[str, Any]:
    """The eigenvalues of a pair at the packings, the curves through them, and the shapes of its modes."""
    found = mean_and_square(pair.eigenvalues)
    ways = [curve_through(axis.values[leg], pair.eigenvalues[leg]) for leg in legs]
    shapes = [_shape(pair, k) if np.isfinite(each) else None for k, each in enumerate(found["mean"])]
    return {**found, "curves": [{"load": load, **mean_and_square(values)} for load, values in ways], "shapes": shapes}


def _shape(pair: FollowedPair, k: int) -> dict[str, Any]:
    """Two rows of 8 bits, with their scales: real and imaginary part of a complex mode, or two real modes."""
    plane = pair.planes[k]
    first, second = (displacement(pair.packings[k], vector) for vector in (plane.right @ members_of(plane)[1]).T)
    rows = np.stack([first.real, first.imag if pair.eigenvalues[k, 0].imag else second.real])
    largest = np.abs(rows).max(axis=(1, 2)) / 127
    whole = np.rint(rows / np.where(largest > 0, largest, 1.0)[:, None, None])
    return {"scale": largest.tolist(), "rows": _array(whole, "i1")}


def _colours(count: int) -> list[str]:
    return [to_hex(MOBILIZATION(k / (count - 1))) for k in range(count)]
