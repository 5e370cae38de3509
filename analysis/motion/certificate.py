r"""A certificate that no fast motion grows, and the slow motions one by one: the verdict on large packings.

In mass-weighted coordinates a motion :math:`z e^{st}` obeys

.. math:: (s^2 + s\,(G + H) + S + N)\, z = 0, \qquad s = a + i b, \quad |z| = 1 ,

with the symmetric parts S of A and G of the damping, and their antisymmetric parts N and H (H comes from lever arms,
and is small). With :math:`\sigma = z^H S z`, :math:`g = z^H G z`, :math:`i\nu = z^H N z` and :math:`i h = z^H H z` its
parts are

.. math:: a^2 - b^2 + a g - b h + \sigma = 0, \qquad 2 a b + b g + a h + \nu = 0 .

**One form at one frequency.** For some :math:`\beta > 0` let the Hermitian form

.. math:: F(b) = b\,(G - \beta S) + \beta\, b^3 - i\,(N + \beta\, b^2 H)

be positive at :math:`b = w \ge |H|`. The mean of F and of its complex conjugate says that :math:`G - \beta S + \beta
w^2 > 0`, so that F grows with b: it is positive at all :math:`b \ge w`. For a motion with such a b

.. math:: 0 < z^H F(b)\, z = \beta\, b\, a\,(a + g) - a\,(2 b + h) .

So a is not zero, and a motion that grows has :math:`a + g > (2 + h/b)/\beta \ge 1/\beta`. But :math:`(2 + h/b)\, a + g
= -\nu/b` bounds :math:`a + g \le |N|/w + |G|`. Hence where :math:`\beta\,(|N|/w + |G|) \le 1`, **no motion with**
:math:`|\mathrm{Im}\, s| \ge w` **grows**. That F is positive is known from the signs of the pivots of one factorisation
(Sylvester's law of inertia), of the real symmetric matrix of twice the size. With :math:`G - 2\epsilon`, :math:`S -
\epsilon G + \epsilon^2` and :math:`N - \epsilon H` in place of G, S and N all fast motions decay at the rate
:math:`\epsilon` or faster. (On gyroscopic, circulatory and dissipative forces: Kirillov, *Nonconservative Stability
Problems of Modern Physics*, 2013.)

**The frequency is local.** N over G at contacts decides, so that w is the same for 50 spheres and for 12,000. F of a
few particles is a principal part of F of all: w and beta are sought there, and F of all is factored once or twice.

**Slow motions.** A motion with :math:`a \ge 0` and :math:`|b| < w` has :math:`\sigma \le b^2 < w^2`. Its shape is
mostly one of the eigenvectors of S below :math:`w^2`, which are counted by inertia, and found in slices
(:mod:`~faultgouge.analysis.factors.lanczos`). In each slice, with neighbours on either side, S, N and G are small
matrices, whose eigenvalues are s. What the neighbours leave out is a residual orthogonal to them, r of the right vector
and l of the left one, :math:`|r|\,|l| / (d\, |y^H (2 s + G) x|)` in s, with the distance d of :math:`b^2` from the
eigenvalues outside. Where this error matters for the verdict, solutions with the factors of the slice are added to the
small space, until it does not.
"""

import os
from resource import RUSAGE_SELF, getrusage

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eig, qr
from scipy.sparse import block_array, csc_array, csr_array, eye_array
from scipy.sparse.csgraph import breadth_first_order
from scipy.sparse.linalg import ArpackNoConvergence, eigsh

from ..arrays import Complexes, Floats, Indices
from ..factors.lanczos import Slice, SlicedSpectrum, SliceError, Solve
from ..factors.sparse_lu import elimination_places, negative_pivots, symmetric_lu
from ..progress import report_progress
from .eigenvalues import Linear

Pencil = tuple[csr_array, csr_array, csr_array, csr_array]
"""S, N, G and H, in an order of elimination."""

FREE_MARGIN = 0.02
"""Decay that fast motions are to have from the first, as a share of that at w of dashpots that are as stiffnesses: it
costs a few slow motions more."""


class NoProofError(Exception):
    """Why there is no certificate: a clause."""


