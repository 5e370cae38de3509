"""Dashpots and drag in LAMMPS: forces over velocities, Coulomb's bound, orders in the time step."""

import itertools
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from faultgouge.analysis import MindlinLaw, Packing, damping_matrix, touching
from faultgouge.analysis.files.formats.lammps_dump import dump_frames
from faultgouge.pywrap.lammps.decks import DECKS
from faultgouge.pywrap.lammps.engine import Engine

KN, KT = 2e5, 2e5 * 2 / 7
exponents = pytest.mark.parametrize("exponent", [1.5, 1.0], ids=["Hertz", "harmonic"])
arithmetics = pytest.mark.parametrize("compensated", [False, True], ids=["double", "compensated"])


def moving(engine):
    """A function of velocities (x.., y.., R theta..): forces (Fx.., Fy.., T/R..) of the packing, dashpots on."""
    # the integrator adds the low parts of forces
    engine.lammps.commands_string(f"fix move all nve/disc 1.0 ${{compensated}}\ninclude {DECKS}/dashpots.in")

    def force(velocity):
        vx, vy, vu = velocity.reshape(3, -1)
        engine.scatter("v", np.column_stack([vx, vy, 0 * vx]))
        engine.scatter("omega", np.column_stack([0 * vx, 0 * vx, vu / engine.packing.radius]))
        engine.command("run 0 post no")
        return engine.net_force

    return force


@exponents
@arithmetics
def test_matrix_is_the_derivative_of_the_forces_over_velocities(reference_packing, exponent, compensated):
    packing = reference_packing(1.0, compensated, [0.1, -0.3, 0.6, 0.0], exponent=exponent, cn=1.3, ct=0.7)
    matrix, step = damping_matrix(packing), 2.0**-10
    assert packing.contacts.floor.any()
    with Engine(packing) as engine:
        force_at = moving(engine)
        # of all disks at once: a wrong entry is seen along every direction
        for velocity in np.random.default_rng(0).choice([-1.0, 1.0], (10, matrix.shape[0])):
            force = (force_at(-step * velocity) - force_at(step * velocity)) / (2 * step)
            # the forces are linear in the velocity; they are known to the last place of a sum of order 3, over the step
            assert np.abs(force - matrix @ velocity).max() < 1e-9 * np.abs(matrix.data).max()


@exponents
@arithmetics
@pytest.mark.parametrize(
    ("cn", "ct", "mu", "overlap"),
    [
        *itertools.product([0.0, 40.0], [0.0, 25.0], [0.0, 0.8], [1e-3]),
        *itertools.product([0.0], [0.0], [0.0, 1e-6, 10.0], [1e-7, 0.1]),
    ],
)
def test_two_disks_and_the_floor_in_motion(exponent, compensated, cn, ct, mu, overlap):
    """The law in ten lines, within Coulomb's bound and beyond it, sliding on and sliding back; and at rest."""
    radius, law = np.array([0.5, 0.7]), MindlinLaw(KN, KT, mu, exponent, cn=cn, ct=ct)
    height = 0.5 - overlap
    position = np.array([[1.0, height], [1.9, height + np.sqrt((1.2 - overlap) ** 2 - 0.81)]])
    found, low = touching(position, radius), np.zeros((2, 2)) if compensated else None
    bare = Packing(position=position, position_low=low, radius=radius, law=law, contacts=found)
    limit = law.slip_limit(bare.geometry.overlap)
    rng = np.random.default_rng(5)
    # overlaps are known to 1e-16 of a coordinate
    known = 5e-13 + (0.0 if compensated else 5e-16 / overlap)
    with Engine(bare) as engine:
        force_at = moving(engine)
        for share, scale in itertools.product([-1.0, -0.5, 0.0, 0.9, 1.0, 3.0], [0.0, 1e-3, 1.0]):
            packing = replace(bare, contacts=found.slipped(share * limit))
            velocity = scale * rng.standard_normal(6)
            engine.restore(packing)
            force = force_at(velocity).reshape(3, 2)
            expected = forces_of_moving_contacts(packing, ((0, 1), (0, -1)), *velocity.reshape(3, 2))
            np.testing.assert_allclose(force, expected, rtol=0, atol=known * np.abs(expected).max())


