"""Rescaled slips, and Coulomb's slider: LAMMPS against the law, against LAMMPS's own style, and growth."""

from pathlib import Path

import numpy as np
import pytest

from faultgouge.analysis import Contacts, MindlinLaw, Packing, fit_growth, stiffness_matrix
from faultgouge.analysis.motion.eigenvalues import mass_weighted
from faultgouge.pywrap import Scene, perturb, ramp
from faultgouge.pywrap.lammps.engine import Engine

KN, KT = 2e5, 2e5 * 2 / 7
LAW = MindlinLaw(KN, KT, 1.0, rescaled=True)
SLIDER = MindlinLaw(KN, KT, 1.0, coulomb=True)

arithmetics = pytest.mark.parametrize("compensated", [False, True], ids=["double", "compensated"])


def on(other, overlap, slip, compensated=False, law=LAW):
    """Disk 0 on another disk, whose number is 1, or on the floor, which has -1."""
    position = np.array([[1.0, 3.0], [1.0, 4.0 - overlap]] if other == 1 else [[1.0, 0.5 - overlap]])
    more = {"contacts": Contacts([0], [other], [slip]), "position_low": 0 * position if compensated else None}
    return Packing(position=position, radius=[0.5] * len(position), law=law, **more)


def pressed(packing, closer, turned=0.0):
    """The displacement that presses a contact, and has it slip by turning the last disk."""
    last = np.arange(1, len(packing) + 1) == len(packing)
    return np.concatenate([0.0 * last, -closer * last, turned * last])


@arithmetics
@pytest.mark.parametrize("other", [1, -1], ids=["two disks", "floor"])
@pytest.mark.parametrize("closer", [3e-3, 1e-6, -1e-6, -5e-4])
@pytest.mark.parametrize("law", [LAW, SLIDER], ids=["smooth", "slider"])
def test_slip_is_rescaled_while_the_overlap_grows(other, closer, compensated, law):
    packing = on(other, 1e-3, 2e-4, compensated=compensated, law=law)
    with Engine(packing) as engine:
        after = engine.displace(packing, pressed(packing, closer))
        again = engine.displace(packing, np.zeros(3 * len(packing)))
        force = engine.net_force
    before, now = packing.geometry.overlap[0], after.geometry.overlap[0]
    # coordinates are rounded at 4e-16, overlaps with them
    remembered = 2e-4 * min(1.0, np.sqrt(before / now))
    assert [after.contacts.slip[0], law.remembered(2e-4, before, now)] == pytest.approx([remembered] * 2, rel=1e-12)
    assert np.array_equal(again.contacts.slip, [2e-4])
    assert -force[-1] == pytest.approx(float(packing.tangential_force[0]), rel=1e-12)


@pytest.mark.parametrize("other", [1, -1], ids=["two disks", "floor"])
def test_slipping_and_pressing_at_once_is_second_order_in_the_step(other):
    errors = []
    for steps in (8, 16, 32):
        packing = on(other, 1e-3, 0.0)
        with Engine(packing) as engine:
            for _ in range(steps):
                packing = engine.displace(packing, pressed(packing, 3e-3 / steps, 1e-4 / steps))
        # s delta^(1/2) = c (integral of delta^(1/2) over the slip) with delta from 1e-3 to 4e-3
        exact = -1e-4 * (2 / 3) * (4e-3**1.5 - 1e-3**1.5) / 3e-3 / np.sqrt(4e-3)
        errors.append(abs(packing.contacts.slip[0] - exact))
    assert np.log2(np.divide(errors[:-1], errors[1:])) == pytest.approx([2.0, 2.0], abs=0.05)


SCRIPT = Path(__file__).with_name("inputs").joinpath("two_disks.in").read_text()
LEG = """
set             group all omega 0.0 0.0 {spin}
fix             move upper move linear 0.0 {speed} 0.0
run             {steps} post no
print           "$(c_force:%.17g)" append forces screen no
unfix           move
"""


@pytest.fixture
def forces_after(lmp, tmp_path):
    """Forces after legs of 200 steps of 1e-3, each a spin and a speed, with a style of pairs or of the floor."""

    def forces(style, legs, *, radius=0.5, floor=None, refined=1):
        script = SCRIPT.format(style=style, dt=1e-3 / refined)
        script = script.replace("diameter 1.0", f"diameter 1.0\nset atom 1 diameter {2 * radius}")
        # beside a floor the first disk is out of reach
        script = script.replace("single 0.0 0.0", "single 4.0 4.0" if floor else f"single 0.0 {0.5 - radius}")
        script += f"fix floor upper {floor}\n" if floor else ""
        lmp(script + "".join(LEG.format(spin=spin, speed=speed, steps=200 * refined) for spin, speed in legs))
        found = np.loadtxt(tmp_path / "forces")
        (tmp_path / "forces").unlink()
        return found

    return forces


