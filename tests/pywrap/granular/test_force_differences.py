"""K and C by differences of LAMMPS's forces: beside the measured laws, beside LAMMPS's motion, and through a file."""

import numpy as np
import pytest
from granular_packings import DECKS, LAWS, agree, command, deck, instance, is_proved, refused
from pushes import moves_alike
from scipy.spatial import cKDTree

import faultgouge
from faultgouge.analysis import spectrum, stability, stiffness_matrix
from faultgouge.analysis.arrays import derive_frozen
from faultgouge.analysis.files.configuration_file import read_configuration, write_configuration


@pytest.mark.long
@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("law", LAWS)
def test_measured_laws_and_differences_agree(bed, law, d):
    """K within 1e-5, which `granular` and its bound of 1e-10 of Coulomb's needs, and C within 1e-6, of the largest."""
    lmp, laws = bed(law, d)
    found = faultgouge.from_lammps(lmp, differences=True)
    assert (laws.operators, found.operators) == ("laws", "differences")
    assert not laws.contacts.at_bound.any()
    agree(found, laws)
    assert found.operator_error < 1e-5
    # a law with two derivatives has a jump at every contact, and no other has one where nothing slides
    rescales = "rescale" in law
    assert len(found.one_sided_particles) == rescales * len(found)
    if rescales:
        assert (told := spectrum(found)).is_stable is stability(found).stable is None
        assert "not known whether the packing is stable: the forces on" in repr(told)
    assert found.residual == pytest.approx(laws.residual, abs=1e-9 * laws.contacts.normal_force.mean())


def test_a_contact_at_the_bound_is_seen(taken):
    """Its two particles have other derivatives forwards than backwards, and K is the mean of sticking and sliding."""
    lmp, exact = taken("", "passing.in", balance=np.inf)
    assert exact.contacts.at_bound.sum() == 1
    found = faultgouge.from_lammps(lmp, balance=np.inf, differences=True)
    assert set(found.ids[found.one_sided_particles]) == {1, 2}
    slides = derive_frozen(exact, contacts=derive_frozen(exact.contacts, sliding=exact.contacts.at_bound))
    mean = 0.5 * (stiffness_matrix(exact) + stiffness_matrix(slides))
    assert abs(stiffness_matrix(found) - mean).max() < 1e-6 * abs(mean).max()


SLIDES = "hooke/history 1e4 3e3 20 NULL 0.5 1 zplane 0 NULL contacts"


def row(*places, more: str = "fix move all nve/sphere") -> str:
    """Spheres without friction on a plane with friction."""
    law = "hooke/history 1e4 3e3 20 NULL 0.0 1"
    return deck([(*each, 0.4999) for each in places], law, more=f"fix floor all wall/gran {SLIDES}\n{more}")


FROZEN = row((-0.99, 0.1), (0, 0), (0.99, 0.1), more="group base id 1\nfix base base freeze\nfix move all nve/sphere")
CHAINS = [
    deck([(x, 0, 0) for x in (0.0, 0.99, 1.98, 2.98 - overlap)], "hooke/history 1e4 3e3 20 NULL 0.5 1", load="",
         box="block -4 4 -4 4 -4 4") for overlap in (1e-6, 4e-8)
]  # fmt: skip


@pytest.mark.parametrize("lines", [FROZEN, *(pytest.param(each, marks=pytest.mark.long) for each in CHAINS)])
def test_dashpots_of_frozen_particles_and_weak_contacts_among_strong_ones(lammps_with, lines):
    """The frozen weigh infinitely much in LAMMPS's dashpots, whichever way C is found. The displacement that suits the
    other contacts opens a weak one, and has it slide; a finer one does not."""
    lmp = lammps_with(lines)
    found, laws = (faultgouge.from_lammps(lmp, differences=each, balance=np.inf, prove=False) for each in (True, False))
    agree(found, laws, *((1e-5, 1e-6) if lines is FROZEN else (1e-6, 1e-5)))
    assert found.operator_error < 1e-5
    assert lines is FROZEN or not len(found.one_sided_particles)


@pytest.mark.parametrize("gap", [1e-13, 1e-5])
def test_particles_that_nearly_touch(taken, gap):
    """LAMMPS's compute pair/local says nothing of them, and one that is displaced may feel the other one.

    A displacement is far longer than one of the gaps, and far shorter than the other.
    """
    lmp, found = taken(row((-1.5, 0), (0, 0), (1 + gap, 0)), differences=True, balance=np.inf)
    laws = faultgouge.from_lammps(lmp, prove=False, balance=np.inf)
    assert len(found.contacts) == 0
    assert found.operator_error < 1e-5
    added, mean = (stiffness_matrix(found) - stiffness_matrix(laws)).toarray()[:9, :9], np.zeros((9, 9))
    if gap < 1e-9:  # the spring of two that touch, in half of all displacements
        mean[1:3, 1:3] = 0.5 * 1e4 * np.array([[1, -1], [-1, 1]])
        assert set(found.ids[found.one_sided_particles]) == {2, 3}
    assert np.abs(added - mean).max() < 1e-3 * 1e4


def in_a_box(*places, down: str) -> str:
    """Spheres in a region."""
    law = "hooke/history 4e3 NULL 100 NULL 0.5 1"
    region = f"region inner block -6 6 -6 6 -6 6 units box\nfix inner all wall/gran/region {law} region inner"
    more = f"{region}\nfix move all nve/sphere\nfix drag all viscous 1"
    return deck(places, law, box="block -10 10 -10 10 -10 10", load=down, more=more, timestep=0.004, run="run 20000")


