"""Equilibria of a LAMMPS of one's own along a load: a slope that is tilted, a force on a layer, and what goes wrong."""

import os
import signal
import time
from pathlib import Path

import numpy as np
import pytest
from granular_packings import DECKS, command, instance, refused

import faultgouge
from docs.run_page import files
from faultgouge.analysis import BadInputError, NoEquilibriumError, find_onset, spectrum, stiffness_matrix


@pytest.fixture(scope="module")
def layer(tmp_path_factory):
    """Disks on a slope, which no test changes."""
    lmp = instance(tmp_path_factory.mktemp("log") / "log.lammps")
    lmp.file(str(DECKS / "layer.in"))
    yield lmp
    lmp.close()


@pytest.mark.long
def test_tilt_of_a_slope(layer):
    """Loads in balance, back and forth, as one copy of LAMMPS after the other reaches them; then it flows."""
    from faultgouge.pywrap import lammps_path

    before = np.array(layer.numpy.extract_atom("x"))
    with lammps_path(layer, "slope") as path:
        found = {value: path(value) for value in (0.0, 0.02, 0.1, 0.05)}
        for value, each in found.items():
            assert (each.fx, 0 < each.load_error < 1e-7) == (value, True)
            assert each.residual < 1e-8 * each.contacts.normal_force.mean()
            weight = each.mass.sum() * np.array([value, -1.0, 0.0]) / np.hypot(value, 1)
            assert each.load[:, 0].sum(axis=0) == pytest.approx(weight, abs=1e-9)
        # the first, from which the others come, is proved
        assert (found[0.0].proof < 1e-5, found[0.1].proof, path(0.02) is found[0.02]) == (True, None, True)
        assert path(0.05) == found[0.05]  # from 0.02 both times, to the bit
        assert [each.fx for each in path.climb([0.11, 0.9, 1.0])] == [0.11]
        assert [each.fx for each in path.equilibria] == [0.0, 0.02, 0.1, 0.11]
    with lammps_path(layer, "slope", steps=2000) as path, pytest.raises(NoEquilibriumError, match=r"at 0\.1 in 2"):
        path(0.1)
    assert len(spectrum(found[0.1]).pairs) > 0
    # no other load is asked for: the packing is unstable as it stands
    onset = find_onset({0.0: found[0.0]}.__getitem__, [0.0, 0.02], first=True)
    assert (onset.fx_c, len(onset.at_start.pairs)) == (0.0, len(spectrum(found[0.0]).pairs))
    assert np.array_equal(layer.numpy.extract_atom("x"), before)


@pytest.mark.long
def test_a_path_of_many_loads_keeps_few_copies(layer, monkeypatch, tmp_path):
    """However many loads there are; a load between two of them, whose copy has ended, is the same to the bit."""
    from faultgouge.pywrap import lammps_path
    from faultgouge.pywrap.granular import lammps_path as module

    (tmp_path / "mark").touch()
    mark = (tmp_path / "mark").open()  # each copy inherits the open file; no process of another test has it

    def holds(process: Path) -> bool:
        try:
            return any(os.readlink(each) == mark.name for each in process.glob("fd/*"))
        except OSError:  # it ended meanwhile
            return False

    def held() -> np.ndarray:
        """Processes and descriptors."""
        return np.array([sum(map(holds, Path("/proc").glob("[0-9]*"))), len(os.listdir("/dev/fd"))])

    before, found = held(), []
    for most in (48, 2):
        monkeypatch.setattr(module, "MOST_COPIES", most)
        with lammps_path(layer, "slope") as path:
            for k in range(6):
                path(1e-5 * k)
            if most == 2:  # of the processes some have just ended
                assert np.all(held() - before <= [1 + 2 * most, 1 + most])
            found.append([path(load) for load in (1.5e-5, 3.5e-5)])
    assert found[0] == found[1]


