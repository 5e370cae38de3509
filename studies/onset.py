r"""The task "onset": the first window of complex eigenvalues of one scene, and the modes that merge there.

A ramp to the first window ends in one of three ways: with an *onset*; without one at the scene's last F_x (*until*); or
with a packing that *flows*, because no equilibrium follows the last. In the latter two cases the onset, if there is
one, lies beyond the last equilibrium: they are right-censored observations.

**The pair.** At the onset the two modes have one eigenvector v in common (mass-weighted, unit length). Disk k carries
the weight :math:`w_k = v_{x,k}^2 + v_{y,k}^2 + v_{u,k}^2`, and :math:`1/\sum_k w_k^2` is the *participation*, the
number of disks that move. The *rotation* is the share :math:`\sum_k v_{u,k}^2`, the *layer* that of the disks of the
upper layer. If all modes of a packing are computed, *rank* is the number of eigenvalues below the pair and *modes* the
total number. *ancestors* are the numbers of the two modes at F_x = 0 that span most of the plane of the pair, and
*ancestry* is their share of it. If slips are zero, K at F_x = 0 does not depend on mu: two onsets of one packing at
different mu belong to one pair if their ancestors are the same.

**The error** is the total error, as in `faultgouge onset`, and F_x^c is the same: the path is solved again with other
increments (:mod:`~faultgouge.pywrap.runs.path_error`). *error_of_path* is the part due to the increments. It is None
if no equilibrium is found at the onset a second time; the error then is that of rounding alone.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.linalg import eigh, eigvals

from ..analysis import NoEquilibriumError, Onset, OnsetError, Packing, dynamical_matrix, find_onset
from ..analysis.motion.buckling import nearest_modes
from ..analysis.windows import force_bearing, takes_all_modes
from ..pywrap import Scene, SceneError
from ..pywrap.equilibria.quasistatic import Equilibrium
from ..pywrap.load_path import LoadPath
from ..pywrap.runs.path_error import with_path_error
from ..pywrap.runs.ramp_loads import ramp_loads
from ..pywrap.scenes.command_sections import PATH
from .packing_tools import Start, contact_pairs, path_from
from .result_rows import Row
from .study import task

DISTANCE_BELOW = 1e-7
"""Distance below the onset at which the pair is looked at, in units of F_x^c: the angle between its eigenvectors is
about the root of this distance, so that both are accurate."""


@task(reads=PATH, needs=("ramp",))
def onset(scene: Scene, start: Start) -> Row:
    """The first onset of a scene with one friction coefficient, as a row of a table.

    Raises
    ------
    SceneError
        If the scene has several friction coefficients.
    NoEquilibriumError
        If the packing does not settle.
    """
    if len(scene.law.mus) > 1:
        raise SceneError('a row has one friction coefficient: give the list as "law.mu" below [sweep]')
    rest = start(scene.law.mus[0])
    with path_from(rest, scene) as path:
        ends, reach, found = first_window(path, scene)
        row: dict[str, Any] = {"ends": ends, "fx_c": None, "reach": reach}
        row |= {"contacts": len(rest.packing.contacts), "rattlers": len(rest.packing.rattlers)}
        if found is not None:
            seen, window = found.windows[0], with_path_error(found, path).windows[0]
            row |= {"fx_c": window.fx_onset, "error": window.error, "error_of_path": window.path_error}
            row |= {"kind": window.kind, "lambda": window.eigenvalue}
            row |= {"fx_end": window.fx_end, "doubtful": len(found.doubtful)}
            row |= pair(path(seen.fx_onset * (1 - DISTANCE_BELOW)), rest.packing, window.eigenvalue)
    return row


def first_window(path: LoadPath[Equilibrium], scene: Scene) -> tuple[str, float, Onset | None]:
    """How the ramp ends, the largest F_x up to which there is no window, and the onset if there is one."""
    try:
        found = find_onset(path, ramp_loads(scene), first=True)
    except NoEquilibriumError:
        return "flows", path.equilibria[-1].fx, None
    except OnsetError:
        return "until", path.equilibria[-1].fx, None
    return "onset", found.fx_c, found


def pair(packing: Packing, rest: Packing, eigenvalue: float) -> dict[str, Any]:
    """The pair of modes that meets next to an eigenvalue, 1 / time^2, and the contacts of a packing.

    The packing is just below the onset, and `rest` the one at F_x = 0. Where all modes are computed: the rank of the
    pair, and the modes of the packing at F_x = 0 that it has come from.
    """
    near = nearest_modes(force_bearing(packing), eigenvalue * (1 + 1e-6), 2)
    vector = near.right[:, 0].real / np.linalg.norm(near.right[:, 0].real)
    axes = vector.reshape(3, -1) ** 2
    weight = axes.sum(axis=0)
    before, now = contact_pairs(rest), contact_pairs(packing)
    row: dict[str, Any] = {
        "participation": float(1 / np.sum(weight**2)),
        "rotation": float(axes[2].sum()),
        "layer": float(weight[packing.top].sum()),
        "disks": np.argsort(weight)[::-1][:3].tolist(),
        "sliding": int(np.count_nonzero(packing.sliding)),
        "opened": len(before - now),
        "closed": len(now - before),
    }
    if not takes_all_modes(packing):
        return row
    (loaded, _), (unloaded, active) = (dynamical_matrix(force_bearing(each)) for each in (packing, rest))
    values, dense = np.sort(eigvals(loaded.toarray()).real), unloaded.toarray()
    rank = int(np.count_nonzero(values < eigenvalue * (1 - 1e-6)))
    around = values[max(0, rank - 5) : rank + 7]
    share = np.sum((eigh(0.5 * (dense + dense.T))[1].T @ np.linalg.qr(near.right.real[active])[0]) ** 2, axis=1)
    ancestors = np.sort(np.argsort(share)[-2:])
    row |= {"modes": len(values), "rank": rank, "spacing": float((around[-1] - around[0]) / (len(around) - 1))}
    row |= {"largest": float(values[-1]), "ancestors": ancestors.tolist()}
    return row | {"ancestry": float(0.5 * share[ancestors].sum())}
