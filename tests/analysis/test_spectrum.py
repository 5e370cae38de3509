"""Spectra: which pairs are real, what is left out, and the large-packing solver against the dense one."""

from dataclasses import replace

import numpy as np
import pytest
from linearised import matrices
from scipy.linalg import block_diag
from scipy.sparse import csr_array, diags_array
from tiling import tile

from faultgouge.analysis import (
    Contacts,
    MindlinLaw,
    Packing,
    discrete_frequency,
    dynamical_matrix,
    eigenvalues,
    growth_rate,
    nearest_modes,
    negative_eigenvalues,
    spectrum,
    stable_timestep,
    touching,
)


def test_eigenvalues_are_those_of_the_linearised_motion(cluster):
    """M^-1 K of disks of several masses, with K as it is compared elsewhere."""
    k, _, mass, _ = matrices(cluster)
    expected, result = np.sort_complex(np.linalg.eigvals(k / mass[:, None])), spectrum(cluster)
    np.testing.assert_allclose(result.eigenvalues, expected, rtol=0, atol=1e-12 * np.abs(expected).max())
    assert result.omega_max == pytest.approx(np.sqrt(np.abs(expected).max()), rel=1e-12)


def test_rattlers_and_force_free_coordinates_are_left_out(reference_packing):
    packing = reference_packing(1.0)
    smooth = replace(packing, law=MindlinLaw(2e5, 0, 1.0))
    nothing = Packing(position=[[0, 9]], radius=[1], contacts=Contacts([], [], []), law=packing.law)
    whole, *others = map(spectrum, (packing, smooth, nothing))
    assert whole.rattlers.tolist() == [58, 80, 85, 88, 89]
    assert [len(each.eigenvalues) for each in (whole, *others)] == [285, 190, 0]
    assert others[1].omega_max == 0


def test_eigenvalues_alone_are_those_of_the_spectrum(reference_packing):
    packing = reference_packing(0.2)
    whole, alone = spectrum(packing), eigenvalues(packing)
    # the same operator in two orders of its coordinates: a simple eigenvalue moves by kappa u |A|
    kappa = 1 / nearest_modes(packing, 0.0, 1).overlap.min()
    np.testing.assert_allclose(alone, whole.eigenvalues, rtol=0, atol=1e3 * kappa * whole.rounding)
    pairs = whole.eigenvalues[whole.eigenvalues.imag > 0]
    assert whole.least_q == min((abs(w.real) / abs(2 * w.imag) for w in np.sqrt(pairs)), default=np.inf)


def test_copies_of_a_packing_have_its_pairs_each_and_no_others(cluster):
    """Three copies that do not touch each other: threefold eigenvalues, which rounding splits at will."""
    c = cluster.contacts
    kept = np.arange(len(c)) != 2  # the contact across the box
    single = replace(cluster, mass=None, inertia_factor=1.0, contacts=Contacts(c.i[kept], c.j[kept], c.slip[kept]))
    one, three = ([pair.eigenvalue for pair in spectrum(each).pairs] for each in (single, tile(single, 3)))
    assert one
    # The overlaps of 1e-2 cost two digits of coordinates up to 11.
    np.testing.assert_allclose(np.sort_complex(three), np.sort_complex(np.repeat(one, 3)), rtol=1e-10)


@pytest.mark.parametrize("near", [2058.4, 2058.4 + 3j, 40.0])
def test_shift_invert_finds_what_lapack_finds(path, near):
    packing = path(0.022)
    dense = spectrum(packing)
    some = nearest_modes(packing, near, 6)
    nearest = dense.eigenvalues[np.argsort(np.abs(dense.eigenvalues - near))[:6]]
    # one by one: the order of a pair is that of its real parts, which rounding decides
    partner = np.abs(some.values[:, None] - nearest).argmin(axis=1)
    assert len(set(partner)) == 6
    # Condition numbers up to 3 and the rounding of either solver, some 20 u |A|.
    np.testing.assert_allclose(some.values, nearest[partner], rtol=0, atol=100 * dense.rounding)
    sparse, active = dynamical_matrix(packing)
    matrix, right, left = sparse.toarray(), some.right[active], some.left[active].conj().T
    scale = np.linalg.norm(matrix, 2)
    assert np.abs(matrix @ right - right * some.values).max() < 1e-13 * scale
    assert np.abs(left @ matrix - some.values[:, None] * left).max() < 1e-13 * scale
    np.testing.assert_allclose(np.linalg.norm(some.left, axis=0), 1, rtol=1e-12)
    for pair in dense.pairs:
        known = np.abs(some.values - pair.eigenvalue) < 1e-6
        np.testing.assert_allclose(some.overlap[known], pair.overlap, rtol=1e-8)