def prove(stiffness: csr_array, damping: csr_array, zero: float) -> Linear:
    """What is proved of all motion: that no fast motion grows, and what slow motions do.

    `stiffness` and `damping` are A and G, particle by particle, without motions of one particle that no force opposes;
    `zero` is the uncertainty of an eigenvalue of zero of A, 1 / time^2. Raises NoProofError if there is no certificate,
    or too many motions are slow.
    """
    order = np.argsort(elimination_places(csc_array(abs(stiffness) + abs(damping))))
    s, n = (csr_array(0.5 * (stiffness + sign * stiffness.T))[order][:, order] for sign in (1, -1))
    g, h = (csr_array(0.5 * (damping + sign * damping.T))[order][:, order] for sign in (1, -1))
    size, identity = s.shape[0], eye_array(s.shape[0])
    stiffest, *bounds = (float(abs(each).sum(axis=1).max(initial=0.0)) for each in (s, n, g, h))
    top, ratio = float(np.sqrt(stiffest)), float(g.diagonal().sum() / s.diagonal().sum())
    w, beta = _frequency((s, n, g, h), top, ratio, *bounds)
    while True:
        factored = symmetric_lu(csc_array(s - w**2 * identity), ordered=True, symmetric=True)
        count, entries = factored.negative, factored.entries
        if count >= min(40, size // 2):  # the slowest decay is that of a slow motion
            break
        w *= 1.5
    work = count / 120 * (300 * entries + 4e5 * size)  # multiplications, 3e9 in a second
    # where strong dashpots couple all motions, slices do not hold their s: with most of 1,200 slow, those at middle
    # frequencies were not known; 400 are three slices
    if count > max(0.4 * size, 400) or work > 4e12:
        raise NoProofError(
            f"dashpots hold growth above a frequency of {w:.3g} alone, of {top:.3g}, below which there are {count} of "
            f"{size} motions" + (f": that takes {work / 1.8e11:.0f} minutes" if count <= max(0.4 * size, 400) else "")
        )
    # F has four times the entries of S, and a slice a Krylov space: measured at 19,200 and at 72,000 coordinates
    needed = 1024 * getrusage(RUSAGE_SELF).ru_maxrss + 35 * entries + 12_000 * size
    factors = needed < 0.7 * os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    cost = f"about {work / 1.8e11:.2g} min and {needed / 1e9:.2g} GB"
    report_progress(f"certificate: no motion faster than {w:.3g} grows; {count} slower ones to look at, {cost}")
    decay, last = FREE_MARGIN * 0.5 * w**2 * ratio, 1.04**5 * w
    while not _is_positive((s, n, g, h), w, beta, decay, factors=factors):
        w *= 1.04
        if w > 0.999 * last:
            raise NoProofError(f"no frequency was found beyond which dashpots hold growth, up to {w:.3g} of {top:.3g}")
    del factored
    spectrum = SlicedSpectrum(csc_array(s))
    count, free, best, done, low = spectrum.below(w**2), 0, -np.inf, 0, 0.0
    every, doubts, guess = [np.zeros(0, complex)], [np.zeros(0)], w**2 * min(1.0, 60 / max(count, 1))
    try:
        for part, solve in spectrum.walk(0, count, -max(zero, 1e-12 * top**2), guess, 40):  # neighbours on either side
            done += part.own.stop - part.own.start
            high = w if done == count else float(np.sqrt(max(part.values[part.own][-1], 0.0)))
            found, error, drifting = _of_slice((s, n, g, h), part, solve, (low, high), best, top)
            every.append(found)
            doubts.append(error)
            free, low = free + drifting, high
            best = max(best, float((found.real - error).max(initial=-np.inf)))
            report_progress(f"slow motions: {done} of {count}, the slowest with D as exp({2 * best:.3g} t)")
            if best > 0 and done < count:
                break
    except SliceError as failure:
        raise NoProofError(str(failure)) from None
    values, errors = np.concatenate(every), np.concatenate(doubts)
    slowest = -float(values.real.max(initial=-np.inf)) if len(values) else decay
    shares = (1.0, 0.98, 0.9, 0.5) if decay < slowest < np.inf else ()  # less than all leaves an error
    faster = (share * slowest for share in shares if share * slowest > decay)
    decay = next((each for each in faster if _is_positive((s, n, g, h), w, beta, each, factors=factors)), decay)
    fast = f"no motion faster than {w:.3g} grows ({'proved' if factors else 'shown'})"
    if not len(values):
        return Linear(True, -2 * decay, 2 * decay, free, said=fast)
    first = int(np.argmax(values.real))
    s_slow, bound, doubt = complex(values[first]), float(errors[first]), float((values.real + errors).max())
    rate, slower = 2 * s_slow.real, f"of {count} slower ones, known one by one,"
    if s_slow.real > bound:
        return Linear(False, rate, 2 * bound, free, s_slow, at_least=done < count)
    if doubt >= 0:
        why = f"{fast}, but {slower} the slowest has 2 Re s = {rate:.3g} with an error of {2 * bound:.2g}"
        return Linear(None, rate, 2 * bound, free, s_slow, searched=2 * doubt, reasons=(why,))
    said = f"{fast}, and {slower} the slowest decays with D as exp({rate:.6g} t)"
    bound = max(bound, doubt - s_slow.real, -s_slow.real - decay, 1e-14 * top)
    return Linear(True, rate, 2 * bound, free, s_slow, said)


def _is_positive(pencil: Pencil, w: float, beta: float, decay: float, *, factors: bool = True) -> bool:
    """Whether F is positive, with the decay of all faster motions at least."""
    (s, n, g, h), size = pencil, pencil[0].shape[0]
    one = eye_array(size, format="csr")
    s, n, g = s - decay * g + decay**2 * one, n - decay * h, g - 2 * decay * one
    real, turning = csr_array(w * (g - beta * s) + beta * w**3 * one), csr_array(n + beta * w**2 * h)
    if not factors:
        form = csr_array(real - 1j * turning)
        try:
            lowest, vector = eigsh(form, 1, which="SA", tol=1e-3, maxiter=100 * size)
        except ArpackNoConvergence:
            return False
        return bool(lowest[0] > np.linalg.norm(form @ vector - vector * lowest))
    pairs = np.argsort(np.concatenate([2 * np.arange(size), 2 * np.arange(size) + 1]))
    both = csc_array(block_array([[real, turning], [-turning, real]], format="csr")[pairs][:, pairs])
    return bool(both.diagonal().min() > 0) and negative_pivots(both, ordered=True) == 0


def _frequency(
    pencil: Pencil, top: float, ratio: float, twisting: float, strongest: float, gyration: float
) -> tuple[float, float]:
    """The lowest w and its beta in a part of the packing; NoProofError if there is none below the fastest motions."""
    size, local = pencil[0].shape[0], 3000  # a factorisation of 0.2 s; w of all is larger by some per cent
    if size > local:
        near = np.sort(breadth_first_order(pencil[0], size // 2, return_predecessors=False)[:local])
        s, n, g, h = (csr_array(each[near][:, near]) for each in pencil)
        pencil, ratio = (s, n, g, h), float(g.diagonal().sum() / s.diagonal().sum())
    best, width = (top, 0.0), 0.02
    for share in (0.1, 0.2, 0.4):  # 0.2 is best in beds of spheres, by a fifth at the most

        def certain(w: float, share: float = share) -> float:
            """beta, or zero where F is not positive."""
            beta, decay = min(share * ratio, 1 / (twisting / w + strongest)), FREE_MARGIN * 0.5 * w**2 * ratio
            return beta if gyration <= w and _is_positive(pencil, w, beta, decay) else 0.0

        low, high = 1e-3 * top, (1 - width) * best[0]
        if high <= 2 * low or not (beta := certain(high)):
            continue
        while high - low > width * high:
            w = 0.5 * (low + high)
            low, high, beta = (low, w, found) if (found := certain(w)) else (w, high, beta)
        best = high, beta
    if not best[1]:
        raise NoProofError(f"the dashpots hold growth at no frequency below that of the fastest motion, {top:.3g}")
    return (1 + width) * best[0], best[1]


def _of_slice(
    pencil: Pencil, part: Slice, solve: Solve, within: tuple[float, float], best: float, top: float
) -> tuple[Complexes, Floats, int]:
    """s of a slice whose Im s lies within two numbers, the errors of Re s, and how many motions no force opposes."""
    values, basis = part.values, part.vectors
    edges = values[0] if part.first else -np.inf, values[-1]
    nearest, largest = 1e-3 * max(part.border.spacing, 1e-300), 2 * basis.shape[1]
    images = [matrix @ basis for matrix in pencil]  # of S, N, G and H

    def leave(columns: Floats) -> Floats:
        return np.asarray(columns - basis @ (basis.T @ columns))

    def outside(x: Complexes, s: Complexes, sign: int) -> Floats:
        """What the pencil, or its transpose, makes of vectors outside of the space, real parts and imaginary parts."""
        still, turning = np.hstack([x.real, x.imag]), np.hstack([(s * x).real, (s * x).imag])
        return leave((images[0] + sign * images[1]) @ still + (images[2] + sign * images[3]) @ turning)

    def lengths(both: Floats) -> Floats:
        return np.asarray(np.linalg.norm(both.reshape(len(basis), 2, -1), axis=(0, 1)))

    while True:
        small = [basis.T @ image for image in images]
        size, scale = basis.shape[1], max(float(np.sqrt(np.abs(values).mean())), 1e-6 * top)
        a, g = small[0] + small[1], small[2] + small[3]
        first_order = np.block([[np.zeros((size, size)), scale * np.eye(size)], [-a / scale, -g]])
        s, left, right = eig(first_order, left=True, right=True, check_finite=False)
        kept = (s.imag >= max(within[0], 0.0)) & (s.imag < within[1])
        s, x, y = s[kept], right[:size, kept], left[size:, kept]
        x, y = x / np.linalg.norm(x, axis=0), y / np.linalg.norm(y, axis=0)
        # that of a motion that no force opposes may be as large: zero is double, and rounding of 1e-10 leaves its root
        drifts = (np.abs(s) < 1e-5 * top) & (np.linalg.norm(a @ x, axis=0) < 1e-9 * top**2)
        slope = np.abs(np.sum(y.conj() * (2 * s * x + g @ x), axis=0))
        apart = np.maximum(np.minimum(s.imag**2 - edges[0], edges[1] - s.imag**2), nearest)

        def doubtful(among: Indices, of: Floats) -> NDArray[np.bool_]:
            """Which of some motions may be slower than the slowest that is known, with an error that matters."""
            return (s.real[among] + of > best) & (of > 1e-3 * np.abs(s.real[among]))  # noqa: B023  called within its turn of the loop

        # what each vector of the basis leaves outside bounds what a motion leaves
        squares = ([np.sum(each**2, axis=0) for each in pair] for pair in zip(images, small, strict=True))
        leaves = [np.sqrt(np.maximum(whole - inside, 0.0)) for whole, inside in squares]
        still, turning = leaves[0] + leaves[1], leaves[2] + leaves[3]
        bounds = [still @ np.abs(each) + np.abs(s) * (turning @ np.abs(each)) for each in (x, y)]
        with np.errstate(divide="ignore", invalid="ignore"):
            error = np.where(drifts, 0.0, bounds[0] * bounds[1] / (slope * apart))
            seen = np.flatnonzero(~drifts & doubtful(np.arange(len(s)), error))
            rest, turned = outside(x[:, seen], s[seen], 1), outside(y[:, seen], s[seen].conj(), -1)
            length = lengths(rest)
            error[seen] = length * lengths(turned) / (slope[seen] * apart[seen])
        best = max(best, float((s.real - error)[~drifts].max(initial=-np.inf)))
        places = np.flatnonzero(doubtful(seen, error[seen]))
        if len(places):  # what is outside is mostly stiffer than the nearest of it
            reached = leave(solve(turned[:, [*places, *(places + len(seen))]]))
            chosen, middle = seen[places], 0.5 * float(values[part.own][0] + values[part.own][-1])
            nearer = 1 + np.abs(s.imag[chosen] ** 2 - middle) / apart[chosen]
            error[chosen] = np.minimum(error[chosen], nearer * length[places] * lengths(reached) / slope[chosen])
            best = max(best, float((s.real - error)[~drifts].max(initial=-np.inf)))
            more = np.flatnonzero(doubtful(chosen, error[chosen]))
        if not len(places) or not len(more):
            break
        if basis.shape[1] > largest:
            if best <= 0 <= float((s.real + error)[chosen[more]].max()):
                between = f"{within[0]:.3g} to {within[1]:.3g}"
                raise NoProofError(f"dashpots couple motions at {between} with too many others")
            break
        more = more[np.argsort(-(s.real + error)[chosen[more]])[:16]]  # eigenvalues take up to a second each time
        worst, count = places[more], len(places)
        columns = np.hstack([reached[:, [*more, *(more + count)]], solve(rest[:, [*worst, *(worst + len(seen))]])])
        vectors, triangle, _ = qr(leave(leave(columns)), mode="economic", pivoting=True, check_finite=False)
        sizes = np.abs(np.diag(triangle))
        added = vectors[:, sizes > 1e-8 * sizes.max(initial=0.0)]
        basis = np.hstack([basis, added])
        images = [np.hstack([image, matrix @ added]) for image, matrix in zip(images, pencil, strict=True)]
    # zero is double but for drag, and LAPACK need not find as many vectors of it as there are
    stiff = np.linalg.matrix_rank(a, tol=1e-9 * top**2) if drifts.any() else size
    return s[~drifts], error[~drifts], int(size - stiff)
