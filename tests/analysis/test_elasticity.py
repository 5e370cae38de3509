"""Stress, moduli, vibrations and lost energy against closed forms, dense matrices and a slow integration."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import eigh
from table_rows import rows_of

from faultgouge.analysis import (
    BadInputError,
    Material,
    damping_matrix,
    dispersion,
    elastic_moduli,
    lost_by_modes,
    lost_energy,
    softness,
    spheres_of_material,
    stable_timestep,
    stiffness_matrix,
    stress,
    timestep_rules,
    vibrations,
)
from faultgouge.analysis.arrays import derive_frozen
from faultgouge.analysis.elasticity import vibrations as how

FACES = np.array([[0, 0, 0], [1, 1, 0], [1, 0, 1], [0, 1, 1]]) / 2


def periodic(place, radius, material, cells, edge):
    """Spheres in a periodic box of cells of this edge."""
    return spheres_of_material(place, radius, material, box=edge * np.diag(cells), periodic=[True] * 3)


def places(cells):
    """Those of a face-centred cubic crystal whose cells have the edge one."""
    return np.concatenate([FACES + np.array(cell) for cell in np.ndindex(*cells)])


def crystal(poisson=0.2, overlap=1e-6, cells=(2, 2, 2)):
    """Spheres of radius 1/2 in contact; the overlap is in radii."""
    place, edge = places(cells), np.sqrt(2) * 0.5 * (2 - overlap)
    return periodic(edge * place, np.full(len(place), 0.5), Material(1.0, poisson, density=1.0), cells, edge)


def disordered(cells=(3, 3, 3), **more):
    """Spheres of two sizes near the places of a crystal, which touch: no packing at rest, but every K has modes."""
    rng, edge, place = np.random.default_rng(0), 1.38, places(cells)
    place = edge * place + rng.uniform(-0.01, 0.01, place.shape)
    radius = rng.uniform(0.5, 0.52, len(place))
    return periodic(place, radius, Material(1000.0, 0.25, density=1.0, **more), cells, edge)


@pytest.mark.parametrize("poisson", [0.0, 0.2, 0.45])
@pytest.mark.parametrize("overlap", [1e-5, 1e-7])
def test_moduli_of_a_crystal_are_those_of_duffy_and_mindlin(poisson, overlap):
    """Their formulas leave the present stress p out; in C11 its parts cancel but for a tenth of delta/R."""
    packing = crystal(poisson, overlap)
    found, p = elastic_moduli(packing), np.trace(stress(packing)) / 3
    mu = 1 / (2 * (1 + poisson))
    scale = (3 * mu**2 * p / (2 * (1 - poisson) ** 2)) ** (1 / 3) / (2 - poisson)
    c = found.tensor
    assert c[0, 0, 0, 0] == pytest.approx((4 - 3 * poisson) * scale, rel=0.1 * overlap + 1e-13)
    assert c[1, 2, 1, 2] == pytest.approx((4 - 3 * poisson) * scale / 2, abs=2 * p)
    assert c[0, 0, 1, 1] == pytest.approx(poisson * scale / 2, abs=2 * p)
    assert np.abs(found.antisymmetric).max() < 1e-14 * c[0, 0, 0, 0]
    assert np.abs(c - found.affine).max() < 1e-12 * c[0, 0, 0, 0]  # each sphere is a centre of inversion


@pytest.mark.parametrize("d", [2, 3])
def test_isotropic_numbers_are_those_of_an_isotropic_tensor(d):
    """With lambda = 3 and mu = 2; E and nu are those of a strain along x with free sides."""
    found, one = elastic_moduli(crystal()), np.diag(np.arange(3) < d).astype(float)
    pairs = np.einsum("ik,jl->ijkl", one, one)
    tensor = 3.0 * np.einsum("ij,kl->ijkl", one, one) + 2.0 * (pairs + pairs.transpose(0, 1, 3, 2))
    made = replace(found, tensor=tensor, dimension=d)
    strain = np.linalg.solve(np.einsum("iijj->ij", tensor)[:d, :d], np.eye(d)[0])
    assert (made.shear, made.bulk) == pytest.approx((2.0, 3 + 4 / d), rel=1e-14)
    assert (made.young, made.poisson) == pytest.approx((1 / strain[0], -strain[1] / strain[0]), rel=1e-13)
    assert made.anisotropy < 1e-15


def test_disks_on_a_triangular_lattice_are_isotropic_in_their_plane():
    """Bonds of three directions have G = 3^(1/2) (k_n + k_t)/4 and the bulk modulus 3^(1/2) k_n/2; z has no part."""
    edge, cell = 1 - 1e-9, np.array([1.0, np.sqrt(3)])
    place = edge * np.concatenate([[cell * at, cell * (np.array(at) + 0.5)] for at in np.ndindex(4, 3)])
    box = edge * np.diag([4, 3 * np.sqrt(3), 1.0])
    material = Material(kn=1e3, kt=300.0, exponent=1.0, density=1.0)
    found = elastic_moduli(
        spheres_of_material(place, np.full(24, 0.5), material, box=box, periodic=[True, True, False])
    )
    assert found.shear == pytest.approx(np.sqrt(3) / 4 * 1300, rel=1e-8)
    assert found.bulk == pytest.approx(np.sqrt(3) / 2 * 1000, rel=1e-8)
    assert found.anisotropy < 1e-8
    for axis in range(4):
        assert not np.moveaxis(found.tensor, axis, 0)[2].any()


def test_waves_of_a_crystal_are_those_of_its_moduli_and_of_its_springs():
    """Long waves have the speeds of the moduli; a shorter one, whose spheres move along x alone, k_n and k_t."""
    packing = crystal(0.2, 1e-4, (12, 2, 2))
    waves, speeds = dispersion(packing, 0, 2), elastic_moduli(packing).wave_speeds[0]
    c, edge = packing.contacts, packing.box[0, 0] / 12
    for wave in waves:
        speed = speeds[min(wave.polarisation, 1)]
        assert wave.frequency / wave.wave_number == pytest.approx(speed, rel=0.03 * (wave.wave_number * edge) ** 2)
        # a little of a transverse wave goes into rotation, which beats
        assert abs(wave.attenuation) < 1e-4 * wave.frequency
    # planes of spheres along x are 4 bonds apart on each side: n.x = 1/sqrt 2
    half = (c.normal_stiffness[0] + c.tangential_stiffness[0] - c.normal_force[0] / c.distance[0]) / 2
    told = [np.sqrt(8 * half * (1 - np.cos(wave.wave_number * edge / 2)) / packing.mass[0]) for wave in waves[::3]]
    assert [wave.frequency for wave in waves[::3]] == pytest.approx(told, rel=1e-6)


def test_density_of_states_is_that_of_all_eigenvalues(monkeypatch):
    """By random vectors and by LAPACK, within the stated errors, and of integral one."""
    packing = disordered(restitution=0.7)
    exact = vibrations(packing, moments=96)
    monkeypatch.setattr(how, "ALL_MODES", 0)
    found = vibrations(packing, moments=96, vectors=12)
    told = np.interp(found.frequency, exact.frequency, exact.density)
    off = np.abs(found.density - told) / np.maximum(found.density_error, 0.02 * told.max())
    assert np.mean(off < 2) > 0.9
    assert off.max() < 5
    for each in (exact, found):
        width = np.gradient(each.frequency)
        assert np.sum(each.density * width) == pytest.approx(1, abs=2e-3)
        assert (each.counted, each.negative) == (packing.coordinates - 3, 0)
    middle = told > 0.3 * told.max()
    rotation, damping = (np.interp(found.frequency, exact.frequency, each) for each in (exact.rotation, exact.damping))
    assert np.abs(found.rotation - rotation)[middle].max() < 0.1
    assert np.abs(found.damping / damping - 1)[middle].max() < 0.1


def test_modes_are_those_of_lapack():
    packing = disordered((2, 2, 2), restitution=0.7)
    found, root = vibrations(packing), np.sqrt(packing.coordinate_mass)
    values, vectors = eigh((stiffness_matrix(packing) / np.outer(root, root)).toarray())
    c = (damping_matrix(packing) / np.outer(root, root)).toarray()
    assert found.modes["frequency"] == pytest.approx(np.sqrt(values[3:]), rel=1e-9)
    assert found.modes["damping"] == pytest.approx(np.einsum("ik,ij,jk->k", vectors, c, vectors)[3:], rel=1e-6)
    energy = (vectors**2).reshape(6, len(packing), -1)[:, :, 3:]
    of_sphere = energy.sum(axis=0)
    assert found.modes["participation"] == pytest.approx(1 / (len(packing) * np.sum(of_sphere**2, axis=0)), rel=1e-6)
    assert found.modes["rotation"] == pytest.approx(energy[3:].sum(axis=(0, 1)), rel=1e-6)


def test_softness_is_that_of_the_inverse(monkeypatch):
    packing = disordered((2, 2, 2))
    n = len(packing)
    inverse = np.linalg.pinv(stiffness_matrix(packing).toarray(), rcond=1e-10)
    told = np.diag(inverse)[: 3 * n].reshape(3, n).mean(axis=0)
    found, error = softness(packing)
    assert found == pytest.approx(told, rel=1e-6)
    assert not error.any()
    monkeypatch.setattr(how, "EXACT_SOFTNESS", 0)
    guess, error = softness(packing)
    assert np.mean(np.abs(guess - told) < 2 * error) > 0.85


def test_a_free_sphere_counts_nowhere():
    packing = crystal()
    c, last = packing.contacts, len(packing) - 1
    packing = derive_frozen(packing, contacts=c.chosen((c.i != last) & (c.j != last)))
    assert np.isinf(softness(packing)[0]).nonzero()[0].tolist() == [len(packing) - 1]
    assert vibrations(packing).counted == 6 * (len(packing) - 1) - 3
    assert elastic_moduli(packing).density == pytest.approx(elastic_moduli(crystal()).density * 31 / 32)


def test_moduli_over_frequency_are_driven_by_springs_and_dashpots():
    """(K + i omega C - omega^2 M) q is the force of the affine motion: that of springs, and i omega that of dashpots.

    Beside LAMMPS the moduli over frequency are in tests/pywrap/test_moduli_in_lammps.py.
    """
    packing = disordered((2, 2, 2), restitution=0.05)
    k, c, m = stiffness_matrix(packing), damping_matrix(packing), packing.coordinate_mass[:, None]
    springs = k @ elastic_moduli(packing).displacement.reshape(-1, 9)
    dashpots = []
    for omega in (3.0, 20.0):
        found = elastic_moduli(packing, omega)
        q = found.displacement.reshape(-1, 9)
        rest = k @ q + 1j * omega * (c @ q) - omega**2 * m * q - springs
        assert np.abs(rest.real).max() < 1e-8 * np.abs(springs).max()
        assert abs(found.shear.imag) > 1e-3 * abs(found.shear)
        dashpots.append(rest.imag / omega)
    size = np.abs(dashpots).max()
    assert size > 1e-3 * np.abs(springs).max()
    np.testing.assert_allclose(*dashpots, rtol=0, atol=1e-8 * size)


def test_lost_energy_is_what_the_motion_has_no_more():
    """Followed by small steps with dashpots and drag, without sliding: 1/2 v M v + 1/2 q K q falls by it."""
    packing = disordered((2, 2, 2), restitution=0.5)
    k, c, m = stiffness_matrix(packing), damping_matrix(packing), packing.coordinate_mass
    dt = 0.01 * float(stable_timestep(packing))
    q, v = np.zeros(len(m)), 1e-6 * np.random.default_rng(3).standard_normal(len(m))
    states = [(q, v)]
    for _ in range(600):
        half = v - 0.5 * dt / m * (k @ q + c @ v)
        q = q + dt * half
        v = half - 0.5 * dt / m * (k @ q)
        v = v - 0.5 * dt / m * (c @ v)
        states.append((q, v))
    places, speeds = zip(*states, strict=True)
    lost = lost_energy(packing, dt * np.arange(601), places, speeds)
    energy = [0.5 * v @ (m * v) + 0.5 * q @ (k @ q) for q, v in states]
    assert energy[-1] < 0.5 * energy[0]
    assert lost.total[-1] == pytest.approx(energy[0] - energy[-1], rel=1e-2)
    assert lost.slider.sum() == 0
    of_modes = lost_by_modes(packing, speeds[0])[1]
    assert of_modes.sum() == pytest.approx(speeds[0] @ (c @ speeds[0]), rel=1e-9)
    assert (of_modes > -1e-3 * of_modes.sum()).all()


def test_a_slider_takes_force_times_slip():
    """Two spheres pressed together and drawn apart sideways: the spring to the bound, then mu f_n times the way."""
    draws, material = 1e-4, Material(1.0, 0.2, density=1.0, friction=0.3)
    pair = spheres_of_material([[0, 0, 0], [1 - 1e-4, 0, 0]], [0.5, 0.5], material, tangential_force=np.zeros((1, 3)))
    c = pair.contacts
    way = np.linspace(0, draws, 101)
    moved = np.zeros((101, 12))
    moved[:, 3] = way  # y of the second sphere
    lost = lost_energy(pair, way, moved, np.gradient(moved, way, axis=0))
    bound = float(c.friction[0])
    told = bound * (draws - bound / c.tangential_stiffness[0])
    assert lost.slider[0] == pytest.approx(told, rel=1e-9, abs=0)
    assert lost.total[-1] == pytest.approx(told, rel=1e-9, abs=0)


@pytest.mark.parametrize(("given", "word"), rows_of("analysis/refused_materials.txt"))
def test_what_no_material_has_is_named(given, word):
    with pytest.raises(BadInputError, match=word):
        spheres_of_material([[0.0, 0.0, 0.0]], [0.5], Material(**given))


def test_where_there_is_no_volume_none_is_guessed(reference_packing):
    layer = reference_packing(1.0)
    for asked, says in (
        (stress, "along y it is neither periodic nor between two flat walls"),
        (elastic_moduli, "periodic along all of its axes"),
        (lambda packing: dispersion(packing, 1), "Plane waves need a box that is periodic along y"),
    ):
        with pytest.raises(BadInputError, match=says):
            asked(layer)
    assert stress(layer, 2.0) == pytest.approx(0.5 * stress(layer, 1.0))
    assert [wave.wave_number for wave in dispersion(layer, 0, 1)] == pytest.approx([2 * np.pi / layer.box_length] * 2)


def test_a_bent_chain_straightens_without_resistance():
    """Its forces, 1e-12 of its springs, are too small to hold it."""
    link, friction_free = 1 - 1e-12, Material(1.0, friction=0.0, density=1.0)

    def along(turn):
        place = link * np.array([[0, 0, 0], [np.cos(turn), np.sin(turn), 0], [2 * np.cos(turn), 0, 0]])
        cells = 1 + 2 * np.cos(turn), 3.0, 3.0
        return elastic_moduli(periodic(place, np.full(3, 0.5), friction_free, cells, link)).tensor[0, 0, 0, 0]

    straight, bent = along(0.0), along(0.1)
    assert straight > 0
    assert abs(bent) < 1e-8 * straight


def test_time_steps_beside_the_rules():
    step, rules = timestep_rules(crystal(0.0, 1e-3))
    assert step / rules["o_sullivan_bray"] == pytest.approx(1.860, abs=1e-3)
    assert rules["oscillator"] > step > rules["o_sullivan_bray"]
    assert rules["rayleigh"] > step
