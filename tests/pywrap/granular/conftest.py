"""LAMMPS as a user's script has it: each with a log of its own, closed at the end; and packings at rest on a slope."""

from collections.abc import Callable, Iterator
from functools import cache
from typing import Any

import numpy as np
import pytest
from granular_packings import ALMOST_NONE, DECKS, TWO, command, instance, on_slope, with_law

import faultgouge


@pytest.fixture
def lammps_with(tmp_path) -> Iterator[Callable[..., Any]]:
    """Makes LAMMPS with some commands and a deck, and with a log in the folder of the test, or without."""
    made = []

    def make(lines: str = "", deck: str = "", *, log: str | None = "log.lammps"):
        made.append(instance(None if log is None else tmp_path / log))
        command(made[-1], lines)
        if deck:
            made[-1].file(str(DECKS / deck))
        return made[-1]

    yield make
    for each in made:
        each.close()


@pytest.fixture
def taken(lammps_with):
    """Makes LAMMPS with some commands and a deck, and takes its configuration."""

    def make(lines: str, deck: str = "", **options):
        lmp = lammps_with(lines, deck)
        return lmp, faultgouge.from_lammps(lmp, **options)

    return make


@pytest.fixture
def two(lammps_with):
    """Makes two spheres that touch, with some commands; a LAMMPS without a log, and what it was told of contacts."""

    def make(pair: str, coefficients: str, more: str = ""):
        told = [f"pair_style {pair}", *(f"pair_coeff {each}" for each in coefficients.split(";")), *more.splitlines()]
        return lammps_with(TWO + "\n".join([*told, "run 0"]), log=None), told

    return make


@pytest.fixture(scope="session")
def bed(tmp_path_factory) -> Callable[..., Any]:
    """LAMMPS with particles at rest on a slope, none of whose contacts is at the bound, and their configuration, by
    law, dimension and whether they have dashpots; made once each, not to be changed."""

    @cache
    def make(law: str, d: int, damped: bool = True):
        # with 3 a contact of these disks comes to rest at the bound
        mu = "10.0" if (law, d, damped) == ("mindlin_rescale", 2, True) else "3.0"
        dashpots, e = ("40", "40" if damped else ALMOST_NONE), ("0.2", "0.2" if damped else "1.0")
        log = tmp_path_factory.mktemp("log") / "log.lammps"
        lmp = on_slope(log, law, d, 0.1 if d == 3 else 0.05, dashpots, e, mu)
        for _ in range(12):
            lmp.command("run 20000")
            found = faultgouge.from_lammps(lmp, balance=np.inf)
            if found.residual < 1e-9 * found.contacts.normal_force.mean():
                break
        if not damped:
            with_law(lmp, law, d, ALMOST_NONE, "", ("1.0", "1.0"), mu)
        return lmp, faultgouge.from_lammps(lmp)

    return make
