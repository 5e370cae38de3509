"""The verdict on linear motion: certificate, slow motions and random states beside LAPACK's eigenvalues."""

import numpy as np
import pytest
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from faultgouge.analysis.motion.certificate import NoProofError, prove


def random_packing(seed):
    """A and G of disks with random contacts: springs, dashpots of some strength, forces that follow the overlap or turn.

    Some have drag, no tangential dashpots, springs that push apart, or lever arms that differ; some nothing that holds
    them, so that they drift."""
    rng = np.random.default_rng(seed)
    side = int(rng.integers(6, 10))
    place = np.stack(np.meshgrid(*[np.arange(side)] * 2), -1).reshape(-1, 2) + rng.uniform(-0.25, 0.25, (side**2, 2))
    pairs = cKDTree(place).query_pairs(1.35, output_type="ndarray")
    i, j = pairs[rng.random(len(pairs)) < 0.9].T
    normal = place[i] - place[j]
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    count, contacts = len(place), np.arange(len(i))
    along = np.zeros((2, len(i), 3 * count))  # rows: what a motion stretches and slides
    for sign, end in ((1, i), (-1, j)):
        for axis in range(2):
            along[0, contacts, 3 * end + axis] = sign * normal[:, axis]
            along[1, contacts, 3 * end + axis] = sign * (-1) ** (axis + 1) * normal[:, 1 - axis]
        along[1, contacts, 3 * end + 2] = -1.0
    stretch, slide = along
    other = slide.copy()
    other[:, 2::3] *= 1 - rng.choice([0.0, 1e-3])
    kn, kt = rng.uniform(500, 2000, len(i)), rng.uniform(300, 800, len(i))
    follows = 10 ** rng.uniform(-4, -0.5) * kn * rng.uniform(-1, 1, len(i))
    pressed = rng.choice([0.0, 1e-3, 0.05]) * kn * rng.random(len(i))
    turn = slide * np.tile([1, 1, 0], count)
    a = stretch.T @ (kn[:, None] * stretch) + other.T @ (kt[:, None] * slide)
    a += other.T @ (follows[:, None] * stretch) - turn.T @ (pressed[:, None] * turn)
    strength = 10 ** rng.uniform(-4.5, -0.5)
    tangential = rng.choice([0.5, 0.5, 0.0])
    g = strength * (stretch.T @ (kn[:, None] * stretch) + tangential * other.T @ (kn[:, None] * slide))
    if rng.random() < 0.3:
        g += 10 ** rng.uniform(-3, 0) * np.eye(3 * count)
    held = np.arange(3 * count) >= (0 if rng.random() < 0.2 else 3 * side)  # a floor
    return csr_array(a[held][:, held]), csr_array(g[held][:, held])


def all_values(a, g):
    """s with Im s >= 0 by LAPACK, but for those of a double zero."""
    size = a.shape[0]
    s = np.linalg.eigvals(np.block([[np.zeros((size, size)), np.eye(size)], [-a.toarray(), -g.toarray()]]))
    return s[s.imag >= 0]


@pytest.mark.parametrize("first", range(0, 200, 20))
def test_certificate_against_lapack_on_random_packings(first):
    """Never a false word: what is proved to decay decays, each stated error covers, and no growth is overlooked."""
    proofs = 0
    for seed in range(first, first + 20):
        a, g = random_packing(seed)
        try:
            proof = prove(a, g, 1e-9)
        except NoProofError:
            continue
        proofs += 1
        s, top = all_values(a, g), np.sqrt(abs(a).sum(axis=1).max())
        s = s[np.abs(s) > 1e-5 * top]
        fast = s[s.imag >= proof.frequency]
        rounding = 1e-11 * top  # of LAPACK's eigenvalues, whose vectors are oblique
        assert fast.real.max(initial=-np.inf) <= -proof.decay + rounding
        if not proof.all_slow:
            assert proof.values.real.max() > 0
        slowest = s[s.imag < proof.frequency].real.max(initial=-np.inf)
        found = proof.values.real.max(initial=-np.inf)
        error = proof.errors[np.argmax(proof.values.real)]
        if proof.all_slow:
            assert abs(found - slowest) <= error + rounding
        else:
            assert s.real.max() > 0
        for value in proof.values[:10]:
            assert np.abs(s - value).min() <= max(proof.errors[list(proof.values).index(value)], 1e-6 * top)
    assert proofs >= 5
