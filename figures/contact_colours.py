r"""What the colours of contacts show.

- ``mobilised``, :math:`|f_t|/(\mu f_n)`: the mobilised fraction of Coulomb's bound, one for a sliding contact,
- ``slip``, :math:`|s|/t^*`: the slip over the slip limit; a Configuration has no slips,
- ``force``, :math:`f_n` itself,
- ``none``: ink.

Most contacts of a stable packing are far below Coulomb's bound, so that both fractions have a logarithmic scale.
"""

from collections.abc import Callable
from operator import attrgetter
from typing import Any

import numpy as np
from matplotlib.colors import Colormap, LogNorm, Normalize

from faultgouge.analysis import BadInputError, Packing
from faultgouge.analysis.arrays import Floats
from faultgouge.analysis.has_configuration import HasConfiguration

from .style import INK, MOBILIZATION

LEAST_SHARE = 1e-4
"""Lower end of the scale of mobilised friction and slip."""


def slip_share(packing: HasConfiguration) -> Floats:
    if not isinstance(packing, Packing):
        raise BadInputError("A packing of LAMMPS has forces and no slips: let colours show mobilised, force or none.")
    limit = packing.law.slip_limit(packing.geometry.overlap)
    return np.divide(np.abs(packing.contacts.slip), limit, out=np.zeros(len(limit)), where=limit > 0)


def _share_scale(_: Floats) -> Normalize:
    return LogNorm(LEAST_SHARE, 1, clip=True)  # a contact without slip has the lowest colour


def _force_scale(values: Floats) -> Normalize:
    return Normalize(0, values.max(initial=0.0) or 1.0)


COLOURS: dict[str, tuple[str, Callable[[HasConfiguration], Floats], Callable[[Floats], Normalize], str | Colormap]] = {
    "mobilised": (r"mobilised friction $|f_t|/(\mu f_n)$", attrgetter("mobilised"), _share_scale, MOBILIZATION),
    "slip": ("slip / slip limit", slip_share, _share_scale, MOBILIZATION),
    "force": ("normal force $f_n$", attrgetter("normal_force"), _force_scale, "viridis_r"),
}
"""Quantities that the bars of contacts may show: label, values of the contacts, scale, colours."""


def style_of_bars(packing: HasConfiguration, color: str) -> dict[str, Any]:
    """Colours of the bars of all contacts."""
    if color != "none":
        _, values_of, scale_of, colours = COLOURS[color]
        values = values_of(packing)
        if values.any():
            return {"array": values, "cmap": colours, "norm": scale_of(values)}
    return {"colors": INK}
