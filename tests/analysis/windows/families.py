"""Families of matrices whose windows are known."""

import numpy as np

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


def crossing(place, product):
    """Two levels that pass each other at `place`, coupled: D = (2 (F - place))^2 + 4 product."""

    def operator(f):
        coupling = np.sqrt(abs(product))
        gap = f - place
        return embedded([[10 + gap, coupling], [np.sign(product) * coupling, 10 - gap]])

    return operator


def then_jumping(f):
    """A window of two levels, and a jump to another one at 1.1, which takes bisection, and divided increments."""
    return crossing(0.6, -0.01)(f) if f < 1.1 else crossing(1.2, -0.04)(f)


# The eigenvalues of the embedded block are good to some 50 u |A| = 1e-12, and D of order 1 to about that.
DIGITS = 1e-11


def with_dissipation(path, **kind):
    """Equilibria with dashpots or drag, as of `Packing.with_dissipation`."""
    return lambda fx: path(fx).with_dissipation(**kind)
