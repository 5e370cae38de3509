"""Stress and moduli of packings with friction against LAMMPS's own pressure and its own deformed box."""

import numpy as np
import pytest

from faultgouge.analysis import elastic_moduli, stress
from faultgouge.pywrap import from_lammps

STRAIN, STEPS, DT = 1e-7, 2000, 0.002
"""So small that a contact's stiffness changes by 1e-5; half of the difference of both directions takes that out."""


@pytest.fixture(scope="module", params=[2, pytest.param(3, marks=pytest.mark.slow)], ids=["disks", "spheres"])
def sheared(request, tmp_path_factory):
    """Disks, or spheres, at rest in a tilted periodic box after a shear with friction; their LAMMPS and dimension."""
    from periodic_box import at_rest

    lmp = at_rest(request.param, tmp_path_factory.mktemp("log") / "log.lammps")
    yield lmp, request.param
    lmp.close()


def pressure(lmp):
    """LAMMPS's pressure tensor: pxy is the force along y over the branch along x."""
    names = [["p" + "".join(sorted(a + b)) for b in "xyz"] for a in "xyz"]
    return np.array([[lmp.get_thermo(name) for name in row] for row in names])


def as_lammps(tensor):
    """The six components that LAMMPS has of a tensor that is not quite symmetric."""
    return np.where(np.triu(np.ones((3, 3))), tensor.T, tensor)


def gradient(packing, name):
    """The displacement gradient of fix deform, of a box that may be tilted: its edges change by dh."""
    edges, change = packing.box.T, np.zeros((3, 3))
    a, b = "xyz".index(name[0]), "xyz".index(name[-1])
    change[a, b] = edges[b, b]
    return change @ np.linalg.inv(edges)


def test_stress_is_the_pressure_of_lammps(sheared):
    lmp, d = sheared
    packing = from_lammps(lmp)
    assert np.abs(packing.contacts.tangential_force).max() > 0.01 * packing.contacts.normal_force.mean()
    lmp.command("run 0")
    told = pressure(lmp)[:d, :d]
    assert as_lammps(stress(packing))[:d, :d] == pytest.approx(told, abs=1e-11 * np.abs(told).max())


@pytest.mark.parametrize("sheared", [2, pytest.param(3, marks=pytest.mark.long)], indirect=True, scope="module")
def test_moduli_are_those_of_a_deformed_box(sheared):
    """Of disks; of spheres, whose stress is compared above, in `make long`."""
    lmp, d = sheared
    packing = from_lammps(lmp)
    found = elastic_moduli(packing)
    odd = np.linalg.norm(found.antisymmetric) / np.linalg.norm(found.tensor)
    assert odd > 1e-4  # friction under load: not reciprocal
    for name in ("x", "xy") if d == 2 else ("z", "yz"):
        pressures = []
        for sign in (1, -2, 1):
            lmp.command(f"fix box all deform 1 {name} erate {sign * STRAIN / STEPS / DT!r} remap v flip no")
            lmp.command(f"run {STEPS}")
            lmp.commands_string("unfix box\nrun 10000")
            pressures.append(pressure(lmp))
        told = -(pressures[0] - pressures[1]) / (2 * STRAIN)
        here = as_lammps(np.einsum("abkl,kl->ab", found.by_gradient, gradient(packing, name)))
        assert np.abs(here - told)[:d, :d].max() < 2e-6 * np.abs(told).max()


# the same code in both dimensions: disks take a tenth of the time
@pytest.mark.parametrize("sheared", [pytest.param(2, id="disks")], indirect=True, scope="module")
def test_dashpots_are_the_viscosity_of_a_box_that_is_sheared_steadily(sheared):
    """Without drag: stress = C (rate t) + eta rate once the start has died away, with eta = Im C/omega at omega -> 0.

    LAMMPS's dashpots feel the velocity of half a step before, which shifts the stress by C rate dt/2.
    """
    lmp, _ = sheared
    packing = from_lammps(lmp)
    omega, rate, dt = 1e-4, 1e-8, 0.0005
    moduli = elastic_moduli(packing, omega)
    shear = gradient(packing, "xy")
    eta = float(np.einsum("abkl,kl->ab", moduli.by_gradient.imag / omega, shear)[1, 0])
    lmp.commands_string(f"unfix drag\ntimestep {dt}\nfix box all deform 1 xy erate {rate} remap v flip no")
    time, told = 1000 * dt * np.arange(1, 121), np.full(120, stress(packing)[1, 0])
    for sample in range(120):
        lmp.command("run 1000")
        told[sample] -= lmp.get_thermo("pxy")
    # a cubic: the springs stiffen with the strain, 1e-6 of which is left
    slope, at_once = np.polyfit(time[40:], told[40:], 3)[2:]
    assert slope / rate == pytest.approx(np.einsum("abkl,kl->ab", moduli.by_gradient.real, shear)[1, 0], rel=1e-4)
    assert at_once / rate == pytest.approx(eta, rel=0.03)