def forces_of_moving_contacts(packing, pairs, x, y, u):
    """(F_x, F_y, T/R) of each disk from the formulas, for velocities (x, y, R theta)."""
    law, expected = packing.law, np.zeros((3, len(packing)))
    p, g = law.exponent, packing.geometry
    for (i, j), slip, n, tau, d in zip(pairs, packing.contacts.slip, g.normal, g.tangent, g.overlap, strict=True):
        v = np.array([x[i], y[i]]) - (np.array([x[j], y[j]]) if j >= 0 else 0)
        rolling = u[i] + (u[j] if j >= 0 else 0)
        normal = KN * d**p - law.cn * d ** (p - 1) * (n @ v)
        limit, bound = law.mu * KN / KT * d, law.mu * KN * d**p
        slip = np.clip(slip, -limit, limit)
        s = abs(slip) / limit if law.mu else 0.0
        tangential = -KT * d ** (p - 1) * (1 + s - s * s) * slip - law.ct * d ** (p - 1) * (tau @ v - rolling)
        tangential = np.clip(tangential, -bound, bound)
        expected[:, i] += *(normal * n + tangential * tau), -tangential
        if j >= 0:
            expected[:, j] += *(-normal * n - tangential * tau), -tangential
    return expected


@exponents
@pytest.mark.parametrize(
    "parts",
    [{"cn": 4.0}, {"ct": 4.0}, {"drag_time": 0.5}, {"cn": 40.0, "ct": 40.0, "drag_time": 0.5}],
    ids=["normal", "tangential", "drag", "all"],
)
def test_second_order_in_the_time_step(exponent, parts):
    """A column of disks under a load, shaken: no contact opens, where the force of harmonic disks would have a kink."""
    overlap, radius, ends = 1e-2, np.full(5, 0.5), []
    height = 0.5 - overlap + (1 - overlap) * np.arange(5)
    position = np.column_stack([np.full(5, 2.0), height]) + 1e-4 * np.random.default_rng(2).standard_normal((5, 2))
    law = MindlinLaw(1e4 * overlap ** (1 - exponent), 5e3 * overlap ** (1 - exponent), 50.0, exponent)
    load = {"fx": 1.0, "fy": float(law.normal_force(overlap)), "top": np.arange(5) == 4}
    column = Packing(position=position, radius=radius, law=law, contacts=touching(position, radius), **load)
    for dt in (1e-3, 5e-4, 2.5e-4):
        with Engine(column.with_dissipation(**parts)) as engine, engine.undamped(dt) as dynamics:
            end = dynamics.advance(round(0.064 / dt))
        ends.append(np.column_stack([end.position, end.velocity, radius * end.spin]))
    coarse, fine = (np.linalg.norm(ends[k] - ends[k + 1]) for k in (0, 1))
    assert 3.7 < coarse / fine < 4.3


INPUTS = Path(__file__).with_name("inputs")
SYSTEM = f"variable decks index {DECKS}\ninclude {DECKS}/system.in\n"


@arithmetics
def test_drag_lets_free_disks_decay(lmp, tmp_path, compensated):
    lmp(INPUTS / "drag.in", decks=DECKS, precision="compensated" if compensated else "double")
    rows = next(dump_frames(tmp_path / "end")).rows
    # two hundred rounded factors
    np.testing.assert_allclose(rows, np.exp(-0.4) * np.tile([0.3, -0.2, 0.5], (len(rows), 1)), rtol=2e-14)


@arithmetics
def test_forces_after_a_run_are_those_of_the_contacts(lmp, tmp_path, compensated):
    """single() and the floor's columns hand out the forces, dashpots included, that the disks have felt."""
    given = {"decks": DECKS, "precision": "compensated" if compensated else "double"}
    lmp(INPUTS / "seen_forces.in", cn=9.0, ct=7.0, **given)
    (*_, disks), (*_, pairs) = (dump_frames(tmp_path / name) for name in ("disks", "pairs"))
    radius, floor_n, floor_t = disks.rows[:, 3:].T
    expected = np.column_stack([-floor_t, floor_n, -radius * floor_t])
    for i, j, fn, ft, nx, ny in pairs.rows:
        force = np.array([fn * nx - ft * ny, fn * ny + ft * nx])
        for disk, sign in ((int(i) - 1, 1), (int(j) - 1, -1)):
            expected[disk] += *(sign * force), -radius[disk] * ft
    np.testing.assert_allclose(disks.rows[:, :3], expected, rtol=0, atol=1e-12 * np.abs(expected).max())


@pytest.mark.slow
def test_a_dashpot_that_is_adapted_is_so_from_the_start(lmp, tmp_path):
    """fix adapt changes a parameter through extract(): the run is that of a pair style with the other value."""
    style = "pair_style mindlin/smooth ${kn} ${kt} ${mu} damping ${cn} 2.0"
    model = f"{SYSTEM}{style}\nfix move all nve/disc 1.0\n"
    adapt = "variable wanted equal 4.0\nfix adapt all adapt 1 pair mindlin/smooth cn * * v_wanted\n"
    run = "timestep 1e-3\nrun 500\nwrite_dump all custom end id x y omegaz modify sort id format float %.17g\n"
    ends = []
    for cn, extra in ((4.0, ""), (1.0, adapt)):
        lmp(model + extra + run, fx=3.0, cn=cn)
        ends.append((tmp_path / "end").read_text())
    assert ends[0] == ends[1]
