r"""Which motions may grow in spite of their dissipation: second order in the damping, on all motions without it.

In the right and left eigenvectors of A, :math:`y_k^H x_l = \delta_{kl}`, stiffness is diagonal, whatever pairs are
complex or nearly so, and the damping is :math:`\Gamma = Y^H G X`. Motion k alone has
:math:`s^2 + s \Gamma_{kk} + \lambda_k = 0`. The others add

.. math:: \sigma_k = - \sum_{l \ne k} \frac{s^2\, \Gamma_{kl} \Gamma_{lk}}{g_{kl}}, \qquad
          g_{kl} = \lambda_l + s\, \Gamma_{ll} + s^2

to :math:`\lambda_k`. Where :math:`|s|\,|\Gamma_{kl} \Gamma_{lk}|^{1/2} < 0.2\, |g_{kl}|` this gives Re s to a
thousandth (packings of 40 and 100 disks, dashpots from 0.01 to 10). In a stable packing Re s differs from
:math:`-\Gamma_{kk}/2` by per cents. *Suspects* have a tenth of that or less, mix more, are complex without dissipation,
or come close to a neighbour between two loads. All motions but these, and their neighbours, go on losing energy.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError

from ..arrays import Complexes
from .motions import Motions, System
from .search import lowest

MIXING = 0.2
"""Mixing of two motions up to which the second order is trusted: it leaves out a relative order of its square."""

SPARE = 0.1
"""Share of a motion's own damping that has to be left."""

MOST = 24
"""Suspects, with neighbours, beyond which all motions take no longer."""


class Quiet:
    """The few motions that may grow between two loads, at both."""

    def __init__(self) -> None:
        self.crowded = False  # whether dashpots mix a third of all motions beyond the second order
        self._known: dict[float, tuple[Complexes, NDArray[np.bool_], Motions]] = {}

    def __call__(self, here: System, there: System) -> tuple[Motions, Motions] | None:
        """The motions at both loads; None if they are too many, or not known."""
        if not np.array_equal(here.active, there.active):
            return None
        (a, doubt_a, below), (b, doubt_b, above) = self._suspects(here), self._suspects(there)
        self._known = {there.fx: self._known[there.fx]}
        # levels that may come as close to a neighbour between the loads as half of their distance there
        ends, span = [], there.fx - here.fx
        for state, other in ((below, there), (above, here)):
            drift = span * state.slopes(other)
            levels, drifts = (np.concatenate([each, each[state.grows]]).real for each in (state.values, drift))
            order = np.argsort(levels, kind="stable")
            ends.append((np.diff(levels[order]), np.diff(drifts[order])))
        (g0, v0), (g1, v1) = ends
        least = 0.25 * np.minimum(g0, g1) ** 2
        close = lowest(g0**2 - least, 2 * g0 * v0, g1**2 - least, 2 * g1 * v1)[0] > 0
        places = np.flatnonzero(doubt_a | doubt_b | np.append(close, False) | np.insert(close, 0, False))
        groups = np.split(places, np.flatnonzero(np.diff(places) > 3) + 1) if len(places) else []
        counts = [int(each[-1] - each[0]) + 4 for each in groups]
        if sum(counts) > MOST:
            return None
        try:
            near = (
                [(1j * np.sqrt(np.mean(values[each[[0, -1]]].real)), n) for each, n in zip(groups, counts, strict=True)]
                for values in (a, b)
            )
            return Motions.near(here, next(near)), Motions.near(there, next(near))
        except LinAlgError:
            return None

    def _suspects(self, system: System) -> tuple[Complexes, NDArray[np.bool_], Motions]:
        """lambda of all motions without dissipation, by real part, and which of them may grow."""
        if system.fx in self._known:
            return self._known[system.fx]
        state = Motions.of(System(system.fx, system.stiffness))
        values, x, y = state.with_conjugates()
        if not np.any(values.imag):
            x, y = x.real, y.real
        with np.errstate(divide="ignore", invalid="ignore"):
            gamma = (y.conj().T @ (system.damping @ x)) / np.sum(y.conj() * x, axis=0)[:, None]
            own = np.diag(gamma)
            s = 1j * np.sqrt(values - 0.25 * own**2 + 0j) - 0.5 * own
            apart = values + s[:, None] * own + s[:, None] ** 2
            np.fill_diagonal(apart, np.inf)
            shift = s[:, None] ** 2 * gamma * gamma.T / apart
            s = 1j * np.sqrt(values - shift.sum(axis=1) - 0.25 * own**2 + 0j) - 0.5 * own
            trusted = np.sqrt(np.abs(shift / apart)).max(axis=1) < MIXING
            self.crowded = self.crowded or bool(np.count_nonzero(~trusted) > len(values) / 3)
            quiet = trusted & (-2 * s.real > SPARE * np.abs(own)) & (values.imag == 0) & (values.real > 0)
        self._known[system.fx] = values, ~quiet, state
        return self._known[system.fx]
