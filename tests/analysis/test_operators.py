"""Stability operator and damping matrix.

The block of a contact against 60 decimal digits: derivatives of the forces. Coordinates, radii and slips count as the
exact doubles that they are, with their low parts if they have any, and nothing is shared with the package but the law's
definition, which the tests have written down once more. Then what is assembled of many contacts: sums of outer products
of what each of them does. Differences of LAMMPS's forces are in tests/plugin.
"""

from dataclasses import replace

import mpmath
import numpy as np
import pytest
from quasistatic import plain_force

from faultgouge.analysis import FLOOR, Contacts, MindlinLaw, Packing, damping_matrix, stiffness_matrix

mpf = mpmath.mpf

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
    with mpmath.workdps(60):
        yield


def exact(array):
    """Doubles as numbers of many digits."""
    return np.vectorize(mpf, otypes=[object])(array)


def one_contact(law, overlap, share, radii=(0.5, 0.7), place=(3.1, 2.2), box=None, compensated=False):
    """Two disks, or one on the floor if there is one radius, at an angle that is nothing special."""
    gap, turn = mpf(overlap) * min(radii), np.array([mpmath.cos(0.7), mpmath.sin(0.7)])
    points = np.array([[mpf(place[0]), radii[0] - gap]])
    if len(radii) == 2:
        points = np.array([exact(place) + (sum(exact(radii)) - gap) * turn, exact(place)])
    if box is not None:
        points[:, 0] %= mpf(box)
    position = points.astype(np.float64)
    partners = ([0], [FLOOR if len(radii) == 1 else 1])
    low, contacts = (points - position).astype(np.float64) if compensated else None, Contacts(*partners, [0.0])
    bare = Packing(position=position, position_low=low, radius=radii, law=law, box_length=box, contacts=contacts)
    slip = share * law.slip_limit(bare.geometry.overlap)
    return replace(bare, contacts=Contacts(*partners, slip, 1e-17 * slip if compensated else None))


class Exact:
    """One contact in 60 digits."""

    def __init__(self, packing):
        law, contacts = packing.law, packing.contacts
        self.law = [mpf(number) for number in (law.kn, law.kt, law.mu)]
        self.exponent, self.floor = mpf(law.exponent), bool(contacts.floor[0])
        points = exact(packing.position) + (exact(packing.position_low) if packing.compensated else 0)
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


def each_contact(packing):
    """Number, distance (infinite for the floor, whose normal does not turn), and three rows over all coordinates: the
    relative motion along the normal, along the tangent, and the slip."""
    n, contacts, geometry = len(packing), packing.contacts, packing.geometry
    for k, (i, j) in enumerate(zip(contacts.i, contacts.j, strict=True)):
        along, across, turning = np.zeros((3, 3 * n))
        for disk, sign in ((i, 1), (j, -1)) if j >= 0 else ((i, 1),):
            along[[disk, disk + n]], turning[disk + 2 * n] = sign * geometry.normal[k], -1
            across[[disk, disk + n]] = sign * geometry.tangent[k]
        yield k, geometry.distance[k] if j >= 0 else np.inf, along, across, across + turning


@pytest.mark.parametrize("form", ["consistent", "paper"])
def test_stiffness_matrix(cluster, form):
    """Sticking, near the bound, sliding, floor, across the box; the paper's form lacks the turning of the tangent."""
    law = cluster.law.derivatives(cluster.geometry.overlap, cluster.contacts.slip)
    expected = np.zeros((18, 18))
    for k, distance, along, across, slip in each_contact(cluster):
        expected += law.normal_stiffness[k] * np.outer(along, along)
        expected += np.outer(slip, law.overlap_derivative[k] * along - law.slip_derivative[k] * slip)
        expected -= law.normal_force[k] / distance * np.outer(across, across)
        if form == "consistent":
            expected += law.tangential_force[k] / distance * np.outer(along, across)
    matrix = stiffness_matrix(cluster, form).toarray()
    # a handful of rounded products and sums
    np.testing.assert_allclose(matrix, expected, rtol=0, atol=4e-16 * np.abs(expected).max())
    with pytest.raises(ValueError, match="consistent"):
        stiffness_matrix(cluster, "exact")


@pytest.mark.parametrize(
    ("law", "drag_time"),
    [({"cn": 3.0}, None), ({"cn": 3.0, "ct": 5.0}, 7.0), ({"cn": 3.0, "ct": 5.0, "mu": 0.0}, None), ({}, 7.0)],
)
def test_damping_matrix(cluster, law, drag_time):
    packing = replace(cluster, law=replace(cluster.law, **law), drag_time=drag_time)
    law, limit = packing.law, packing.law.slip_limit(packing.geometry.overlap)
    mass = np.concatenate([packing.mass, packing.mass, packing.inertia_factor * packing.mass])
    expected = np.diag(mass / drag_time) if drag_time else np.zeros((18, 18))
    for k, _, along, _, slip in each_contact(packing):
        grown = packing.geometry.overlap[k] ** (law.exponent - 1)
        expected += law.cn * grown * np.outer(along, along)
        if abs(packing.contacts.slip[k]) < limit[k]:
            expected += law.ct * grown * np.outer(slip, slip)
    np.testing.assert_allclose(damping_matrix(packing).toarray(), expected, rtol=0, atol=2e-15 * np.abs(expected).max())
    assert damping_matrix(cluster).nnz == 0
