"""Windows of complex eigenvalues, on families of matrices whose windows are known, and along a ramp."""

from dataclasses import replace

import numpy as np
import pytest

from faultgouge.analysis import Contacts, OnsetError, complex_windows, find_onset, follow, scan_windows, spectrum
from faultgouge.analysis import large as large_module
from faultgouge.analysis import onset as onset_module
from faultgouge.analysis.edges import LostPairError
from faultgouge.analysis.large import FirstWindow, first_window
from faultgouge.analysis.meetings import Outlook
from faultgouge.analysis.modes import Modes, assign, full_operator, loaded
from faultgouge.analysis.windows import deepest_dip

RNG = np.random.default_rng(5)
BASIS = np.eye(12) + 0.3 * RNG.normal(size=(12, 12))
INVERSE = np.linalg.inv(BASIS)
OTHERS = np.linspace(20, 60, 10)


def embedded(block):
    """A 2 x 2 block among ten other modes, in an oblique basis, beside three coordinates without force."""
    inner = np.diag(np.concatenate([[0, 0], OTHERS]))
    inner[:2, :2] = block
    matrix = np.zeros((15, 15))
    matrix[1:13, 1:13] = BASIS @ inner @ INVERSE
    return matrix


def normal_form(d):
    """(1-d, e), (-e, 1+d): the eigenvalues 1 -+ (d^2 - e^2)^(1/2) meet at e = d."""
    return lambda e: embedded([[1 - d, e], [-e, 1 + d]])


def crossing(place, product, speed=1.0):
    """Two levels that pass each other at `place`, coupled: D = (2 speed (F - place))^2 + 4 product."""

    def operator(f):
        coupling = np.sqrt(abs(product))
        gap = speed * (f - place)
        return embedded([[10 + gap, coupling], [np.sign(product) * coupling, 10 - gap]])

    return operator


# The eigenvalues of the embedded block are good to some 50 u |A| = 1e-12, and D of order 1 to about that.
DIGITS = 1e-11


@pytest.mark.parametrize("d", [0.01, 0.3])
@pytest.mark.parametrize("points", [2, 5, 40])
def test_normal_form(d, points):
    (window,) = complex_windows(normal_form(d), np.linspace(0, 2.2 * d, points))
    assert window.kind == "coalescence"
    assert window.fx_onset == pytest.approx(d, abs=DIGITS)
    assert window.fx_end is None
    assert window.eigenvalue == pytest.approx(1, abs=DIGITS)
    assert window.error < DIGITS
    # |y^H x| = (1 - (e/d)^2)^(1/2) in an orthonormal basis, at the closest of the points that were evaluated.
    assert window.overlap < 1e-2


@pytest.mark.parametrize("half_width", [2e-1, 1e-2, 1e-4, 1e-6])
@pytest.mark.parametrize("place", [0.31, 0.5, 0.77])
def test_window_narrower_than_the_increment(half_width, place):
    """An increment of 1 that shows real eigenvalues at either end, and a window of any width inside."""
    operator = crossing(place, -(half_width**2))
    assert not np.iscomplex(np.linalg.eigvals(operator(0.0)[1:13, 1:13])).any()
    assert not np.iscomplex(np.linalg.eigvals(operator(1.0)[1:13, 1:13])).any()
    (window,) = complex_windows(operator, [-1.0, 0.0, 1.0, 2.0])
    assert window.kind == "coalescence"
    # At the edges the slope of D and its noise are both proportional to the coupling, which is half_width.
    assert window.fx_onset == pytest.approx(place - half_width, abs=DIGITS)
    assert window.fx_end == pytest.approx(place + half_width, abs=DIGITS)


@pytest.mark.parametrize("half_width", [1e-2, 1e-5])
def test_narrow_windows_of_curved_levels(half_width):
    """Levels that bend, in a basis that turns: nothing that the prediction assumes holds exactly."""

    def operator(f):
        turn = np.eye(15)
        turn[1:3, 1:3] = [[np.cos(f), np.sin(f)], [-np.sin(f), np.cos(f)]]
        bent = crossing(0.4, -(half_width**2))(np.sin(f) + 0.4 - np.sin(0.4))
        return turn.T @ bent @ turn

    (window,) = complex_windows(operator, [0.0, 1.0])
    edges = [np.arcsin(np.sin(0.4) + sign * half_width) for sign in (-1, 1)]
    assert [window.fx_onset, window.fx_end] == pytest.approx(edges, abs=DIGITS)


