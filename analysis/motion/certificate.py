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
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.linalg import eig, qr
from scipy.sparse import block_array, csc_array, csr_array, eye_array
from scipy.sparse.csgraph import breadth_first_order
from scipy.sparse.linalg import ArpackNoConvergence, eigsh

from ..arrays import Complexes, Floats, Indices
from ..factors.lanczos import Slice, SlicedSpectrum, SliceError
from ..factors.sparse_lu import SingularMatrixError, elimination_places, symmetric_lu
from ..progress import report_progress

LOCAL = 3000
"""Coordinates of the part in which w and beta are sought: a factorisation of 0.2 s, and w of all is larger by some per
cent."""

SHARES = (0.1, 0.2, 0.4)
"""beta over the ratio of the traces of G and S that are tried: 0.2 is best in beds of spheres, by a fifth at the
most."""

LOWEST_SHARE, LEAST = 1e-3, 40
"""w is not sought below this share of the largest frequency, and is taken larger until so many motions are slow: the
slowest decay is one of theirs."""

WIDTH, WIDER, W_TRIES = 0.02, 1.04, 5
"""Relative width to which w is found in the part, its factor from one try of all coordinates to the next, and tries."""

FREE_MARGIN = 0.02
"""Decay that fast motions are to have from the first, as a share of that at w: it costs a few slow motions more."""

DECAYS = (1.0, 0.98, 0.9, 0.5)
"""Shares of the slowest decay that are tried as that of all fast motions: less than all leaves an error."""

MARGIN = 40
"""Neighbours of a slice on either side."""

WORST, LARGEST_SPACE = 16, 2.0
"""Motions whose error is made smaller at a time, and the size up to which the space of a slice grows for that, over its
first one: eigenvalues take up to a second each time."""

MOST_SLOW, FEW_SLOW = 0.4, 400
"""Share of the motions that may be slow, unless these are few, which take three slices. Where strong dashpots couple
all motions, slices do not hold their s: with most of 1,200 slow, those at middle frequencies were not known."""

SURE = 1e-3
"""Error of a rate, as a share, that is small enough."""

ZERO = 1e-5
"""|s| below this share of the largest frequency may be that of a motion that no force opposes: zero is double, and
rounding of 1e-10 leaves its root."""

FORM_BYTES = 26
"""Bytes of the factors of F for each entry of those of S: four times the entries, with rows, and what is under way."""

MEMORY_SHARE = 0.7
"""Share of the memory of the machine that factors of F may take."""

MOST_WORK, RATE = 4e12, 3e9
"""Multiplications for slow motions that are taken on, twenty minutes, and multiplications in a second."""


@dataclass(frozen=True)
class Proof:
    """What was proved of all motion.

    Attributes
    ----------
    values : ndarray of complex, shape (k,)
        s of slow motions, Im s >= 0, the slowest decay first, 1 / time; motions that no force opposes are left out.
    errors : ndarray, shape (k,)
        Of Re s, 1 / time.
    frequency : float
        w: no motion with a larger |Im s| grows, 1 / time.
    slow : int
        Eigenvalues of S below w^2.
    free : int
        Motions that no force opposes.
    decay : float
        Re s of all faster motions is below minus this, 1 / time.
    shown : bool
        Whether Lanczos has shown, and no inertia proved, that F is positive, as factors do not fit in memory.
    all_slow : bool
        Whether all slow motions were looked at: the search ends with a slice in which motion grows.
    largest : float
        The largest frequency at the most, 1 / time, in whose rounding Re s is known.
    """

    values: Complexes
    errors: Floats
    frequency: float
    slow: int
    free: int
    decay: float
    shown: bool = False
    all_slow: bool = True
    largest: float = 0.0


class NoProofError(Exception):
    """Why there is no certificate: a clause."""


