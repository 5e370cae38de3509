"""The block of a contact against 60 decimal digits: derivatives of the forces.

Coordinates, radii and slips count as the exact doubles that they are, with their low parts if they have any. Nothing
is shared with the package but the law's definition, which the tests have written down once more.
"""

import mpmath
import numpy as np
import pytest
from quasistatic import plain_force

from faultgouge.analysis import FLOOR, Contacts, MindlinLaw, Packing, stiffness_matrix

mpf = mpmath.mpf
DIGITS = 60

OVERLAPS = (1e-12, 1e-9, 1e-6, 6e-4, 0.05, 0.3)
"""In units of the smaller radius."""

SHARES = (1 - 1e-12, -(1 - 1e-9), 1 - 1e-4, -2 / 3, 1 / 3, 1e-6, -1e-12)
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


def one_contact(law, overlap, share, radii=(0.5, 0.7), place=(3.1, 2.2), box=None, compensated=False):
    """Two disks, or one on the floor if there is one radius, at an angle that is nothing special."""
    gap = mpf(overlap) * min(radii)
    if len(radii) == 1:
        points = [[mpf(place[0]), radii[0] - gap]]
    else:
        distance = mpf(radii[0]) + mpf(radii[1]) - gap
        away = [distance * mpmath.cos(0.7), distance * mpmath.sin(0.7)]
        points = [[mpf(a) + b for a, b in zip(place, away, strict=True)], [mpf(a) for a in place]]
    if box is not None:
        points = [[x % mpf(box), y] for x, y in points]
    position = np.array(points).astype(np.float64)
    where = {
        "position": position,
        "position_low": (np.array(points) - position).astype(np.float64) if compensated else None,
        "radius": radii,
        "law": law,
        "box_length": box,
    }
    partners = ([0], [FLOOR if len(radii) == 1 else 1])
    bare = Packing(contacts=Contacts(*partners, [0.0]), **where)
    slip = share * law.slip_limit(bare.geometry.overlap)
    return Packing(contacts=Contacts(*partners, slip, 1e-17 * slip if compensated else None), **where)


class Exact:
    """One contact in 60 digits."""

    def __init__(self, packing):
        law, c = packing.law, packing.contacts
        self.kn, self.kt, self.mu, self.p = mpf(law.kn), mpf(law.kt), mpf(law.mu), mpf(law.exponent)
        self.floor = bool(c.floor[0])
        first, second = int(c.i[0]), int(c.j[0])
        low = packing.position_low if packing.compensated else np.zeros_like(packing.position)
        points = [
            [mpf(float(a)) + mpf(float(b)) for a, b in zip(*pair, strict=True)]
            for pair in zip(packing.position, low, strict=True)
        ]
        if self.floor:
            self.branch = [mpf(0), points[first][1]]
            self.reach = mpf(float(packing.radius[first]))
        else:
            self.branch = [a - b for a, b in zip(points[first], points[second], strict=True)]
            if packing.box_length is not None:
                box = mpf(packing.box_length)
                self.branch[0] -= box * mpmath.nint(self.branch[0] / box)
            self.reach = mpf(float(packing.radius[first])) + mpf(float(packing.radius[second]))
        self.slip = mpf(float(c.slip[0])) + (mpf(float(c.slip_low[0])) if c.slip_low is not None else 0)

    def forces(self, q):
        """(F_x, F_y, T/R) on i and on j after a displacement, the slip advanced along the tangent at its middle."""
        between = [self.branch[a] + (0 if self.floor and a == 0 else q[a] - q[3 + a]) for a in (0, 1)]
        distance = mpmath.sqrt(between[0] ** 2 + between[1] ** 2)
        if self.floor:
            normal, overlap, middle = [mpf(0), mpf(1)], self.reach - between[1], [mpf(0), mpf(1)]
        else:
            normal, overlap = [b / distance for b in between], self.reach - distance
            middle = [a + b for a, b in zip(between, self.branch, strict=True)]
            length = mpmath.sqrt(middle[0] ** 2 + middle[1] ** 2)
            middle = [m / length for m in middle]
        slip = self.slip - middle[1] * (q[0] - q[3]) + middle[0] * (q[1] - q[4]) - q[2] - q[5]
        fn, ft = plain_force(self.kn, self.kt, self.mu, overlap, slip, self.p)
        on_i = [fn * normal[0] - ft * normal[1], fn * normal[1] + ft * normal[0], -ft]
        return [*on_i, -on_i[0], -on_i[1], -ft]

    def differentiated(self):
        """-dF/dq by central differences; their step of 1e-22 of the overlap leaves 1e-20 of truncation, or less."""
        overlap = self.reach - mpmath.sqrt(self.branch[0] ** 2 + self.branch[1] ** 2)
        step, block = overlap * mpf(10) ** -22 * min(1, self.mu * self.kn / self.kt), []
        for k in range(6):
            q = [mpf(0)] * 6
            q[k] = step
            ahead, behind = self.forces(q), self.forces([-v for v in q])
            block.append([(b - a) / (2 * step) for a, b in zip(ahead, behind, strict=True)])
        matrix = np.array(block).T
        if self.floor:
            matrix[3:], matrix[:, 3:] = mpf(0), mpf(0)
        return matrix


def block(packing):
    """K of a packing of one contact in (x_i, y_i, u_i, x_j, y_j, u_j), shape (6, 6)."""
    disks, order = len(packing), [disk + len(packing) * axis for disk in range(len(packing)) for axis in range(3)]
    found = np.zeros((6, 6))
    found[: 3 * disks, : 3 * disks] = stiffness_matrix(packing).toarray()[np.ix_(order, order)]
    return found


def assert_exact(packing):
    """The package agrees with the reference, relative to the largest entry of the block."""
    truth = Exact(packing).differentiated()
    scale = max(abs(entry) for entry in truth.ravel())
    difference = block(packing).astype(object) - truth
    # asked for are 1e-10; the entries are some twenty rounded operations
    assert max(abs(entry) for entry in difference.ravel()) < mpf(2) * mpf(10) ** -15 * scale


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


def test_low_parts_count():
    """Far from the origin the last place of a coordinate is 2e-12, and an overlap of 1e-10 known to 1 % without."""
    exact = one_contact(LAWS[0], 1e-10, 0.5, place=(9.5e3, 2.2), compensated=True)
    rounded = Packing(position=exact.position, radius=exact.radius, law=exact.law, contacts=exact.contacts)
    one, other = (block(packing) for packing in (exact, rounded))
    assert 1e-4 < np.abs(one - other).max() / np.abs(one).max() < 2e-2
