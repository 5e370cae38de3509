"""The proof of a look by LAMMPS's own motion: what it refuses with which sentence, and what it takes."""

import shutil

import numpy as np
import pytest
from granular_packings import command, deck, instance, start, with_law

TRAPS = """
variable trap atom -0.2*(x-1.5)
variable later equal (step>100000000)*0.05
region everywhere block INF INF INF INF INF INF
"""
HERTZ = "gran/hertz/history 3e3 NULL 40 40 0.5 1"


def at_rest(log, d: int, mu: str):
    """Particles at rest on a slope, with their log."""
    lmp = instance(log)
    start(lmp, d, 20 if d == 3 else 18)
    with_law(lmp, "gran/hertz/history", d, "40", "40", ("", ""), mu)
    command(lmp, TRAPS)
    command(lmp, f"""
fix load all gravity 1.0 vector {"0.1 0 -1" if d == 3 else "0.05 -1 0"}
fix move all nve/sphere
fix drag all viscous 1.5
timestep 0.002
thermo 100000
run 60000
""")  # fmt: skip
    return lmp


@pytest.fixture(scope="module")
def bed(tmp_path_factory):
    """Spheres."""
    log = tmp_path_factory.mktemp("log") / "log.lammps"
    lmp = at_rest(log, 3, "0.5")
    yield lmp, log
    lmp.close()


@pytest.fixture(scope="module")
def sliding(tmp_path_factory):
    """Disks, some of their contacts at Coulomb's bound."""
    lmp = at_rest(tmp_path_factory.mktemp("log") / "log.lammps", 2, "0.3")
    yield lmp
    lmp.close()


def look(lmp, log, lines: str = "", run: int = 0, *, prove: bool = True):
    """A look in a copy of the process, which has a log of its own, some lines more, and has run before."""
    from faultgouge.pywrap import from_lammps
    from faultgouge.pywrap.granular.look_in_a_copy import in_a_copy

    def work():
        shutil.copyfile(log, f"{log}.copy")
        lmp.command(f'log "{log}.copy" append')
        command(lmp, lines)
        lmp.command(f"run {run} post no")
        return from_lammps(lmp, prove=prove)

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
def test_fixes_that_act_as_contacts_do_not_tell(bed, fix):
    from faultgouge.pywrap import NotTakenError

    says = f"fix trap {fix.split()[0]} {FIXES[fix]}"
    says = f"^LAMMPS's forces do not change as K says: .*{says}" if FIXES[fix] == ACTS else f"^{says}"
    with pytest.raises(NotTakenError, match=says) as refusal:
        look(*bed, f"fix trap all {fix}", 10000)
    assert "\n" not in str(refusal.value)


def test_a_load_that_follows_the_time(bed):
    """A gravity that rises by a millionth a step is no force by positions."""
    from faultgouge.pywrap import NotTakenError

    rises = (
        "variable now equal step\nvariable rise equal 1+1e-6*(step-${now})\nfix load all gravity v_rise vector 0.1 0 -1"
    )
    with pytest.raises(NotTakenError, match=r"^LAMMPS's forces change with the time, though nothing moves: a load, "):
        look(*bed, rises)


def test_a_weak_spring_between_particles(bed):
    """A spring of 0.5 beside contacts of 300: laws of contacts nearly agree, and a common displacement says nothing."""
    spring = "group one id 1\ngroup other id 9\nfix trap one spring couple other 0.5 0.5 0.5 0.5 0.2"
    found = look(*bed, spring, 30000)
    assert found.operators == "differences"
    assert found.proof < 1e-5


@pytest.mark.parametrize(
    "fix",
    ["accelerate/cos 0.02", "drag 1.5 1.5 NULL 0.05 0.1", "spring/self 0.1",
     pytest.param("aveforce NULL 0 NULL", marks=pytest.mark.long)],  # test_lids has lids
)  # fmt: skip
def test_forces_of_places_are_taken_by_differences(bed, fix):
    """The laws of contacts do not have them, which the proof shows; K by differences does, and has a proof."""
    found = look(*bed, f"fix trap all {fix}", 10000)
    assert found.operators == "differences"
    assert found.proof < 1e-5
    assert found.operator_error < 1e-5


