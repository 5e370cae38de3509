"""The verdict on three disks of whose contacts one is at Coulomb's bound, and on packings of which not all is known."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm
from three_disks import balanced, stuck_at_rest, three_disks

from faultgouge.analysis import Contacts, MindlinLaw, Packing, one_sided_motion, stability, transient_gain
from faultgouge.analysis.arrays import derive_frozen
from faultgouge.analysis.motion import pushes as pushes_module
from faultgouge.analysis.motion.one_sided import OneSidedSystem
from faultgouge.analysis.motion.reach import reach_of
from faultgouge.analysis.motion.verdict import as_known

RISE = np.tile([1.0, 0.0], (3, 1))


def test_stability_of_three_disks():
    moves = stability(three_disks())  # in no balance
    assert (moves.at_bound, moves.stable) == (1, None)
    assert "the packing moves" in moves.reasons[0]
    at_rest = balanced(three_disks())
    told = stability(at_rest)
    assert (told.stable, told.one_sided.grows) == (True, False)
    assert told.one_sided.amplification > 0
    assert str(told).startswith("stable: each of 4 pushes comes to rest")
    assert "neither of two linear motions decides" in str(told)
    assert json.loads(json.dumps(told.as_dict()))["one_sided"]["pushes"] == told.one_sided["pushes"] == 4
    rising, twice = (stability(at_rest, rise=size * RISE, time=4.0).rising for size in (1, 2))
    assert twice.drift == pytest.approx(2 * rising.drift, rel=1e-9)
    assert dict(rising) == rising.as_dict() | {"other_start": rising.other_start}


def test_without_dissipation_no_push_comes_to_rest():
    """Contacts stop sliding, and what is left vibrates for ever."""
    three = three_disks()
    at_rest = balanced(replace(three, law=replace(three.law, cn=0.0, ct=0.0)))
    told = stability(at_rest)
    assert told.stable is True
    assert str(told).startswith("stable: each of 4 pushes ends in vibration that goes on, but does not grow")
    size = one_sided_motion(at_rest, np.ones((3, 2)), times=np.linspace(0, 12, 121)).mean_square_displacement
    assert size[81:].max() > 0.8 * size[41:81].max()


@pytest.mark.parametrize(
    ("least", "says"), [(np.inf, "its residual forces alone"), (1e3, "reach it, or residual forces")]
)
def test_a_motion_that_is_that_of_no_push_has_no_verdict(monkeypatch, least, says):
    """Some contacts count as at the bound and are not, and others are as near to it."""
    monkeypatch.setattr(pushes_module, "least_scale", lambda *given: least)
    found = stability(balanced(three_disks()))
    assert found.stable is None
    assert says in found.reasons[0]
    assert found.reasons[0].endswith("bring the packing to rest more closely")
    assert "Infinity" not in json.dumps(found.as_dict())


def test_a_short_time_gives_no_verdict_and_says_which_may_do():
    found = stability(balanced(three_disks()), rise=RISE, time=0.05)
    assert found.stable is None
    assert "has not settled within t = 0.05" in found.reasons[0]
    assert "the mean velocity over the rate rises from" in found.not_followed
    assert found.not_followed.endswith("give more time")


def test_a_packing_that_grows_says_where_its_first_contact_changes():
    """A disk that stands on another falls over: their contact slides, or loses its overlap."""
    law = MindlinLaw(2e3, 6e2, 0.5, cn=0.5, ct=0.1, coulomb=True)
    position, c = [[0.0, 0.49], [0.0, 1.47]], Contacts([0, 1], [-1, 0], np.zeros(2))
    pile = balanced(Packing(position=position, radius=[0.5] * 2, contacts=c, law=law))
    told, risen = stability(pile), stability(pile, rise=np.tile([1.0, 0.0], (2, 1)))
    assert told.stable is risen.stable is False
    assert risen.sentences[-1] == "under a load that rises: not followed, since small motion grows"
    assert 0 < told.first_change**0.5 < 0.5
    assert f"the first contact changes at a displacement of {told.first_change**0.5:.2g} (root of D)" in str(told)
    ends = replace(told, follow={"displacement": 0.3, "ends": "flows"})
    assert str(ends).endswith("LAMMPS goes on from there, and flows, at a displacement of 0.3")


def test_a_contact_of_next_to_no_force_that_residual_forces_open_takes_no_verdict_away():
    """Two disks overlap by 1e-8; a force of 1e-5 is left over, which moves them farther."""
    three = three_disks()
    here = replace(three, position=[[0.0, 0.49], [1 - 1e-8, 0.49], [0.495, 1.34]], law=replace(three.law, mu=50.0))
    at_rest = balanced(replace(here, contacts=here.contacts.slipped(np.zeros(5), None)))
    load = at_rest.load.copy()
    load[0, 0, 0] -= 1e-5
    told = stability(derive_frozen(at_rest, load=load))
    assert told.stable is stability(at_rest).stable is True
    assert "the residual forces alone change 1 contact of next to no force" in told.remarks[-1]


@pytest.mark.long
def test_a_rested_packing_holds_for_every_push_below_its_energy(path):
    """Of forty random states of a layer below its onset, none gains more than is told; and the worst come near."""
    told = stability(stuck_at_rest(exponent=1.0))
    assert (told.stable, told.push_time) == (True, None)
    assert "holds for every push of an energy up to" in str(told)
    system = OneSidedSystem.of(path(0.02))
    reach, z = reach_of(system), system.motion.first_order
    assert (reach.time, system.motion.energy_norm.positive) == (np.inf, True)
    assert 1 < transient_gain(path(0.02), "energy").gain < reach.gain < 50
    step, state = expm(0.1 * z), np.random.default_rng(0).standard_normal((len(z), 40))
    first = np.sum(state**2, axis=0)
    for _ in range(25):
        state = step @ state
        assert np.all(np.sum(state**2, axis=0) < reach.gain * first)


@pytest.mark.parametrize(
    ("least", "most", "says"), [(0.58, 0.99, "1"), (0.95, 0.99, "0.99"), (1.234, 1.2341, "1.2341"), (2.0, 2.0, "2")]
)
def test_numbers_have_as_many_digits_as_pushes_agree_in(least, most, says):
    assert as_known(least, most) == says
