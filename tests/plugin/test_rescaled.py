"""Slips that are rescaled while overlaps grow: LAMMPS against the law, against LAMMPS's own style, and growth."""

import numpy as np
import pytest

from faultgouge.analysis import Contacts, MindlinLaw, Packing, stiffness_matrix
from faultgouge.analysis.spectrum.spectrum import mass_weighted
from faultgouge.pywrap import Scene, perturb, ramp
from faultgouge.pywrap.lammps.engine import Engine

KN, KT = 2e5, 2e5 * 2 / 7
LAW = MindlinLaw(KN, KT, 1.0, rescaled=True)

arithmetics = pytest.mark.parametrize("compensated", [False, True], ids=["double", "compensated"])


def on(other, overlap, slip, compensated=False):
    """Disk 0 on another disk, whose number is 1, or on the floor, which has -1."""
    position = np.array([[1.0, 3.0], [1.0, 4.0 - overlap]] if other == 1 else [[1.0, 0.5 - overlap]])
    low = np.zeros_like(position) if compensated else None
    contact, radius = Contacts([0], [other], [slip]), [0.5] * len(position)
    return Packing(position=position, radius=radius, contacts=contact, law=LAW, position_low=low)


def moved(packing, closer=0.0, turned=0.0):
    """The displacement that presses a contact, and has it slip by turning the last disk."""
    displacement = np.zeros((3, len(packing)))
    displacement[1:, -1] = -closer, turned
    return displacement.ravel()


@arithmetics
@pytest.mark.parametrize("other", [1, -1], ids=["two disks", "floor"])
@pytest.mark.parametrize("closer", [3e-3, 1e-6, -1e-6, -5e-4])
def test_slip_is_rescaled_while_the_overlap_grows(other, closer, compensated):
    packing = on(other, 1e-3, 2e-4, compensated=compensated)
    with Engine(packing) as engine:
        after = engine.displace(packing, moved(packing, closer))
        again = engine.displace(packing, np.zeros(3 * len(packing)))
        force = engine.net_force
    before, now = packing.geometry.overlap[0], after.geometry.overlap[0]
    # coordinates are rounded at 4e-16, overlaps with them
    assert after.contacts.slip[0] == pytest.approx(2e-4 * min(1.0, np.sqrt(before / now)), rel=1e-12)
    assert after.contacts.slip[0] == pytest.approx(float(LAW.remembered(2e-4, before, now)), rel=1e-12)
    assert np.array_equal(again.contacts.slip, [2e-4])
    assert -force[-1] == pytest.approx(float(packing.tangential_force[0]), rel=1e-12)


@pytest.mark.parametrize("other", [1, -1], ids=["two disks", "floor"])
def test_slipping_and_pressing_at_once_is_second_order_in_the_step(other):
    errors = []
    for steps in (8, 16, 32):
        packing = on(other, 1e-3, 0.0)
        with Engine(packing) as engine:
            for _ in range(steps):
                packing = engine.displace(packing, moved(packing, 3e-3 / steps, 1e-4 / steps))
        # s delta^(1/2) = c (integral of delta^(1/2) over the slip) with delta from 1e-3 to 4e-3
        exact = -1e-4 * (2 / 3) * (4e-3**1.5 - 1e-3**1.5) / 3e-3 / np.sqrt(4e-3)
        errors.append(abs(packing.contacts.slip[0] - exact))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.1)
    assert np.log2(errors[1] / errors[2]) == pytest.approx(2.0, abs=0.05)


SCRIPT = """
units           lj
dimension       2
boundary        f f p
atom_style      sphere
atom_modify     map yes
comm_modify     vel yes
region          box block -5 5 -5 5 -0.5 0.5
create_box      1 box
create_atoms    1 single 0.0 0.0 0.0
create_atoms    1 single 0.0 0.999 0.0
set             group all diameter 1.0
neigh_modify    delay 0 every 1
{style}
timestep        1e-3
group           upper id 2
compute         each all property/atom fx
compute         force upper reduce sum c_each
thermo_style    custom step c_force
thermo          0
"""
LEG = """
set             group all omega 0.0 0.0 {spin}
fix             move upper move linear 0.0 {speed} 0.0
run             200 post no
print           "$(c_force:%.17g)" append forces screen no
unfix           move
"""


@pytest.mark.slow
def test_linear_limit_is_lammps_rescale_force(lmp, tmp_path):
    """mu is so large that x is 1e-6; a leg either turns the disks or presses them, and is then exact in both."""
    # the built-in styles have the root of the effective radius, 1/2, in their stiffnesses
    ours = f"pair_style mindlin/smooth {KN} {KT} 1e6 history {{}}\npair_coeff * *"
    theirs = f"pair_style granular\npair_coeff * * hertz {2 * KN} 0.0 tangential {{}} {2 * KT} 0.0 1e6 damping velocity"
    styles = {name: ours.format(name) for name in ("total", "rescaled")}
    styles |= {name: theirs.format(name) for name in ("mindlin", "mindlin_rescale", "mindlin_rescale/force")}
    legs = [(1e-4, 0), (0, -2e-3), (1e-4, 0), (0, 1e-3), (-3e-4, 0), (0, 2e-3), (0, -2e-3), (2e-4, 0)]
    script = "".join(LEG.format(spin=spin, speed=speed) for spin, speed in legs)
    forces = {}
    for name, style in styles.items():
        lmp(SCRIPT.format(style=style) + script)
        forces[name] = np.loadtxt(tmp_path / "forces")
        (tmp_path / "forces").unlink()
    scale = np.abs(forces["rescaled"]).max()
    close = {"atol": 1e-5 * scale, "rtol": 0}  # of the smoothing, x = 1e-6 at each step
    np.testing.assert_allclose(forces["rescaled"], forces["mindlin_rescale/force"], **close)
    np.testing.assert_allclose(forces["total"], forces["mindlin"], **close)
    assert np.abs(forces["rescaled"] - forces["mindlin_rescale"]).max() > 0.05 * scale


@pytest.mark.slow
def test_growth_is_that_of_the_mean_of_both_derivatives():
    """D(t) of an undamped run: its rate lies a few per cent below that of K, since tangential forces fall meanwhile."""
    scene = Scene.from_mapping(
        {
            "packing": {"disks": 100, "width": 11.9, "seed": 5},
            "law": {"kn": 2e5, "history": "rescaled"},
            "load": {"fy": 3.0},
            "ramp": {"step": 3e-3, "until": 0.3},
            "perturb": {"fx": 0.3, "time": 10.0, "amplitude": 1e-7, "omega": 50.0},
        }
    )
    *_, last = ramp(scene)
    rates = {}
    for share in (0.0, 0.5, 1.0):
        matrix = mass_weighted(stiffness_matrix(last.packing, parting=share), last.packing).toarray()
        rates[share] = 2 * np.sqrt(np.linalg.eigvals(matrix).astype(complex)).imag.max()
    time, msd = np.array([(sample.time, sample.msd) for sample in perturb(scene, last, samples=500, early=0)]).T
    grows = slice(np.flatnonzero(msd > 1e-17)[0], np.flatnonzero(msd > 1e-13)[0])
    measured = np.polyfit(time[grows], np.log(msd[grows]), 1)[0]
    assert 0.93 * rates[0.5] < measured < rates[0.5]
    assert measured < 0.9 * rates[0.0]
    assert measured > 1.1 * rates[1.0]