@pytest.mark.parametrize("value", [1.0, 2.5e3, 2e3 + 1.5j, -30.0, 1e-8])
@pytest.mark.parametrize("dt", [1e-3, 1e-2])
def test_discrete_frequency_is_that_of_velocity_verlet(value, dt):
    """One step is a 2 x 2 matrix, with eigenvalues exp(+-i Omega dt)."""
    half = 1 - 0.5 * dt**2 * value
    factors = np.linalg.eigvals(np.array([[half, dt], [-dt * value * (1 - 0.25 * dt**2 * value), half]], complex))
    omega = complex(discrete_frequency(value, dt))
    assert np.cos(omega * dt) == pytest.approx(1 - value * dt**2 / 2, rel=1e-14)
    # The two factors differ by 2 Omega dt, and their rounding is magnified by its inverse.
    for factor in (np.exp(1j * omega * dt), np.exp(-1j * omega * dt)):
        assert np.abs(factors - factor).min() < 4e-15 / abs(omega * dt)
    assert omega == pytest.approx(np.sqrt(complex(value)), rel=abs(value) * dt**2 / 12)


def test_the_fastest_motion_is_found_where_sums_of_rows_are_small(reference_packing):
    """Two clusters that do not touch: the sums of rows are larger in one, and the eigenvalue in the other."""
    packing = reference_packing(1.0)
    half = packing.coordinates // 2
    random = np.random.default_rng(1).normal(size=(half, half))
    one = (random + random.T) @ (random + random.T)
    other = np.diag(np.append(1.3 * np.linalg.eigvalsh(one)[-1], np.full(packing.coordinates - half - 1, 1e-3)))
    root = np.sqrt(packing.coordinate_mass)
    stiffness = csr_array(np.outer(root, root) * block_diag(one, other))
    step = stable_timestep(packing, stiffness)
    assert step == pytest.approx(2 / np.sqrt(other[0, 0]), rel=1e-8)


@pytest.mark.parametrize("dashpots", [0.0, 0.05], ids=["undamped", "damped"])
@pytest.mark.parametrize("last", [2.0, 6.0], ids=["chain", "one fast coordinate"])
def test_the_error_of_a_step_of_many_coordinates_covers_the_limit(reference_packing, dashpots, last):
    """A chain of springs, most of whose modes are near the fastest one; and one coordinate that no other is tied to."""
    packing = tile(reference_packing(1.0), 40)
    n = packing.coordinates
    assert n > 10_000
    link, chain = np.append(np.full(n - 2, -1.0), 0.0), np.append(np.full(n - 1, 2.0), last)
    root = diags_array(np.sqrt(packing.coordinate_mass))
    stiffness = csr_array(root @ diags_array([link, chain, link], offsets=[-1, 0, 1]) @ root)
    largest = max(last, 4 * np.sin(0.5 * np.pi * (n - 1) / n) ** 2)
    mu = 0.5 * (dashpots * largest + np.sqrt((dashpots * largest) ** 2 + 4 * largest))
    step = stable_timestep(packing, stiffness, dashpots / 2 * stiffness if dashpots else None)  # which counts twice
    # what is missed is a tenth of the error, which holds for any matrix
    assert -4 * np.finfo(float).eps * step <= step - 2 / mu < 0.1 * step.error < 0.005 * step
    assert step.certain <= 2 / mu * (1 + 1e-12)


def test_dispersion_changes_no_stability_below_the_limit():
    limit = stable_timestep(50.0)
    assert limit == 0.04
    assert discrete_frequency(2500.0, 0.999 * limit).imag == 0
    assert abs(discrete_frequency(2500.0, 1.001 * limit).imag) > 0
    assert (growth_rate(2500.0), growth_rate(-4.0)) == (0, 4)
    assert growth_rate(1 + 2j) == growth_rate(1 - 2j) == pytest.approx(2 * np.sqrt((np.sqrt(5) - 1) / 2))


