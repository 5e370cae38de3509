"""One pair of modes through equilibria on the way to its onset: its normal form and its eigenvalues at each load."""

from collections.abc import Iterator, Sequence

import numpy as np

from ..motion.eigenvalues import Complexes
from ..packing.packing import Packing
from ..responses.normal_form import NormalForm
from .space import Space
from .system import System
from .system_modes import SystemModes


def normal_forms(packings: Sequence[Packing], eigenvalue: float) -> list[NormalForm]:
    """The normal form of one pair, through equilibria on the way to its onset.

    Parameters
    ----------
    packings : sequence of Packing
        Equilibria in order of their distance from the onset, nearest first, close enough for the planes of the
        pair to be recognised.
    eigenvalue : float
        The double eigenvalue at the onset, as of :class:`~faultgouge.analysis.Window`, 1 / time^2: the nearest two of
        the first packing are the pair.

    Returns
    -------
    list of NormalForm
        In the order of the packings.
    """
    return [normal_form(pair) for pair in _follow_pair(packings, eigenvalue)]


def pair_eigenvalues(packings: Sequence[Packing], eigenvalue: float) -> Complexes:
    """Both eigenvalues of one pair, from its onset on through other loads.

    The two are followed by the plane that they span, and computed from the 2 x 2 block on it: half its trace -+ half
    the root of its discriminant. So they are two real numbers or two exact conjugates at every load.

    Parameters
    ----------
    packings : sequence of Packing
        As of :func:`normal_forms`, on one side of the onset.
    eigenvalue : float
        As of :func:`normal_forms`.

    Returns
    -------
    ndarray of complex, shape (S, 2)
        1 / time^2; nan from where on the planes are not recognised any more.
    """
    values = np.full((len(packings), 2), np.nan, dtype=np.complex128)
    before: Space | None = None
    for row, pair in zip(values, _follow_pair(packings, eigenvalue), strict=True):
        if before is not None and not before.like(pair):
            break
        root = 0.5 * np.emath.sqrt(pair.discriminant)
        row[:] = pair.mean - root, pair.mean + root
        before = pair
    return values


def normal_form(pair: Space) -> NormalForm:
    """The normal form of two modes of a system."""
    right, left = pair.right, pair.left
    dual = np.linalg.solve(left.T @ right, left.T).T
    return NormalForm.of_block(dual.T @ pair.system.image(right), pair.discriminant, right, dual)


def _follow_pair(packings: Sequence[Packing], eigenvalue: float) -> Iterator[Space]:
    """The pair at each load: followed from the load before, and sought among all modes where that leads nowhere."""
    pair: Space | None = None
    for packing in packings:
        system = System.of(packing)
        image = None if pair is None else pair.at(system)
        if image is None:
            modes = SystemModes.of(system)
            image = modes.space(modes.nearest(pair) if pair else modes.about(eigenvalue))
        pair = image
        yield pair
