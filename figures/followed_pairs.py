"""The pairs of eigenvalues of a ramp, each followed through the loads, and the verdict at each load.

A pair is followed from the load at which it is complex first. Its image at another load is the pair of modes that lies
closest to its planes (`Plane.closest` of :mod:`~faultgouge.analysis.windows.pair_over_load`). If these are not those of
the pair, the pair is unknown at that load, and it may be found again at a later one. If no pair of the ramp is
complex, the two real modes of the last load that are closest to merging are followed.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from faultgouge.analysis import (
    Mode,
    Modes,
    Spectrum,
    Stability,
    closest_to_meeting,
    stability,
)
from faultgouge.analysis.counted import counted
from faultgouge.analysis.has_configuration import HasConfiguration
from faultgouge.analysis.motion.eigenvalues import is_negative, is_zero, zero_uncertainties, zero_uncertainty
from faultgouge.analysis.windows import Motions, System, force_bearing
from faultgouge.analysis.windows.pair_over_load import Plane

from .mode import Complexes, displacement

Progress = Callable[[Sequence[HasConfiguration]], Iterable[HasConfiguration]]

MEMORY = 1e9
"""Bytes of modes that are kept until all pairs are followed; at other loads a pair is found by inverse iteration."""

SECONDS_OF_1000 = 18.0
"""Seconds that all modes of 1,000 disks take on one core; the time grows as the cube of the number of disks."""


@dataclass(frozen=True, eq=False)
class FollowedPair:
    """A pair of eigenvalues along a ramp of S loads.

    Attributes
    ----------
    eigenvalues : ndarray of complex, shape (S, 2)
        Both members, 1 / time^2: the one with the positive imaginary part, or the lower one, first; nan where the pair
        is unknown.
    planes : mapping of int to Plane
        The two modes at each load at which the pair is known.
    packings : sequence of Packing or Configuration
        The equilibria.
    """

    eigenvalues: Complexes
    planes: Mapping[int, Plane]
    packings: Sequence[HasConfiguration]

    @cached_property
    def modes(self) -> Complexes:
        """Displacements of both members, see :func:`~faultgouge.figures.mode.displacement`, shape (S, 2, axes, N).

        They are zero where the pair is unknown.
        """
        last = self.packings[-1]
        modes = np.zeros((len(self.packings), 2, last.axes, len(last)), dtype=np.complex128)
        for k, pair in self.planes.items():
            vectors = pair.right @ _members_of(pair)[1]
            modes[k] = [displacement(self.packings[k], vector) for vector in vectors.T]
        return modes

    @property
    def growth(self) -> np.ndarray:
        """Growth rate of D without dissipation, 1 / time, shape (S,); nan where the pair is unknown."""
        return 2 * np.abs(np.sqrt(self.eigenvalues[:, 0]).imag)


@dataclass(frozen=True, eq=False)
class RampEigenvalues:
    """Eigenvalues along a ramp.

    Attributes
    ----------
    values : list of ndarray of complex, shape (E,)
        All eigenvalues at each load, 1 / time^2. A complex pair that is rounding noise has lost its imaginary parts.
    verdicts : list of Stability
        Whether the packing moves, for each load.
    pairs : list of FollowedPair
        The pairs that are complex at some load, fastest growing first; without any, the two real modes closest to
        merging; none if a packing has fewer than two modes.
    """

    values: list[Complexes]
    verdicts: list[Stability]
    pairs: list[FollowedPair]


def follow_eigenvalues(packings: Sequence[HasConfiguration], progress: Progress = iter) -> RampEigenvalues:
    """Eigenvalues of equilibria in the order of their path.

    The motion of contacts at Coulomb's bound, which takes seconds to minutes, is followed in a single packing alone.

    Parameters
    ----------
    packings : sequence of Packing or Configuration
        The equilibria, all with the same particles.
    """
    followed = _Followed(packings)
    values, verdicts = [], []
    for k, packing in enumerate(progress(packings)):
        modes = Motions.of(System.of(packing))
        values.append(modes.with_conjugates()[0])
        verdicts.append(_verdict_on(force_bearing(packing), modes, alone=len(packings) == 1))
        followed.add(k, modes)
    followed.close()
    pairs = [_along(packings, each) for each in followed.pairs]
    return RampEigenvalues(values, verdicts, sorted(pairs, key=lambda pair: -np.nanmax(pair.growth)))


def seconds(packings: Sequence[HasConfiguration]) -> float:
    """Seconds of `follow_eigenvalues` on one core."""
    return (4 if packings[0].damped else 1) * SECONDS_OF_1000 * (packings[0].coordinates / 3000) ** 3 * len(packings)


class _Followed:
    """Pairs that are followed while the loads of a ramp come one after the other, and then back to where they began."""

    def __init__(self, packings: Sequence[HasConfiguration]) -> None:
        self.packings = packings
        self.pairs: list[dict[int, Plane]] = []
        self._modes: dict[int, Motions] = {}
        self._last: Motions | None = None

    def add(self, k: int, modes: Motions) -> None:
        """The next load, with all of its modes."""
        size = 32.0 * modes.right.size  # right and left vectors
        if size * (len(self._modes) + 1) <= MEMORY:
            self._modes[k] = modes
        self._last, taken = modes, set()
        for known, members in zip(self.pairs, self._members(k, modes), strict=True):
            if members is not None and members not in taken:
                known[k] = Plane.of(modes, members)
                if len(members) == 1:
                    taken.add(members)
        complex_ = ((int(each),) for each in np.flatnonzero(modes.grows))
        self.pairs += [{k: Plane.of(modes, members)} for members in complex_ if members not in taken]

    def close(self) -> None:
        """Follow all pairs back, to loads at which they are not yet known."""
        if not self.pairs and self._last is not None:
            self.pairs = [{len(self.packings) - 1: pair} for pair in _about_to_meet(self._last)]
        for k in range(len(self.packings) - 2, -1, -1):
            unknown = [known for known in self.pairs if k not in known and max(known) > k]
            later = [known[min(n for n in known if n > k)] for known in unknown]
            for known, image in zip(unknown, self._images(later, k), strict=True):
                if image is not None:
                    known[k] = image

    def _members(self, k: int, modes: Motions) -> list[tuple[int, ...] | None]:
        """The members of each pair at this load, followed from its last load, or else from its closest load."""
        last = [max(known) for known in self.pairs]
        found = _images_of(modes, [known[n] for known, n in zip(self.pairs, last, strict=True)])
        fx = self.packings[k].fx
        closest = [min(known, key=lambda n: abs(self.packings[n].fx - fx)) for known in self.pairs]
        lost = [each for each, members in enumerate(found) if members is None and closest[each] != last[each]]
        again = _images_of(modes, [self.pairs[each][closest[each]] for each in lost])
        for each, members in zip(lost, again, strict=True):
            found[each] = members
        return found

    def _images(self, pairs: Sequence[Plane], k: int) -> list[Plane | None]:
        """Each of some pairs at a load, None where the pair is unknown there."""
        if k in self._modes:
            modes = self._modes[k]
            return [None if members is None else Plane.of(modes, members) for members in _images_of(modes, pairs)]
        system = System.of(self.packings[k])
        images = [pair.at(system) for pair in pairs]
        return [image if image.like(pair) else None for image, pair in zip(images, pairs, strict=True)]


def _images_of(modes: Motions, pairs: Sequence[Plane]) -> list[tuple[int, ...] | None]:
    """The modes closest to each of some pairs, None where their planes are not like those of the pair."""
    found: list[tuple[int, ...] | None] = []
    for pair in pairs:
        members = tuple(pair.closest(modes))
        found.append(members if Plane.of(modes, members).like(pair) else None)
    return found


def _verdict_on(packing: HasConfiguration, modes: Motions, alone: bool) -> Stability:
    """Whether a packing moves; of one among many the motion of contacts at Coulomb's bound is not followed."""
    slide = int(packing.configuration.contacts.one_sided.sum())
    reasons = []
    if slide and not alone:
        contacts = counted(slide, "contact")
        how = "this page does not follow, and `faultgouge spectrum --frame` does"
        reasons.append(f"{contacts} at Coulomb's bound may slide on, which {how}")
    return stability(packing, spectrum_of_stiffness=_spectrum_of(packing, modes), reasons=reasons)


