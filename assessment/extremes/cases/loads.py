"""Stiffness, load, friction and size over many decades: equilibria within the rounding floor, and K right."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from ....analysis import Packing
from ....pywrap import Engine, NoEquilibriumError, equilibrate
from .alone import expect_refusal
from .case import Case, Outcome, refused_outcome
from .checks import balance, derivative
from .packings import arches, at_rest, bed, crystal, law, shear_packing

GROUP = "stiffness and load"

Make = Callable[[], Packing]

LOOSE_SCENE = """
packing = { disks = 24, top = 5, width = 5.95, seed = 2 }
law = { kn = 2e5 }
load = { fy = 2e4 }
"""


def _balance(make: Make) -> Outcome:
    return balance(shear_packing(make()))


def _derivative(make: Make) -> Outcome:
    return derivative(make())


def _flows() -> Outcome:
    """Without friction the floor holds nothing back."""
    start = at_rest(bed(law(mu=0.0)))
    packing = start.packing
    with Engine(packing) as engine:
        return refused_outcome(lambda: equilibrate(engine, start, 1e-3 * packing.fy), "flows", NoEquilibriumError)


def _tolerance_below_the_floor() -> Outcome:
    """The paper's f_min in doubles: the iteration ends at the floor, and the residual that is reported is measured."""
    packing = bed()
    start = at_rest(packing)
    with Engine(packing) as engine:
        found = equilibrate(engine, start, 3e-3 * packing.fy, force_tolerance=1e-15)
    if found.residual <= 1e-15:
        return Outcome("fails", found.residual, 1e-15, "a balance is reported that doubles do not have")
    return balance(found)


LOADED_PACKINGS: dict[str, tuple[Make, bool]] = {
    **{f"k_n = 1e{n}": (partial(bed, law(10.0**n)), n in (2, 12)) for n in (2, 4, 6, 8, 10, 12)},
    **{
        f"load {load:g} k_n, a crystal": (partial(crystal, 3, 2, law(), load, True), load in (1e-12, 0.1))
        for load in (1e-12, 1e-9, 1e-6, 1e-3, 0.1)
    },
    **{f"load {load:g} k_n, a bed": (partial(bed, law(), load, seed=2), False) for load in (1e-6, 1e-2)},
    **{f"mu = {mu:g}": (partial(bed, law(mu=mu)), mu <= 1e-6) for mu in (0.0, 1e-6, 1e-3, 10.0)},
    **{f"k_t = {share:g} k_n": (partial(bed, law(kt_share=share)), share == 10) for share in (0.0, 1e-3, 1.0, 10.0)},
    **{f"sizes 1 : {ratio}": (partial(arches, ratio), ratio == 50) for ratio in (10, 50)},
}
"""Packings by what is extreme in them, and whether they belong to the small part."""

CASES = [
    *(
        Case(GROUP, f"{name}: {what}", partial(criterion, make), quick)
        for name, (make, quick) in LOADED_PACKINGS.items()
        for what, criterion in (("equilibrium", _balance), ("K", _derivative))
    ),
    Case(GROUP, "f_min = 1e-15 in doubles", _tolerance_below_the_floor, True),
    Case(GROUP, "F_x without friction", _flows, True),
    Case(
        GROUP,
        "load 0.1 k_n from a loose start",
        partial(expect_refusal, "faultgouge settle FILE -o run.h5", LOOSE_SCENE, "contact law does not hold"),
        True,
    ),
]
