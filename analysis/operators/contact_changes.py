r"""Which multiples of a displacement take contacts to another state: to Coulomb's bound, open, or closed.

To first order a displacement and its velocity change the tangential force of contact c by :math:`\mathbf g_c`, in the
plane of the contact, Coulomb's bound :math:`\mu f_n` by :math:`h_c`, and the overlap :math:`\delta` by
:math:`\dot\delta_c`, dashpots included. A motion x times as large takes a sticking contact to the bound where

.. math:: |\mathbf f_t + x\, \mathbf g_c| = \mu f_n + x\, h_c ,

and opens the contact where the overlap is zero. Particles that do not touch yet close where their gap is zero.

**Contacts at the bound** slide on ahead by :math:`p_c`, which takes :math:`p_c \mathbf e_c` off :math:`\mathbf g_c`. On
the way back they reach the bound once more where the same equation has a solution :math:`x > 0`. Sideways they are as
stiff as contacts that stick, as long as their force does not turn much: for :math:`x |\mathbf g_c \times \mathbf e_c|`
up to a share `TURN` of :math:`\mu f_n`.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, diags_array, vstack

from ..arrays import Floats, Indices, ratio
from ..configuration import Configuration
from .gaps import gaps_of
from .linearised_contacts import overlap_rows, tangential_rows

TURN = 0.2
"""Angle, radian, by which the force of a contact at Coulomb's bound may turn: half of it is the share of a sideways
displacement that the contact then slips, a tenth, so that D is right to a fifth."""


class Multiples(NamedTuple):
    """Multiples of displacements, infinite where none changes anything: shape (C, P) of the contacts that reach the
    bound and of those that open, (G, P) of the gaps that close, (B, P) of the contacts at the bound whose forces
    turn."""

    reaches: Floats
    opens: Floats
    closes: Floats
    turns: Floats


@dataclass(frozen=True, eq=False)
class ContactChanges:
    """The contacts and gaps of a configuration, in rows for products with displacements; C contacts, G gaps.

    `rows` (3C + G, coordinates) give the changes of the tangential forces along f_t, and across, of the overlaps, and
    of the gaps, which they close; `viscous` (3C, coordinates) those that dashpots make, by velocities, and of Coulomb's
    bound. `tangential`, `bound`, `bound_slope`, `overlap` (C, 1) are |f_t|, mu f_n, d (mu f_n)/d delta and delta; `gap`
    (G, 1) has distances of surfaces.

    `sticks` (C, 1) are the contacts below Coulomb's bound that may reach it; `slides` (B,) and `wears` (R,) the numbers
    of those that slide on ahead, and of those with two derivatives. `worn` (2, R, 1) has the changes of the tangential
    force of the latter, along and across, by the path of the overlap.
    """

    rows: csr_array | Floats
    viscous: csr_array | Floats
    tangential: Floats
    bound: Floats
    bound_slope: Floats
    overlap: Floats
    sticks: NDArray[np.bool_]
    slides: Indices
    wears: Indices
    worn: Floats
    gap: Floats

    @classmethod
    def of(cls, configuration: Configuration) -> "ContactChanges":
        """Of contacts that stick."""
        c, gaps = configuration.contacts, gaps_of(configuration)
        size = np.linalg.norm(c.tangential_force, axis=1)
        along = _directions(c.tangential_force, c.normal)
        across = np.cross(c.normal, along)
        coupling = 0.5 * (c.closing + c.parting)
        ways = ((each, np.einsum("ca,ca->c", coupling, each)) for each in (along, across))
        gains = [tangential_rows(configuration, each, c.tangential_stiffness, part) for each, part in ways]
        overlaps = overlap_rows(configuration)
        bears = np.isfinite(c.friction) & (c.friction > 0) & (c.normal_force > 0)
        bound = np.where(bears, c.friction, 0.0)
        slope, none = ratio(bound * c.normal_stiffness, c.normal_force), np.zeros(len(c))
        viscous = [tangential_rows(configuration, each, c.tangential_dashpot, none) for each in (along, across)]
        of_bound = ratio(bound * c.normal_dashpot * c.viscous_slider, c.normal_force)
        dashpots = vstack([*viscous, diags_array(of_bound) @ overlaps])
        wears = np.flatnonzero(c.two_derivatives)
        difference = 0.5 * (c.closing - c.parting)[wears]
        worn = np.array([np.einsum("ca,ca->c", difference, each[wears])[:, None] for each in (along, across)])
        return cls(
            rows=csr_array(vstack([*gains, overlaps, gaps.rates(configuration)])),
            viscous=csr_array(dashpots), tangential=size[:, None], bound=bound[:, None], bound_slope=slope[:, None],
            overlap=np.where(c.normal_force > 0, c.overlap, 0.0)[:, None], sticks=(bears & ~c.at_bound)[:, None],
            slides=np.flatnonzero(c.one_sided), wears=wears, worn=worn, gap=gaps.gap[:, None],
        )  # fmt: skip

    def multiples(self, displacement: Floats, velocity: Floats, slid: Floats, paths: Floats) -> Multiples:
        """The smallest multiples above zero of P motions, shape (coordinates, P), that change each contact, and each
        gap; with p of contacts at the bound, (B, P), and paths of the overlaps of contacts with two derivatives, (R,
        P)."""
        count = len(self.bound)
        products = np.asarray(self.rows @ displacement)
        along, across, closing = products[: 3 * count].reshape(3, count, products.shape[1])
        by_dashpots = np.asarray(self.viscous @ velocity).reshape(3, count, products.shape[1])
        along, across, bound = np.array([along, across, self.bound_slope * closing]) + by_dashpots
        along[self.slides] -= slid
        along[self.wears] += self.worn[0] * paths
        across[self.wears] += self.worn[1] * paths
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            reaches, turns = self._reaches_and_turns(along, across, bound)
            opens = np.where((closing < 0) & (self.overlap > 0), -self.overlap / closing, np.inf)
            gains = products[3 * count :]
            closes = np.where(gains > 0, self.gap / gains, np.inf)
        return Multiples(reaches, opens, closes, turns)

    def first(self, displacement: Floats, velocity: Floats, slid: Floats, paths: Floats) -> Floats:
        """The smallest of all these multiples for each motion, shape (P,)."""
        found = self.multiples(displacement, velocity, slid, paths)
        return np.min([each.min(axis=0, initial=np.inf) for each in found], axis=0)

    def _reaches_and_turns(self, along: Floats, across: Floats, bound: Floats) -> tuple[Floats, Floats]:
        """Where |f_t + x g| = mu f_n + x h, and where the force of a contact at the bound turns."""
        # a x^2 + 2 b x + slack = 0; of sticking contacts the slack is negative
        a = along**2 + across**2 - bound**2
        b = self.tangential * along - self.bound * bound
        slack = self.tangential**2 - self.bound**2
        root = b + np.sqrt(np.maximum(b * b - a * slack, 0.0))
        reaches = np.where(self.sticks & (b * b >= a * slack) & (root > 0), -slack / root, np.inf)
        here = self.slides
        back, most, sideways = np.maximum(bound - along, 0.0)[here], self.bound[here], np.abs(across[here])
        goes_back = 2 * back > TURN * sideways
        reaches[here] = np.where(goes_back & (a[here] > 0), 2 * most * back / a[here], np.inf)
        turns = np.where(~goes_back & (sideways > 0), TURN * most / sideways, np.inf)
        return reaches, turns


def _directions(force: Floats, normal: Floats) -> Floats:
    """Unit vectors along tangential forces, or where there is none in the plane of the contact."""
    # of two axes one is far from the normal
    axis = np.eye(3)[np.argmin(np.abs(normal), axis=1)]
    any_way = np.cross(normal, axis)
    points = np.linalg.norm(force, axis=1, keepdims=True)
    along = np.where(points > 0, force, any_way)
    return along / np.linalg.norm(along, axis=1, keepdims=True)