@pytest.mark.parametrize(("overlap", "digits"), [(0.01, 1e-12), (2.0**-41, 1e-2)])
def test_negative_eigenvalues_grow(overlap, digits):
    """Two disks one above the other, pressed together without friction, buckle; also where they touch so little that
    the eigenvalue is not far above the rounding of K."""
    law = MindlinLaw(2e5, 0.0, 0.0)
    place, contacts = [[0, 0.5 - overlap], [0, 1.5 - 3 * overlap]], Contacts([0, 0], [-1, 1], [0, 0])
    column = Packing(position=place, radius=[0.5, 0.5], contacts=contacts, law=law)
    result = spectrum(column)
    # f_n/r on the relative motion of two equal masses.
    slope = -2 * law.kn * (2 * overlap) ** 1.5 / (1 - 2 * overlap)
    for found in (result.unstable, negative_eigenvalues(column)):
        assert found == pytest.approx(np.array([slope]), rel=digits, abs=0)
    assert not result.is_stable
    rates = result.growth_rate(), result.growth_rate(dt=1e-3)
    expected = 2 * np.sqrt(-slope), 2 * abs(discrete_frequency(slope, 1e-3).imag)
    assert rates == pytest.approx(expected, rel=digits, abs=0)


@pytest.mark.parametrize(("force", "negative"), [(3e-5, 0), (3e-3, 1)])
def test_forces_out_of_balance_do_not_make_a_packing_unstable(force, negative):
    """A disk on another, pressed by nothing, is out of balance by the force of its contact, which lets it buckle.

    Where this force is a hundred-thousandth of the largest one it counts as balance that is not there, and the
    eigenvalue as zero. Where it is a thousandth the packing moves, and its eigenvalues are those of its forces.
    """
    law = MindlinLaw(kn=2e5, kt=2e5 * 2 / 7, mu=1.0)
    rests, touches = (3.0 / law.kn) ** (2 / 3), (force / law.kn) ** (2 / 3)
    position, radius = np.array([[0.5, 0.5 - rests], [2.5, 0.5 - touches], [2.5, 1.5 - 2 * touches]]), np.full(3, 0.5)
    packing = Packing(
        position=position, radius=radius, top=[True, False, False], box_length=5.0, law=law, fy=3.0,
        contacts=touching(position, radius, 5.0),
    )  # fmt: skip
    found = spectrum(packing)
    assert packing.residual == pytest.approx(force, rel=1e-6)
    assert found.eigenvalues.real[0] == pytest.approx(-0.5 * force, rel=1e-2)
    assert len(found.negative) == len(negative_eigenvalues(packing)) == negative
    assert found.is_stable is (None if negative else True)
    assert ("not known whether the packing is stable: the packing moves" in repr(found)) == bool(negative)
    assert found.free == 3 - negative  # two rolling motions, and that of the disk above


def test_negative_eigenvalues_of_more_disks_than_the_dense_solver_takes():
    """Five columns under different loads among a thousand disks on the floor."""
    law, floor = MindlinLaw(2e5, 0.0, 0.0), np.arange(1005)
    overlap = np.array([0.01, 0.012, 0.015, 0.018, 0.02])
    base = np.column_stack([2.0 * floor, np.where(floor < 5, 0.49, 0.495)])
    top = np.column_stack([2.0 * np.arange(5), 1.49 - overlap])
    contacts = Contacts([*floor, *range(5)], [*np.full(1005, -1), *range(1005, 1010)], np.zeros(1010))
    columns = Packing(position=np.vstack([base, top]), radius=np.full(1010, 0.5), contacts=contacts, law=law)
    expected = np.sort(-2 * law.kn * overlap**1.5 / (1 - overlap))
    np.testing.assert_allclose(negative_eigenvalues(columns), expected, rtol=1e-9)
    stable = replace(columns, contacts=Contacts(floor, np.full(1005, -1), np.zeros(1005)))
    assert len(negative_eigenvalues(stable)) == 0
