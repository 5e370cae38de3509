"""Stiffness, load, friction and size over many decades: equilibria within the rounding floor, and K right."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from ....analysis import Packing
from ....pywrap import Engine, NoEquilibriumError, equilibrate
from .alone import refused_by_command
from .case import Case, Outcome, refused
from .checks import balance, derivative
from .packings import arches, at_rest, bed, crystal, law, sheared

GROUP = "stiffness and load"

Make = Callable[[], Packing]

LOOSE = """
packing = { disks = 24, top = 5, width = 5.95, seed = 2 }
law = { kn = 2e5 }
load = { fy = 2e4 }
"""


def _balance(make: Make) -> Outcome:
    return balance(sheared(make()))


def _derivative(make: Make) -> Outcome:
    return derivative(make())


def _flows() -> Outcome:
    """Without friction the floor holds nothing back."""
    start = at_rest(bed(law(mu=0.0)))
    packing = start.packing
    with Engine(packing) as engine:
        return refused(lambda: equilibrate(engine, start, 1e-3 * packing.fy), NoEquilibriumError, "flows")


def _tolerance_below_the_floor() -> Outcome:
    """The paper's f_min in doubles: the iteration ends at the floor, and the residual that is reported is measured."""
    packing = bed()
    start = at_rest(packing)
    with Engine(packing) as engine:
        found = equilibrate(engine, start, 3e-3 * packing.fy, force_tolerance=1e-15)
    if found.residual <= 1e-15:
        return Outcome("fails", found.residual, 1e-15, "a balance is reported that doubles do not have")
    return balance(found)


def _both(name: str, make: Make, quick: bool = False) -> list[Case]:
    return [
        Case(GROUP, f"{name}: equilibrium", partial(_balance, make), quick),
        Case(GROUP, f"{name}: K", partial(_derivative, make), quick),
    ]


CASES = [
    *(
        case
        for exponent in (2, 4, 6, 8, 10, 12)
        for case in _both(f"k_n = 1e{exponent}", partial(bed, law(10.0**exponent)), exponent in (2, 12))
    ),
    *(
        case
        for load in (1e-12, 1e-9, 1e-6, 1e-3, 0.1)
        for case in _both(
            f"load {load:g} k_n, a crystal", partial(crystal, 3, 2, law(), load, True), load in (1e-12, 0.1)
        )
    ),
    *(case for load in (1e-6, 1e-2) for case in _both(f"load {load:g} k_n, a bed", partial(bed, law(), load, seed=2))),
    *(
        case
        for mu in (0.0, 1e-6, 1e-3, 10.0)
        for case in _both(f"mu = {mu:g}", partial(bed, law(mu=mu)), mu in (0.0, 1e-6))
    ),
    *(
        case
        for share in (0.0, 1e-3, 1.0, 10.0)
        for case in _both(f"k_t = {share:g} k_n", partial(bed, law(kt_share=share)), share == 10)
    ),
    *(case for ratio in (10, 50) for case in _both(f"sizes 1 : {ratio}", partial(arches, ratio), ratio == 50)),
    Case(GROUP, "f_min = 1e-15 in doubles", _tolerance_below_the_floor, True),
    Case(GROUP, "F_x without friction", _flows, True),
    Case(
        GROUP,
        "load 0.1 k_n from a loose start",
        partial(refused_by_command, "settle", LOOSE, "contact law does not hold"),
        True,
    ),
]