@pytest.mark.slow
def test_linear_limit_is_lammps_rescale_force(forces_after):
    """mu is so large that x is 1e-6; a leg either turns the disks or presses them, and is then exact in both."""
    # the built-in styles have the root of the effective radius, 1/2, in their stiffnesses
    ours = f"pair_style mindlin/smooth {KN} {KT} 1e6 history {{}}\npair_coeff * *"
    theirs = f"pair_style granular\npair_coeff * * hertz {2 * KN} 0.0 tangential {{}} {2 * KT} 0.0 1e6 damping velocity"
    styles = {name: ours.format(name) for name in ("total", "rescaled")}
    styles |= {name: theirs.format(name) for name in ("mindlin", "mindlin_rescale", "mindlin_rescale/force")}
    legs = [(1e-4, 0), (0, -2e-3), (1e-4, 0), (0, 1e-3), (-3e-4, 0), (0, 2e-3), (0, -2e-3), (2e-4, 0)]
    forces = {name: forces_after(style, legs) for name, style in styles.items()}
    scale = np.abs(forces["rescaled"]).max()
    close = {"atol": 1e-5 * scale, "rtol": 0}  # of the smoothing, x = 1e-6 at each step
    np.testing.assert_allclose(forces["rescaled"], forces["mindlin_rescale/force"], **close)
    np.testing.assert_allclose(forces["total"], forces["mindlin"], **close)
    assert np.abs(forces["rescaled"] - forces["mindlin_rescale"]).max() > 0.05 * scale


def slider_and_theirs(forces_after, legs, *, wall=False, radius=0.5, refined=1):
    """Forces of our slider, and those of LAMMPS's style or wall granular."""
    # the built-in styles have the root of the effective radius in their stiffnesses, and a wall the disk's own
    root = np.sqrt(0.5 if wall else 0.5 * radius / (0.5 + radius))
    theirs = f"hertz {KN / root} 0.0 tangential mindlin_rescale/force {KT / root} 0.0 0.5 damping velocity"
    ours = f"mindlin/smooth {KN} {KT} 0.5 {{}}history coulomb"
    pairs = f"pair_style {ours.format('')}\npair_coeff * *\n", f"pair_style granular\npair_coeff * * {theirs}\n"
    floors = f"wall/{ours.format('ylo 0.5 ')}", f"wall/gran granular {theirs} yplane 0.5 NULL"
    floors = floors if wall else (None, None)
    return [forces_after(pairs[k], legs, floor=floors[k], radius=radius, refined=refined) for k in (0, 1)]


SPINS = (1e-2, 0, 3e-3, 0, -5e-4, -2e-2, 0, 0, 0, 4e-3)
SPEEDS = (0, -2e-3, 0, 2.5e-3, 0, 0, 1e-3, 4e-3, -9e-3, 0)
"""The contact slides, sticks when it is pressed or turned back, slides since it parts, and is lost and met again."""


@pytest.mark.slow
@pytest.mark.parametrize("kind", [{}, {"radius": 0.7}, {"wall": True}], ids=["two disks", "of two sizes", "floor"])
def test_slider_is_lammps_rescale_force(forces_after, kind):
    """Also where the contact slides. A leg either turns the disks or presses them: what both do at once LAMMPS counts
    with the stiffness at the end of a step, and the plugin with the mean of both ends."""
    ours, theirs = slider_and_theirs(forces_after, list(zip(SPINS, SPEEDS, strict=True)), **kind)
    # a step takes a slip from velocities, and so to 1e-16 of its force
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-13 * np.abs(theirs).max())
    assert len(np.unique(np.round(ours, 12))) > 6


@pytest.mark.slow
def test_slider_turned_and_pressed_at_once_is_lammps_in_the_limit_of_small_steps(forces_after):
    legs = [(1e-3, -2e-3), (-1.5e-3, 1e-3), (1e-3, 2e-3), (5e-3, -2e-3), (-2e-4, 5e-4)]
    both = [slider_and_theirs(forces_after, legs, refined=refined) for refined in (1, 2, 4)]
    apart = [np.abs(ours - theirs).max() / np.abs(ours).max() for ours, theirs in both]
    assert apart[0] < 1e-2
    assert np.log2(np.divide(apart[:-1], apart[1:])) == pytest.approx([1.0, 1.0], abs=0.1)


