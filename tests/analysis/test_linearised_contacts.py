"""K and C of linearised contacts: a force law in extended precision, symmetries, and the operators of disks."""

from dataclasses import replace

import numpy as np
import pytest
from packing_snapshot import snapshot_of
from scipy.linalg import block_diag, expm
from table_rows import rows_of

from faultgouge.analysis import (
    BadInputError,
    Configuration,
    Contacts,
    LinearisedContacts,
    MindlinLaw,
    Packing,
    damping_matrix,
    eigenvalues,
    find_onset,
    layer_force,
    linear_response,
    normal_modes,
    solid_fraction,
    spectrum,
    stable_timestep,
    stiffness_matrix,
)
from faultgouge.analysis.arrays import derive_frozen
from faultgouge.analysis.contacts import PER_CONTACT
from faultgouge.analysis.operators.linearised_contacts import rescaling_operators

STEP = np.longdouble(1e-8)
"""Of central differences. Their error is 1e-16 of the third derivative, the rounding of long doubles 1e-11."""


def cross(a, b):
    """np.cross has no long doubles of one vector each that it does not warn about."""
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


@pytest.fixture(params=[2, 3], ids=["disks", "spheres"])
def bed(request) -> Configuration:
    return make(request.param)


def make(d: int, *, slides: bool = True) -> Configuration:
    """Six particles in no balance, every two of which touch, with a wall below the first two."""
    rng, n = np.random.default_rng(7 + d), 6
    position = np.zeros((n, 3))
    position[:, :d], radius = rng.normal(size=(n, d)), rng.uniform(0.5, 1.0, n)
    i, j = np.hstack([np.triu_indices(n, 1), [[0, 1], [-1, -1]]])
    wall, count = j < 0, len(i)
    branch = np.where(wall[:, None], np.eye(3)[d - 1] * 0.9, position[i] - position[j])
    distance = np.linalg.norm(branch, axis=1)
    normal, overlap = branch / distance[:, None], rng.uniform(0.01, 0.02, count)
    tangential = rng.normal(size=(count, 3)) * (np.arange(3) < d)
    tangential -= normal * np.sum(normal * tangential, axis=1)[:, None]
    arms = np.column_stack([radius[i], np.where(wall, 0, radius[j])])
    lever, slope = np.where(arms > 0, arms - 0.5 * overlap[:, None], 0), np.full(count, 0.5)
    fn, size = rng.uniform(1, 2, count), np.linalg.norm(tangential, axis=1)
    sliding = slides & (np.arange(count) % 3 == 0)
    contacts = LinearisedContacts(
        i=i, j=j, normal=normal, distance=np.where(wall, np.inf, distance), overlap=overlap,
        slip_arm=arms, lever_arm=lever, lever_slope=slope, normal_force=fn,
        tangential_force=tangential, normal_stiffness=1.5 * fn / overlap,
        tangential_stiffness=rng.uniform(50, 90, count), closing=0.5 * tangential / overlap[:, None],
        parting=0.5 * tangential / overlap[:, None], friction=np.where(sliding, size, 10 * size), sliding=sliding,
        normal_dashpot=rng.uniform(1, 2, count), tangential_dashpot=rng.uniform(1, 2, count),
    )  # fmt: skip
    mass = rng.uniform(1, 2, n)
    return Configuration(
        dimension=d, position=position[:, :d], radius=radius, mass=mass, inertia=0.4 * mass * radius**2,
        contacts=contacts, box=np.eye(3), origin=np.zeros(3), periodic=np.zeros(3, bool), load=np.zeros((n, 2, 3)),
    )  # fmt: skip