@pytest.mark.parametrize("product", [0.0, 1e-12, 1e-4, 0.3])
def test_crossings_are_no_windows(product):
    assert complex_windows(crossing(0.37, product), np.linspace(0, 1, 4)) == ()


def test_gap_inside_a_window_is_seen():
    """A pair that is complex at both ends of an increment and real in between: two windows."""

    def operator(f):
        return embedded([[10, f - 0.35], [0.55 - f, 10]])

    first, second = complex_windows(operator, [0.0, 1.0])
    assert (first.kind, first.fx_onset) == ("start", 0.0)
    assert first.fx_end == pytest.approx(0.35, abs=DIGITS)
    assert second.fx_onset == pytest.approx(0.55, abs=DIGITS)
    assert second.fx_end is None


def test_jump_is_no_coalescence():
    def operator(f):
        return embedded([[10, 1.0], [-0.3 if f > 0.321 else 0.3, 10]])

    (window,) = complex_windows(operator, [0.0, 1.0])
    assert window.kind == "contact change"
    # Bracketed to 1e-9 of the increment; the middle of the bracket is in error by half of it.
    assert abs(window.fx_onset - 0.321) <= window.error < 1e-9


def test_partners_may_change():
    """One level meets a second, parts, and meets a third: two windows of two pairs within one increment."""

    def operator(f):
        inner = np.diag([1.0 + 2 * f, 2.0, 3.0])
        inner[0, 1], inner[1, 0] = 0.1, -0.1
        inner[0, 2], inner[2, 0] = 0.05, -0.05
        return inner

    first, second = complex_windows(operator, [0.0, 1.5])
    fine = np.linspace(0, 1.5, 15001)
    split = [np.abs(np.linalg.eigvals(operator(f)).imag).max() > 1e-9 for f in fine]
    edges = fine[np.flatnonzero(np.diff(split))]
    found = [first.fx_onset, first.fx_end, second.fx_onset, second.fx_end]
    np.testing.assert_allclose(found, edges, atol=1.1e-4)  # the scan's increment
    for edge in found:  # the eigenvalues do meet there, to the root of the rounding
        values = np.linalg.eigvals(operator(edge))
        assert np.abs(values[:, None] - values[None, :])[np.triu_indices(3, 1)].min() < 1e-5


@pytest.mark.parametrize("loads", [[1.0], [0.0, 0.0], [1.0, 0.0], [0.0, np.nan]])
def test_impossible_loads(loads):
    with pytest.raises(ValueError, match="increasing"):
        complex_windows(normal_form(0.1), loads)


def test_noise_loses_its_imaginary_part():
    """A double eigenvalue in Jordan form splits by (u |A|)^(1/2), real or complex as rounding has it."""
    split = 0
    for seed in range(20):
        rng = np.random.default_rng(seed)
        basis = np.linalg.qr(rng.normal(size=(12, 12)))[0]
        inner = np.diag(np.concatenate([[5.0, 5.0], OTHERS]))
        inner[0, 1] = 1.0
        matrix = basis @ inner @ basis.T
        split += np.iscomplex(np.linalg.eigvals(matrix)).any()
        assert not Modes.of(0.0, matrix).complex_pairs
        inner[1, 0] = -1e-8  # imaginary parts of 1e-4
        assert len(Modes.of(0.0, basis @ inner @ basis.T).complex_pairs) == 1
    assert split > 0


def test_block_of_a_pair_is_exact_on_both_sides():
    for e in (0.29, 0.31, 0.3 * (1 - 1e-12), 0.3):
        modes = Modes.of(e, normal_form(0.3)(e))
        pair = tuple(np.argsort(np.abs(modes.values - 1))[:2])
        # (1-d-1-d)^2 - 4 e^2, to the rounding of an operator of norm 100.
        assert modes.block(pair).discriminant == pytest.approx(4 * (0.09 - e**2), abs=1e-12)


def test_deepest_dip_of_parabolas():
    """(t - 0.3)^2 - w^2 from its ends: the width is 2 w, and what a twentieth of the smaller end adds."""
    for w in (0.0, 1e-3, 0.1):
        d0, d1 = 0.09 - w * w, 0.49 - w * w
        width, at = deepest_dip(*(np.array([v]) for v in (d0, -0.6, d1, 1.4)))
        assert at[0] == pytest.approx(0.3, abs=1e-12)
        assert width[0] == pytest.approx(2 * np.sqrt(w * w + 0.05 * d0 * 4 * 0.3 * 0.7), rel=1e-9)
    width, _ = deepest_dip(*(np.array([v]) for v in (1.0, -0.1, 1.0, 0.1)))
    assert width[0] == 0