def _spectrum_of(packing: HasConfiguration, modes: Motions) -> Spectrum:
    """The spectrum of a packing whose modes are known, fastest growing pair first."""
    found = Modes(*modes.with_conjugates(), packing.axes)
    rounding = modes.system.rounding
    particle = np.arange(len(found.right)) % len(packing.configuration)
    zero = zero_uncertainties(packing, rounding, particle, found.left, found.right)
    numbers = zip(found.values, found.overlap, found.participation, found.rotation, strict=True)
    pairs = [Mode(complex(value), *map(float, rest)) for value, *rest in numbers if value.imag > 0]
    below = is_negative(found.values, found.overlap, rounding, zero)
    free = ~below & is_zero(found.values, found.overlap, zero_uncertainty(packing, rounding), zero)
    return Spectrum(
        eigenvalues=found.values,
        pairs=tuple(sorted(pairs, key=lambda pair: -pair.growth_rate)),
        negative=np.sort(found.values[below].real),
        noise_pairs=0,  # they have lost their imaginary parts
        rattlers=packing.rattlers,
        rounding=rounding,
        free=int(free.sum()),
        packing=packing,
    )


def _about_to_meet(modes: Motions) -> list[Plane]:
    """The two real modes that are closest to meeting; none of a packing with fewer than two."""
    try:
        first, second, _ = closest_to_meeting(Modes(modes.values, modes.right, modes.left))
    except ValueError:
        return []
    return [Plane.of(modes, (first, second))]


def _along(packings: Sequence[HasConfiguration], known: dict[int, Plane]) -> FollowedPair:
    """A pair with its eigenvalues."""
    found = np.full((len(packings), 2), complex(np.nan, np.nan))
    for k, pair in known.items():
        found[k] = _members_of(pair)[0]
    return FollowedPair(found, known, packings)


def _members_of(pair: Plane) -> tuple[Complexes, Complexes]:
    """Eigenvalues of both members, and their eigenvectors on the plane in columns."""
    own, vectors = np.linalg.eig(pair.block)
    order = np.lexsort((-own.imag, own.real))
    return own[order], vectors[:, order]