@pytest.mark.long
def test_windows_of_spheres_are_those_of_all_eigenvalues(lammps_with):
    """At loads between, right below and right above all edges LAPACK has as many complex pairs as there are windows."""
    from faultgouge.pywrap import lammps_path

    def pairs(configuration) -> int:
        root = np.sqrt(configuration.coordinate_mass)
        values = np.linalg.eigvals(stiffness_matrix(configuration).toarray() / np.outer(root, root))
        # imaginary parts at 1e-7 from an edge are some 1e-4 of the largest eigenvalue, those of rounding 1e-8
        return int(np.sum(values.imag > 1e-6 * np.abs(values).max()))

    with lammps_path(lammps_with(deck="column.in"), "slope") as path:
        windows = find_onset(path, [0.0, 0.01, 0.02]).windows
        spans = [(each.fx_onset, np.inf if each.fx_end is None else each.fx_end) for each in windows]
        edges = [edge for span in spans for edge in span if 0 < edge < 0.02]
        assert len(edges) >= 5
        assert all(window.error < 1e-8 for window in windows)
        for load in sorted([0.0, 0.01, 0.02, *(edge + away for edge in edges for away in (-1e-7, 1e-7))]):
            assert pairs(path(load)) == sum(onset <= load < end for onset, end in spans)


@pytest.mark.long
def test_where_drag_leaves_it(lammps_with):
    """A step in which nothing slides ends where LAMMPS's own run with drag ends, contact by contact."""
    from faultgouge.pywrap import lammps_path

    lmp = lammps_with(deck="layer.in")
    with lammps_path(lmp, "slope") as path:
        first, last = path(0.0), path(0.001)
    assert not last.contacts.at_bound.any()
    command(lmp, "variable slope equal 0.001\nfix drag all viscous 1.0\nrun 60000 post no")
    found = faultgouge.from_lammps(lmp)
    # both ways of the slips differ to second order, and the way is 3e-4 of a radius
    far, way = (np.abs(last.position - each.position).max() for each in (found, first))
    assert far < 1e-5 * way
    one, other = (np.sort(np.linalg.norm(each.contacts.tangential_force, axis=1)) for each in (found, last))
    assert one == pytest.approx(other, abs=1e-7 * found.contacts.normal_force.mean())


OF_A_USER = """import numpy as np, sys
divides = lambda lmp, value: 1 / 0
library = lambda lmp, value: np.linalg.inv(np.zeros((2, 2)))
ends = lambda lmp, value: sys.exit(3)
lammps = lambda lmp, value: lmp.command('fix pull nobody addforce 1 0 0')
"""
FAILS = {
    "divides": r"^At 0\.1: apply failed with ZeroDivisionError: division by zero \(load\.py, line 2\)\.$",
    "library": r"^At 0\.1: apply failed with LinAlgError: Singular matrix \(load\.py, line 3\)\.$",
    "ends": r"^At 0\.1: apply failed with SystemExit: 3 \(load\.py, line 4\)\.$",
    "lammps": r"^At 0\.1: LAMMPS stopped: .*nobody.* \(load\.py, line 5\)\.$",
    "tilt": r"At 0\.1: LAMMPS stopped: .*tilt",  # the name of no variable
    "nothing": r"No force changes .* at 0\.1",
    "leaves": "ended without a word",
}


@pytest.mark.slow
def test_force_on_a_layer_and_what_is_wrong_with_a_path(layer, tmp_path):
    """By a function; it says where it changes nothing, and what it raises, with its line in the user's file."""
    from faultgouge.pywrap import lammps_path

    with lammps_path(layer, lambda lmp, value: lmp.set_internal_variable("push", value)) as path:
        assert path(0.02).load[15:, 0, 0] == pytest.approx(0.02, abs=1e-9)
    (tmp_path / "load.py").write_text(OF_A_USER)
    own: dict = {"nothing": lambda *_: None, "leaves": lambda *_: os._exit(1)}
    exec(compile(OF_A_USER, str(tmp_path / "load.py"), "exec"), own)
    for name, says in FAILS.items():
        with lammps_path(layer, own.get(name, name)) as path, refused(says):
            path(0.1)
    with refused(r"The path is closed: ask it inside of its `with` block"):
        path(0.1)
    path.close()  # a second time does no harm
    with pytest.raises(BadInputError, match="balance = "):
        lammps_path(layer, "slope", balance=np.nan)


@pytest.fixture
def periodic(lammps_with):
    """Disks under pressure in a periodic box, at rest, with a log."""
    return lammps_with(deck="periodic.in")


def stress(found) -> np.ndarray:
    """Of the contacts, xx and yy, force / length."""
    c = found.contacts
    force = c.normal_force[:, None] * c.normal + c.tangential_force
    return -np.sum(force * c.distance[:, None] * c.normal, axis=0)[:2] / (found.box[0, 0] * found.box[1, 1])