def forces(bed: Configuration, q):
    """Forces on all coordinates after a small displacement: Hertz, and a history that turns with its contact."""
    d, n, c = bed.dimension, len(bed), bed.contacts
    move, turn = np.zeros((2, n, 3), np.longdouble)
    parts = q.reshape(bed.axes, n)
    move[:, :d] = parts[:d].T
    turn[:, 3 - len(parts[d:]) :] = (parts[d:] / bed.radius).T
    total = np.zeros((2, n, 3), np.longdouble)
    for k in range(len(c)):
        i, j, wall = c.i[k], c.j[k], c.j[k] < 0
        u = move[i] - (0 if wall else move[j])
        w = c.slip_arm[k, 0] * turn[i] + (0 if wall else c.slip_arm[k, 1] * turn[j])
        n0 = c.normal[k].astype(np.longdouble)
        n0 = n0 / np.sqrt(n0 @ n0)  # a unit vector to more digits than doubles have
        branch = n0 * (1 if wall else c.distance[k]) + u
        length = np.sqrt(branch @ branch)
        normal = n0 if wall else branch / length
        closer = -(n0 @ u) if wall else c.distance[k] - length
        delta = c.overlap[k] + closer
        fn = c.normal_force[k] * (delta / c.overlap[k]) ** np.longdouble(1.5)
        old = c.tangential_force[k].astype(np.longdouble)
        old = old - n0 * (n0 @ old)
        pull = old - c.tangential_stiffness[k] * (u - n0 * (n0 @ u) + cross(n0, w))
        if c.sliding[k]:
            pull *= np.sqrt(old @ old) * fn / c.normal_force[k] / np.sqrt(pull @ pull)
        else:
            pull = pull + old * (np.sqrt(delta / c.overlap[k]) - 1)
        pull = pull - normal * (normal @ pull)
        for p, (who, sign) in enumerate(((i, 1), (j, -1))[: 1 if wall else 2]):
            total[0, who] += sign * (fn * normal + pull)
            total[1, who] -= (c.lever_arm[k, p] - c.lever_slope[k] * closer) * cross(normal, pull) / bed.radius[who]
    return np.concatenate([total[0, :, :d].T.ravel(), total[1, :, 3 - len(parts[d:]) :].T.ravel()])


def test_differences_of_forces_in_extended_precision(bed):
    k = stiffness_matrix(bed).toarray()
    found = np.empty(k.shape)
    for column in range(len(k)):
        q = np.zeros(len(k), np.longdouble)
        q[column] = STEP
        found[:, column] = -(forces(bed, q) - forces(bed, -q)) / (2 * STEP)
    # the third derivative is that of lengths of 1e-2: 1e-16/1e-4; the unit vectors of doubles are off by 1e-16
    assert np.abs(found - k).max() < 2e-10 * np.abs(k).max()


@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
def test_operators_of_disks(cluster, share):
    rescaled = cluster.law.exponent == 1.5
    packing = replace(cluster, law=replace(cluster.law, cn=1.3, ct=0.4, rescaled=rescaled), inertia_factor=0.5)
    snapshot = snapshot_of(packing)
    for one, other in (
        (stiffness_matrix(packing, parting=share), stiffness_matrix(snapshot, parting=share)),
        (damping_matrix(packing), damping_matrix(snapshot)),
    ):
        assert abs(one - other).max() < 4e-15 * abs(one).max()  # a few roundings
    assert list(snapshot.rattlers) == list(packing.rattlers)
    assert snapshot.coordinate_mass == pytest.approx(packing.coordinate_mass, rel=1e-15)
    net = packing.net_force.reshape(3, -1)
    turned = snapshot.net_force[:, 1, 2] / packing.radius
    assert np.array([*snapshot.net_force[:, 0, :2].T, turned]) == pytest.approx(net, abs=1e-12 * np.abs(net).max())


def test_contacts_of_particles_give_no_momentum(bed):
    """Walls do; nor does a common motion stretch what is between particles alone."""
    c = bed.contacts
    alone = derive_frozen(bed, contacts=c.chosen(c.j >= 0))
    shift = np.kron(np.eye(bed.axes)[: bed.dimension], np.ones(len(bed)))
    for operator in (stiffness_matrix, damping_matrix):
        k = operator(alone).toarray()
        assert max(np.abs(k @ shift.T).max(), np.abs(shift @ k).max()) < 1e-13 * np.abs(k).max()


@pytest.mark.parametrize("mirrored", [False, True])
def test_turned_and_mirrored(bed, mirrored):
    d, turn = bed.dimension, np.eye(3)
    turn[:d, :d] = np.linalg.qr(np.random.default_rng(1).normal(size=(d, d)))[0]
    turn[:, 0] *= np.sign(np.linalg.det(turn)) * (-1 if mirrored else 1)
    vectors = [name for name, shape in PER_CONTACT.items() if shape == (3,)]
    c = derive_frozen(bed.contacts, **{name: getattr(bed.contacts, name) @ turn.T for name in vectors})
    other = derive_frozen(bed, contacts=c, position=bed.position @ turn[:d, :d].T)
    spin = np.linalg.det(turn) * turn  # rotations are pseudovectors
    whole = np.kron(block_diag(turn[:d, :d], spin if d == 3 else spin[2:, 2:]), np.eye(len(bed)))
    for operator in (stiffness_matrix, damping_matrix):
        k = operator(bed).toarray()
        assert np.abs(operator(other).toarray() - whole @ k @ whole.T).max() < 1e-13 * np.abs(k).max()


