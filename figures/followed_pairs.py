"""The pairs of eigenvalues of a ramp, each followed through the loads, and the verdict at each load.

A pair is followed from the load at which it is complex first. Its image at another load is the pair of modes that lies
closest to its planes (`Plane.closest` of :mod:`~faultgouge.analysis.windows.pair_over_load`). If these are not those of
the pair, the pair is unknown at that load, and it may be found again at a later one. If no pair of the ramp is
complex, the two real modes of the last load that are closest to merging are followed.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
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

NOT_FOLLOWED = "this page does not follow, and `faultgouge spectrum --frame` does"
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
        slide = int(packing.configuration.contacts.one_sided.sum()) if len(packings) > 1 else 0
        reasons = [f"{counted(slide, 'contact')} at Coulomb's bound may slide on, which {NOT_FOLLOWED}"][: bool(slide)]
        bearing = force_bearing(packing)
        verdicts.append(stability(bearing, spectrum_of_stiffness=_spectrum_of(bearing, modes), reasons=reasons))
        if 32.0 * modes.right.size * (len(kept) + 1) <= MEMORY:  # right and left vectors
            kept[k] = modes
        taken = set()
        for known in pairs:
            # followed from its last load, or else from the closest one
            closest = min(known, key=lambda n, fx=packing.fx: abs(packings[n].fx - fx))  # type: ignore[misc]  # binds the load of this turn
            for pair in (known[max(known)], known[closest]):
                members = tuple(pair.closest(modes))
                if (plane := Plane.of(modes, members)).like(pair):
                    if members not in taken:
                        known[k] = plane
                        taken |= {members} if len(members) == 1 else set()
                    break
        complex_ = [(int(each),) for each in np.flatnonzero(modes.grows)]
        pairs += [{k: Plane.of(modes, members)} for members in complex_ if members not in taken]
    if not pairs:
        with suppress(ValueError):  # fewer than two modes
            *both, _ = closest_to_meeting(Modes(modes.values, modes.right, modes.left))
            pairs = [{len(packings) - 1: Plane.of(modes, both)}]
    # and back, to loads at which they are not yet known
    for k in range(len(packings) - 2, -1, -1):
        unknown = [each for each in pairs if k not in each and max(each) > k]
        system = System.of(packings[k]) if unknown and k not in kept else None
        for known in unknown:
            later = known[min(n for n in known if n > k)]
            image = later.at(system) if system else Plane.of(kept[k], later.closest(kept[k]))
            if image.like(later):
                known[k] = image
    found = []
    for known in pairs:
        eigenvalues = np.full((len(packings), 2), complex(np.nan, np.nan))
        for k, plane in known.items():
            eigenvalues[k] = members_of(plane)[0]
        found.append(FollowedPair(eigenvalues, known, packings))
    fastest = [-np.nanmax(np.abs(np.sqrt(pair.eigenvalues[:, 0]).imag)) for pair in found]
    return RampEigenvalues(values, verdicts, [found[k] for k in np.argsort(fastest, kind="stable")])


def seconds(packings: Sequence[HasConfiguration]) -> float:
    """Seconds of `follow_eigenvalues` on one core."""
    return (4 if packings[0].damped else 1) * SECONDS_OF_1000 * (packings[0].coordinates / 3000) ** 3 * len(packings)


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


def members_of(pair: Plane) -> tuple[Complexes, Complexes]:
    """Eigenvalues of both members, and their eigenvectors on the plane in columns."""
    own, vectors = np.linalg.eig(pair.block)
    order = np.lexsort((-own.imag, own.real))
    return own[order], vectors[:, order]
