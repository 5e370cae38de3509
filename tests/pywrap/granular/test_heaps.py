"""Heaps of spheres with rolling friction (`rolling sds`) beside LAMMPS's own motion: they rest, roll on, or grow.

Spheres fall into a cylinder on a plane, and the cylinder is taken away. Rolling friction keeps a heap from flowing
apart. Its torque R n x f has a spring and a dashpot of the relative rotation, and a bound mu_r f_n with a slider.
"""

import numpy as np
import pytest
from granular_packings import MOVES, agree, command, is_proved
from pushes import in_steps, pushed

import faultgouge
from faultgouge.analysis import stability, stable_timestep
from faultgouge.analysis.motion.pushes import random_pushes

DAMPED, UNDAMPED = ("0.6", "1e-3", "coeff_restitution limit_damping"), ("1e-12", "0.0", "velocity")
MODEL = "hertz/material 1e7 {} 0.3 tangential {law} NULL 1.0 0.5 rolling sds 2e2 {} {mu} damping {}"


@pytest.fixture
def heap(lammps_with):
    """Makes a heap at rest: tangential law, bound of rolling friction, whether there are dashpots, and the seed."""

    def make(law: str, mu: float, damped: bool, seed: int, count: int):
        model, wall = (MODEL.format(*each, law=law, mu=mu) for each in (DAMPED, DAMPED if damped else UNDAMPED))
        texts = {"model": model, "wall": wall, "seed": seed, "count": count}
        lmp = lammps_with("\n".join(f'variable {name} string "{text}"' for name, text in texts.items()), "heap.in")
        faultgouge.relax(lmp)
        if not damped:
            lmp.command(f"pair_coeff * * {wall}")
            faultgouge.relax(lmp)
        return lmp

    return make


HEAPS = {
    "rests": ("mindlin_rescale/force", 0.1, True, 1, 20),
    "rolls at the bound": ("mindlin_rescale/force", 0.02, True, 1, 30),
    "rests without dashpots": ("mindlin_rescale/force", 0.1, False, 2, 20),
    "grows": ("mindlin_rescale", 0.1, False, 5, 50),
}


@pytest.mark.long
@pytest.mark.parametrize("which", HEAPS)
def test_a_heap_after_pushes(heap, which):
    """D after opposite pushes, in LAMMPS's own steps. What grows does so by a factor of 1000."""
    here = faultgouge.from_lammps(lmp := heap(*HEAPS[which]))
    is_proved(here, "laws", 1e-4)
    assert here.contacts.couple.sum() == len(here.contacts.touching)
    told, rolls = stability(here), which == "rolls at the bound"
    assert (told.stable, told.at_bound, told.rolling_at_bound > 0) == (which != "grows", 0, rolls)
    assert ("and the rolling friction of 2 at its own: each slides" in str(told)) is rolls
    times, size = ([0.05, 0.1, 0.2, 0.4], 1e-10) if which == "grows" else ([0.02, 0.05, 0.1, 0.2], 1e-8)
    push, timestep = random_pushes(here, 1), 0.1 * float(stable_timestep(here))
    found = pushed(lmp, here, push, times, timestep, size)
    expected = [in_steps(here, each[:, None], times, timestep) for each in push.T]
    np.testing.assert_allclose(np.transpose(expected), found, rtol=0.01)
    assert (which == "grows") == bool(found[-1].min() > 1000 * found[0].max())


def test_k_and_c_are_those_of_forces(heap):
    """K and C by laws beside differences of LAMMPS's forces, which know nothing of rolling."""
    lmp = heap("mindlin/force", 0.1, True, 1, 15)
    laws, differences = (faultgouge.from_lammps(lmp, differences=each) for each in (False, True))
    assert len(laws.contact_columns()["mobilised"]) == len(differences.contacts) + laws.contacts.touching.wall.sum()
    assert not len(differences.one_sided_particles)
    agree(laws, differences, 1e-6)


@pytest.mark.parametrize("mu", [0.5, 0.0])
def test_the_law_of_two_spheres_and_a_wall(two, tmp_path, mu):
    """`rolling sds` has a stiffness, a dashpot and a bound that no overlap, radius or mass changes; a file keeps it."""
    from faultgouge.analysis.files.configuration_file import read_configuration, write_configuration

    law = f"hertz 1e5 1 tangential mindlin 3e4 1.0 {mu} rolling sds 7e2 0.3 0.02"
    lmp, told = two("granular", f"* * {law}", f"fix w all wall/gran granular {law} zplane 0 NULL{MOVES}")
    lmp.numpy.extract_atom("omega")[:] = [0.2, 0.1, 0.0]
    command(lmp, "timestep 1e-6\nrun 3 post no")
    found = faultgouge.from_lammps(lmp, told, balance=np.inf, prove=False)
    touching, rolls = found.contacts.touching, found.contacts.chosen(found.contacts.couple)
    assert len(touching) == len(rolls) == 2
    for name in ("i", "j", "normal", "overlap", "normal_force", "normal_stiffness"):
        assert np.array_equal(getattr(touching, name), getattr(rolls, name))
    assert rolls.tangential_stiffness == pytest.approx(7e2, rel=1e-9)
    assert rolls.tangential_dashpot == pytest.approx(0.3, rel=1e-6)
    assert rolls.friction == pytest.approx(0.02 * rolls.normal_force, rel=1e-9)
    assert rolls.slip_arm == pytest.approx(np.where(rolls.wall[:, None], [0.5, 0.0], [0.25, -0.25]), rel=1e-12)
    assert touching.lever_slope == pytest.approx(np.where(touching.wall, 0.0, 0.5) * (mu > 0))
    write_configuration(tmp_path / "rolls.h5", found)
    assert read_configuration(tmp_path / "rolls.h5") == found