@dataclass(frozen=True, eq=False)
class Pencil:
    """S, N, G and H, sparse, in an order of elimination."""

    matrices: tuple[csr_array, ...]

    @classmethod
    def of(cls, stiffness: csr_array, damping: csr_array) -> "Pencil":
        """Of A and G + H."""
        order = np.argsort(elimination_places(csc_array(abs(stiffness) + abs(damping))))
        parts = (each[order][:, order] for each in (stiffness, damping))
        return cls(tuple(csr_array(0.5 * (each + sign * each.T)) for each in parts for sign in (1, -1)))

    def part(self, rows: Indices) -> "Pencil":
        """Of some coordinates."""
        return Pencil(tuple(csr_array(each[rows][:, rows]) for each in self.matrices))

    @property
    def size(self) -> int:
        """Coordinates."""
        return int(self.matrices[0].shape[0])

    def is_positive(self, w: float, beta: float, decay: float, *, factors: bool = True) -> bool:
        """Whether F is positive, with the decay of all faster motions at least."""
        one, (s, n, g, h) = eye_array(self.size, format="csr"), self.matrices
        s, n, g = s - decay * g + decay**2 * one, n - decay * h, g - 2 * decay * one
        real, turning = csr_array(w * (g - beta * s) + beta * w**3 * one), csr_array(n + beta * w**2 * h)
        if not factors:
            form = csr_array(real - 1j * turning)
            try:
                lowest, vector = eigsh(form, 1, which="SA", tol=1e-3, maxiter=100 * self.size)
            except ArpackNoConvergence:
                return False
            return bool(lowest[0] > np.linalg.norm(form @ vector - vector * lowest))
        pairs = np.argsort(np.concatenate([2 * np.arange(self.size), 2 * np.arange(self.size) + 1]))
        form = csc_array(block_array([[real, turning], [-turning, real]], format="csr")[pairs][:, pairs])
        if form.diagonal().min() <= 0:
            return False
        try:
            return symmetric_lu(form, ordered=True, symmetric=True).negative == 0
        except SingularMatrixError:
            return False


