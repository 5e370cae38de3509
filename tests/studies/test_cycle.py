"""The spectrum along the cycles of a driven layer: the spring in K beside LAMMPS's motion, and the files."""

import csv
import json
from itertools import accumulate

import numpy as np
import pytest
from reference_layer import SMALL
from scipy.linalg import expm

from faultgouge.analysis import FLOOR, Contacts, MindlinLaw, Packing, RunFile, stability
from faultgouge.analysis.files.configuration_file import read_configuration, write_configuration
from faultgouge.analysis.motion.motion import Motion
from faultgouge.analysis.responses.slips import Slip
from faultgouge.pywrap import Equilibrium, Record, Scene, SceneError
from faultgouge.pywrap.runs.drive import SERIES, settle_for_drive
from faultgouge.studies.cycle import CYCLE_COLUMNS, cycle, cycle_state, with_spring

SPRING, PACKING = 10.0, {"disks": 40, "seed": 2}


def make_run(path, **drive):
    """The file of a driven run of forty disks."""
    scene = Scene.from_mapping(
        SMALL | {"damping": {"cn": 60.0, "ct": 17.0}, "drive": {"spring": SPRING} | drive, "packing": PACKING}
    )
    with Record(path, scene, task="drive") as record:
        record.append(Equilibrium.of(settle_for_drive(scene)))
        list(record.drive())
        record.finish()
    return path


@pytest.fixture(scope="module")
def slow(tmp_path_factory):
    return make_run(tmp_path_factory.mktemp("slow") / "drive.h5", velocity=1e-3, until=20.0, states=10.0)


def linear_displacement(packing, spring, rate, times):
    """Mean displacement of the layer by linear motion from rest, under a force that rises at a rate on each disk."""
    motion = Motion.of(with_spring(packing, spring))
    size = len(motion.active)
    layer = np.zeros(packing.coordinates)
    layer[: len(packing)] = packing.top
    along = layer[motion.active] / motion.root_mass
    system = np.zeros((2 * size + 2,) * 2)  # positions, velocities, the force, and one
    system[:size, size : 2 * size] = np.eye(size)
    system[size : 2 * size, :-1] = np.c_[-motion.stiffness.toarray(), -motion.damping.toarray(), rate * along]
    system[2 * size, 2 * size + 1] = 1.0
    step, state = expm((times[1] - times[0]) * system), np.eye(2 * size + 2)[-1]
    states = list(accumulate(times[1:], lambda state, _: step @ state, initial=state))
    return np.array(states)[:, :size] @ along / packing.top.sum()


def test_the_layer_moves_as_the_spring_in_the_stiffness_says(tmp_path):
    """A strong spring, so that its stiffness decides: LAMMPS's displacement is that of K with the spring."""
    spring, velocity = 2000.0, 1e-7
    path = make_run(tmp_path / "drive.h5", spring=spring, velocity=velocity, until=0.6, states=0.06)
    with RunFile(path) as file:
        start, series = file.packing(0), file.series(SERIES)
    even = np.linspace(0, series["time"][-1], 61)
    with_it, without = (linear_displacement(start, each, spring * velocity, even) for each in (spring, 0.0))
    moved = np.interp(even, series["time"], series["displacement"])
    assert np.abs(moved - with_it).max() < 0.01 * np.abs(moved).max()
    assert np.abs(moved - without).max() > 0.1 * np.abs(moved).max()


@pytest.mark.long
def test_the_states_of_a_run_go_on_where_they_were_cut_off(slow, tmp_path):
    def states(folder, **options):
        cycle(slow, folder, **options)
        return json.loads((folder / "cycle.json").read_text())["states"]

    whole, part, asked = states(tmp_path / "whole"), tmp_path / "parts", []
    assert len(states(part, progress=lambda frames, count: frames[:2])) == 2
    assert states(part, progress=lambda frames, count: asked.append(count) or frames) == whole
    assert asked == [len(whole) - 2]
    with (part / "cycle.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert tuple(rows[0]) == CYCLE_COLUMNS
    assert [float(row["damped_sticking"]) for row in rows] == [state["damped_sticking"] for state in whole]
    assert (part / "cycle.png").stat().st_size > 10_000


def test_a_rigid_drive_is_refused(tmp_path):
    with pytest.raises(SceneError, match="rigid drive"):
        cycle(make_run(tmp_path / "rigid.h5", spring="rigid", velocity=1e-3, until=0.2, states=0.1), tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_state_at_rest_has_the_rates_of_stability_and_its_file_keeps_the_spring(slow, tmp_path):
    with RunFile(slow) as file:
        packing, moving = file.packing(0), file.packing(-1)
    configuration = with_spring(packing, SPRING)
    found, verdict = cycle_state(packing, SPRING), stability(configuration)
    assert found["rests"]
    assert found["alone_sticking"] == 0
    assert found["damped_sticking"] == pytest.approx(verdict.growth_rate, rel=1e-6)
    assert found["pairs_sticking"] == verdict.undamped.pairs
    assert found["lowest_sticking"] > cycle_state(packing, 0.0)["lowest_sticking"]
    # the pairs that the force brings grow in spite of the dashpots
    assert cycle_state(moving, SPRING)["pairs_sticking"] > found["pairs_sticking"]
    write_configuration(tmp_path / "run.h5", configuration)
    assert read_configuration(tmp_path / "run.h5") == configuration != with_spring(configuration, 0.0)


def test_motions_of_many_lone_disks_do_not_hide_a_motion_of_two():
    """Beside two disks that touch, heavy lone disks lie on the floor, whose motions decay more slowly."""

    def two_and(lone):
        x = np.r_[0.0, 0.999, 3.0 * np.arange(1, lone + 1)]
        floor = np.arange(lone + 2)
        return Packing(
            position=np.column_stack([x, np.full(lone + 2, 0.499)]),
            radius=np.full(lone + 2, 0.5),
            mass=np.r_[1.0, 1.0, np.geomspace(1e4, 2e4, lone)],  # equal motions would mix
            top=floor == 1,
            contacts=Contacts(np.r_[0, floor], np.r_[1, np.full(lone + 2, FLOOR)], np.zeros(lone + 3)),
            law=MindlinLaw(2e5, 6e4, 1.0, cn=60.0, ct=17.0),
        )

    alone, beside = (cycle_state(two_and(lone), SPRING) for lone in (0, 25))
    assert alone["damped_sticking"] < 0
    assert beside["damped_sticking"] == pytest.approx(alone["damped_sticking"], rel=1e-6)


def test_modes_and_spectrum_of_a_drive_have_the_spring(slow, tmp_path, faultgouge_here, monkeypatch):
    slip = Slip(begins=15.0, ends=30.0, force_before=1.0, force_after=0.5, slip=1e-3, kinetic_energy=1e-6)
    monkeypatch.setattr("faultgouge.studies.cycle.slips_in", lambda file: ([slip], None))
    said = faultgouge_here("modes", slow, "-o", "cycle").stdout
    states = json.loads((tmp_path / "cycle" / "cycle.json").read_text())["states"]
    assert f"{len(states)} states" in said
    # the table has the last state before the slip, of the times 0, 10 and 20
    assert f"{states[1]['force']:.4g}" in said
    assert f"{states[2]['force']:.4g}" not in said
    found = json.loads(faultgouge_here("spectrum", slow, "--frame", "0", "--json").stdout)
    assert found["spring"] == SPRING
    assert found["eigenvalues"][0][0] == pytest.approx(states[0]["lowest_sticking"], rel=1e-9)
