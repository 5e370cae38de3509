"""Shear cells with a lid that moves as one body: LAMMPS's own motion beside that of the projected operators."""

import numpy as np
import pytest
from granular_packings import agree, deck, is_proved, refused
from pushes import in_steps, moves_alike, pushed

import faultgouge
from faultgouge.analysis import stability, stiffness_matrix
from faultgouge.analysis.files.configuration_file import read_configuration, write_configuration
from faultgouge.analysis.motion.pushes import random_pushes

LAW = "hertz/history 1e4 3e3 20 10 0.5 1"
PLACES = np.array([(x, y, z) for z in range(4) for y in range(3) for x in range(3)]) * 1.1 + 0.55
PLACES[:27, :2] += np.random.default_rng(3).uniform(-0.04, 0.04, (27, 2))


@pytest.fixture
def cell(lammps_with):
    """Makes a LAMMPS with 27 spheres under a lid of nine, and its configuration at rest."""

    def make(lid: str, *, law: str = LAW, run: str = "run 20000", rests: bool = True):
        groups = "group lid type 2\ngroup filling type 1\nneigh_modify exclude group lid lid"
        more = f"{groups}\nfix move filling nve/sphere\n{lid}\nfix drag all viscous 1.0"
        lmp = lammps_with(deck(
            PLACES, law, "zplane 0 NULL contacts", box="block 0 3.3 0 3.3 -1 12", boundary="p p f",
            kinds=[1] * 27 + [2] * 9, diameters=(1.0, 1.0), more=more, run=run,
        ))  # fmt: skip
        if rests:
            assert faultgouge.relax(lmp) < 1e-8
        return lmp, faultgouge.from_lammps(lmp)

    return make


CONFINED, RIGID = "fix push lid addforce 0.05 0 -2.0", "fix body lid rigid single torque 1 off off off"
LIDS = {
    "aveforce": f"fix body lid nve\n{CONFINED}\nfix stiff lid aveforce 0.0 0.0 0.0",
    "aveforce, sideways held": f"fix body lid nve\n{CONFINED}\nfix hold lid setforce NULL 0.0 NULL\n"
    "fix stiff lid aveforce 0.0 NULL 0.0",
    "rigid": f"{CONFINED}\n{RIGID}",
    "rigid, pushed by a later fix": f"{RIGID}\n{CONFINED}",
    "rigid, sideways held": f"{CONFINED}\nfix body lid rigid group 1 lid torque * off off off force 1 on off on",
}


@pytest.mark.long
@pytest.mark.parametrize("lid", LIDS)
def test_a_lid_moves_as_one(cell, tmp_path, lid):
    lmp, found = cell(LIDS[lid])
    n, on_lid = len(found), np.flatnonzero(found.kind == 2)
    is_proved(found, "laws")
    measured = faultgouge.from_lammps(lmp, differences=True)
    agree(found, measured, 1e-6)
    assert abs(found.constraint - measured.constraint).max() == 0
    assert found.residual == pytest.approx(measured.residual, rel=1e-3)
    moves = np.array([True, "held" not in lid, True, False, False, False])  # of the first particle, for all
    rows = np.diff(stiffness_matrix(found).indptr).reshape(6, n)
    assert np.array_equal(rows[:, on_lid] > 0, np.outer(moves, np.arange(9) == 0))
    assert found.coordinate_mass.reshape(6, n)[moves, on_lid[0]] == pytest.approx(found.mass[on_lid].sum())
    translation, rotation = found.vectors(np.eye(6 * n)[2 * n + on_lid[0]])
    assert np.ptp(translation[on_lid], axis=0).max() == 0 == np.abs(rotation).max()
    assert np.count_nonzero(translation) == 9
    moves_alike(lmp, found, 0.02)
    write_configuration(tmp_path / "cell.h5", found)
    assert read_configuration(tmp_path / "cell.h5") == found


@pytest.mark.long
def test_a_grain_between_two_bodies_of_one_fix(lammps_with):
    """fix rigid moves the particles of its bodies alone, whatever its own group is; a body that keeps its place is as
    frozen particles, but for dashpots, which feel its mass."""
    from faultgouge.pywrap import compare_motion

    found = []
    for moved in ("all", "bed"):
        lmp = lammps_with(f"variable moved string {moved}", "two_bodies.in", log=f"log.{moved}")
        found.append(faultgouge.from_lammps(lmp))
    here = found[1]
    assert found[0] == here
    assert list(here.free) == [False] * 4 + [True] * 5
    is_proved(here, "laws")
    measured = faultgouge.from_lammps(lmp, differences=True)
    assert measured.remarks[0].startswith("K and C are differences of LAMMPS's forces: ")
    agree(here, measured, 1e-6)
    told, run = stability(here), compare_motion(lmp, here, 1.0, 1e-6, timestep=2e-5)
    assert (told.stable, run.difference < 1e-3) == (True, True)
    # D falls as its slowest part or faster
    later = compare_motion(lmp, here, 11.0, 1e-6, timestep=1e-4).velocity
    assert np.sum(later**2) < np.sum(run.velocity**2) * np.exp(told.growth_rate * 10.0)


def later(lmp):
    """The configuration of a LAMMPS whose residual forces have died away, its verdict and a push."""
    lmp.command("run 50000 post no")
    found = faultgouge.from_lammps(lmp)
    return found, stability(found), random_pushes(found, 1)[:, :1]