def prove(stiffness: csr_array, damping: csr_array, zero: float) -> Proof:
    """No fast motion grows, and what slow motions do.

    Parameters
    ----------
    stiffness, damping : scipy.sparse.csr_array, shape (n, n)
        A and G, particle by particle, without motions of one particle that no force opposes.
    zero : float
        Uncertainty of an eigenvalue of zero of A, 1 / time^2.

    Raises
    ------
    NoProofError
        If there is no certificate, or too many motions are slow.
    """
    pencil = Pencil.of(stiffness, damping)
    bounds = [float(abs(each).sum(axis=1).max(initial=0.0)) for each in pencil.matrices]
    top = float(np.sqrt(bounds[0]))
    w, beta = _frequency(pencil, *bounds)
    while True:
        shifted = csc_array(pencil.matrices[0] - w**2 * eye_array(pencil.size))
        found = symmetric_lu(shifted, ordered=True, symmetric=True)
        count, entries = found.negative, found.entries
        if count >= min(LEAST, pencil.size // 2):
            break
        w *= 1.5
    if count > max(MOST_SLOW * pencil.size, FEW_SLOW):
        raise NoProofError(
            f"dashpots hold growth above a frequency of {w:.3g} alone, of {top:.3g}, below which there are {count} of "
            f"{pencil.size} motions"
        )
    work = count / 120 * (300 * entries + 4e5 * pencil.size)
    if work > MOST_WORK:
        raise NoProofError(
            f"dashpots hold growth above a frequency of {w:.3g} alone, of {top:.3g}, below which there are {count} "
            f"motions: that takes {work / RATE / 60:.0f} minutes"
        )
    bytes_needed = FORM_BYTES * entries + 8 * pencil.size * 1400
    factors = bytes_needed < MEMORY_SHARE * os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    report_progress(
        f"certificate: no motion faster than {w:.3g} grows; {count} slower ones to look at, about "
        f"{work / RATE / 60:.2g} min and {bytes_needed / 1e9:.2g} GB"
    )
    decay = FREE_MARGIN * _typical_decay(pencil, w)
    for _ in range(W_TRIES):
        if pencil.is_positive(w, beta, decay, factors=factors):
            break
        w *= WIDER
    else:
        raise NoProofError(f"no frequency was found beyond which the dashpots hold growth, up to {w:.3g} of {top:.3g}")
    del found, shifted
    values, errors, free, count, all_slow = _slow_motions(
        pencil, SlicedSpectrum(csc_array(pencil.matrices[0])), w, top, zero
    )
    slowest = -float(values.real.max(initial=-np.inf)) if len(values) else decay
    for share in DECAYS if slowest > decay and np.isfinite(slowest) else ():
        if share * slowest > decay and pencil.is_positive(w, beta, share * slowest, factors=factors):
            decay = share * slowest
            break
    return Proof(values, errors, w, count, free, decay, not factors, all_slow, top)


def _typical_decay(pencil: Pencil, w: float) -> float:
    """Of motions at w, if dashpots are as stiffnesses."""
    return 0.5 * w**2 * _ratio(pencil)


def _ratio(pencil: Pencil) -> float:
    """Of the traces of G and S."""
    return float(pencil.matrices[2].diagonal().sum() / pencil.matrices[0].diagonal().sum())


def _frequency(
    pencil: Pencil, stiffest: float, twisting: float, strongest: float, gyration: float
) -> tuple[float, float]:
    """The lowest w and its beta in a part of the packing; NoProofError if there is none below the fastest motions."""
    ratio, top = _ratio(pencil), float(np.sqrt(stiffest))
    if pencil.size > LOCAL:
        middle = pencil.size // 2
        pencil = pencil.part(
            np.sort(breadth_first_order(pencil.matrices[0], middle, return_predecessors=False)[:LOCAL])
        )
    best = top, 0.0
    for share in SHARES:
        low, high = LOWEST_SHARE * top, best[0]

        def holds(w: float, share: float = share) -> float:
            beta = min(share * ratio, 1 / (twisting / w + strongest))
            return (
                beta if gyration <= w and pencil.is_positive(w, beta, FREE_MARGIN * _typical_decay(pencil, w)) else 0.0
            )

        if high <= 2 * low or not (beta := holds((1 - WIDTH) * high)):
            continue
        while high - low > WIDTH * high:
            w = 0.5 * (low + high)
            if found := holds(w):
                high, beta = w, found
            else:
                low = w
        best = high, beta
    if not best[1]:
        raise NoProofError(f"the dashpots hold growth at no frequency below that of the fastest motion, {top:.3g}")
    return (1 + WIDTH) * best[0], best[1]


def _slow_motions(
    pencil: Pencil, spectrum: SlicedSpectrum, w: float, top: float, zero: float
) -> tuple[Complexes, Floats, int, int, bool]:
    """s with |Im s| < w and their errors, motions that no force opposes, eigenvalues of S, and whether all were
    seen."""
    count = spectrum.below(w**2)
    every: list[Complexes] = []
    errors: list[Floats] = []
    free, best, done, low = 0, -np.inf, 0, 0.0
    guess = w**2 * min(1.0, 60 / max(count, 1))
    try:
        for part, solve in spectrum.walk(0, count, -max(zero, 1e-12 * top**2), guess, MARGIN):
            high = float(np.sqrt(max(part.values[part.own][-1], 0.0)))
            done += part.own.stop - part.own.start
            high = w if done == count else high
            s, error, drifting = _of_slice(pencil, part, solve, (low, high), best, top)
            every.append(s)
            errors.append(error)
            free, low = free + drifting, high
            best = max(best, float((s.real - error).max(initial=-np.inf)))
            report_progress(f"slow motions: {done} of {count}, the slowest with D as exp({2 * best:.3g} t)")
            if best > 0 and done < count:
                break
    except SliceError as failure:
        raise NoProofError(str(failure)) from None
    values, error = (np.concatenate([*each, []]) for each in (every, errors))
    order = np.argsort(-values.real, kind="stable")
    return values[order].astype(complex), error[order], free, count, done == count


def _of_slice(
    pencil: Pencil,
    part: Slice,
    solve: Callable[[Floats], Floats],
    within: tuple[float, float],
    best: float,
    top: float,
) -> tuple[Complexes, Floats, int]:
    """s of a slice whose Im s lies within two numbers, the errors of Re s, and how many motions no force opposes."""
    values, basis = part.values, part.vectors
    edges = values[0] if part.first else -np.inf, values[-1]
    nearest = 1e-3 * max(part.border.spacing, 1e-300)
    images = [matrix @ basis for matrix in pencil.matrices]  # of S, N, G and H

    def outside(x: Complexes, s: Complexes, sign: int) -> Floats:
        """What the pencil, or its transpose, makes of vectors outside of the space, real parts and imaginary parts."""
        still, turning = np.hstack([x.real, x.imag]), np.hstack([(s * x).real, (s * x).imag])
        made = (images[0] + sign * images[1]) @ still + (images[2] + sign * images[3]) @ turning
        return _outside(basis, made)

    largest = LARGEST_SPACE * basis.shape[1]
    while True:
        s_small, n_small, g_small, h_small = (basis.T @ each for each in images)
        size, scale = basis.shape[1], max(float(np.sqrt(np.abs(values).mean())), 1e-6 * top)
        a, g = s_small + n_small, g_small + h_small
        first_order = np.block([[np.zeros((size, size)), scale * np.eye(size)], [-a / scale, -g]])
        s, left, right = eig(first_order, left=True, right=True, check_finite=False)
        kept = (s.imag >= max(within[0], 0.0)) & (s.imag < within[1])
        s, x, y = s[kept], right[:size, kept], left[size:, kept]
        x, y = x / np.linalg.norm(x, axis=0), y / np.linalg.norm(y, axis=0)
        drifts = (np.abs(s) < ZERO * top) & (np.linalg.norm(a @ x, axis=0) < 10 * (ZERO * top) ** 2)
        slope = np.abs(np.sum(y.conj() * (2 * s * x + g @ x), axis=0))
        apart = np.maximum(np.minimum(s.imag**2 - edges[0], edges[1] - s.imag**2), nearest)
        # what each vector of the basis leaves outside bounds what a motion leaves
        leaves = [
            np.sqrt(np.maximum(np.sum(image**2, axis=0) - np.sum(small**2, axis=0), 0.0))
            for image, small in zip(images, (s_small, n_small, g_small, h_small), strict=True)
        ]
        still, turning = leaves[0] + leaves[1], leaves[2] + leaves[3]
        bounds = [still @ np.abs(each) + np.abs(s) * (turning @ np.abs(each)) for each in (x, y)]
        with np.errstate(divide="ignore", invalid="ignore"):
            error = np.where(drifts, 0.0, bounds[0] * bounds[1] / (slope * apart))
            seen = np.flatnonzero(~drifts & (s.real + error > best) & (error > SURE * np.abs(s.real)))
            rest, turned = outside(x[:, seen], s[seen], 1), outside(y[:, seen], s[seen].conj(), -1)
            length, other = (np.linalg.norm(each.reshape(len(basis), 2, -1), axis=(0, 1)) for each in (rest, turned))
            error[seen] = length * other / (slope[seen] * apart[seen])
        best = max(best, float((s.real - error)[~drifts].max(initial=-np.inf)))
        doubtful = (s.real[seen] + error[seen] > best) & (error[seen] > SURE * np.abs(s.real[seen]))
        if doubtful.any():  # what is outside is mostly stiffer than the nearest of it
            reached = _outside(basis, solve(turned[:, np.tile(doubtful, 2)]))
            far = np.linalg.norm(reached.reshape(len(basis), 2, -1), axis=(0, 1))
            chosen, middle = seen[doubtful], 0.5 * float(values[part.own][0] + values[part.own][-1])
            nearer = 1 + np.abs(s.imag[chosen] ** 2 - middle) / apart[chosen]
            error[chosen] = np.minimum(error[chosen], nearer * length[doubtful] * far / slope[chosen])
            best = max(best, float((s.real - error)[~drifts].max(initial=-np.inf)))
            left_over = (s.real[chosen] + error[chosen] > best) & (error[chosen] > SURE * np.abs(s.real[chosen]))
            doubtful[doubtful] = left_over
        if not doubtful.any():
            break
        if basis.shape[1] > largest:
            if best <= 0 <= float((s.real + error)[chosen[left_over]].max()):
                raise NoProofError(
                    f"dashpots couple motions at {within[0]:.3g} to {within[1]:.3g} with too many others"
                )
            break
        ordered = np.argsort(-(s.real + error)[chosen[left_over]])[:WORST]
        worst = np.flatnonzero(doubtful)[ordered]
        more = np.flatnonzero(left_over)[ordered]
        count = reached.shape[1] // 2
        columns = np.hstack([reached[:, [*more, *(more + count)]], solve(rest[:, [*worst, *(worst + len(seen))]])])
        columns = _outside(basis, _outside(basis, columns))
        vectors, triangle, _ = qr(columns, mode="economic", pivoting=True, check_finite=False)
        sizes = np.abs(np.diag(triangle))
        more = vectors[:, sizes > 1e-8 * sizes.max(initial=0.0)]
        basis = np.hstack([basis, more])
        images = [np.hstack([image, matrix @ more]) for image, matrix in zip(images, pencil.matrices, strict=True)]
    return s[~drifts], error[~drifts], int(drifts.sum() + 1) // 2


def _outside(basis: Floats, columns: Floats) -> Floats:
    return np.asarray(columns - basis @ (basis.T @ columns))
