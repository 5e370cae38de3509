"""Up to which push the linear motion holds, whatever the push: the same however a packing is written, and in LAMMPS."""

from dataclasses import replace

import numpy as np
import pytest
from pushes import in_steps, pushed
from scipy.linalg import expm
from scipy.sparse import csr_array

from faultgouge.analysis import stability
from faultgouge.analysis.arrays import derive_frozen
from faultgouge.analysis.contacts import PER_CONTACT, LinearisedContacts
from faultgouge.analysis.motion.one_sided import OneSidedSystem
from faultgouge.analysis.motion.reach import OVERLAP_CHANGE, reach_of

BEDS = [("mindlin/force", 2), ("gran/hertz/history", 3)]
VECTORS = ("normal", "tangential_force", "closing", "parting")


def renumbered(here, random):
    """The packing with its particles and contacts in another order, and the partners of pairs exchanged."""
    order = random.permutation(len(here))
    place = np.argsort(order)
    c = here.contacts.chosen(random.permutation(len(here.contacts)))
    values = {name: np.array(getattr(c, name)) for name in PER_CONTACT}
    values["i"], values["j"] = place[c.i], np.where(c.wall, -1, place[c.j])
    swap = ~c.wall & (random.random(len(c)) < 0.5)
    values["i"][swap], values["j"][swap] = values["j"][swap], values["i"][swap]
    for name in VECTORS:
        values[name][swap] *= -1
    for name in ("slip_arm", "lever_arm"):
        values[name][swap] = values[name][swap][:, ::-1]
    names = ("position", "radius", "mass", "inertia", "load", "free", "kind")
    given = {name: getattr(here, name)[order] for name in names}
    return derive_frozen(here, contacts=LinearisedContacts(**values), **given)


def turned(here, matrix):
    """The packing rotated or mirrored: vectors turn, and torques as pseudovectors."""
    c, d, load = here.contacts, here.dimension, here.load @ matrix.T
    load[:, 1] *= np.linalg.det(matrix)
    contacts = derive_frozen(c, **{name: getattr(c, name) @ matrix.T for name in VECTORS})
    position = here.position @ matrix[:d, :d].T
    return derive_frozen(here, contacts=contacts, load=load, box=here.box @ matrix.T, position=position)


@pytest.mark.long
@pytest.mark.parametrize(("law", "d"), BEDS)
def test_the_range_does_not_depend_on_how_the_packing_is_written(bed, law, d):
    _, here = bed(law, d)
    expected, random = reach_of(OneSidedSystem.of(here)), np.random.default_rng(2)
    assert stability(here).largest_energy == pytest.approx(expected.energy, rel=1e-9)
    others = [renumbered(here, random) for _ in range(20)]
    rotation = expm(np.array([[0.0, -0.7, 0.0], [0.7, 0.0, 0.0], [0.0, 0.0, 0.0]]))
    others += [turned(here, each) for each in (rotation, np.diag([-1.0, 1.0, 1.0]))]
    for other in others:
        found = reach_of(OneSidedSystem.of(other))
        for name in ("energy", "gain", "residual_energy"):
            assert getattr(found, name) == pytest.approx(getattr(expected, name), rel=1e-6)


@pytest.mark.long
@pytest.mark.parametrize(("law", "d"), BEDS)
def test_every_push_within_the_range_moves_lammps_as_the_linear_packing(bed, law, d):
    """Of one particle, and of all in random directions: D is the same within 2 %."""
    lmp, here = bed(law, d)
    told, random = stability(here), np.random.default_rng(3)
    times, dt = np.array([0.2, 0.5, 1.0, 2.0, 4.0]), 1e-3
    moving, pushes = d * len(here), np.zeros((here.coordinates, 6))
    for one, many in pushes.T.reshape(3, 2, -1):
        one[random.integers(len(here)) : moving : len(here)] = random.standard_normal(d)
        many[:moving] = random.standard_normal(moving)
        for push in (one, many):
            push *= np.sqrt(told.largest_energy / (0.5 * np.sum(here.coordinate_mass * push**2)))
    assert 0.5 * here.mass.max() * told.largest_push**2 == pytest.approx(told.largest_energy, rel=1e-9)
    assert 10 * told.residual_push < told.largest_push
    found = pushed(lmp, here, pushes, times, dt, 0.99)
    for k in range(pushes.shape[1]):
        np.testing.assert_allclose(found[:, k], in_steps(here, pushes[:, k : k + 1], times, dt), rtol=0.02)


@pytest.mark.parametrize(("law", "d"), BEDS)
def test_the_push_that_the_bound_is_made_for_takes_a_contact_there(bed, law, d):
    """The bound is no looser than its gain: the state that Cauchy and Schwarz name changes the contact at once."""
    _, here = bed(law, d)
    system = OneSidedSystem.of(here)
    reach, stiffness = reach_of(system), system.motion.stiffness
    symmetric = 0.5 * (stiffness + stiffness.T).toarray()
    changes, none, best = system.changes, np.zeros((0, 1)), np.inf
    rows, viscous = (csr_array(each).toarray() for each in (changes.rows, changes.viscous))
    count = len(changes.bound)
    for k, opens in enumerate(rows[2 * count : 3 * count]):
        for s in (1.0, -1.0):
            row = s * rows[k] - changes.bound_slope[k] * opens
            dashpots = s * viscous[k] - viscous[2 * count + k]
            z = np.linalg.solve(symmetric, row)
            first = changes.first(z[:, None], dashpots[:, None], none, none)[0]
            best = min(best, 0.5 * (z @ row + dashpots @ dashpots) * first**2)
        lift = OVERLAP_CHANGE * changes.overlap[k, 0]
        best = min(best, 0.5 * lift**2 / (opens @ np.linalg.solve(symmetric, opens)))
    assert 0.7 * best < reach.energy * reach.gain < best * (1 + 1e-9)  # a contact may be nearest the bound sideways


def test_free_motions_limit_the_time(bed):
    """Without friction disks turn freely; the range then holds up to a time that is told."""
    _, here = bed("mindlin/force", 2)
    c, none = here.contacts, 0 * here.contacts.tangential_force
    smooth = derive_frozen(c, tangential_stiffness=c.tangential_stiffness * ~c.wall, tangential_force=none)
    found = reach_of(OneSidedSystem.of(derive_frozen(here, contacts=smooth)), free=1)
    assert found is not None
    assert 0 < found.time < np.inf


def test_a_verdict_is_true_false_or_an_error(bed):
    told = stability(bed("mindlin/force", 2)[1])
    assert bool(told) is told.stable is True
    assert not replace(told, stable=False)
    with pytest.raises(ValueError, match=r"not known whether the packing is stable: no reason: ask for \.stable"):
        bool(replace(told, stable=None, reasons=("no reason",)))
