"""The proof of a look by LAMMPS's own motion: what it refuses with which sentence, and what it takes."""

import shutil

import numpy as np
import pytest
from granular_packings import command, deck, is_proved, on_slope, refused

import faultgouge
from faultgouge.analysis import stiffness_matrix
from faultgouge.pywrap import in_a_copy

TRAPS = """
variable trap atom -0.2*(x-1.5)
variable later equal (step>100000000)*0.05
region everywhere block INF INF INF INF INF INF
"""
HERTZ = "gran/hertz/history 3e3 NULL 40 40 0.5 1"


@pytest.fixture(scope="module")
def spheres(tmp_path_factory):
    log = tmp_path_factory.mktemp("log") / "log.lammps"
    lmp = on_slope(log, "gran/hertz/history", 3, 0.1, mu="0.5", run=60000)
    command(lmp, TRAPS)
    yield lmp, log
    lmp.close()


@pytest.fixture(scope="module")
def sliding(tmp_path_factory):
    """Disks, some of their contacts at Coulomb's bound."""
    lmp = on_slope(tmp_path_factory.mktemp("log") / "log.lammps", "gran/hertz/history", 2, 0.05, mu="0.3", run=60000)
    yield lmp
    lmp.close()


def look(lmp, log, lines: str = "", run: int = 0, *, prove: bool = True):
    """A look in a copy of the process, which has a log of its own, some lines more, and has run before."""

    def work():
        shutil.copyfile(log, f"{log}.copy")
        command(lmp, f'log "{log}.copy" append\n{lines}\nrun {run} post no')
        return faultgouge.from_lammps(lmp, prove=prove)

    return in_a_copy(work)


ACTS = "may act on particles as contacts do not tell"
CHANGES = "moves or holds particles, or changes velocities, in a way that is not known here: unfix it"
FIXES = {
    "smd cvel 2.0 1e-9 tether 1.5 1.5 NULL 0.0": ACTS,
    "rhok 1 0 0 20.0 0.2": ACTS,
    "flow/gauss 1 1 0": ACTS,
    "addtorque 2.0 0.0 2.0": ACTS,
    "momentum 1000 linear 1 1 0": CHANGES,
    "temp/rescale 1000 1e-20 1e-20 0.0 1.0": CHANGES,
    "temp/berendsen 1e-20 1e-20 1.0": CHANGES,
    "oneway 1000 everywhere x": CHANGES,
    "propel/self velocity 0.01": CHANGES,
}

OFTEN = ("momentum", "temp", "addtorque", "oneway", "propel")
"""Begins of fixes whose refusal takes less than a second."""


@pytest.mark.parametrize(
    "fix", [each if each.startswith(OFTEN) else pytest.param(each, marks=pytest.mark.long) for each in FIXES]
)
def test_fixes_that_act_as_contacts_do_not_tell(spheres, fix):
    says = f"fix trap {fix.split()[0]} {FIXES[fix]}"
    says = f"^LAMMPS's forces do not change as K says: .*{says}" if FIXES[fix] == ACTS else f"^{says}"
    with refused(says) as refusal:
        look(*spheres, f"fix trap all {fix}", 10000)
    assert "\n" not in str(refusal.value)


def test_a_load_that_follows_the_time(spheres):
    """A gravity that rises by a millionth a step is no force by positions."""
    rises = "variable now equal step\nvariable rise equal 1+1e-6*(step-${now})"
    with refused(r"^LAMMPS's forces change with the time, though nothing moves: a load, "):
        look(*spheres, f"{rises}\nfix load all gravity v_rise vector 0.1 0 -1")


@pytest.mark.parametrize(
    ("fix", "run"),
    [("all accelerate/cos 0.02", 10000), ("all drag 1.5 1.5 NULL 0.05 0.1", 10000), ("all spring/self 0.1", 10000),
     # beside contacts of 300: laws of contacts nearly agree, and a common displacement says nothing
     ("one spring couple other 0.5 0.5 0.5 0.5 0.2", 30000),
     pytest.param("all aveforce NULL 0 NULL", 10000, marks=pytest.mark.long)],  # test_lids has lids
)  # fmt: skip
def test_forces_of_places_are_taken_by_differences(spheres, fix, run):
    """The laws of contacts do not have them, which the proof shows; K by differences does, and has a proof."""
    is_proved(look(*spheres, f"group one id 1\ngroup other id 9\nfix trap {fix}", run), "differences")


def test_a_force_of_places_is_in_the_operator(spheres):
    """F = -0.2 (x - 1.5) adds 0.2 to each x of K."""
    found, laws = (look(*spheres, "fix trap all addforce v_trap 0 0", 10000, prove=prove) for prove in (True, False))
    assert laws.operators == "laws"
    is_proved(found, "differences")
    added = (stiffness_matrix(found) - stiffness_matrix(laws)).toarray()
    expected = np.diag(np.repeat([0.2, 0.0], [len(found), 5 * len(found)]))
    assert added == pytest.approx(expected, abs=1e-5 * laws.contacts.normal_stiffness.max())
    assert added.diagonal()[: len(found)] == pytest.approx(0.2, rel=0.05)