def test_scan_agrees_within_its_increment_and_misses_what_lies_between(ramp):
    path = ramp(1.0, 1e-3, 22)
    solved = find_onset(path, path.grid)
    (scanned,) = scan_windows(path.states)
    assert scanned.kind == "scan"
    assert scanned.error == pytest.approx(5e-4)
    assert abs(scanned.fx_onset - solved.fx_c) < scanned.error
    with pytest.raises(ValueError, match="increasing"):
        scan_windows(path.states[::-1])


def test_no_onset_is_said_so(ramp):
    path = ramp(1.0, 1e-3, 22)
    with pytest.raises(OnsetError, match=r"up to fx = 0\.0030"):
        find_onset(path, path.grid[:4])


@pytest.mark.parametrize("mu", [1.0, 0.8])
def test_what_nothing_happens_on_is_not_decomposed(ramp, mu, monkeypatch):
    """The same windows as from all modes at every load, which are computed next to the edges alone."""
    path, decomposed = ramp(mu, 1e-3, 22), []
    compute = Modes.of.__func__

    def counted(cls, fx, matrix):
        decomposed.append(fx)
        return compute(cls, fx, matrix)

    monkeypatch.setattr(Modes, "of", classmethod(counted))
    quick = find_onset(path, path.grid)
    few, decomposed[:] = len(decomposed), []
    monkeypatch.setattr(Outlook, "meetings", lambda *_: None)  # nothing is known of any increment
    every = find_onset(path, path.grid)
    assert len(decomposed) >= 23
    assert few <= 4 * len(quick.windows)
    assert len(quick.windows) == len(every.windows)
    for one, other in zip(quick.windows, every.windows, strict=True):
        assert one.fx_onset == pytest.approx(other.fx_onset, abs=one.error + other.error)
        assert (one.fx_end, one.kind) == (other.fx_end, other.kind)


def family_with_a_long_window(f):
    """A pair that is complex from 0.35 to 8.6, and one that is so between 5.2 and 5.3, in an orthonormal basis."""
    matrix = np.diag(np.concatenate([[100.0, 100.0, 200.0, 200.0], 300 + 50 * OTHERS]))
    matrix[0, 1], matrix[1, 0] = 1.0, (f - 0.35) * (f - 8.6)
    matrix[2:4, 2:4] += [[f - 5.25, 0.05], [-0.05, 5.25 - f]]
    return matrix


def test_open_windows_keep_their_names_over_increments_that_are_skipped():
    edges = [(window.fx_onset, window.fx_end) for window in complex_windows(family_with_a_long_window, np.arange(10.0))]
    np.testing.assert_allclose(edges, [(0.35, 8.6), (5.2, 5.3)], atol=1e-9)


def test_what_the_projection_misses_is_walked_again(monkeypatch):
    """A window that opens on increments said to be quiet is found as soon as anything makes us look."""
    quiet = Outlook.meetings

    def blind(self, here, there):
        return [] if there[1, 0] > -5.0 else quiet(self, here, there)

    def operator(f):
        return family_with_a_long_window(0.3 * f)

    monkeypatch.setattr(Outlook, "meetings", blind)
    first = complex_windows(operator, np.arange(10.0))[0]
    assert first.fx_onset == pytest.approx(0.35 / 0.3, abs=1e-9)


def test_json(ramp):
    path = ramp(1.0, 1e-3, 22)
    onset = find_onset(path, path.grid[20:])
    as_dict = onset.as_dict()
    assert as_dict["fx_c"] == onset.fx_c
    assert as_dict["error"] == onset.error
    assert as_dict["windows"][0].keys() >= {"fx_onset", "fx_end", "lambda", "error"}
    assert as_dict["windows"][0]["lambda"] == onset.windows[0].eigenvalue


def test_modes_keep_their_columns(ramp):
    path = ramp(1.0, 1e-3, 22)
    columns = follow(path.states)
    assert columns.shape == (23, 285)
    for row, packing in zip(columns, path.states, strict=True):
        expected = spectrum(packing).eigenvalues
        # The same solver on the same numbers, but for the order of its sums.
        np.testing.assert_allclose(np.sort_complex(row), np.sort_complex(expected), atol=1e-7)


def test_modes_that_cross_keep_their_names():
    """Coupled so weakly that the levels pass each other within the increment, and strongly enough not to."""
    for product, exchanged in ((1e-6, True), (-1e-6, True), (4.0, False)):
        operator = crossing(0.37, product)
        here, there = Modes.of(0.0, operator(0.0)), Modes.of(1.0, operator(1.0))
        expected = np.arange(12)
        if exchanged:
            expected[:2] = 1, 0
        np.testing.assert_array_equal(assign(here, there), expected)


