"""Packings that are unstable at the smallest load, or become so without oscillation: what is said of them."""

from dataclasses import replace

import numpy as np
import pytest
from packing_snapshot import snapshot_of

from faultgouge.analysis import Contacts, find_onset, spectrum
from faultgouge.analysis.errors import TurningPointError
from faultgouge.analysis.windows import LIMITS

FEW = replace(LIMITS, all_windows=10)
"""With these a packing of 100 disks is a large one."""


def buckled(path, fx):
    """The packing at a load without friction and without every third contact, so that it gives way."""
    packing = path(fx)
    law, c, kept = packing.law, packing.contacts, np.arange(len(packing.contacts.i)) % 3 > 0
    fewer = Contacts(c.i[kept], c.j[kept], c.slip[kept])
    return replace(packing, law=replace(law, kt=1e-6 * law.kt), contacts=fewer)


def ending(path, last):
    """Equilibria that have a negative eigenvalue from a load on."""
    return lambda fx: path(fx) if fx < last else buckled(path, fx)


@pytest.mark.parametrize("of_lammps", [False, True], ids=["packing", "snapshot"])
@pytest.mark.parametrize("limits", [LIMITS, FEW], ids=["small", "large"])
def test_a_packing_that_is_unstable_from_the_start(path, limits, of_lammps):
    loads, pairs = [0.022, 0.0221], spectrum(path(0.022)).pairs
    equilibrium = (lambda fx: snapshot_of(path(fx))) if of_lammps else path
    onset = find_onset(equilibrium, loads, first=True, limits=limits)
    assert (onset.fx_c, onset.windows[0].kind) == (0.022, "start")
    rate = pytest.approx(max(pair.growth_rate for pair in pairs), rel=1e-9)
    assert onset.as_dict()["unstable_at_start"] == {"pairs": len(pairs), "negative": 0, "growth_rate": rate}


def test_a_negative_eigenvalue_ends_the_branch(path):
    assert len(spectrum(buckled(path, 0.0219)).negative) > 0
    with pytest.raises(TurningPointError, match=r"before F_x = 0\.0218,"):
        find_onset(ending(path, 0.0218), [0.0216, 0.0217, 0.0218, 0.0219])
    onset = find_onset(ending(path, 0.0222), [0.0218, 0.0219, 0.0222, 0.0223])
    assert onset.fx_c == pytest.approx(0.0218330564080, abs=1e-10)
    assert onset.as_dict()["branch_ends"] == 0.0222


def test_complex_from_the_start_and_negative_at_the_next_load(path):
    onset = find_onset(ending(path, 0.0221), [0.022, 0.0221])
    assert (onset.fx_c, onset.ends) == (0.022, 0.0221)
    assert len(onset.at_start.pairs) > 0