def test_the_analysis_takes_a_snapshot_as_a_packing(bed):
    mass = bed.coordinate_mass
    k, c = stiffness_matrix(bed).toarray(), damping_matrix(bed).toarray()
    values = np.sort_complex(np.linalg.eigvals(k / mass[:, None]))
    assert eigenvalues(bed) == pytest.approx(values, abs=1e-9 * np.abs(values).max())
    n, d = len(k), bed.dimension
    push, still = np.random.default_rng(0).normal(size=n), np.zeros((n, n))
    system = np.block([[still, np.eye(n)], [-k / mass[:, None], -c / mass[:, None]]])
    moved = expm(0.3 * system) @ np.concatenate([push, np.zeros(n)])
    found = linear_response(bed, [0.3], initial=push)
    assert found.displacement[0] == pytest.approx(moved[:n], abs=1e-9 * np.abs(moved[:n]).max())
    assert found.msd[0] == pytest.approx(np.sum(moved[: d * len(bed)] ** 2) / len(bed), rel=1e-9)
    share = normal_modes(bed).rotation
    assert np.all((share >= 0) & (share <= 1))
    mu = np.linalg.eigvals(np.block([[c / mass[:, None], k / mass[:, None]], [np.eye(n), still]])).real.max()
    step = stable_timestep(bed)
    assert step == pytest.approx(2 / mu, rel=1e-7)
    assert abs(step - 2 / mu) <= step.error + 1e-12 * step
    # the sums of rows are a bound for all eigenvalues, and no useless one
    assert 0.3 * step < step.certain <= 2 / mu * (1 + 1e-12)
    # the matrices that are handed in are those that count
    assert stable_timestep(bed, stiffness_matrix(bed), damping_matrix(bed)) == step
    assert stable_timestep(bed, 4 * stiffness_matrix(bed), 2 * damping_matrix(bed)) == pytest.approx(step / 2, rel=1e-7)
    # also those of a configuration whose contacts have no dashpots
    still = dict.fromkeys(("normal_dashpot", "tangential_dashpot"), np.zeros(len(bed.contacts)))
    bare = derive_frozen(bed.contacts, **still)
    given = derive_frozen(bed, contacts=bare, stiffness=stiffness_matrix(bed), damping=damping_matrix(bed))
    assert float(stable_timestep(given)) == pytest.approx(float(step), rel=1e-9)


def test_numbers_of_a_layer_are_right_of_a_configuration_or_refused(bed):
    """The volume fraction of a periodic box; no force on a layer that is not there."""
    d = bed.dimension
    box = np.diag([9.0, 8.0, 7.0])
    box[1, 0] = 2.0  # sheared
    closed = derive_frozen(bed, box=box, periodic=np.ones(3, dtype=bool))
    volume = np.pi * np.sum(bed.radius**2) / 72 if d == 2 else 4 / 3 * np.pi * np.sum(bed.radius**3) / 504
    assert solid_fraction(closed) == pytest.approx(volume, rel=1e-14)
    with pytest.raises(BadInputError, match="this one is open along y"):
        solid_fraction(derive_frozen(closed, periodic=np.array([True, False, True])))
    with pytest.raises(BadInputError, match="acts on an upper layer, and this packing has none"):
        layer_force(bed, 1.0)


def test_rescaling_is_half_of_the_difference_of_both_derivatives(bed):
    """dF = -K dq + B |N dq|: with K of the mean, B N is what K while all contacts close lacks, and N is d delta."""
    c = bed.contacts
    bed = derive_frozen(bed, contacts=derive_frozen(c, closing=0.2 * c.closing, parting=1.3 * c.parting))
    n, b = rescaling_operators(bed)
    closing, mean, parting = (stiffness_matrix(bed, parting=share).toarray() for share in (0.0, 0.5, 1.0))
    size = 1e-13 * np.abs(mean).max()
    assert (b @ n).toarray() == pytest.approx(mean - closing, abs=size)
    assert (b @ n).toarray() == pytest.approx(parting - mean, abs=size)
    assert np.abs((b @ n).toarray()).max() > 1e-2 * np.abs(mean).max()
    # springs along the normals alone have K = N^T k N
    still, none = 0 * c.closing, 0 * c.friction
    alone = {"tangential_force": still, "normal_force": none, "tangential_stiffness": none}
    bare = derive_frozen(c, closing=still, parting=still, **alone)
    springs = stiffness_matrix(derive_frozen(bed, contacts=bare)).toarray()
    assert (n.T * c.normal_stiffness) @ n.toarray() == pytest.approx(springs, abs=size)