def test_slider_obeys_friction_that_weakens_during_a_run(lmp, tmp_path):
    """And when friction is as strong as before, the force stays what it was."""
    style = f"pair_style mindlin/smooth {KN} {KT} 0.5 history coulomb\npair_coeff * *"
    weaker = "variable mu equal 0.2\nfix weaker all adapt 1 pair mindlin/smooth mu * * v_mu\nrun 1\n"
    strong = "unfix weaker\nvariable mu equal 0.5\nfix strong all adapt 1 pair mindlin/smooth mu * * v_mu\nrun 1\n"
    say = 'print "$(c_force:%.17g)" append forces screen no\n'
    slide = LEG.format(spin=1e-2, speed=0, steps=200)
    stop = "set group all omega 0.0 0.0 0.0\nfix move upper move linear 0.0 0.0 0.0\n"
    lmp(SCRIPT.format(style=style, dt=1e-3) + slide + stop + weaker + say + strong + say)
    forces = np.loadtxt(tmp_path / "forces") / (KN * 1e-3**1.5)
    np.testing.assert_allclose(np.abs(forces), [0.5, 0.2, 0.2], rtol=1e-12)


def test_a_vibration_shakes_contacts_down_to_the_default_matrix(reference_packing):
    """Contacts at the bound among them: from the second cycle on they stick. The mean of both halves of a cycle, in one
    of which a contact parts and in the other closes, is the matrix with half of either derivative."""
    packing = reference_packing(0.3, shares=[-1.0, 0.05, 0.5, 0.99, 1.0, -0.2, 0.1], coulomb=True)
    rng, width = np.random.default_rng(5), 2.0**-27
    matrix, slides = stiffness_matrix(packing), stiffness_matrix(packing, sliding=True)
    with Engine(packing) as engine:
        for _ in range(3):
            direction, now, ends = np.round(rng.uniform(-1, 1, 3 * len(packing)), 2), packing, []
            for step in (1, *3 * (-2, 2)):  # three cycles
                now = engine.displace(now, step * width * direction)
                ends.append(engine.net_force)
            right, left, again = ends[-3:]
            measured = (0.5 * (right + again) - left) / (-2 * width)
            # changes by the vibration, 1e-8 over the smallest overlaps, and forces rounded at 1e-16 of K over 1e-8
            scale = 1e-5 * np.abs(matrix @ direction).max()
            np.testing.assert_allclose(measured, matrix @ direction, rtol=0, atol=scale)
            assert np.abs(measured - slides @ direction).max() > 1e3 * scale


GROWTHS = {
    # a few per cent below that of K, since tangential forces fall meanwhile
    "rescaled": (5, 0.3, {"time": 10.0, "amplitude": 1e-7, "omega": 50.0}, (1e-17, 1e-13), (0.93, 1.0), 1.1),
    # four contacts are at the bound; in five packings 0.87 to 1.13: the mean is the first harmonic alone
    "coulomb": (2, 0.6, {"time": 64.0, "amplitude": 1e-9, "omega": 30.0}, (1e-16, 1e-9), (0.85, 1.15), 1.6),
}
"""Seed, F_x, pushes, amplitudes of the fit, limits of the rate over the default one, and how far off others are."""


@pytest.mark.parametrize("history", ["rescaled", pytest.param("coulomb", marks=pytest.mark.long)])
@pytest.mark.slow
def test_growth_is_that_of_the_mean_of_both_derivatives(history):
    """D(t) of an undamped run. K with one of both derivatives for all contacts, or in which sliders slide on, is far
    off."""
    seed, fx, perturbation, fitted, within, apart = GROWTHS[history]
    sections = {"packing": {"disks": 100, "width": 11.9, "seed": seed}, "law": {"kn": 2e5, "history": history}}
    sections |= {"load": {"fy": 3.0}, "ramp": {"step": fx / 100, "until": fx}, "perturb": {"fx": fx, **perturbation}}
    scene = Scene.from_mapping(sections)
    *_, last = ramp(scene)
    others = [{"parting": 0.0}, {"parting": 1.0}]
    if history == "coulomb":
        assert last.packing.sliding.any()
        others += [{"sliding": True}]

    def rate(**branch):
        matrix = mass_weighted(stiffness_matrix(last.packing, **branch), last.packing).toarray()
        return 2 * np.sqrt(np.linalg.eigvals(matrix).astype(complex)).imag.max()

    time, msd = np.array([(sample.time, sample.msd) for sample in perturb(scene, last, samples=400, early=0)]).T
    measured = fit_growth(time, msd, *fitted).rate
    assert within[0] < measured / rate() < within[1]
    for other in others:
        assert not 1 / apart < rate(**other) / measured < apart