def test_a_force_of_places_is_in_the_operator(bed):
    """F = -0.2 (x - 1.5) adds 0.2 to each x of K."""
    from faultgouge.analysis import stiffness_matrix

    found, laws = (look(*bed, "fix trap all addforce v_trap 0 0", 10000, prove=prove) for prove in (True, False))
    assert (found.operators, laws.operators) == ("differences", "laws")
    assert found.proof < 1e-5
    assert found.operator_error < 1e-5
    added = (stiffness_matrix(found) - stiffness_matrix(laws)).toarray()
    expected = np.diag(np.repeat([0.2, 0.0], [len(found), 5 * len(found)]))
    assert added == pytest.approx(expected, abs=1e-5 * laws.contacts.normal_stiffness.max())
    assert added.diagonal()[: len(found)] == pytest.approx(0.2, rel=0.05)


@pytest.mark.parametrize(
    "fix",
    [
        "addforce 0.01 0 0",
        "addforce v_later 0 0",
        "damping/cundall 0.3 0.3",
        "indent 1.0 sphere 0 0 100 1",
        "setforce NULL NULL NULL",
        "ave/time 1 1 1 c_thermo_temp",
    ],
)
def test_fixes_without_effect_on_small_motion(bed, fix):
    """Whatever their names are, the proof takes them."""
    found = look(*bed, f"fix trap all {fix}", 10000)
    assert found.operators == "laws"
    assert found.proof < 1e-5


def test_proof_is_kept(sliding, tmp_path):
    """The proof is in the file and in what is printed, and no part of the comparison of two packings."""
    from faultgouge.analysis.files.configuration_file import read_configuration, write_configuration
    from faultgouge.pywrap import from_lammps

    found, other = from_lammps(sliding, [f"pair_style {STYLE}", *REST[:3]]), from_lammps(sliding, prove=False)
    assert found.contacts.at_bound.any()
    assert found.proof < 1e-5
    assert f"proof {found.proof:.1g}>" in repr(found)
    assert other.proof is None
    assert "not proved>" in repr(other)
    assert found == other
    for each in (found, other):
        write_configuration(tmp_path / "run.h5", each)
        assert read_configuration(tmp_path / "run.h5").proof == each.proof
        (tmp_path / "run.h5").unlink()


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
    from faultgouge.pywrap import NotTakenError, from_lammps
    from faultgouge.pywrap.granular.look_in_a_copy import in_a_copy

    def work():
        command(sliding, "\n".join(REST[3:]))
        return from_lammps(sliding, [f"pair_style {STYLE.replace(*change)}", *REST])

    with pytest.raises(NotTakenError, match=says) as refusal:
        in_a_copy(work)
    assert "addforce" not in str(refusal.value)


def test_a_log_that_lacks_commands(tmp_path):
    from faultgouge.pywrap import NotTakenError, from_lammps

    lmp = instance(tmp_path / "log.lammps")
    start(lmp, 3, 20)
    command(lmp, f"""
pair_style gran/hertz/history 3e3 2e3 40 40 0.5 1
pair_coeff * *
echo none
pair_style {HERTZ}
echo both
fix floor all wall/gran hertz/history 3e3 NULL 40 40 0.5 1 zplane 0 NULL contacts
fix load all gravity 1.0 vector 0.1 0 -1
fix move all nve/sphere
fix drag all viscous 1.5
timestep 0.002
run 60000
""")  # fmt: skip
    with pytest.raises(NotTakenError, match=r"as K says: .*some are not in the log"):
        from_lammps(lmp)
    lmp.close()


def test_bonds(lammps_with):
    """The laws have none: four spheres on a floor, two of them bonded, and no force in the bond but a small one."""
    from faultgouge.analysis import stiffness_matrix
    from faultgouge.pywrap import from_lammps

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
    found = from_lammps(lmp)
    assert found.operators == "differences"
    assert found.proof < 1e-5
    with_bond = stiffness_matrix(found)
    lmp.command("delete_bonds all bond 1 remove")
    without = from_lammps(lmp, balance=np.inf, differences=True)
    # E = 50 (r - 0.99)^2
    branch = found.position[1] - found.position[0]
    r = np.linalg.norm(branch)
    along = np.outer(branch, branch) / r**2
    expected = 100 * along + 100 * (r - 0.99) / r * (np.eye(3) - along)
    added = (with_bond - stiffness_matrix(without)).toarray()
    first, second = len(found) * np.arange(3), len(found) * np.arange(3) + 1
    for rows, columns, sign in ((first, first, 1), (first, second, -1), (second, second, 1)):
        assert added[np.ix_(rows, columns)] == pytest.approx(sign * expected, abs=1e-2)
