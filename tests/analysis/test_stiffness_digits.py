"""The block of a contact against 60 decimal digits: derivatives of the forces.

Coordinates, radii and slips count as the exact doubles that they are, with their low parts if they have any. Nothing
is shared with the package but the law's definition, which the tests have written down once more.
"""

from dataclasses import replace

import mpmath
import numpy as np
import pytest
from quasistatic import plain_force

from faultgouge.analysis import FLOOR, Contacts, MindlinLaw, Packing, stiffness_matrix

mpf = mpmath.mpf
DIGITS = 60

OVERLAPS = (1e-12, 1e-9, 1e-6, 6e-4, 0.05, 0.3)
"""In units of the smaller radius."""

SHARES = (1.5, 1 - 1e-12, -(1 - 1e-9), 1 - 1e-4, -2 / 3, 1 / 3, 1e-6, -1e-12)
"""Slip in units of its limit."""

LAWS = [
    MindlinLaw(2e5, 2e5 * 2 / 7, 1.0),
    MindlinLaw(1e2, 1e3, 10.0),
    MindlinLaw(1e12, 1e9, 1e-6),
    MindlinLaw(1.0, 0.3, 0.2),
    MindlinLaw(2e3, 2e3 * 2 / 7, 1.0, exponent=1.0),
    MindlinLaw(1e9, 1e6, 1e-6, exponent=1.0),
]


@pytest.fixture(autouse=True)
def digits():
    with mpmath.workdps(DIGITS):
        yield


def exact(array):
    """Doubles as numbers of many digits."""
    return np.vectorize(mpf, otypes=[object])(array)


def one_contact(law, overlap, share, radii=(0.5, 0.7), place=(3.1, 2.2), box=None, compensated=False):
    """Two disks, or one on the floor if there is one radius, at an angle that is nothing special."""
    gap = mpf(overlap) * min(radii)
    points = np.array([[mpf(place[0]), radii[0] - gap]])
    if len(radii) == 2:
        away = (mpf(radii[0]) + mpf(radii[1]) - gap) * np.array([mpmath.cos(0.7), mpmath.sin(0.7)])
        points = exact(place) + np.array([away, [mpf(0), mpf(0)]])
    if box is not None:
        points[:, 0] %= mpf(box)
    position = points.astype(np.float64)
    partners = ([0], [FLOOR if len(radii) == 1 else 1])
    bare = Packing(
        position=position,
        position_low=(points - position).astype(np.float64) if compensated else None,
        radius=radii,
        law=law,
        box_length=box,
        contacts=Contacts(*partners, [0.0]),
    )
    slip = share * law.slip_limit(bare.geometry.overlap)
    return replace(bare, contacts=Contacts(*partners, slip, 1e-17 * slip if compensated else None))


class Exact:
    """One contact in 60 digits."""

    def __init__(self, packing):
        law, contacts = packing.law, packing.contacts
        self.law = [mpf(number) for number in (law.kn, law.kt, law.mu)]
        self.exponent, self.floor = mpf(law.exponent), bool(contacts.floor[0])
        low = packing.position_low if packing.compensated else np.zeros_like(packing.position)
        points = exact(packing.position) + exact(low)
        self.branch = np.array([mpf(0), points[0, 1]]) if self.floor else points[0] - points[1]
        if packing.box_length is not None:
            self.branch[0] -= packing.box_length * mpmath.nint(self.branch[0] / packing.box_length)
        self.reach = sum(exact(packing.radius))
        self.slip = sum(exact(contacts.slip)) + (sum(exact(contacts.slip_low)) if packing.compensated else 0)

    def forces(self, q):
        """(F_x, F_y, T/R) on i and on j after a displacement, the slip advanced along the tangent at its middle."""
        between = self.branch + q[:2] - q[3:5]
        if self.floor:
            between[0] = mpf(0)
        normal, overlap = between / mpmath.norm(between), self.reach - mpmath.norm(between)
        middle = (between + self.branch) / mpmath.norm(between + self.branch)
        slip = self.slip - middle[1] * (q[0] - q[3]) + middle[0] * (q[1] - q[4]) - q[2] - q[5]
        fn, ft = plain_force(*self.law, overlap, slip, self.exponent)
        x, y = fn * normal[0] - ft * normal[1], fn * normal[1] + ft * normal[0]
        return np.array([x, y, -ft, -x, -y, -ft])

    def differentiated(self):
        """-dF/dq by central differences; their step of 1e-22 of the overlap leaves 1e-20 of truncation, or less."""
        kn, kt, mu = self.law
        step = (self.reach - mpmath.norm(self.branch)) * mpf(10) ** -22 * min(1, mu * kn / kt)
        steps = step * np.eye(6, dtype=int)
        matrix = np.array([(self.forces(-q) - self.forces(q)) / (2 * step) for q in steps]).T
        if self.floor:
            matrix[3:], matrix[:, 3:] = mpf(0), mpf(0)
        return matrix


def assert_exact(packing):
    """The package agrees with the reference, relative to the largest entry of the block."""
    disks = len(packing)
    order = np.arange(3 * disks).reshape(3, disks).T.ravel()  # (x_i, y_i, u_i, x_j, y_j, u_j)
    truth = Exact(packing).differentiated()[: 3 * disks, : 3 * disks]
    difference = stiffness_matrix(packing).toarray()[np.ix_(order, order)] - truth
    # asked for are 1e-10; the entries are some twenty rounded operations
    assert np.abs(difference).max() < mpf(2) * mpf(10) ** -15 * np.abs(truth).max()


@pytest.mark.parametrize("law", LAWS, ids=lambda law: f"kn={law.kn:g} p={law.exponent:g}")
@pytest.mark.parametrize("radii", [(0.5, 0.7), (0.02, 1.0), (0.5,)], ids=["pair", "1 to 50", "floor"])
@pytest.mark.parametrize("overlap", OVERLAPS)
def test_block_of_exact_doubles(law, radii, overlap):
    for share in SHARES:
        assert_exact(one_contact(law, overlap, share, radii))


@pytest.mark.parametrize("overlap", OVERLAPS)
@pytest.mark.parametrize("place", [(3.1, 2.2), (11.5, 2.2), (9.5e3, 2.2)], ids=["inside", "across", "far away"])
def test_block_with_low_parts(place, overlap):
    box = 11.9 if place[0] < 20 else None
    for share in SHARES:
        assert_exact(one_contact(LAWS[0], overlap, share, place=place, box=box, compensated=True))