@pytest.mark.slow
def test_histories_that_a_restart_file_has_lost_are_named(periodic, lammps_with, tmp_path):
    """Another granular instance was there in the process, and LAMMPS reads no history at all."""
    count = len(faultgouge.from_lammps(periodic).contacts)
    periodic.command(f"write_restart {tmp_path}/state")
    law = "pair_style gran/hertz/history 1e5 3e4 40 20 2.0 1\npair_coeff * *\nfix move all nve/sphere disc"
    again = lammps_with(f"newton off\ncomm_modify vel yes\nread_restart {tmp_path}/state\n{law}", log="log.again")
    with refused(f"{count} of {count} contacts have no tangential force, as where histories"):
        faultgouge.from_lammps(again)


@pytest.mark.long
def test_moduli_along_a_path_of_strain_are_those_of_a_run(periodic):
    """By the function of the how-to: as LAMMPS's own slow run with fix deform. By change_box they are others."""
    from faultgouge.pywrap import lammps_path

    own: dict = {}
    exec(files(Path(__file__).parents[3] / "docs" / "howto_own_lammps.md")["strain.py"], own)
    strain, length, steps, moduli = 1e-5, own["LENGTH"], 20000, {}

    def change_box(lmp, value: float) -> None:
        lmp.command(f"change_box all x final 0 {length * (1 + value):.17g} remap")

    for name, apply in (("strain", own["strain"]), ("change_box", change_box)):
        with lammps_path(periodic, apply) as path:
            first, last = path(0.0), path(strain)
        assert last.box[0, 0] == pytest.approx(length * (1 + strain), rel=1e-14)
        assert not last.contacts.at_bound.any()
        moduli[name] = (stress(last) - stress(first)) / strain
    before = stress(faultgouge.from_lammps(periodic))
    command(periodic, f"""
velocity all ramp vx 0 {length * strain / (steps * 1e-3):.17g} x 0 {length}
fix strain all deform 1 x final 0 {length * (1 + strain):.17g} remap v
run {steps} post no
unfix strain
velocity all set 0 0 0
run 40000 post no""")  # fmt: skip
    run = (stress(faultgouge.from_lammps(periodic)) - before) / strain
    # 2e-7 measured; the strain adds 1e-3 to the forces of contacts, and the run ends with a residual of 1e-9 of them
    assert moduli["strain"] == pytest.approx(run, rel=2e-6)
    assert np.all(np.abs(moduli["change_box"] / run - 1) > 0.05)


@pytest.mark.slow
def test_a_law_that_the_load_changes_is_measured_again(layer):
    """The laws that a path knows are those of the commands: here the load is the tangential stiffness."""
    from faultgouge.pywrap import lammps_path

    def stiffen(lmp, share):
        lmp.command(f"pair_style gran/hertz/history 1e5 {3e4 * (1 + share):.17g} 40 20 0.5 1")
        lmp.command("pair_coeff * *")

    with lammps_path(layer, stiffen) as path:
        for share in (0.0, 0.1):
            pairs = (c := path(share).contacts).chosen(~c.wall)
            reduced = pairs.slip_arm.prod(axis=1) / pairs.slip_arm.sum(axis=1)
            factor = pairs.tangential_stiffness / np.sqrt(reduced * pairs.overlap)
            # a force over a slip, at an overlap that is a difference and has lost some six digits
            assert factor == pytest.approx(3e4 * (1 + share), rel=1e-9)


@pytest.mark.long
def test_a_copy_that_relaxes_ends_with_the_path(layer, tmp_path):
    """However the program ends; a relaxation may take minutes."""
    from faultgouge.pywrap import lammps_path

    copy = tmp_path / "copy"

    def stand_still(_, value):
        if value > 0:
            copy.write_text(str(os.getpid()))
            time.sleep(100)

    def wait(until) -> None:
        deadline = time.monotonic() + 60
        while not until():
            assert time.monotonic() < deadline
            time.sleep(0.02)

    program = os.fork()
    if program == 0:
        try:
            lammps_path(layer, stand_still)(1.0)
        finally:
            os._exit(1)
    wait(lambda: copy.exists() and copy.read_text())
    os.kill(program, signal.SIGKILL)
    os.waitpid(program, 0)
    wait(lambda: not Path(f"/proc/{copy.read_text()}").exists())