@pytest.mark.parametrize("kisses", [False, True])
def test_spheres_in_an_edge_and_in_a_corner_of_a_region(taken, kisses):
    """With friction at two and three faces; or at a face that bears nothing, which is about to open."""
    places = [(-5.5, -5.5, -5.5), (-4.5, -5.5, -5.5)]
    _, found = taken(in_a_box(*places[: 2 - kisses], down="0 -0.4 -1" if kisses else "-0.5 -0.4 -1"))
    one_sided, stable = ([1], None) if kisses else ([], True)  # nothing presses a sphere along x that kisses the face
    assert (list(found.ids[found.one_sided_particles]), stability(found).stable) == (one_sided, stable)
    if not kisses:
        is_proved(found, "differences")
        assert found.operator_error < 1e-6


def test_rest_is_measured_by_forces_of_walls_too(lammps_with):
    """Two spheres rest on the floor of a region and hardly press each other: their weight is what is in balance."""
    lmp, weight = lammps_with(in_a_box((0, 0, -5.5), (0.999, 0, -5.5), down="0 0 -1")), np.pi / 6
    found = faultgouge.from_lammps(lmp, balance=1.0)
    assert found.wall_force == pytest.approx(weight, rel=1e-3)
    contacts = derive_frozen(found.contacts, normal_force=np.full(len(found.contacts), 1e-6 * weight))
    feeble = derive_frozen(found, contacts=contacts)
    says = "the packing moves: the residual force on a particle is 0.00524, the largest force of a contact or a wall"
    for share, moves in ((1e-5, False), (1e-2, True)):
        load = feeble.load - feeble.net_force
        load[0, 0, 0] += share * weight
        assert (says in str(stability(derive_frozen(feeble, load=load)).reasons)) is moves


@pytest.mark.long
def test_forces_that_depend_on_all_contacts_of_a_particle(taken):
    """In a die the model mdr has a particle's volume resist: its neighbours feel one another through it."""
    _, found = taken("", "die.in")
    assert found.operator_error < 1e-5
    assert found.proof < 1e-3  # the volume acts one step late: 3e-4 in long steps, 3e-5 in short ones
    along = abs(stiffness_matrix(found).toarray()[8:12, 8:12])
    assert min(along.diagonal(2).min(), along.diagonal(-2).min()) > 0.01 * along.max()
    assert along[0, 3] == along[3, 0] == 0.0


def test_particles_far_apart_that_something_couples(lammps_with):
    """They are displaced together, as no neighbours are; the refusal names the one that feels the other most."""
    lmp = lammps_with(row((-1.5, 0), (0, 0), (2.5, 0)))
    command(lmp, "group left id 1\ngroup right id 3\nfix tie left spring couple right 3e3 4 0 0 0")
    with refused(r"at particle [13] at \(.*, 0, 0\.4999\).*couples particles that are no"):
        faultgouge.from_lammps(lmp, differences=True, balance=np.inf)


@pytest.fixture(scope="module", params=[36, pytest.param(126, marks=pytest.mark.long)])
def cone(request, tmp_path_factory):
    """Spheres with cohesion, rolling and twisting friction, at rest, and their configuration."""
    lmp = instance(tmp_path_factory.mktemp("cone") / "log.lammps")
    lmp.command(f"variable count equal {request.param}")
    lmp.file(str(DECKS / "cone.in"))
    faultgouge.relax(lmp)
    yield lmp, faultgouge.from_lammps(lmp)
    lmp.close()


@pytest.mark.long
def test_cohesive_spheres_in_a_cone(cone, tmp_path):
    """JKR, rolling and twisting friction in a region: LAMMPS moves as K and C say, and a file has them to the bit."""
    lmp, found = cone
    is_proved(found, "differences")  # by steps of Verlet, so that no error of the step is in it
    assert "K and C by differences of forces" in repr(found)
    pairs = cKDTree(found.position).query_pairs(1.0)  # the region hands out no contacts
    assert len(pairs) > 0.5 * len(found)
    assert pairs <= {tuple(sorted(each)) for each in zip(found.contacts.i, found.contacts.j, strict=True)}
    assert found.contacts.normal_force.min() < 0  # cohesion
    moves_alike(lmp, found, 0.005)
    write_configuration(tmp_path / "cone.h5", found)
    assert read_configuration(tmp_path / "cone.h5") == found
    with pytest.raises(ValueError, match="leave parting and sliding out"):
        stiffness_matrix(found, parting=0.0)


def test_the_cone_is_as_stable_as_lammps_says(cone):
    """All motions decay, some of them slowly, and LAMMPS's own velocities fall by as much as those of K and C."""
    from faultgouge.pywrap import compare_motion

    lmp, found = cone
    verdict = stability(found)
    assert verdict.stable is (verdict.growth_rate < 0) is True
    assert str(verdict).startswith("stable: every motion decays")
    runs = [compare_motion(lmp, found, time, 1e-5, timestep=2.5e-4) for time in (0.1, 0.8)]
    of_lammps, of_k_and_c = np.linalg.norm([[run.velocity, run.linear_velocity] for run in runs], axis=2).T
    assert of_lammps[1] < 0.8 * of_lammps[0]
    # dashpots feel the velocities of half steps: 1 % of them at this time step, and half of it at half of the step
    assert of_lammps[1] / of_lammps[0] == pytest.approx(of_k_and_c[1] / of_k_and_c[0], rel=1e-2)