def test_onset_of_a_family_of_snapshots():
    """Tangential forces grow with the load; bisection with all eigenvalues finds the same edge."""
    still = make(2, slides=False)
    # without large pushes along contacts, which buckle
    c = derive_frozen(still.contacts, normal_force=1e-3 * still.contacts.normal_force)

    def at(load: float) -> Configuration:
        force = load * c.tangential_force
        b = 0.5 * force / c.overlap[:, None]
        return derive_frozen(
            still, fx=load, load_error=1e-9, contacts=derive_frozen(c, tangential_force=force, closing=b, parting=b)
        )

    def pairs(load: float) -> bool:
        root = np.sqrt(still.coordinate_mass)
        values = np.linalg.eigvals(stiffness_matrix(at(load)).toarray() / root / root[:, None])
        return bool(np.any(values.imag > 1e-7 * np.abs(values).max()))

    onset = find_onset(at, np.linspace(0, 5, 11), first=True)
    low, high = onset.fx_c - 0.25, onset.fx_c + 0.25
    assert not any(map(pairs, np.linspace(0, low, 9)))
    while high - low > 1e-11:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if pairs(middle) else (middle, high)
    # the imaginary part is 1e-7 of the largest eigenvalue some 2e-9 beyond the edge
    assert onset.fx_c == pytest.approx(high, abs=1e-8)
    assert 1e-9 <= onset.error < 2e-9
    assert onset.as_dict()["error_of_path"] is None


def one_contact(**change):
    """Two disks with one contact, but for some values of it or of them."""
    law, contact = MindlinLaw(1e3, 3e2, 0.5), Contacts([0], [1], [1e-4])
    pair = Packing(position=[[0.0, 0.99], [0.0, 0.0]], radius=[0.5, 0.5], contacts=contact, law=law).configuration
    names = ("dimension", "position", "radius", "mass", "inertia", "box", "origin", "periodic", "load")
    given = {name: getattr(pair, name) for name in names} | change
    of_contact = {name: given.pop(name, getattr(pair.contacts, name)) for name in PER_CONTACT}
    return Configuration(contacts=LinearisedContacts(**of_contact), **given)


@pytest.mark.parametrize(
    ("change", "says"), rows_of("analysis/refused_configurations.txt", masked_array=np.ma.masked_array)
)
def test_values_that_no_packing_has(change, says):
    with pytest.raises(ValueError, match=says) as refusal:
        one_contact(**change)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("coulomb", [False, True])
def test_a_smoothed_law_has_no_one_sided_contacts(reference_packing, coulomb):
    """Close to the bound its tangential stiffness has gone, on both sides; that of Coulomb's slider stays."""
    packing = reference_packing(0.5)
    law = replace(packing.law, coulomb=coulomb)
    share = 1.0 if coulomb else 1 - 5e-4
    slip = share * law.slip_limit(packing.geometry.overlap)
    contacts = derive_frozen(packing, law=law, contacts=replace(packing.contacts, slip=slip)).configuration.contacts
    assert contacts.at_bound.all()
    assert contacts.one_sided.all() == contacts.one_sided.any() == coulomb


def test_k_and_c_are_sums_over_contacts(bed):
    """Two particles may touch through two images; one that is held takes part in contacts alone."""
    c, free = bed.contacts, np.arange(len(bed)) != 2
    twice = c.chosen(np.append(np.arange(len(c)), [3, 0]))
    held, moves = derive_frozen(bed, contacts=twice, free=free), np.tile(free, bed.axes)
    for operator in (stiffness_matrix, damping_matrix):
        matrix = operator(held)
        assert matrix.has_canonical_format
        assert np.all(matrix.data != 0)
        each = [operator(derive_frozen(bed, contacts=twice.chosen([k]))).toarray() for k in range(len(twice))]
        expected = np.sum(each, axis=0) * np.outer(moves, moves)
        # roundings of a dozen terms
        np.testing.assert_allclose(matrix.toarray(), expected, rtol=0, atol=1e-14 * np.abs(each).max())


def test_spin_about_the_only_contact_costs_nothing():
    bed = make(3, slides=False)
    two = derive_frozen(bed, contacts=bed.contacts.chosen([0]))
    assert list(two.rattlers) == [2, 3, 4, 5]
    found = spectrum(two)
    # three translations and three twists or common turns, and the soft ones of a force that is not in balance
    assert np.sum(np.abs(found.eigenvalues) < 1e-12 * np.abs(found.eigenvalues).max()) >= 6
    assert len(found.pairs) == 0
