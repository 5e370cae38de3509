"""The windows of random families against all eigenvalues at many loads."""

from collections import Counter
from functools import cache
from itertools import product

import numpy as np
import pytest
from scipy.sparse import csr_array

from faultgouge.analysis.windows import System, find_windows

LOADS = np.linspace(0.0, 1.0, 101)


def family(seed, size, feed, dissipation):
    """Levels that move along straight lines and cross, with couplings that grow with the load, in a turned basis."""
    rng = np.random.default_rng(seed)
    turn = np.linalg.qr(rng.normal(size=(size, size)))[0]
    levels = np.sort(rng.uniform(20, 20 + 2 * size, size))
    drift, coupling = np.diag(rng.normal(size=size) * 2), rng.normal(size=(2, size, size))
    symmetric, antisymmetric = coupling[0] + coupling[0].T, coupling[1] - coupling[1].T
    loss = rng.normal(size=(size, size))
    loss = dissipation * (loss @ loss.T / size + 0.1 * np.eye(size))

    def system(fx):
        a = np.diag(levels) + fx * (drift + 0.1 * symmetric + feed * antisymmetric)
        damping = csr_array(turn @ loss @ turn.T) if dissipation else None
        return System(fx, csr_array(turn @ a @ turn.T), damping)

    return system


def count_growing(system):
    """How many motions grow, by LAPACK, and by how much the slowest of them does, or the fastest of the others."""
    a = system.stiffness.toarray()
    if system.damping is None:
        values = np.linalg.eigvals(a)
        return int(np.sum(values.imag > 1e-6)), np.abs(values.imag[np.abs(values.imag) > 1e-12]).min(initial=np.inf)
    nothing, one = np.zeros_like(a), np.eye(len(a))
    values = np.linalg.eigvals(np.block([[nothing, one], [-a, -system.damping.toarray()]]))
    values = values[values.imag > 0]
    return int(np.sum(values.real > 0)), np.abs(values.real).min(initial=np.inf)


@cache
def growing_at_loads(seed, size, feed, dissipation):
    """What `count_growing` has at each of `LOADS`: the same for all increments of a search."""
    system = family(seed, size, feed, dissipation)
    return [count_growing(system(fx)) for fx in LOADS]


def look_inside(windows):
    """Loads inside undamped windows, where growth without dissipation is largest; `onset_run` looks there, too."""
    inside = [each.fx_onset for each in windows]
    inside += [0.5 * (each.fx_onset + each.fx_end) for each in windows if each.fx_end is not None]
    return lambda below, above: [fx for fx in inside if below < fx < above]


@pytest.mark.parametrize(
    ("increments", "dissipation", "seeds"),
    [
        (3, 0.3, 3),
        *(pytest.param(*each, 6, marks=pytest.mark.long) for each in product((1, 3), (1e-4, 1e-2, 0.3))),
    ],
)
def test_as_many_windows_are_open_at_each_load_as_motions_grow(increments, dissipation, seeds):
    """Windows that begin and end within an increment, several of them, and gaps between two windows of one motion;
    without dissipation and with it."""
    found = Counter()
    for seed, feed in product(range(seeds), (0.05, 0.3, 1.0)):
        size, loads = 4 + seed, np.linspace(0.0, 1.0, increments + 1)
        undamped = find_windows(family(seed, size, feed, 0.0), loads)
        damped = find_windows(family(seed, size, feed, dissipation), loads, look=look_inside(undamped))
        for windows, loss in ((undamped, 0.0), (damped, dissipation)):
            edges = np.array([edge for each in windows for edge in (each.fx_onset, each.fx_end) if edge is not None])
            for fx, (growing, doubt) in zip(LOADS, growing_at_loads(seed, size, feed, loss), strict=True):
                begun = sum(each.fx_onset < fx and (each.fx_end is None or fx < each.fx_end) for each in windows)
                # LAPACK cannot tell next to an edge, or where two modes cross: it knows Re s to the root of rounding
                in_doubt = np.abs(edges - fx).min(initial=np.inf) < 1e-6 or doubt < 1e-6
                assert in_doubt or begun == growing, (fx, windows)
            found[loss] += len(windows)
    assert min(found.values()) >= (10 if seeds == 6 else 3)
