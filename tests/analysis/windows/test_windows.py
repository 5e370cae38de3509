"""Windows of complex eigenvalues, on families of matrices whose windows are known, and along a ramp."""

import pickle
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from families import DIGITS, OTHERS, crossing, embedded, normal_form, then_jumping
from scipy.linalg import block_diag

from faultgouge.analysis import Contacts, NoEquilibriumError, OnsetError, complex_windows, find_onset
from faultgouge.analysis.uncertain_digits import with_uncertainty
from faultgouge.analysis.windows import Limits, Motions, NoGrowthError, System, force_bearing


def bent(f):
    """Levels that approach, and are bent apart in the last increment: its chord alone shows no window."""
    gap = 1 - f if f < 1.1 else 5 * (f - 1.1) - 0.1
    return embedded([[10 + gap, 0.05], [-0.05, 10 - gap]])


def with_a_long_window(f):
    """A pair that is complex from 0.35 to 8.6, and one that is so between 5.2 and 5.3, in an orthonormal basis."""
    matrix = np.diag(np.concatenate([[100.0, 100.0, 200.0, 200.0], 300 + 50 * OTHERS]))
    matrix[0, 1], matrix[1, 0] = 1.0, (f - 0.35) * (f - 8.6)
    matrix[2:4, 2:4] += [[f - 5.25, 0.05], [-0.05, 5.25 - f]]
    return matrix


def with_a_hole(low, high):
    """A window from 0.3 to 0.7, and loads without an equilibrium."""

    def operator(f):
        if low < f < high:
            raise NoEquilibriumError("no equilibrium")
        return crossing(0.5, -0.04)(f)

    return operator


@pytest.mark.parametrize(
    ("operator", "loads", "edges"),
    [
        (bent, [0.0, 0.5, 0.9, 1.3], [(0.95, 1.05), (1.11, 1.13)]),
        # a pair that is complex at both ends of an increment and real in between
        (lambda f: embedded([[10, f - 0.35], [0.55 - f, 10]]), [0.0, 1.0], [(0.0, 0.35), (0.55, np.inf)]),
        (with_a_long_window, np.arange(10.0), [(0.35, 8.6), (5.2, 5.3)]),  # which keep their names
        (with_a_hole(0.49, 0.51), [0.0, 1.0], [(0.3, 0.7)]),
        *((crossing(0.37, product), np.linspace(0, 1, 4), []) for product in (0.0, 1e-12, 1e-4, 0.3)),
        (then_jumping, [0.0, 0.5, 1.0, 1.5], [(0.5, 0.7), (1.1, 1.4)]),
        *((normal_form(d), np.linspace(0, 2.2 * d, n), [(d, np.inf)]) for d, n in product((0.01, 0.3), (2, 5, 40))),
    ],
)
def test_windows_that_are_known(operator, loads, edges):
    found = complex_windows(operator, loads)
    ends = [(each.fx_onset, np.inf if each.fx_end is None else each.fx_end) for each in found]
    assert np.ravel(ends) == pytest.approx(np.ravel(edges), abs=1e-8 if operator is then_jumping else DIGITS)
    assert all((each.kind == "start") == (each.fx_onset == 0.0) for each in found)
    assert operator is then_jumping or all(each.error < DIGITS for each in found)


@pytest.mark.parametrize(
    ("speed", "others", "couplings", "last"), [(5, (13.0, 10.7), (1.1, 0.02), 1.0), (2, (11.0, 12.0), (0.1, 0.05), 1.5)]
)
def test_partners_may_change(speed, others, couplings, last):
    """One level meets another one, parts, and meets a third: two windows of two pairs within one increment."""

    def three(f):
        levels = np.diag([10 + speed * f, *others, *OTHERS])
        levels[0, [1, 2]] = couplings
        levels[[1, 2], 0] = np.negative(couplings)
        return levels

    def complex_beside(edge):
        return [np.count_nonzero(np.linalg.eigvals(three(edge + side)).imag > 1e-9) for side in (-1e-6, 1e-6)]

    first, second = complex_windows(three, [0.0, last])
    assert first.fx_end < second.fx_onset < last
    for window in (first, second):
        assert complex_beside(window.fx_onset) == [0, 1]
        assert window.fx_end is None or complex_beside(window.fx_end) == [1, 0]


@pytest.mark.parametrize("half_width", [2e-1, 1e-2, 1e-4, 1e-6])
@pytest.mark.parametrize("place", [0.31, 0.5, 0.77])
def test_window_narrower_than_the_increment(half_width, place):
    """Of levels that bend, in a basis that turns: nothing that the prediction assumes holds exactly.

    The increment of 1 shows real eigenvalues at either end, and a window of any width inside.
    """

    def operator(f):
        turn = block_diag(1, [[np.cos(f), np.sin(f)], [-np.sin(f), np.cos(f)]], np.eye(12))
        bent = crossing(place, -(half_width**2))(np.sin(f) + place - np.sin(place))
        return turn.T @ bent @ turn

    (window,) = complex_windows(operator, [-1.0, 0.0, 1.0, 2.0])
    assert window.kind == "coalescence"
    # At the edges the slope of D and its noise are both proportional to the coupling, which is half_width.
    edges = [np.arcsin(np.sin(place) + sign * half_width) for sign in (-1, 1)]
    assert [window.fx_onset, window.fx_end] == pytest.approx(edges, abs=DIGITS)


