"""Slopes of a LAMMPS's forces along directions, from both sides of rest.

A displacement may be too long for a contact whose force is far below the mean one: the contact opens within it, or
slides, and then its stiffness seems to be next to nothing. `slopes_by_shorter_steps` tries ever shorter displacements.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...analysis.arrays import Floats, Indices
from .force_probe import Probe, Sides


class Slope(NamedTuple):
    """dF along a direction, over the size of the displacement or velocity; shape (axes N,) each.

    Attributes
    ----------
    mean : ndarray
        Mean of the slopes ahead and behind.
    jump : ndarray
        Difference of these two.
    bend : ndarray
        Difference of the means at the two sizes of a displacement.
    """

    mean: Floats
    jump: Floats
    bend: Floats

    @property
    def uneven(self) -> Floats:
        """How far the force is from a linear function of the size, shape (axes N,)."""
        return np.maximum(np.abs(self.jump), np.abs(self.bend))

    def apart(self, other: "Slope") -> float:
        """Largest difference of two slopes, of one side or the other."""
        return float((np.abs(self.mean - other.mean) + np.abs(self.jump - other.jump)).max())


def slopes_along(probe: Probe, directions: list[Floats], size: float) -> list[Slope]:
    """Slopes along unit directions, by steps of a size."""
    return [_slope(each, probe.sizes, size) for each in probe.each([size * q for q in directions])]


def slopes_by_shorter_steps(
    probe: Probe,
    directions: dict[int, Floats],
    owners: list[Indices],
    sizes: list[float],
    differs: NDArray[np.bool_],
    same: float,
) -> dict[int, Slope]:
    """Slopes along directions by ever shorter steps.

    A shorter step is taken for all particles that feel a body where it makes the forces far more linear. A shorter step
    that says the same, as at a contact which slides on one side, ends the search along a direction.

    Parameters
    ----------
    probe : Probe
        The LAMMPS.
    directions : dict
        Directions by their numbers.
    owners : list of ndarray
        The body that each particle feels, shape (N,), -1 for none, of all directions.
    sizes : list of float
        Lengths of the steps, the longest first.
    differs : ndarray of bool, shape (N,)
        Particles on which the shortest steps exert other forces than K says: the search along their directions goes on,
        and a slope counts for them where it is linear.
    same : float
        Difference of two slopes that are the same.
    """
    probe = replace(probe, sizes=(0.5, 1.0))  # how far a force is from a linear one
    last = dict(zip(directions, slopes_along(probe, list(directions.values()), sizes[0]), strict=True))
    found = dict(last)
    for size in sizes[1:]:
        slopes = dict(zip(last, slopes_along(probe, [directions[k] for k in last], size), strict=True))
        found |= {k: _more_linear(found[k], slope, owners[k], differs, same) for k, slope in slopes.items()}
        last = {
            k: slope for k, slope in slopes.items() if np.any(owners[k][differs] >= 0) or slope.apart(last[k]) > same
        }
        if not last:
            break
    return found


def _more_linear(one: Slope, other: Slope, owner: Indices, differs: NDArray[np.bool_], same: float) -> Slope:
    """Slopes with those of `other` for all particles that feel a body where these are far more linear, or where they
    are linear and a particle differs."""
    bodies = np.tile(owner, len(one.mean) // len(owner))
    most = np.zeros((2, len(owner) + 1))  # the last column stands for no body
    for uneven, slope in zip(most, (one, other), strict=True):
        np.maximum.at(uneven, bodies, slope.uneven)
    seen = np.isin(np.arange(len(owner) + 1), owner[differs & (owner >= 0)])
    better = (most[1] < 0.5 * most[0]) | (seen & (most[1] <= same))
    better = better[bodies]
    return Slope(*(np.where(better, new, old) for old, new in zip(one, other, strict=True)))


def _slope(found: Sides, sizes: tuple[float, ...], step: float) -> Slope:
    """Slopes of each side, extrapolated to a step of zero by Lagrange's polynomial in the step."""
    rest, both = found
    sides, means = np.zeros((2, len(rest))), []
    for share, forces in zip(sizes, both, strict=True):
        weight = np.prod([other / (other - share) for other in sizes if other != share])
        slopes = (np.array(forces) - rest) / (share * step)
        sides += weight * slopes
        means.append((slopes[0] - slopes[1]) / 2)
    ahead, behind = sides
    return Slope((ahead - behind) / 2, ahead + behind, means[-1] - means[0])
