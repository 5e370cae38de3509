"""Energy and virial that LAMMPS reports, and the energy that sliding and dashpots take: keyword energy."""

import itertools
from pathlib import Path

import numpy as np
import pytest

from faultgouge.analysis import read_dump
from faultgouge.analysis.files.formats.lammps_dump import dump_frames
from faultgouge.pywrap.lammps.decks import DECKS

KN, KT, MU, FX, FY, WIDTH = 2e5, 2e5 * 2 / 7, 0.5, 2.5, 3.0, 2.8

INPUTS = Path(__file__).with_name("inputs")
HEAD, PILE, LAW, LOOK = ((INPUTS / f"{name}.in").read_text() for name in ("pile_head", "pile", "pile_law", "look"))
MODEL = HEAD + PILE + LAW
"""Two disks on a floor that touch through the sides of a periodic box, and a third one that slides over them."""

AGAIN = f"write_restart middle.restart\nclear\n{HEAD}read_restart middle.restart\ngroup top type 2\n"

arithmetics = pytest.mark.parametrize("compensated", ["", "compensated"], ids=["double", "compensated"])


@pytest.fixture
def watch_script(lmp, tmp_path):
    """Runs a script, and gives what was seen of pairs and of disks, the tables of a dump, one a step."""

    def run(script, every=500, counted=True, compensated="", **settings):
        settings |= {"every": every, "compensated": compensated, "column": 7 + bool(compensated) + counted}
        lmp(script, kn=KN, kt=KT, mu=MU, fx=FX, fy=FY, width=WIDTH, **settings)
        return [[frame.rows for frame in dump_frames(tmp_path / name)] for name in ("pairs", "disks")]

    return run


def contacts(pairs, disks):
    """Slip, overlap and dissipated energy of each contact, by the IDs of its disks; 0 is the floor."""
    found = {(min(row[:2]), max(row[:2])): row[2:] for row in pairs}
    return found | {(0, row[0]): row[7:10] for row in disks if row[8] > 0}


def tangential_energy(slip, overlap):
    """Integral of the tangential force over the slip at one overlap: k_t delta^(1/2) s^2 (1/2 + x/3 - x^2/4)."""
    x = np.abs(slip) / (MU * KN / KT * overlap)
    return KT * np.sqrt(overlap) * slip**2 * (1 / 2 + x / 3 - x**2 / 4)


def balance(pairs, disks):
    """(work of the load, energy gained, energy dissipated, what overlaps gave to stuck contacts) of a run."""
    looks = [contacts(*both) for both in zip(pairs, disks, strict=True)]

    def energy(k):
        # I = I_0 m R^2 with I_0 = m = 1 and R = 1/2
        kinetic = 0.5 * np.sum(disks[k][:, 4:6] ** 2) + 0.125 * np.sum(disks[k][:, 6] ** 2)
        return kinetic + sum(0.4 * KN * d**2.5 + tangential_energy(s, d) for s, d, _ in looks[k].values())

    # the tangential force of this law has no potential: its stiffness changes with the overlap, at no cost
    given, ended = 0.0, sum(row[2] for row in looks[-1].values())
    for old, new in itertools.pairwise(looks):
        ended += sum(old[each][2] for each in old.keys() - new.keys())
        for each in old.keys() & new.keys():
            (s, d, _), (t, e, _) = old[each], new[each]
            given += tangential_energy((s + t) / 2, e) - tangential_energy((s + t) / 2, d)
    way = disks[-1][2, 2:4] - disks[0][2, 2:4]
    return way @ [FX, -FY], energy(-1) - energy(0), ended, given


@pytest.mark.slow
@pytest.mark.parametrize(("dashpots", "compensated"), [("20 10", ""), ("0 0", ""), ("20 10", "compensated")])
def test_work_of_the_load_is_stored_moves_or_is_dissipated(watch_script, dashpots, compensated):
    """What is missing is of first order in the time step: the power at the end of a step stands for the whole step."""
    missing, settings = [], {"dashpots": dashpots, "compensated": compensated, "every": 1}
    for steps in (500, 1000):
        found = watch_script(MODEL + LOOK + f"run {steps}\n", dt=0.2 / steps, **settings)
        work, gained, dissipated, given = balance(*found)
        missing.append(work + given - gained - dissipated)
    assert dissipated > 0.05 * work
    assert abs(given) < 0.1 * dissipated
    assert missing[0] / missing[1] == pytest.approx(2.0, abs=0.05)
    assert abs(2 * missing[1] - missing[0]) < 2e-4 * dissipated  # in the limit of short steps


@arithmetics
@pytest.mark.ranks
@pytest.mark.parametrize("ranks", [1, 2])
def test_energies_go_through_a_restart(watch_script, compensated, ranks):
    def last(middle, **on):
        found = watch_script(f"{MODEL}run 500\n{middle}{LOOK}run 500\n", compensated=compensated, **on)
        return contacts(*(frames[-1] for frames in found))

    straight, again = last(""), last(AGAIN + LAW, ranks=ranks)
    assert {pair: tuple(row) for pair, row in straight.items()} == {pair: tuple(row) for pair, row in again.items()}
    assert max(row[2] for row in straight.values()) > 0


@arithmetics
@pytest.mark.parametrize(("first", "second"), [("yes", "no"), ("no", "yes")])
def test_counting_changes_nothing_else_also_where_a_restart_begins_or_ends_it(watch_script, first, second, compensated):
    """Energies begin at zero then, or are left out; a wall without them has no column for them."""
    again = AGAIN + LAW.replace("${energy}", f"energy {second}")
    seen = []
    for middle, energy, counted in ((again, f"energy {first}", second == "yes"), ("", "", False)):
        settings = {"energy": energy, "counted": counted, "compensated": compensated}
        (pairs,), (disks,) = watch_script(f"{MODEL}run 500\n{middle}{LOOK}run 0\n", **settings)
        seen.append((pairs, disks[:, :9]))
        assert not pairs[:, 4].any()
        assert not counted or not disks[:, 9].any()
    assert all(np.array_equal(one, other) for one, other in zip(*seen, strict=True))


@pytest.mark.slow
def test_energy_is_conserved_without_friction_to_second_order(lmp, tmp_path):
    """Without friction the forces have the energy that LAMMPS reports, floor included."""
    drift = []
    for dt in (4e-4, 2e-4):
        lmp(INPUTS / "drift.in", decks=DECKS, mu=0.0, dt=dt)
        _, total, kinetic = np.loadtxt(tmp_path / "series").T
        assert kinetic.max() > 10 * kinetic[0]  # the layer bursts apart: contact energy becomes kinetic
        drift.append(np.abs(total - total[0]).max())
    assert 3.5 < drift[0] / drift[1] < 4.5


def test_virial_is_that_of_the_contacts(lmp, tmp_path):
    lmp(INPUTS / "virial.in", decks=DECKS, fx=0.3)
    *pressure, volume = np.loadtxt(tmp_path / "virial")
    packing = read_dump(tmp_path / "state.disks")
    g, pair = packing.geometry, ~packing.contacts.floor
    branch = g.distance[pair, None] * g.normal[pair]
    force = (packing.normal_force[:, None] * g.normal + packing.tangential_force[:, None] * g.tangent)[pair]
    # LAMMPS divides by the volume of the box, which is 1 thick; xy is tallied as x times f_y
    stress = (branch.T @ force / volume)[[0, 1, 0], [0, 1, 1]]
    # a force is known to k eps x = 1e-11 of itself, and the shear stress of a packing at rest is all cancellation
    np.testing.assert_allclose(pressure, stress, rtol=0, atol=1e-11 * np.abs(stress).max())
