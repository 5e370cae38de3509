r"""The mechanism told from a coincidence: onsets of operators that share some of a packing's properties, and not
others.

linear
    The packing's own operator as a straight line about rest, :math:`\mathrm{diag}(e) + F (V + C)` (see
    :mod:`~research.genericity.levels`). What the onset owes to bending is missing.
random
    The same with everything else than its statistics taken away. Spacings are permuted among `BLOCK` neighbouring
    levels; the elements of V and of C are permuted within blocks of `BLOCK` by `BLOCK` levels and get random signs.
    Levels, and couplings as a function of the levels that they couple, are those of the packing; which mode lies
    where is not.
shuffled
    The packing along its true ramp, but the antisymmetric part of every contact's stiffness is that of another
    contact. With :math:`K_c \ni b\,T N^T + (f_t/r) N P^T`, it is :math:`\frac b2 (T N^T - N T^T) + \frac{f_t}{2r} (N
    P^T - P N^T)`, and the numbers b and f_t/r of the contacts between disks at rest are permuted, the same way at all
    loads. Contacts that close later keep their own.

All are searched as the packing is, up to the same load.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.sparse import coo_array, csr_array

from faultgouge.analysis import Floats, NoEquilibriumError, Packing, mass_weighted, stiffness_matrix
from faultgouge.analysis.windows import complex_windows, force_bearing
from faultgouge.pywrap import Equilibrium, Scene, ramp_loads
from faultgouge.studies.packing_tools import path_from
from research.genericity.levels import InterpolatedOperator, pencil_of

BLOCK = 20
"""Levels among which spacings and couplings are permuted: their means change little over so many."""


def surrogates(scene: Scene, rest: Equilibrium) -> dict[str, Any]:
    """The task "surrogates": how the ramps of all surrogates of a scene end, as the task "onset" has it."""
    pencil = pencil_of(scene, rest)
    assert scene.ramp is not None
    seed = int(getattr(scene.packing, "seed", 0))
    drawn = randomise_pencil(pencil, np.random.default_rng(seed))
    steps, narrowest = ramp_loads(scene), 1e-7 * scene.ramp.first
    row = {
        "linear": _first(lambda fx: csr_array(pencil.at(fx)), steps, narrowest),
        "random": _first(lambda fx: csr_array(drawn.at(fx)), steps, narrowest),
    }
    names = _names(force_bearing(rest.packing))
    order = np.random.default_rng(seed).permutation(len(names)).tolist()
    instead = {name: names[k] for name, k in zip(names, order, strict=True)}
    with path_from(rest, scene) as path:
        return row | {"shuffled": _first(lambda fx: shuffle_contacts(path(fx), instead), steps, narrowest)}


def _first(operator: Callable[[float], csr_array], steps: Floats, narrowest: float) -> dict[str, Any]:
    for here, there in pairwise(steps.tolist()):
        try:
            operator(there)
            windows = complex_windows(operator, [here, there], narrowest=narrowest)
        except NoEquilibriumError:
            return {"ends": "flows", "reach": here}
        if windows:
            return {"ends": "onset", "reach": windows[0].fx_onset}
    return {"ends": "until", "reach": float(steps[-1])}


def randomise_pencil(pencil: InterpolatedOperator, generator: np.random.Generator) -> InterpolatedOperator:
    """A packing's pencil with spacings and couplings permuted among neighbouring levels, and random signs."""
    gaps = np.diff(pencil.values)
    for k in range(0, len(gaps), BLOCK):
        gaps[k : k + BLOCK] = generator.permutation(gaps[k : k + BLOCK])
    values = pencil.values[0] + np.concatenate([[0.0], np.cumsum(gaps)])
    symmetric = _permute_elements(pencil.symmetric, generator)
    antisymmetric = _permute_elements(pencil.antisymmetric, generator)
    diagonal = np.diag(pencil.symmetric).copy()
    for k in range(0, len(diagonal), BLOCK):
        diagonal[k : k + BLOCK] = generator.permutation(diagonal[k : k + BLOCK])
    return InterpolatedOperator(
        values, symmetric + symmetric.T + np.diag(diagonal), antisymmetric - antisymmetric.T, pencil.basis
    )


def _permute_elements(matrix: Floats, generator: np.random.Generator) -> Floats:
    """The elements above the diagonal, permuted within blocks, with random signs."""
    upper, above = np.triu(matrix, 1), np.triu(np.ones(matrix.shape, dtype=bool), 1)
    for i in range(0, len(matrix), BLOCK):
        for j in range(i, len(matrix), BLOCK):
            block, chosen = (each[i : i + BLOCK, j : j + BLOCK] for each in (upper, above))
            values = generator.permutation(block[chosen])
            block[chosen] = values * generator.choice([-1.0, 1.0], len(values))
    return upper


def shuffle_contacts(packing: Packing, instead: Mapping[tuple[int, int], tuple[int, int]]) -> csr_array:
    """A of a packing, 1 / time^2, in which each contact has the antisymmetric part of another one of its own."""
    packing = force_bearing(packing)
    own = mass_weighted(stiffness_matrix(packing), packing)
    symmetric = csr_array(0.5 * (own + own.T))
    names = _names(packing)
    place = {name: k for k, name in enumerate(names)}
    source = np.array([place.get(instead.get(name, name), k) for k, name in enumerate(names)], dtype=int)
    every = np.concatenate([source, np.arange(len(names), len(packing.contacts))])
    return csr_array(symmetric + mass_weighted(antisymmetric_part(packing, every), packing))


def _names(packing: Packing) -> list[tuple[int, int]]:
    """The contacts between disks, which come first."""
    pairs = ~packing.contacts.floor
    return list(zip(packing.contacts.i[pairs].tolist(), packing.contacts.j[pairs].tolist(), strict=True))


def antisymmetric_part(packing: Packing, source: Any) -> csr_array:
    """(K - K^T) / 2 assembled from the contacts, each with b and f_t/r of the contact `source`; force / length."""
    normal, tangent, distance, overlap = packing.geometry
    contacts, floor = packing.contacts, packing.contacts.floor
    law = packing.law.derivatives(overlap, contacts.slip)
    b = law.overlap_derivative[source]
    turn = np.where(floor, 0.0, law.tangential_force / np.where(floor, 1.0, distance))[source]
    zero = np.zeros((len(b), 1))
    n, p = np.hstack([normal, zero, -normal, zero]), np.hstack([tangent, zero, -tangent, zero])
    t = np.hstack([tangent, zero - 1, -tangent, zero - 1])
    n[floor, 3:] = p[floor] = t[floor, 3:] = 0.0
    blocks = b[:, None, None] * np.einsum("cp,cq->cpq", t, n) + turn[:, None, None] * np.einsum("cp,cq->cpq", n, p)
    blocks = 0.5 * (blocks - blocks.transpose(0, 2, 1))
    size, other = len(packing), np.where(floor, contacts.i, contacts.j)
    place = np.stack(
        [contacts.i, contacts.i + size, contacts.i + 2 * size, other, other + size, other + 2 * size], axis=1
    )
    rows, columns = np.broadcast_to(place[:, :, None], blocks.shape), np.broadcast_to(place[:, None, :], blocks.shape)
    whole = coo_array((blocks.ravel(), (rows.ravel(), columns.ravel())), shape=(3 * size, 3 * size))
    return csr_array(whole.tocsr())
