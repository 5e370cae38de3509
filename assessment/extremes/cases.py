r"""The stiff and extreme cases: what is tried, what it must not exceed, or how it is refused.

**Balance.** Newton's method ends where the force on a disk no longer falls. In an equilibrium this force is at most ten
times the estimated effect of the rounding of coordinates (`pywrap.equilibria.quasistatic`).

**Derivative.** Along a random direction q the forces of LAMMPS, slips advanced on the way, have the derivative -K q.
Central differences of widths h and h/2 are extrapolated, since f'' jumps at s = 0 and at Coulomb's bound. h is far
below every overlap and every slip limit, and coordinates are compensated; what is left is the rounding of net forces, u
F against a change k h, and the curvature of the law, :math:`(h/\delta)^2`. Slips have all states, also at the bound;
the packing need not be in balance.

**Time step.** Velocity Verlet moves a mode of a frozen K as :math:`x_n = x_0\cos n\Omega\,\Delta t`,
:math:`\cos\Omega\,\Delta t = 1 - \omega^2\Delta t^2/2`: bounded below :math:`\Delta t = 2/\omega_{max}`, and beyond it
growing by :math:`e^\kappa` a step, :math:`\cosh\kappa = \omega^2\Delta t^2/2 - 1`.

**Near-defective pairs.** The block

.. math::

    B = \begin{pmatrix} 1-d & e \\ -e & 1+d \end{pmatrix}, \qquad
    \lambda = 1 \mp \sqrt{D}/2, \quad D = 4(d-e)(d+e) ,

is hidden in an operator of 60 modes by a rotation. With e = d (1 - eps) the pair is real, with e = d (1 + eps) complex,
and its split :math:`\sqrt{|D|}` is of order :math:`\sqrt{8\epsilon}\,d`. Rounding of the operator, u |A|, changes the
split by its own root, but D, a smooth function of the operator, by about 4 d u |A|, however small eps is: so D is what
the onset is computed from.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache, partial
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import eigh, eigvals

from ...analysis import Contacts, MindlinLaw, Packing, spectrum, stable_timestep, stiffness_matrix, touching
from ...analysis.arrays import Floats, Indices
from ...analysis.motion.eigenvalues import SAFETY, unit_rounding
from ...pywrap import Engine, Equilibrium, equilibrate
from ...pywrap.equilibria.rattlers import place_disks
from ...pywrap.runs.undamped import time_step
from .packings import arches, at_rest, bed, crystal, law, shear_packing, with_low_parts

Measured = tuple[float, float, str]
"""A figure, the bound that it must not exceed, and what both are."""


class Case(NamedTuple):
    """Something to try: `run` is collective over the ranks, with the same result on each. The quick cases are a small
    part. `refusal` has words of the sentence of one line with which it must be refused; empty where it must hold."""

    group: str
    name: str
    run: Callable[[], Any]
    quick: bool = False
    refusal: str = ""


def cases() -> list[Case]:
    """All cases, group by group."""
    return [*stiffness_and_load(), *geometry(), *time_stepping(), *eigenvalue_cases()]


def balance(equilibrium: Equilibrium) -> Measured:
    """Whether an equilibrium is one."""
    overlap, residual, floor = equilibrium.packing.geometry.overlap, equilibrium.residual, equilibrium.floor
    says = f"largest force on a disk, {residual:.1e}, in units of what rounding leaves, {floor:.1e}; overlaps are from "
    return residual / floor, 10.0, f"{says}{overlap.min():.1e} to {overlap.max():.1e}"


def derivative(packing: Packing) -> Measured:
    """Whether K is the derivative of the forces in LAMMPS, in four random directions."""
    shares = np.resize((0.1, -0.4, 1.0, 0.02, -0.99, 0.7, -1.0), len(packing.contacts))
    slip = shares * packing.law.slip_limit(packing.geometry.overlap)
    packing = with_low_parts(replace(packing, contacts=packing.contacts.slipped(slip)))
    law, overlap = packing.law, packing.geometry.overlap
    share = min(1.0, law.mu * law.kn / law.kt) if law.frictional else 1.0
    width = 2.0 ** np.floor(np.log2(1e-5 * share * overlap.min()))
    matrix, generator, worst = stiffness_matrix(packing), np.random.default_rng(1), 0.0
    with Engine(packing) as engine:

        def force(step: Floats) -> Floats:
            engine.displace(packing, step)
            return engine.net_force

        for _ in range(4):
            q = generator.choice([-1.0, 1.0], 3 * len(packing))
            wide, narrow = ((force(-h * q) - force(h * q)) / (2 * h) for h in (width, width / 2))
            worst = max(worst, float(np.abs(2 * narrow - wide - matrix @ q).max()))
    # Net forces are rounded once, coordinates known to their low parts; six differences over h, of six contacts.
    scale = np.abs(matrix).max()
    rounding = np.finfo(float).eps * np.abs(packing.net_force).max() / scale + packing.coordinate_rounding
    says = "largest difference of -dF/dq and K q, in units of max |K|, 4 directions q, h = "
    says += f"{width:.0e}; the bound is the rounding of forces over h, and 1e-8 of curvature"
    return worst / scale, 1e-8 + 40 * rounding / width, says


LOADS = (1e-12, 1e-9, 1e-6, 1e-3, 0.1)

PACKINGS: dict[str, Callable[[], Packing]] = {
    **{f"k_n = 1e{n}": partial(bed, law(10.0**n)) for n in (2, 4, 6, 8, 10, 12)},
    **{f"load {load:g} k_n, a crystal": partial(crystal, 3, 2, law(), load, True) for load in LOADS},
    **{f"load {load:g} k_n, a bed": partial(bed, law(), load, seed=2) for load in (1e-6, 1e-2)},
    **{f"mu = {mu:g}": partial(bed, law(mu=mu)) for mu in (0.0, 1e-6, 1e-3, 10.0)},
    **{f"k_t = {share:g} k_n": partial(bed, law(kt_share=share)) for share in (0, 1e-3, 1, 10)},
    **{f"sizes 1 : {ratio}": partial(arches, ratio) for ratio in (10, 50)},
}
"""Packings by what is extreme in them."""

QUICK = {"k_n = 1e2", "k_n = 1e12", "load 1e-12 k_n, a crystal", "load 0.1 k_n, a crystal", "mu = 0", "mu = 1e-06"}
QUICK |= {"k_t = 10 k_n", "sizes 1 : 50"}


def rests(make: Callable[[], Packing]) -> Measured:
    """Whether a packing has an equilibrium under shear."""
    return balance(shear_packing(make()))


def moves(make: Callable[[], Packing]) -> Measured:
    """Whether the K of a packing is right."""
    return derivative(make())


def stiffness_and_load() -> Iterator[Case]:
    """Stiffness, load, friction and size over many decades: equilibria within the rounding floor, and K right."""
    case = partial(Case, "stiffness and load")
    for name, make in PACKINGS.items():
        yield case(f"{name}: equilibrium", partial(rests, make), name in QUICK)
        yield case(f"{name}: K", partial(moves, make), name in QUICK)

    def under(law: MindlinLaw, share: float, tolerance: float | None = None) -> Measured:
        """A bed at F_x of a share of F_y."""
        start = at_rest(bed(law))
        with Engine(start.packing) as engine:
            found = equilibrate(engine, start, share * start.packing.fy, force_tolerance=tolerance)
        figure, bound, says = balance(found)
        return (np.inf if tolerance and found.residual <= tolerance else figure), bound, says

    # the paper's f_min: the iteration ends at the floor, and the residual that is reported is measured
    yield case("f_min = 1e-15 in doubles", partial(under, law(), 3e-3, 1e-15), True)
    yield case("F_x without friction", partial(under, law(mu=0.0), 1e-3), True, "flows")


def disks(*places: tuple[float, float], slip: float | None = None, **changes: Any) -> Packing:
    """Disks of radius 1/2 with compensated coordinates; with a slip, the first two are in contact, touching or not."""
    position, radius = np.array(places), np.full(len(places), 0.5)
    contacts = touching(position, radius, None) if slip is None else Contacts([0], [1], [slip], [0])
    values: dict[str, Any] = {"position": position, "position_low": 0 * position, "radius": radius, "law": law()}
    return Packing(**(values | {"contacts": contacts} | changes))


def geometry() -> Iterator[Case]:
    """Few disks, and contacts at the edge of being one: closing, opening, grazing, at the bound, with one centre."""

    def column(*places: tuple[float, float]) -> Measured:
        """One on top of the other, upright: all contacts carry F_y."""
        top = np.arange(len(places)) == len(places) - 1
        error = np.abs(at_rest(disks(*places, top=top, fy=3.0)).packing.normal_force / 3.0 - 1).max()
        return error, 1e-14, "relative error of the normal forces against F_y; nothing pushes an unstable column"

    def zero_overlap() -> Measured:
        """Exactly touching is no contact, for the pair style as for the analysis."""
        packing = disks((3.0, 3.0), (4.0, 3.0), slip=0.0)
        with Engine(packing) as engine:
            found = engine.displace(packing, np.zeros(6))
            force = np.abs(engine.net_force).max()
        sum_ = force + len(found.contacts) + stiffness_matrix(packing).nnz + np.abs(packing.net_force).max()
        return sum_, 0.0, "forces, contacts and entries of K of two disks that touch exactly: none, nothing over zero"

    def at_the_bound() -> Measured:
        """|f_t| = mu f_n to the bit, and no tangential stiffness."""
        packing = disks((3.0, 3.999), (3.0, 3.0), slip=1.0)
        with Engine(packing) as engine:
            engine.displace(packing, np.zeros(6))
            along, normal = engine.net_force.reshape(3, 2)[:2, 0]
        limit = packing.law.slip_limit(packing.geometry.overlap)
        stiffness = np.abs(packing.law.derivatives(packing.geometry.overlap, limit).slip_derivative[0])
        excess = abs(abs(along) - packing.law.mu * abs(normal))
        return excess + stiffness, 0.0, "|f_t| - mu f_n in LAMMPS, and df_t/ds of the analysis, at the bound"

    def grazing() -> Measured:
        """A disk passes another at an overlap of 1e-12 for one step."""
        aside = disks((2.999, 4.0), (3.0, 3.0), position_low=np.array([[0.0, -1e-12], [0.0, 0.0]]))
        step = np.array([3.0 - aside.position[0, 0], 0.0, 0.0, 0.0, 0.0, 0.0])
        with Engine(aside) as engine:
            closest = engine.displace(aside, step)
            force = engine.net_force.reshape(3, 2)[1]
            beyond = engine.displace(closest, step)
        error = np.abs(force / float(aside.law.normal_force(1e-12)) - [1, -1]).max() + len(beyond.contacts)
        says = "relative error of the force at an overlap of 1e-12; low parts are known to 7e-24, 1e-11 of it"
        return error + np.abs(closest.contacts.slip[0]), 1e-10, says

    case = partial(Case, "geometry")
    yield case("one disk", partial(column, (3.0, 0.4995)), True)
    yield case("two disks", partial(column, (3.0, 0.4994), (3.0, 1.4988)), True)
    yield case("zero overlap", zero_overlap, True)
    yield case("at Coulomb's bound", at_the_bound, True)
    yield case("grazing", grazing, True)
    for wide in (3, 10, 100, 1000, 10_000):
        yield case(f"box {wide} wide", partial(rests, partial(crystal, wide)), wide < 100)
    for name, make, words in (
        ("box 2 wide", partial(crystal, 2), "under two largest diameters"),
        ("one centre", lambda: stiffness_matrix(disks((3.0, 3.0), (3.0, 3.0), slip=0.0)), "same centre"),
        ("a coordinate that is no number", lambda: disks((3.0, np.nan), (9.0, 9.0), slip=0.0), "not finite"),
        ("k_n infinite", lambda: MindlinLaw(float("inf"), 1.0, 1.0), "must be positive"),
    ):
        yield case(name, make, True, words)


@cache
def smooth_mode() -> tuple[Packing, Floats, float]:
    """Six disks at rest without friction: K is symmetric, and there is an energy. With their stiffest mode and its
    limit of the time step; masses are one, and without friction nothing turns."""
    packing = shear_packing(crystal(3, 2, law(mu=0.0))).packing
    active = 2 * len(packing)
    values, vectors = eigh(stiffness_matrix(packing).toarray()[:active, :active])
    return packing, vectors[:, -1], stable_timestep(float(np.sqrt(values[-1])))


def time_stepping() -> Iterator[Case]:
    """Undamped runs at the limit of the time step."""

    def excite_mode(share: float, amplitude: float, steps: Indices) -> Floats:
        """Amplitude of the stiffest mode after so many steps of a share of the limit, in units of the first."""
        packing, mode, limit = smooth_mode()
        size = amplitude * packing.geometry.overlap.min()
        start, found = place_disks(packing, packing.position + size * mode.reshape(2, -1).T), []
        with Engine(start) as engine, engine.undamped(share * limit) as dynamics:
            for forward in np.diff(steps, prepend=0).tolist():
                apart = dynamics.advance(forward).position - packing.position
                found.append(mode @ apart.T.ravel() / size)
        return np.array(found)

    def below_the_limit(share: float) -> Measured:
        steps = 100 * np.arange(1, 101)
        off = excite_mode(share, 1e-4, steps) - np.cos(steps * np.arccos(1 - 2 * share**2))
        says = "stiffest mode against cos(n Omega dt) over 10000 steps, in units of its amplitude; that is 0.0001 of "
        says += "the smallest overlap, so that K is frozen up to that and modes mix at the square of it"
        return np.abs(off).max(), 1e-3, says

    def limit_is_sharp() -> Measured:
        """Beyond the limit that the refusal protects, motion grows as theory predicts."""
        first, last = np.abs(excite_mode(1.01, 1e-8, np.array([10, 30])))
        kappa = np.arccosh(2 * 1.01**2 - 1)
        error = abs(np.log(last / first) / (20 * kappa) - 1)
        return error, 1e-3, f"growth of the stiffest mode against kappa = {kappa:.4g} a step: the limit is sharp"

    def too_long() -> float:
        return time_step(smooth_mode()[0], 1.01 * smooth_mode()[2])

    case = partial(Case, "time stepping")
    yield case("step of 0.5 of the limit", partial(below_the_limit, 0.5), True)
    yield case("step of 0.99 of the limit", partial(below_the_limit, 0.99), True)
    yield case("step of 1.01 of the limit", too_long, True, "over the limit 2/omega_max")
    yield case("step of 1.01 of the limit, LAMMPS alone", limit_is_sharp, True)


def eigenvalue_cases() -> Iterator[Case]:
    """Spectra that are hard: pairs about to coalesce, stiffnesses over ten decades."""

    def near_defective(eps: float, size: int = 60, split: float = 0.05) -> Measured:
        """All other eigenvalues are far from the pair; eps is negative for a real pair."""
        coupling = split * (1 + eps)
        exact = 4 * (split - coupling) * (split + coupling)
        matrix = np.diag(np.linspace(2, 30, size))
        matrix[:2, :2] = [[1 - split, coupling], [-coupling, 1 + split]]
        turn = np.linalg.qr(np.random.default_rng(2).standard_normal((size, size)))[0]
        matrix = turn @ matrix @ turn.T
        values = eigvals(matrix)
        one, other = values[np.argsort(np.abs(values - 1))[:2]]
        says = f"error of D = {exact:.2g}, the squared split of LAPACK's two eigenvalues, ten times 4 d u |A| the "
        says += f"bound; the split is {abs(exact) ** 0.5:.2g}, of LAPACK's eigenvalues {abs(one - other):.2g}"
        # LAPACK's backward error is a few u |A|
        return abs((one - other) ** 2 - exact), 10.0 * unit_rounding(matrix) * 4 * split, says

    def scales() -> Measured:
        """Eigenvalues over k_n are the same for all k_n at the same load over k_n."""
        found = [spectrum(crystal(3, 2, law(kn))).eigenvalues.real / kn for kn in 10.0 ** np.arange(2, 13, 2)]
        scaled = np.sort(found)
        says = "eigenvalues / k_n of a crystal for k_n from 1e2 to 1e12, in units of the largest: 50 roundings"
        return np.abs(scaled - scaled[0]).max() / scaled[0].max(), SAFETY * np.finfo(float).eps, says

    case = partial(Case, "eigenvalues")
    for n in (4, 6, 8, 10, 12, 14, 16):
        for sign, kind in ((-1, "real"), (1, "complex")):
            eps = sign * 10.0**-n
            yield case(f"pair at eps = {eps:+.0e}, {kind}", partial(near_defective, eps), n in (4, 10, 16))
    yield case("eigenvalues over k_n", scales, True)