@pytest.mark.parametrize("noise", [1e-12, 1e-9, 1e-6])
def test_error_follows_the_noise_of_the_equilibria(noise):
    """Operators only known to `noise`, as from equilibria of finite balance: the error says what is lost."""
    clean, d = normal_form(0.3), 0.3

    def operator(e):
        rng = np.random.default_rng(abs(hash(e)) % 2**32)
        matrix = clean(e)
        return matrix * (1 + noise * rng.uniform(-1, 1, matrix.shape))

    (window,) = complex_windows(operator, [0.0, 0.1, 0.2, 0.4, 0.5])
    assert window.kind == "coalescence"
    # Entries of 50 in a basis of condition 10: noise in D some 1e3 times that of an entry, slope 2.4.
    assert noise < window.error < 1e4 * noise
    # Two degrees of freedom make the error itself uncertain by a factor of two or three.
    assert abs(window.fx_onset - d) < 4 * window.error


def test_contacts_without_force_are_left_out(bed):
    """A rattler brought to touch by 1e-12 of a length: a stiffness of 0.3 that no force stands for."""
    packing = bed(1.0)
    rattler = packing.rattlers[0]
    gap = np.hypot(*(packing.position - packing.position[rattler]).T) - packing.radius - packing.radius[rattler]
    gap[packing.rattlers] = np.inf
    neighbour = int(np.argmin(gap))
    direction = packing.position[rattler] - packing.position[neighbour]
    direction /= np.hypot(*direction)
    position = packing.position.copy()
    reach = packing.radius[rattler] + packing.radius[neighbour]
    position[rattler] = position[neighbour] + (reach - 1e-12) * direction
    contacts = packing.contacts
    touching = replace(
        packing,
        position=position,
        contacts=Contacts(
            np.append(contacts.i, rattler), np.append(contacts.j, neighbour), np.append(contacts.slip, 0.0)
        ),
    )
    assert len(touching.rattlers) == len(packing.rattlers) - 1
    assert touching.residual == packing.residual
    assert len(loaded(touching).contacts) == len(contacts)
    assert abs(full_operator(touching) - full_operator(packing)).max() == 0
    # Not so where the balance is bad because the packing is none.
    assert loaded(replace(touching, fx=1.0)).residual > 0.1
    assert len(loaded(replace(touching, fx=1.0)).contacts) >= len(contacts)


@pytest.mark.parametrize(("hole", "error"), [((0.49, 0.51), DIGITS), ((0.299, 0.301), 2e-3)])
def test_loads_without_equilibrium_are_gone_around(hole, error):
    """Where no edge lies nothing is lost; where one does it is known to about the width of the hole."""

    def operator(f):
        if hole[0] < f < hole[1]:
            raise RuntimeError("no equilibrium")
        return crossing(0.5, -0.04)(f)

    (window,) = complex_windows(operator, [0.0, 1.0])
    assert abs(window.fx_onset - 0.3) <= window.error + DIGITS
    assert window.error <= error
    assert window.fx_end == pytest.approx(0.7, abs=DIGITS)


def test_large_packings_are_searched_for_the_first_window(ramp, monkeypatch):
    path = ramp(1.0, 1e-3, 22)
    every = find_onset(path, path.grid[12:])
    assert every.complete
    monkeypatch.setattr(onset_module, "ALL_WINDOWS", 50)
    first = find_onset(path, path.grid[12:])
    assert not first.complete
    assert len(first.windows) == 1
    # Two ways to the same root, each with its error.
    assert abs(first.fx_c - every.fx_c) < first.error + every.error
    with pytest.raises(OnsetError, match="raise the largest load"):
        find_onset(path, path.grid[:4])


def test_parts_of_the_spectrum_have_together_the_windows_of_all(ramp):
    path = ramp(1.0, 1e-3, 22)
    every = find_onset(path, path.grid[12:])
    found = []
    for modes in ((0, 100), (100, 200), (200, 285)):
        try:
            onset = find_onset(path, path.grid[12:], modes=modes)
        except OnsetError as error:
            assert f"among the modes {modes[0]}:{modes[1]}" in str(error)  # noqa: PT017, some have none
        else:
            assert onset.as_dict()["modes"] == list(modes)
            found.append(onset)
    first = min(found, key=lambda onset: onset.fx_c)
    assert abs(first.fx_c - every.fx_c) < first.error + every.error
    for onset in found:
        assert min(abs(onset.fx_c - window.fx_onset) for window in every.windows) < onset.error + every.error
    with pytest.raises(ValueError, match="modes 285:300 is no part of the 285 modes of this packing"):
        find_onset(path, path.grid[12:], modes=(285, 300))