WITHOUT_EFFECT = [
    "addforce 0.01 0 0", "addforce v_later 0 0", "damping/cundall 0.3 0.3", "indent 1.0 sphere 0 0 100 1",
    "setforce NULL NULL NULL", "ave/time 1 1 1 c_thermo_temp",
]  # fmt: skip


@pytest.mark.parametrize("fix", WITHOUT_EFFECT)
def test_fixes_without_effect_on_small_motion(spheres, fix):
    """Whatever their names are, the proof takes them."""
    is_proved(look(*spheres, f"fix trap all {fix}", 10000), "laws")


def test_proof_is_kept(sliding, tmp_path):
    """The proof is in the file and in what is printed, and no part of the comparison of two packings."""
    from faultgouge.analysis.files.configuration_file import read_configuration, write_configuration

    told = [f"pair_style {STYLE}", *REST[:3]]
    found, other = faultgouge.from_lammps(sliding, told), faultgouge.from_lammps(sliding, prove=False)
    assert found == other
    assert found.contacts.at_bound.any()
    assert found.proof < 1e-5
    assert other.proof is None
    for name, each, says in (("one.h5", found, f"proof {found.proof:.1g}>"), ("two.h5", other, "not proved>")):
        assert says in repr(each)
        write_configuration(tmp_path / name, each)
        assert read_configuration(tmp_path / name).proof == each.proof


STYLE = HERTZ.replace("0.5", "0.3")
REST = ["pair_coeff * *", "fix floor all wall/gran hertz/history 3e3 9e2 40 40 0.3 1 yplane 0 NULL contacts",
        "fix move all nve/sphere", "fix one all addforce 0 0 0", "fix two all addforce 0 0 0"]  # fmt: skip
OTHER = r"as K says: .*the commands are those of another run or instance"
RUNS = [
    (("NULL", "1e3"), OTHER),
    *(pytest.param(each, OTHER, marks=pytest.mark.long) for each in (("40 40", "20 40"), ("40 40", "40 10"))),
    pytest.param(("40 0.3", "40 0.9"), OTHER, marks=pytest.mark.long),
    (("40 0.3", "40 0.1"), r"contacts carry more than Coulomb's bound .* with mu = 0.1"),
]


@pytest.mark.parametrize(("change", "says"), RUNS)
def test_commands_of_another_run(sliding, change, says):
    """The same normal forces, but other tangential stiffnesses, dashpots or friction; and two constant forces, which
    are not accused."""

    def work():
        command(sliding, "\n".join(REST[3:]))
        return faultgouge.from_lammps(sliding, [f"pair_style {STYLE.replace(*change)}", *REST])

    with refused(says) as refusal:
        in_a_copy(work)
    assert "addforce" not in str(refusal.value)


def test_a_log_that_lacks_commands(spheres):
    hidden = f"echo none\npair_style {HERTZ.replace('NULL', '2e3')}\npair_coeff * *\necho both"
    with refused(r"as K says: .*some are not in the log"):
        look(*spheres, hidden, 60000)


def test_bonds(lammps_with):
    """The laws have none: four spheres on a floor, two of them bonded, and no force in the bond but a small one."""
    bonded = """fix move all nve/sphere
fix drag all viscous 1.5
bond_style harmonic
bond_coeff 1 50.0 0.99
special_bonds lj/coul 1.0 1.0 1.0
run 0
create_bonds single/bond 1 1 2
run 60000"""
    places = [(0, 0, 0.5), (0.99, 0, 0.5), (0.5, 0.86, 0.5), (0.5, 0.29, 1.3)]
    spheres = deck(places, HERTZ[5:], "zplane 0 NULL contacts", timestep=0.002, more=bonded)
    spheres = spheres.replace("atom_style sphere", "atom_style hybrid sphere bond\natom_modify map array")
    more = "1 box bond/types 1 extra/bond/per/atom 2 extra/special/per/atom 4"
    lmp = lammps_with(spheres.replace("create_box 1 box", f"create_box {more}"))
    found = faultgouge.from_lammps(lmp)
    is_proved(found, "differences")
    lmp.command("delete_bonds all bond 1 remove")
    without = faultgouge.from_lammps(lmp, balance=np.inf, differences=True)
    # E = 50 (r - 0.99)^2
    branch = found.position[1] - found.position[0]
    r = np.linalg.norm(branch)
    along = np.outer(branch, branch) / r**2
    expected = 100 * along + 100 * (r - 0.99) / r * (np.eye(3) - along)
    added = (stiffness_matrix(found) - stiffness_matrix(without)).toarray()[:12, :12].reshape(3, 4, 3, 4)
    for i, j, sign in ((0, 0, 1), (0, 1, -1), (1, 1, 1)):
        assert added[:, i, :, j] == pytest.approx(sign * expected, abs=1e-2)