def test_noise_loses_its_imaginary_part():
    """A double eigenvalue in Jordan form splits by (u |A|)^(1/2), real or complex as rounding has it."""
    split = 0
    for seed in range(20):
        rng = np.random.default_rng(seed)
        basis = np.linalg.qr(rng.normal(size=(12, 12)))[0]
        noisy, paired = (np.diag(np.concatenate([[5.0, 5.0], OTHERS])) for _ in range(2))
        noisy[0, 1] = paired[0, 1] = 1.0
        paired[1, 0] = -1e-8  # imaginary parts of 1e-4
        split += np.iscomplex(np.linalg.eigvals(basis @ noisy @ basis.T)).any()
        grows = [Motions.of(System(0.0, basis @ each @ basis.T)).grows.sum() for each in (noisy, paired)]
        assert grows == [0, 1]
    assert split > 0


@pytest.mark.parametrize("disks", [300, 50])
def test_no_onset_is_said_so(path, disks):
    """By the search of a small packing, and by that of a large one; also where it comes from another process."""
    with pytest.raises(OnsetError, match=r"up to F_x = 0\.003: raise the largest load"):
        find_onset(path, path.grid[:4], limits=Limits(all_windows=disks))
    found = pickle.loads(pickle.dumps(NoGrowthError("Nothing grows", "raise the largest load", finer=True)))
    assert str(found) == "Nothing grows: take smaller increments, or raise the largest load."


@pytest.mark.parametrize("noise", [1e-12, 1e-9, 1e-6])
def test_error_follows_the_noise_of_the_equilibria(noise):
    """Operators only known to `noise`, as from equilibria of finite balance: the error says what is lost."""
    clean, d, errors, misses = normal_form(0.3), 0.3, [], []
    for seed in range(12):

        def operator(e, seed=seed):
            rng = np.random.default_rng((abs(hash(e)) + seed) % 2**32)
            matrix = clean(e)
            return matrix * (1 + noise * rng.uniform(-1, 1, matrix.shape))

        (window,) = complex_windows(operator, [0.0, 0.1, 0.2, 0.4, 0.5])
        if noise == 1e-6 and window.kind == "contact change":
            continue  # a sixth of 60 draws: D is nowhere straight and yet above the noise, and its root a bracket
        assert window.kind == "coalescence"
        errors.append(window.error)
        misses.append(abs(window.fx_onset - d) / window.error)
    assert len(errors) >= 5  # fewer in 7 of 100,000; what is drawn depends on the processor's last digits
    # Entries of 50 in a basis of condition 10: noise in D some 1e3 times that of an entry, slope 2.4.
    assert noise < np.median(errors) < 1e4 * noise
    # Two degrees of freedom make a single error uncertain by a factor of two or three: a median of 60 is 0.3.
    assert np.median(misses) < 1


def test_what_is_out_of_balance_is_part_of_the_error(path):
    """A load that is off by 1e-4 on each of ten disks shifts the onset by as much, less what their mean averages."""
    found = find_onset(lambda fx: replace(path(fx), fy=path(fx).fy + 1e-4), path.grid[20:])
    assert found.fx_c == pytest.approx(0.021833056408, rel=1e-9)
    assert found.error > 0.99e-4 / np.sqrt(10)


def test_contacts_without_force_are_left_out(reference_packing):
    """A rattler brought to touch by 1e-12 of a length: a stiffness of 0.3 that no force stands for."""
    packing = reference_packing(1.0)
    c, rattler, position = packing.contacts, packing.rattlers[0], packing.position.copy()
    apart = position[rattler] - position
    gap = np.hypot(*apart.T) - packing.radius - packing.radius[rattler]
    gap[packing.rattlers] = np.inf
    neighbour = int(np.argmin(gap))
    position[rattler] -= (gap[neighbour] + 1e-12) * apart[neighbour] / np.hypot(*apart[neighbour])
    more = Contacts([*c.i, rattler], [*c.j, neighbour], [*c.slip, 0.0])
    touching = replace(packing, position=position, contacts=more)
    assert len(touching.rattlers) == len(packing.rattlers) - 1
    assert touching.residual == packing.residual
    assert len(force_bearing(touching).contacts) == len(c)
    assert abs(System.of(touching).stiffness - System.of(packing).stiffness).max() == 0
    # not so where the balance is bad because the packing is none
    moves = force_bearing(replace(touching, fx=1.0))
    assert moves.residual > 0.1
    assert len(moves.contacts) >= len(c)


def test_a_load_without_equilibrium_at_an_edge_is_gone_around():
    """The edge is known to about the width of the hole."""
    (window,) = complex_windows(with_a_hole(0.299, 0.301), [0.0, 1.0])
    assert abs(window.fx_onset - 0.3) <= window.error + DIGITS < 2e-3 + 2 * DIGITS
    assert window.fx_end == pytest.approx(0.7, abs=DIGITS)


def test_the_first_window_alone_is_that_of_all_and_nothing_beyond_it_is_asked_for(path):
    every, asked = find_onset(path, path.grid[20:]), []
    written = with_uncertainty(every.fx_c, every.error)
    assert repr(every).startswith(f"<Onset: F_x^c = {written}, ")
    assert f"from {written}</th>" in every._repr_html_()
    first = find_onset(lambda fx: asked.append(fx) or path(fx), path.grid[20:], first=True)
    assert first.fx_c == pytest.approx(every.fx_c, abs=first.error + every.error)
    assert len(first.windows) == 1
    assert max(asked) == min(fx for fx in path.grid if fx > first.fx_c)
