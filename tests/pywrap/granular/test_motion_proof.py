"""The proof of a look by LAMMPS's own motion: what it refuses with which sentence, and what it takes."""

import shutil

import numpy as np
import pytest
from granular_packings import command, is_proved, on_slope, refused
from table_rows import rows_of

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


SAYS = {
    "acts": "^LAMMPS's forces do not change as K says: .*fix trap {} may act on particles as contacts do not tell",
    "changes": "^fix trap {} moves or holds particles, or changes velocities, in a way that is not known here",
}
FIXES = [
    pytest.param(*row, id=row[0], marks=pytest.mark.long if length == "long" else ())
    for *row, length in rows_of("pywrap/granular/fixes.txt")
]


@pytest.mark.parametrize(("fix", "run", "ends"), FIXES)
def test_fixes_that_the_laws_of_contacts_do_not_have(spheres, fix, run, ends):
    """The proof shows it. K by differences has forces of places; others have no effect, or are refused."""
    lines = f"group one id 1\ngroup other id 9\nfix trap {fix}"
    if ends in ("laws", "differences"):
        is_proved(look(*spheres, lines, run), ends)
        return
    with refused(SAYS[ends].format(fix.split()[1])) as refusal:
        look(*spheres, lines, run)
    assert "\n" not in str(refusal.value)


RISES = "variable now equal step\nvariable rise equal 1+1e-6*(step-${now})\nfix load all gravity v_rise vector 0.1 0 -1"
HIDDEN = f"echo none\npair_style {HERTZ.replace('NULL', '2e3')}\npair_coeff * *\necho both"


@pytest.mark.parametrize(
    ("lines", "run", "says"),
    [(RISES, 0, "^LAMMPS's forces change with the time, though nothing moves: a load, "),
     (HIDDEN, 60000, "as K says: .*some are not in the log")],
)  # fmt: skip
def test_a_load_that_follows_the_time_and_a_log_that_lacks_commands(spheres, lines, run, says):
    """A gravity that rises by a millionth a step is no force by positions."""
    with refused(says):
        look(*spheres, lines, run)


def test_a_force_of_places_is_in_the_operator(spheres):
    """F = -0.2 (x - 1.5) adds 0.2 to each x of K."""
    found, laws = (look(*spheres, "fix trap all addforce v_trap 0 0", 10000, prove=prove) for prove in (True, False))
    assert laws.operators == "laws"
    is_proved(found, "differences")
    added, n = (stiffness_matrix(found) - stiffness_matrix(laws)).toarray(), len(found)
    expected = np.diag(np.repeat([0.2, 0.0], [n, 5 * n]))
    assert added == pytest.approx(expected, abs=1e-5 * laws.contacts.normal_stiffness.max())
    assert added.diagonal()[:n] == pytest.approx(0.2, rel=0.05)


def test_proof_is_kept(sliding, tmp_path):
    """The proof is in the file and in what is printed, and no part of the comparison of two packings."""
    from faultgouge.analysis.files.configuration_file import read_configuration, write_configuration

    told = [f"pair_style {STYLE}", *REST[:3]]
    found, other = faultgouge.from_lammps(sliding, told), faultgouge.from_lammps(sliding, prove=False)
    assert (found == other, found.contacts.at_bound.any()) == (True, True)
    assert (found.proof < 1e-5, other.proof) == (True, None)
    for each, says in ((found, f"proof {found.proof:.1g}>"), (other, "not proved>")):
        assert says in repr(each)
        write_configuration(tmp_path / "one.h5", each)
        assert read_configuration(tmp_path / "one.h5").proof == each.proof


STYLE = HERTZ.replace("0.5", "0.3")
REST = ["pair_coeff * *", "fix floor all wall/gran hertz/history 3e3 9e2 40 40 0.3 1 yplane 0 NULL contacts",
        "fix move all nve/sphere", "fix one all addforce 0 0 0", "fix two all addforce 0 0 0"]  # fmt: skip
OTHER = r"as K says: .*the commands are those of another run or instance"
LONG = [("40 40", "20 40"), ("40 40", "40 10"), ("40 0.3", "40 0.9")]
RUNS = [
    (("NULL", "1e3"), OTHER),
    *(pytest.param(each, OTHER, marks=pytest.mark.long) for each in LONG),
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


def test_bonds(taken):
    """The laws have none: four spheres on a floor, two of them bonded, and no force in the bond but a small one."""
    lmp, found = taken("", "bonded.in")
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
