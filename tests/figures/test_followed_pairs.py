"""Pairs along a ramp, and what a page says about the stability at each load."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import eigvals

from faultgouge.analysis import damping_matrix, spectrum, stiffness_matrix
from faultgouge.analysis.arrays import derive_frozen
from faultgouge.figures.followed_pairs import follow_eigenvalues

pytestmark = pytest.mark.slow

TURN = 4
"""The equilibrium at which the ramp turns for the first time."""


@pytest.fixture(scope="module")
def followed(there_and_back):
    return follow_eigenvalues(there_and_back)


def test_every_complex_pair_is_counted_at_every_load(there_and_back, followed):
    found = [spectrum(packing) for packing in there_and_back]
    counts = [len(each.pairs) for each in found]
    assert min(counts) == 0 < max(counts)
    assert [verdict.undamped.pairs for verdict in followed.verdicts] == counts
    drawn = np.array([pair.eigenvalues[:, 0].imag > 0 for pair in followed.pairs])
    assert list(drawn.sum(axis=0)) == counts
    for verdict, each in zip(followed.verdicts, found, strict=True):
        assert verdict.growth_rate == pytest.approx(each.growth_rate(), rel=1e-6)
        assert verdict.stable is not bool(verdict.undamped.pairs)


def test_a_pair_is_followed_up_down_and_up(followed):
    """At every load, with eigenvalues of that load; contacts have slid, so that the way down is another one."""
    first = followed.pairs[0].eigenvalues
    assert np.isfinite(first).all()
    assert not np.allclose(first[: TURN + 1], first[TURN : 2 * TURN + 1][::-1], rtol=1e-6)
    for pair in followed.pairs:
        for two, values in zip(pair.eigenvalues, followed.values, strict=True):
            # of two eigenvalues that are close to a coalescence half of the digits are left
            assert np.isnan(two).all() or np.abs(values[:, None] - two).min(axis=0).max() < 1e-7 * np.abs(values).max()


def test_nothing_is_known_of_a_pair_in_a_packing_with_other_modes(there_and_back, renumbered):
    followed = follow_eigenvalues([*there_and_back[: TURN + 1], renumbered])
    before, other = followed.verdicts[-2:]
    assert before.undamped.pairs == other.undamped.pairs > 0
    pairs = [pair.eigenvalues for pair in followed.pairs if np.isfinite(pair.eigenvalues[0]).all()]
    assert pairs
    assert np.isnan([[pair[-1].real, pair[-1].imag] for pair in pairs]).all()


@pytest.mark.parametrize(("cn", "grows"), [(60.0, False), (1e-3, True)])
def test_dashpots_decide_whether_a_layer_with_complex_pairs_grows(there_and_back, cn, grows):
    packing = derive_frozen(there_and_back[TURN], law=replace(there_and_back[TURN].law, cn=cn, ct=0.3 * cn))
    verdict = follow_eigenvalues([packing]).verdicts[0]
    mass, count = packing.coordinate_mass, packing.coordinates
    system = np.block([
        [np.zeros((count, count)), np.eye(count)],
        [-stiffness_matrix(packing).toarray() / mass[:, None], -damping_matrix(packing).toarray() / mass[:, None]],
    ])  # fmt: skip
    # disks that touch nothing have s = 0
    moving = [s for s in eigvals(system) if abs(s) > 1e-6]
    assert verdict.undamped.pairs == len(spectrum(packing).pairs) > 0
    assert verdict.growth_rate == pytest.approx(2 * max(s.real for s in moving), rel=1e-5)
    assert verdict.stable is not grows


def test_a_path_of_loads_does_not_judge_contacts_that_may_slide_on(there_and_back):
    """Coulomb's slider, at whose bound a contact slides on one side: many packings say so, and one is followed."""
    before = there_and_back[TURN]
    law = replace(before.law, coulomb=True)
    slip = before.contacts.slip.copy()
    largest = int(np.argmax(before.mobilised))
    slip[largest] = np.sign(slip[largest]) * law.slip_limit(before.geometry.overlap)[largest]
    packing = derive_frozen(before, law=law, contacts=replace(before.contacts, slip=slip))
    assert packing.configuration.contacts.one_sided.sum() == 1
    for verdict in follow_eigenvalues([packing, packing]).verdicts:
        assert verdict.stable is None
        assert verdict.one_sided is None
        assert "1 contact at Coulomb's bound may slide on" in verdict.sentences[0]
