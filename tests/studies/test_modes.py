"""Complex modes over the load: counts against NumPy's, and what is left in the folder."""

import csv
import json
from dataclasses import replace

import numpy as np
import pytest
from reference_layer import SMALL, toml

from faultgouge.analysis import Contacts, MindlinLaw, Packing, eigenvalues, spectrum, stiffness_matrix
from faultgouge.pywrap import Engine, Equilibrium, Scene, equilibrate, settle
from faultgouge.studies.modes import PairCounts, antisymmetric_norm, count_pairs, modes
from research.modes.sets import sets

SCENE = SMALL | {
    "packing": {"disks": 60, "width": 9.2, "seed": 77},
    "ramp": {"step": 0.03, "until": 20.0},
    "modes": {"fx_over_fy": [0.1, 0.2, 5.0]},
}


def at_loads(scene, *loads):
    """The packings of a scene in equilibrium at increasing loads."""
    state, found = settle(scene), []
    with Engine(state.packing) as engine:
        for fx in loads:
            state = equilibrate(engine, state, fx=fx)
            found.append(state.packing)
    return found


def test_counts_and_bounds_are_those_of_numpy():
    for packing in at_loads(Scene.from_mapping(SCENE), 0.06, 0.3, 0.6):
        found = count_pairs(packing)
        mass = np.tile(packing.mass, 3)  # the inertia factor is 1
        dense = stiffness_matrix(packing).toarray() / np.sqrt(mass[:, None] * mass)
        plain = np.linalg.eigvals(dense[np.ix_(*[np.flatnonzero(dense.any(axis=1))] * 2)])
        assert (len(found.omega), found.modes) == (np.count_nonzero(plain.imag > 0), len(plain))
        # the least Q is that of a pair far from coalescing: two orders of the coordinates give ten digits
        assert (found.as_dict()["least_q"] or np.inf) == pytest.approx(spectrum(packing).least_q, rel=1e-9)
        bound = antisymmetric_norm(packing)
        assert bound == pytest.approx(np.linalg.norm(0.5 * (dense - dense.T), 2), rel=1e-5)
        assert (found.omega**2).imag.max(initial=0.0) <= bound
    assert len(found.omega) > 3


def test_a_packing_that_buckles_ends_its_branch_and_counts():
    """Two disks on top of each other: no complex pair, and D grows all the same."""
    overlap = (3.0 / 2e5) ** (2 / 3)
    places = {"position": [[2.0, 0.5 - overlap], [2.0, 1.5 - 2 * overlap]], "radius": [0.5, 0.5], "top": [False, True]}
    contacts, law = Contacts([0, 0], [-1, 1], [0, 0]), MindlinLaw(2e5, 2e5 * 2 / 7, 1.0)
    column = Packing(**places, contacts=contacts, law=law, box_length=4.0, fy=3.0)
    found = count_pairs(column).as_dict()
    assert (found["pairs"], found["negative"]) == (0, 1)
    assert found["growth_rate"] == pytest.approx(spectrum(column).growth_rate(), rel=1e-9)
    # the ramp has come to the first load of the scene, 0.1 F_y
    there = Equilibrium(replace(column, fx=0.1 * 3.0), 0.0, 1e-11, 1)
    row = modes.row(Scene.from_mapping(SCENE), lambda mu: there)
    assert (row["ends"], row["loads"]) == ("turning point", [])


@pytest.mark.long
@pytest.mark.slow
def test_the_command_leaves_rows_and_pictures_up_to_the_last_equilibrium(faultgouge_here, tmp_path):
    """Of thirty disks, whose branch ends where the third load is not reached."""
    scene = SCENE | {"packing": {"disks": 30, "top": 5, "width": 6.0, "seed": 3}}
    (tmp_path / "scene.toml").write_text(toml(scene))
    said = faultgouge_here("modes", "scene.toml", "-o", "out", "--workers", "1").stdout
    assert "there is no equilibrium at the next load" in said
    rows = json.loads((tmp_path / "out/modes.json").read_text())["rows"]
    assert [(row["fx_over_fy"], row["disks"], row["seed"]) for row in rows] == [(0.1, 30, 3), (0.2, 30, 3)]
    with (tmp_path / "out/modes.csv").open() as file:
        assert [int(row["pairs"]) for row in csv.DictReader(file)] == [row["pairs"] for row in rows]
    assert (tmp_path / "out" / "modes.png").stat().st_size > 10_000
    again = faultgouge_here("modes", "scene.toml", "-o", "out", "--workers", "1")
    assert "1 of 1 points are in out/results.jsonl already" in again.stderr


@pytest.mark.long
@pytest.mark.parametrize(("name", "seed"), [("force 50", 6), ("force 100", 25)])
def test_displacements_that_lammps_would_refuse_end_no_ramp(name, seed):
    """On the way Newton's method tries displacements with which the centre of a disk lies in another disk."""
    (point,) = (point for point in sets()[name].points if point.values["packing.seed"] == seed)
    found = modes.row(point.scene, lambda mu: settle(point.scene, mu))
    assert len(found["loads"]) >= 8


@pytest.mark.long  # ten seconds of LAPACK
def test_pairs_of_a_large_packing_are_those_of_lapack():
    scene = Scene.from_mapping(SMALL | {"packing": {"disks": 700, "width": 31.5, "seed": 1}})
    *_, packing = at_loads(scene, 0.03, 0.06)
    found, every = count_pairs(packing), PairCounts.of(eigenvalues(packing))
    assert packing.coordinates > 2000
    assert (found.modes, len(found.omega)) == (every.modes, len(every.omega))
    assert found.omega == pytest.approx(every.omega, rel=1e-6)
    assert len(found.omega) > 30
