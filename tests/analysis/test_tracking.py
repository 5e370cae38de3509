"""Pairs that are continued, and found, without the other eigenvalues: against dense LAPACK."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import eig, eigvals
from scipy.sparse import csr_array

from faultgouge.analysis import Contacts, Packing, tracking
from faultgouge.analysis.large import _Search, first_window
from faultgouge.analysis.meetings import meetings
from faultgouge.analysis.modes import Modes, full_operator
from faultgouge.analysis.projection import MIXING, Projection
from faultgouge.analysis.tracking import Block, continued


def dense_block(matrix, reference):
    """The block of the two modes that lie closest to the planes of another one, from all eigenvectors."""
    modes = Modes.of(0.0, matrix)
    return modes.block(modes.nearest(reference))


def pair_of(packing):
    (pair,) = (modes := Modes.of(packing.fx, full_operator(packing))).complex_pairs
    return modes.block(pair)


@pytest.mark.parametrize("factors", ["dense", "sparse", "of a neighbour"])
@pytest.mark.parametrize("fx", [0.0218, 0.0218330564, 0.021833056408868, 0.0219, 0.022])
def test_continued_pair_is_that_of_lapack(ramp, fx, factors, monkeypatch):
    """From real through double to complex, from a load at which the pair is complex."""
    path = ramp(1.0, 1e-3, 22)
    matrix = full_operator(path(fx))
    start = pair_of(path(0.022))
    if factors != "dense":
        monkeypatch.setattr(tracking, "DENSE", 0)
    if factors == "of a neighbour":
        start = continued(full_operator(path(0.0221)), start)
        monkeypatch.setattr(tracking, "_inverse", lambda *_: pytest.fail("other factors were made"))
    found, expected = continued(matrix, start), dense_block(matrix, start)
    rounding = 0.5 * np.finfo(float).eps * np.linalg.norm(matrix.data)
    # D is in error by its coefficients, the entries of B - mean, times some ten of the operator's rounding.
    assert found.mean == pytest.approx(expected.mean, abs=50 * rounding)
    assert found.discriminant == pytest.approx(expected.discriminant, abs=200 * rounding * expected.spread)
    if abs(expected.discriminant) > 1e-8:
        # the overlap goes as the root of D
        error = 100 * rounding * expected.spread / abs(expected.discriminant)
        assert found.overlap == pytest.approx(expected.overlap, rel=1e-4 + error)
    assert found.same_plane(expected)


def test_continuation_is_refused_rather_than_wrong(ramp):
    """Planes of two unrelated modes belong to no pair that inverse iteration can reach."""
    path = ramp(1.0, 1e-3, 22)
    matrix = full_operator(path(0.022))
    modes = Modes.of(0.022, matrix)
    apart = modes.block((30, 200))
    found = continued(matrix, replace(apart, right=np.eye(300)[:, [7, 107]], left=np.eye(300)[:, [7, 107]]))
    assert found is None


def test_overlap_of_a_block_is_that_of_the_eigenvectors(ramp):
    packing = ramp(1.0, 1e-3, 22)(0.022)
    modes = Modes.of(0.022, full_operator(packing))
    (pair,) = modes.complex_pairs
    expected = abs(np.vdot(modes.left[:, pair[0]], modes.right[:, pair[0]]))
    assert modes.block(pair).overlap == pytest.approx(expected, rel=1e-8)


def test_factors_of_a_distant_neighbour_are_given_up(ramp, monkeypatch):
    """Those of another spectrum, nowhere near the pair: its own are made."""
    monkeypatch.setattr(tracking, "DENSE", 0)
    path = ramp(1.0, 1e-3, 22)
    matrix = full_operator(path(0.022))
    start = pair_of(path(0.0219))
    far = tracking._inverse(matrix, 10 * start.mean)
    found = continued(matrix, replace(start, inverse=far))
    assert found.inverse is not far
    assert found.discriminant == pytest.approx(continued(matrix, start).discriminant, rel=1e-9)


@pytest.mark.parametrize("fx", [0.0215, 0.0218330564, 0.022])
def test_slope_of_the_discriminant(ramp, fx):
    """Against the difference of two blocks, from real through double to complex."""
    path, step = ramp(1.0, 1e-3, 22), 1e-6
    below, middle, above = (full_operator(path(fx + offset * step)) for offset in (-1, 0, 1))
    block = dense_block(middle, pair_of(path(0.022)))
    slope = (continued(above, block).discriminant - continued(below, block).discriminant) / 2
    assert block.slope((above - below) / 2) == pytest.approx(slope, rel=1e-5)


def test_block_without_coupling_of_unit_overlap():
    matrix = csr_array(np.diag([1.0, 2.0, 5.0]))
    block = Block.of(matrix, np.eye(3)[:, :2], np.eye(3)[:, :2])
    assert (block.mean, block.discriminant, block.overlap) == (1.5, 1.0, 1.0)


def test_clusters_have_the_eigenvalues_of_the_operator(ramp):
    """Projected on the modes of another load; what is left out is of third order in the coupling."""
    path = ramp(1.0, 1e-3, 22)
    projection = Projection.of(full_operator(path(0.0)))
    owned = [cluster.modes.start + np.arange(cluster.core[0], cluster.core[1] + 1) for cluster in projection.clusters]
    np.testing.assert_array_equal(np.concatenate(owned), np.arange(285))
    for fx, accuracy in ((0.001, 1e-4), (0.01, 2e-2)):
        matrix = full_operator(path(fx))
        expected = np.sort(eigvals(matrix.toarray()).real)[15:]  # five rattlers
        blocks = projection.blocks(projection.levels(matrix))
        assert np.median(projection.mixing(blocks)) < MIXING
        for cluster, block in zip(projection.clusters, blocks, strict=True):
            core = slice(cluster.core[0], cluster.core[1] + 1)
            values = np.sort(eigvals(block).real)[core]
            np.testing.assert_allclose(values, expected[cluster.modes][core], atol=accuracy * np.diff(expected).mean())


@pytest.mark.parametrize("base", [0.0, 0.015, 0.021])
def test_meetings_are_those_of_the_eigenvalues(ramp, base):
    """Every pair that LAPACK has complex, or coming within its couplings, is named; most others are not."""
    path = ramp(1.0, 1e-3, 22)
    projection = Projection.of(full_operator(path(base)))
    for load, most in ((base, 8), (base + 1e-3, 8)):
        here, there = (full_operator(path(fx)) for fx in (load, load + 1e-3 if load < 0.0215 else load))
        named = {tuple(pair) for pair in meetings(projection.levels(here), projection.levels(there))}
        assert len(named) <= most
        for matrix in (here, there):
            modes = Modes.of(0.0, matrix)
            for pair in modes.complex_pairs:
                # the two modes of the projection that carry the plane
                weight = np.linalg.norm(projection.basis.T @ modes.block(pair).right[projection.active], axis=1)
                assert tuple(sorted(np.argsort(weight)[-2:])) in named


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("antisymmetric", [0.02, 0.1, 0.3])
def test_no_complex_pair_escapes_the_meetings(seed, antisymmetric):
    """Random levels and couplings, of spacing 1: as many complex pairs as LAPACK finds are named, or more."""
    rng = np.random.default_rng(seed)
    noise = rng.normal(size=(2, 150, 150))
    diagonal = np.diag(np.sort(rng.uniform(0, 150, 150)))
    symmetric, turning = 0.02 * (noise[0] + noise[0].T), antisymmetric * (noise[1] - noise[1].T)
    projection = Projection.of(csr_array(diagonal))
    here, there = (projection.levels(csr_array(diagonal + share * (symmetric + turning))) for share in (0.9, 1.0))
    named = meetings(here, there)
    values, right = eig(diagonal + symmetric + turning)
    for k in np.flatnonzero(values.imag > 0):
        assert set(np.argsort(np.abs(right[:, k]))[-2:]) in [set(pair) for pair in named.tolist()]


def test_meetings_of_crossing_levels_between_two_loads():
    """Levels that exchange their order meet, coupled as weakly as may be; those that only come close do not."""
    projection = Projection.of(csr_array(np.diag([1.0, 2.0, 5.0])))
    here, crossed, close = (
        projection.levels(csr_array(np.diag(d))) for d in ([1.0, 2.0, 5.0], [2.0, 1.9, 5.0], [1.5, 2.0, 5.0])
    )
    assert meetings(here, crossed).tolist() == [[0, 1]]
    assert meetings(here, close).tolist() == []


def test_projection_is_given_up_where_modes_mix_or_disks_move_in(ramp):
    path = ramp(1.0, 1e-3, 22)
    matrix = full_operator(path(0.0))
    noise = np.random.default_rng(1).normal(size=(300, 300)) * 20.0
    other = matrix + csr_array(
        noise * (matrix.toarray() != 0).any(axis=1)[:, None] * (matrix.toarray() != 0).any(axis=0)
    )
    more = csr_array(matrix + csr_array(([1.0], ([58], [58])), shape=matrix.shape))
    search = _Search(lambda _: matrix, 0.0)

    def projection(operator):
        ((part, _),) = search.projected(operator)
        return part

    first = projection(matrix)
    assert projection(full_operator(path(0.001))) is first
    for unlike in (csr_array(other), more):
        assert projection(unlike) is not first
        first = projection(matrix)


@pytest.mark.parametrize("mu", [1.0, 0.8])
def test_first_window_of_the_reference(ramp, mu):
    path = ramp(mu, 1e-3, 22)
    window = first_window(lambda fx: full_operator(path(fx)), path.grid[12:21] if mu == 0.8 else path.grid[12:]).window
    assert window.kind == "coalescence"
    assert window.fx_onset == pytest.approx({1.0: 0.0218330564080, 0.8: 0.0191432059561}[mu], rel=1e-9)


def tiled(cell: Packing, copies: int) -> Packing:
    """Copies of a periodic packing side by side, in balance as it is, with masses that make them differ."""
    n, contacts = len(cell), cell.contacts
    index = np.arange(copies)[:, None]
    image = np.where(
        contacts.floor,
        0,
        np.round((cell.position[contacts.i, 0] - cell.position[contacts.j, 0]) / cell.box_length).astype(int),
    )
    j = np.where(contacts.floor, -1, contacts.j + n * ((index + image) % copies))
    shift = np.column_stack([cell.box_length * np.arange(copies), np.zeros(copies)])
    return replace(
        cell,
        position=(cell.position + shift[:, None]).reshape(-1, 2),
        radius=np.tile(cell.radius, copies),
        angle=np.tile(cell.angle, copies),
        mass=np.random.default_rng(3).uniform(0.7, 1.3, n * copies),
        top=np.tile(cell.top, copies),
        box_length=copies * cell.box_length,
        contacts=Contacts((contacts.i + n * index).ravel(), j.ravel(), np.tile(contacts.slip, copies)),
    )


@pytest.mark.slow
def test_first_window_of_a_thousand_disks(ramp):
    """Against all eigenvalues by LAPACK, at the loads before it, just below and just above it."""
    path = ramp(1.0, 1e-3, 22)

    def operator(fx):
        return full_operator(tiled(path(fx), 10))

    window = first_window(operator, path.grid).window
    assert window.kind == "coalescence"
    assert window.error < 1e-9
    distance = 1e-6
    before = [fx for fx in path.grid if fx < window.fx_onset][-2:]
    for fx in [*before, window.fx_onset - distance]:
        matrix = operator(fx)
        values = eigvals(matrix.toarray(), check_finite=False)
        # A double eigenvalue is uncertain by the root of u |A| times its coupling.
        assert np.abs(values.imag).max() < 1e-4
    matrix = operator(window.fx_onset + distance)
    values, left, right = eig(matrix.toarray(), left=True, right=True, check_finite=False)
    (k,) = np.flatnonzero(values.imag > 1e-4)
    assert values[k].real == pytest.approx(window.eigenvalue, abs=1e-2)
    bases = (np.linalg.qr(np.column_stack([each[:, k].real, each[:, k].imag]))[0] for each in (right, left))
    block = continued(matrix, Block.of(matrix, *bases))
    # The imaginary part has condition 1/|y^H x|.
    condition = 1 / abs(np.vdot(left[:, k], right[:, k]))
    rounding = 0.5 * np.finfo(float).eps * np.linalg.norm(matrix.data)
    assert np.sqrt(-block.discriminant) / 2 == pytest.approx(values[k].imag, abs=50 * condition * rounding)
    assert block.mean == pytest.approx(values[k].real, abs=50 * condition * rounding)