@pytest.mark.long
def test_a_rigid_lid_with_contacts_at_the_bound_rests_as_in_lammps(cell):
    """D is that of LAMMPS's particles while all but one in a thousand of the motion dies away."""
    lmp, _ = cell(LIDS["rigid"].replace("0.05", "0.5"), law=LAW.replace("0.5", "0.3"))
    found, told, push = later(lmp)
    assert found.contacts.one_sided.any()
    assert (told.stable, told.one_sided is None) == (True, False)
    times = [0.5, 2.0, 8.0, 32.0, 64.0, 100.0]
    expected = in_steps(found, push, times, 2e-3)
    np.testing.assert_allclose(pushed(lmp, found, push, times, 2e-3, 1e-8)[:, 0], expected, rtol=2e-3)
    assert expected[-1] < 0.1 * expected[0]


@pytest.mark.long
def test_a_lid_with_contacts_at_the_bound_grows_as_lammps_does(cell):
    """D is that of LAMMPS over six decades; sticking contacts alone decay or grow.

    At first after a push of 1e-7, to 1 %: after smaller ones what contacts lack of the bound counts. Later after one
    of 1e-8, to 3 %: what has grown from a larger push takes other contacts to the bound.
    """
    lmp, _ = cell(LIDS["aveforce"].replace("0.05", "0.8"))
    found, told, push = later(lmp)
    assert found.contacts.one_sided.sum() > 5
    assert (told.stable, told.one_sided.grows) == (False, True)
    times = np.array([0.5, 2.0, 8.0, 32.0, 80.0, 100.0, 120.0, 140.0])
    expected = in_steps(found, push, times, 2e-3)
    for part, size, agrees in ((slice(0, 5), 1e-7, 0.01), (slice(4, None), 1e-8, 0.03)):
        in_lammps = pushed(lmp, found, push, times[part], 2e-3, size)[:, 0]
        np.testing.assert_allclose(in_lammps, expected[part], rtol=agrees)
    rate = np.polyfit(times[part], np.log(in_lammps), 1)[0]
    assert rate == pytest.approx(told.growth_rate, rel=0.05)


def test_what_touches_nothing_and_belongs_to_a_lid_is_no_rattler(cell):
    """The lid's residual force is that of its first sphere, which may hang free."""
    _, found = cell(f"group first id 28\ndisplace_atoms first move 0 0 0.5\n{LIDS['aveforce']}")
    assert 27 not in {*found.contacts.i, *found.contacts.j, *found.rattlers}
    assert found.residual > 0


@pytest.mark.long
@pytest.mark.parametrize("lid", ["aveforce", "rigid"])
def test_a_lid_of_two_masses(cell, lid):
    """fix aveforce gives its particles the same force: the lid deforms as the inverse masses. A body of fix rigid does
    not, and dashpots feel its mass."""
    lmp, found = cell("set atom 30*32 density 2.0\n" + LIDS[lid])
    assert len(set(found.mass[found.kind == 2].round(10))) == 2
    moves_alike(lmp, found, 0.02)


SPRING = "variable pull equal 0.05-10*(xcm(lid,x)-1.65)\nfix body lid nve\nfix push lid addforce 0 0 -2.0"
OUT_OF_BALANCE = "residual of the lid of 9 particles that move as one, with particle 28 .* of the mean"
REFUSED = [
    # what would be missing in K, as the fix is taken away where forces are differences
    (
        f"{SPRING}\nfix stiff lid aveforce v_pull 0.0 0.0",
        "run 10",
        r"aveforce drives .* the force v_pull: .*fix addforce",
    ),
    ("fix body lid rigid single", "run 10", r"fix rigid single, or group, with `torque \* off off off`"),
    ("fix body lid rigid single torque 1 off off on", "run 10", r"bodies that may rotate.*`torque \* off off off`"),
    (f"{RIGID} reinit no", "run 10", "has reinit no, which is not known here: leave it out"),
    (LIDS["rigid"], "run 20000\nfix more lid addforce 0 0 -1.0", OUT_OF_BALANCE),
    (LIDS["rigid"], "run 0", OUT_OF_BALANCE.replace(".*", ".* is inf")),  # nothing touches anything
]


@pytest.mark.parametrize(("lid", "run", "says"), REFUSED)
def test_what_is_refused(cell, lid, run, says):
    """Fixes that are not known, bodies that may rotate, and a lid that moves."""
    with refused(says):
        cell(lid, run=run, rests=False)


PULL = "fix pull lid spring tether 700.0 1.7 NULL NULL 0.0"


@pytest.mark.long
def test_a_spring_of_a_lid_is_in_the_operator(cell):
    """fix spring pulls at the centre of mass of spheres that move as one: its constant is in one entry of K, and LAMMPS
    moves so."""
    lmp, found = cell(LIDS["aveforce"].replace("fix stiff", f"{PULL}\nfix stiff"))
    is_proved(found, "differences")
    moves_alike(lmp, found, 0.02)
    lmp.command("unfix pull")
    without = faultgouge.from_lammps(lmp, differences=True, balance=np.inf)
    added, leader = found.stiffness - without.stiffness, int(np.flatnonzero(found.kind == 2)[0])
    assert added[leader, leader] == pytest.approx(700.0, rel=1e-4)
    added[leader, leader] = 0.0
    assert abs(added).max() < 1e-6 * abs(found.stiffness).max()