@pytest.mark.parametrize("half_width", [0.2, 0.03])
def test_first_window_that_ends_within_its_increment(half_width):
    window = first_window(crossing(0.47, -(half_width**2)), [0.0, 1.0, 2.0]).window
    assert window.kind == "coalescence"
    assert window.fx_onset == pytest.approx(0.47 - half_width, abs=DIGITS)
    assert window.fx_end == pytest.approx(0.47 + half_width, abs=DIGITS)


def test_first_window_of_real_eigenvalues_or_from_the_start():
    assert first_window(crossing(0.37, 1e-3), np.linspace(0, 1, 4)) == FirstWindow(None)
    window = first_window(normal_form(0.1), [0.2, 0.3]).window
    assert (window.kind, window.fx_onset, window.fx_end) == ("start", 0.2, None)


def test_first_window_where_the_operator_is_no_straight_line():
    """Levels that cross at 0.906 of an increment, and at 0.5 of the straight line between its ends."""
    found = first_window(lambda f: crossing(0.0, -0.0025)(2 * f**7 - 1), [0.0, 1.0])
    window = found.window
    assert window.fx_onset == pytest.approx((0.5 - 0.025) ** (1 / 7), abs=DIGITS)
    assert window.fx_end == pytest.approx((0.5 + 0.025) ** (1 / 7), abs=DIGITS)
    assert found.doubtful == ()


@pytest.mark.parametrize("ahead", [1, 2, 3])
def test_load_without_equilibrium_ends_the_search_for_the_first_window(ahead, monkeypatch):
    """As it does where all eigenvalues are computed, and not before what lies below it has been looked at."""
    monkeypatch.setattr(large_module, "KEPT", 0)
    monkeypatch.setattr(large_module, "AHEAD", ahead)

    def ending(operator):
        def until(f):
            if f > 1.5:
                raise RuntimeError("no equilibrium")
            return operator(f)

        return until

    for search in (complex_windows, first_window):
        with pytest.raises(RuntimeError, match="no equilibrium"):
            search(ending(crossing(0.37, 1e-3)), [0.0, 1.0, 2.0])
    window = first_window(ending(crossing(0.5, -0.04)), [0.0, 1.0, 2.0]).window
    assert window.fx_onset == pytest.approx(0.3, abs=DIGITS)


def test_pair_that_cannot_be_followed_is_not_lost_silently(monkeypatch):
    """A pair that ARPACK has complex, and whose plane inverse iteration does not find."""
    monkeypatch.setattr(large_module, "continued", lambda *_: None)
    with pytest.raises(LostPairError, match="take smaller increments"):
        first_window(crossing(0.47, -0.04), [0.0, 1.0])


def test_pair_that_is_announced_and_not_found_is_told_of(monkeypatch):
    """Clusters that announce a pair of which the operator knows nothing: the shortest increments about it are named."""
    monkeypatch.setattr(large_module, "continued", lambda *_: None)
    monkeypatch.setattr(large_module, "_complex_pair_near", lambda *_: None)
    found = first_window(crossing(0.47, -0.04), [0.0, 1.0])
    assert found.window is None
    widths = np.diff(found.doubtful, axis=1)
    np.testing.assert_allclose(widths, 1 / 16)
    assert found.doubtful[0][0] < 0.27 < 0.67 < found.doubtful[-1][1]


@pytest.mark.parametrize("opens", [True, False])
def test_doubtful_increments_come_with_the_onset(ramp, opens, monkeypatch):
    path = ramp(1.0, 1e-3, 22)
    (window,) = find_onset(path, path.grid[20:]).windows
    found = FirstWindow(window if opens else None, ((0.0125, 0.01275),))

    def search(operator, loads, **_):
        operator(loads[-1])
        return found

    monkeypatch.setattr(onset_module, "first_window", search)
    monkeypatch.setattr(onset_module, "ALL_WINDOWS", 50)
    if opens:
        assert find_onset(path, path.grid[20:]).as_dict()["doubtful"] == [[0.0125, 0.01275]]
    else:
        with pytest.raises(OnsetError, match=r"expected between 0\.0125 and 0\.01275: take smaller increments"):
            find_onset(path, path.grid[20:])
