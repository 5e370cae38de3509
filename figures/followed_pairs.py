"""The pairs of eigenvalues of a ramp, each followed through the loads, and the verdict at each load.

A pair is followed from the load at which it is complex first. Its image at another load is the pair of modes that lies
closest to its planes (`Plane.closest` of :mod:`~faultgouge.analysis.windows.pair_over_load`). If these are not those of
the pair, the pair is unknown at that load, and it may be found again at a later one. If no pair of the ramp is
complex, the two real modes of the last load that are closest to merging are followed.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from faultgouge.analysis import Mode, Modes, Spectrum, Stability, closest_to_meeting, stability
from faultgouge.analysis.arrays import Complexes
from faultgouge.analysis.counted import counted
from faultgouge.analysis.has_configuration import HasConfiguration
from faultgouge.analysis.motion.eigenvalues import is_negative, is_zero, zero_uncertainties, zero_uncertainty
from faultgouge.analysis.windows import Motions, System, force_bearing
from faultgouge.analysis.windows.pair_over_load import Plane

Progress = Callable[[Sequence[HasConfiguration]], Iterable[HasConfiguration]]

MEMORY = 1e9
"""Bytes of modes that are kept until all pairs are followed; at other loads a pair is found by inverse iteration."""

SECONDS_OF_1000 = 18.0
"""Seconds that all modes of 1,000 disks take on one core; the time grows as the cube of the number of disks."""


class FollowedPair(NamedTuple):
    """A pair of eigenvalues along the equilibria of a ramp, `packings`.

    `eigenvalues` (S, 2) has both members, 1 / time^2: the one with the positive imaginary part, or the lower one,
    first; nan where the pair is unknown. `planes` has the two modes at each load at which the pair is known.
    """

    eigenvalues: Complexes
    planes: Mapping[int, Plane]
    packings: Sequence[HasConfiguration]

    @property
    def growth(self) -> np.ndarray:
        """Growth rate of D without dissipation, 1 / time, shape (S,); nan where the pair is unknown."""
        return 2 * np.abs(np.sqrt(self.eigenvalues[:, 0]).imag)


class RampEigenvalues(NamedTuple):
    """All eigenvalues at each load, 1 / time^2, without the imaginary parts of pairs that are rounding noise; the
    verdicts; and the pairs that are complex at some load, fastest growing first. Without any these are the two real
    modes closest to merging, none if a packing has fewer than two."""

    values: list[Complexes]
    verdicts: list[Stability]
    pairs: list[FollowedPair]


def follow_eigenvalues(packings: Sequence[HasConfiguration], progress: Progress = iter) -> RampEigenvalues:
    """Eigenvalues of equilibria of the same particles in the order of their path.

    The motion of contacts at Coulomb's bound, which takes seconds to minutes, is followed in a single packing alone.
    """
    values, verdicts = [], []
    pairs, kept = list[dict[int, Plane]](), dict[int, Motions]()
    for k, packing in enumerate(progress(packings)):
        modes = Motions.of(System.of(packing))
        values.append(modes.with_conjugates()[0])
        verdicts.append(_verdict_on(force_bearing(packing), modes, alone=len(packings) == 1))
        if 32.0 * modes.right.size * (len(kept) + 1) <= MEMORY:  # right and left vectors
            kept[k] = modes
        taken = set()
        for known in pairs:
            # followed from its last load, or else from the closest one
            closest = min(known, key=lambda n, fx=packing.fx: abs(packings[n].fx - fx))  # type: ignore[misc]  # binds the load of this turn
            images = (_image(modes, known[n]) for n in dict.fromkeys((max(known), closest)))
            members, plane = next((each for each in images if each), (None, None))
            if plane is not None and members not in taken:
                known[k] = plane
                taken |= {members} if members and len(members) == 1 else set()
        complex_ = [(int(each),) for each in np.flatnonzero(modes.grows)]
        pairs += [{k: Plane.of(modes, members)} for members in complex_ if members not in taken]
    if not pairs:
        pairs = [{len(packings) - 1: plane} for plane in _about_to_meet(modes)]
    # and back, to loads at which they are not yet known
    for k in range(len(packings) - 2, -1, -1):
        unknown = [each for each in pairs if k not in each and max(each) > k]
        system = System.of(packings[k]) if unknown and k not in kept else None
        for known in unknown:
            later = known[min(n for n in known if n > k)]
            _, image = (None, later.at(system)) if system else _image(kept[k], later) or (None, None)
            if image is not None and image.like(later):
                known[k] = image
    found = []
    for known in pairs:
        eigenvalues = np.full((len(packings), 2), complex(np.nan, np.nan))
        for k, plane in known.items():
            eigenvalues[k] = members_of(plane)[0]
        found.append(FollowedPair(eigenvalues, known, packings))
    return RampEigenvalues(values, verdicts, sorted(found, key=lambda pair: -np.nanmax(pair.growth)))


def seconds(packings: Sequence[HasConfiguration]) -> float:
    """Seconds of `follow_eigenvalues` on one core."""
    return (4 if packings[0].damped else 1) * SECONDS_OF_1000 * (packings[0].coordinates / 3000) ** 3 * len(packings)


def _image(modes: Motions, pair: Plane) -> tuple[tuple[int, ...], Plane] | None:
    """The modes closest to a pair, and their plane; None where it is not like that of the pair."""
    members = tuple(pair.closest(modes))
    plane = Plane.of(modes, members)
    return (members, plane) if plane.like(pair) else None


def _verdict_on(packing: HasConfiguration, modes: Motions, alone: bool) -> Stability:
    """Whether a packing moves; of one among many the motion of contacts at Coulomb's bound is not followed."""
    slide = 0 if alone else int(packing.configuration.contacts.one_sided.sum())
    how = "this page does not follow, and `faultgouge spectrum --frame` does"
    reasons = [f"{counted(slide, 'contact')} at Coulomb's bound may slide on, which {how}"] if slide else []
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
    pairs.sort(key=lambda pair: -pair.growth_rate)
    return Spectrum(  # without noise: such pairs have lost their imaginary parts
        found.values, tuple(pairs), np.sort(found.values[below].real), noise_pairs=0, rattlers=packing.rattlers,
        rounding=rounding, free=int(free.sum()), packing=packing,
    )  # fmt: skip


def _about_to_meet(modes: Motions) -> list[Plane]:
    """The two real modes that are closest to meeting; none of a packing with fewer than two."""
    try:
        first, second, _ = closest_to_meeting(Modes(modes.values, modes.right, modes.left))
    except ValueError:
        return []
    return [Plane.of(modes, (first, second))]


def members_of(pair: Plane) -> tuple[Complexes, Complexes]:
    """Eigenvalues of both members, and their eigenvectors on the plane in columns."""
    own, vectors = np.linalg.eig(pair.block)
    order = np.lexsort((-own.imag, own.real))
    return own[order], vectors[:, order]
