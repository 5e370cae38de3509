r"""The contacts of a packing to first order: forces and derivatives, whatever the law and the code.

**Two derivatives.** For some laws (LAMMPS's mindlin_rescale) the derivative :math:`b = \partial \mathbf f_t / \partial
\delta` differs between a growing and a falling overlap; every operator takes the weight of opening contacts
(:mod:`~faultgouge.analysis.packing.law`). A contact at Coulomb's bound sticks if the motion reverses, and slides if the
motion continues: `sliding` chooses.

**Rolling friction** of two particles is a second entry, a `couple`: a spring with a slider like the tangential one,
which feels the rotations of both particles alone, and acts on these alone. With the arms :math:`R, -R` of the effective
radius R its displacement is :math:`R\, \mathbf n \times (\mathrm d\boldsymbol\theta_i - \mathrm
d\boldsymbol\theta_j)`. Normal force, normal stiffness and overlap are those of the contact, and say how its bound
changes.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .arrays import Booleans, EqualToTheBit, Floats, Indices, derive_frozen, exactly, floats, set_frozen

WALL = -1
"""The index that stands for a wall as the second partner of a contact."""

AT_COULOMBS_BOUND = 1 - 1e-6
"""Share of mu f_n from which on a contact counts as one at the bound. A packing at rest has a residual of 1e-6 of its
forces or less, and a dashpot has carried that much of the tangential force."""

UNIT_ERROR = 1e-6
"""Error of a unit vector, and of a direction in the plane, that text of seven digits has."""

NORMAL_SHARE = 1e-2
"""Share of a tangential force that may be along the normal: LAMMPS turns histories a step behind their contacts."""

BOOLEAN = {"sliding": False, "slider": True, "viscous_slider": True, "couple": False}
"""Fields that are true or false, with the values of contacts that do not say."""


@dataclass(frozen=True, init=False, eq=False, repr=False)
class LinearisedContacts(EqualToTheBit):
    """The contacts of a packing to first order: forces and derivatives. Arrays are copied and made read-only.

    Parameters
    ----------
    i : array_like of int, shape (C,)
        First partner.
    j : array_like of int, shape (C,)
        Second partner; -1 is a wall, which neither moves nor rotates.
    normal : array_like, shape (C, 3)
        Unit vector n towards i.
    distance : array_like, shape (C,)
        Length r of the branch vector between two centres; infinite for a wall, whose normal does not rotate.
    overlap : array_like, shape (C,)
        delta, length.
    slip_arm : array_like, shape (C, 2)
        Arms s_i, s_j of the slip: the rolling s_i d theta_i + s_j d theta_j slides the contact; length.
    lever_arm : array_like, shape (C, 2)
        Arms l_i, l_j of the torques -l n x f_t; length.
    lever_slope : array_like, shape (C,)
        -d l / d delta: 0 if the arm is a radius, 1/2 if it ends in the middle of the overlap.
    normal_force : array_like, shape (C,)
        f_n, force, positive for a repulsion.
    tangential_force : array_like, shape (C, 3)
        f_t, force on i.
    normal_stiffness, tangential_stiffness : array_like, shape (C,)
        d f_n / d delta and -d f_t / d s, force / length.
    closing, parting : array_like, shape (C, 3)
        b = d f_t / d delta at constant slip while the overlap grows, and while the overlap falls; force / length.
    friction : array_like, shape (C,)
        mu f_n, Coulomb's bound, force; infinite without such a bound.
    sliding : array_like of bool, shape (C,)
        Contacts that slide: they have no stiffness along f_t, and b is that of f_t = mu f_n.
    normal_dashpot, tangential_dashpot : array_like, shape (C,)
        Force time / length.
    slider : array_like of bool, shape (C,)
        Contacts whose tangential force is that of a spring in series with Coulomb's slider, so that its derivative
        jumps at the bound; the default. The force of a smoothed law has one derivative there.
    viscous_slider : array_like of bool, shape (C,)
        Contacts whose slip at Coulomb's bound yields to the elastic and the viscous force together, with the bound mu
        times the normal force of spring and dashpot: LAMMPS's slider, and the default. The slip of other contacts
        yields to the elastic force alone, and the sum of both forces is cut at mu times the elastic normal force.
    couple : array_like of bool, shape (C,)
        Entries of rolling friction, which act on rotations alone; their arms have two signs. None by default.

    Raises
    ------
    ValueError
        If a shape does not fit, a number is not finite, or a value is none that a contact can have: a normal that is
        no unit vector, a tangential force along the normal, a distance that is not positive, or a negative arm, bound
        or index.
    """

    i: Indices
    j: Indices
    normal: Floats
    distance: Floats
    overlap: Floats
    slip_arm: Floats
    lever_arm: Floats
    lever_slope: Floats
    normal_force: Floats
    tangential_force: Floats
    normal_stiffness: Floats
    tangential_stiffness: Floats
    closing: Floats
    parting: Floats
    friction: Floats
    sliding: Booleans
    normal_dashpot: Floats
    tangential_dashpot: Floats
    slider: Booleans
    viscous_slider: Booleans
    couple: Booleans

    def __init__(self, **given: ArrayLike) -> None:
        count = np.size(given.get("i", ()))
        given = {name: np.full(count, value) for name, value in BOOLEAN.items()} | given
        if given.keys() != PER_CONTACT.keys():
            raise ValueError(f"Contacts need {', '.join(PER_CONTACT)}; these are {', '.join(given)}.")
        values: dict[str, NDArray] = {name: exactly(name, given[name], count, np.integer) for name in ("i", "j")}
        values |= {name: exactly(name, given[name], count, np.bool_) for name in BOOLEAN}
        for name in PER_CONTACT.keys() - values.keys():
            shape, infinite = (count, *PER_CONTACT[name]), name in ("distance", "friction")
            values[name] = floats(name, given[name], shape, infinite=infinite)
        set_frozen(self, **{name: values[name] for name in PER_CONTACT})
        if np.any(self.i == self.j):
            raise ValueError("Every contact has two different partners, i and j.")
        normal, tangential = self.normal, self.tangential_force
        along = np.abs(np.einsum("ca,ca->c", normal, tangential))
        allowed = NORMAL_SHARE * np.linalg.norm(tangential, axis=1) + UNIT_ERROR * np.abs(self.normal_force)
        refuse_first(self.i < 0, "i = {} is no particle", self.i)
        refuse_first(self.j < WALL, "j = {} is no particle; -1 is a wall", self.j)
        refuse_first(np.abs(np.linalg.norm(normal, axis=1) - 1) > UNIT_ERROR, "the normal {} is no unit vector", normal)
        refuse_first(along > allowed, "the tangential force {} has a part along the normal", tangential)
        refuse_first(self.distance <= 0, "the distance {} is not positive", self.distance)
        refuse_first(self.friction < 0, "friction = {} is negative", self.friction)
        for name in ("slip_arm", "lever_arm"):
            negative = np.any(values[name] < 0, axis=1) & ~self.couple
            refuse_first(negative, f"{name} = {{}} is negative", values[name])

    def __repr__(self) -> str:
        c = self.touching
        return f"<LinearisedContacts: {len(c)}, {int(c.wall.sum())} of them with walls>"

    def __len__(self) -> int:
        return len(self.i)

    @property
    def touching(self) -> "LinearisedContacts":
        """The contacts alone, without entries of rolling friction."""
        return self.chosen(~self.couple) if self.couple.any() else self

    @property
    def wall(self) -> Booleans:
        """Which contacts are with a wall, shape (C,)."""
        return self.j == WALL

    @property
    def at_bound(self) -> Booleans:
        """Which contacts are at Coulomb's bound, shape (C,)."""
        tangential = np.linalg.norm(self.tangential_force, axis=1)
        return (tangential > 0) & (tangential >= AT_COULOMBS_BOUND * self.friction)

    @property
    def one_sided(self) -> Booleans:
        """Which contacts slide on ahead and stick on the way back, shape (C,): sliders at Coulomb's bound."""
        return self.at_bound & self.slider

    @property
    def two_derivatives(self) -> Booleans:
        """Which contacts have other derivatives while they close than while they part, shape (C,); K has the mean."""
        return np.asarray(np.any(self.closing != self.parting, axis=1))

    def overlap_derivative(self, parting: ArrayLike = 0.5) -> Floats:
        """b of each contact, shape (C, 3), with the weight of opening, shape () or (C,)."""
        share = np.broadcast_to(np.asarray(parting, dtype=np.float64), (len(self),))[:, None]
        stick = (1 - share) * self.closing + share * self.parting
        # a sliding contact keeps |f_t| = mu f_n, in the direction in which it slides
        slide = np.divide(
            self.tangential_force * self.normal_stiffness[:, None], self.normal_force[:, None],
            out=np.zeros_like(stick), where=self.normal_force[:, None] != 0,
        )  # fmt: skip
        return np.where(self.sliding[:, None], slide, stick)

    def chosen(self, which: NDArray) -> "LinearisedContacts":
        """Some of the contacts, selected by a mask or by numbers."""
        return derive_frozen(self, **{name: np.array(getattr(self, name)[which]) for name in PER_CONTACT})


PER_CONTACT: Mapping[str, tuple[int, ...]] = (
    dict.fromkeys(LinearisedContacts.__dataclass_fields__, ())
    | dict.fromkeys(("slip_arm", "lever_arm"), (2,))
    | dict.fromkeys(("normal", "tangential_force", "closing", "parting"), (3,))
)
"""Fields of `LinearisedContacts`, with the shape of each for one contact."""


def refuse_first(wrong: Booleans, says: str, values: NDArray) -> None:
    """Refuse the first contact that is wrong, with its value in the sentence."""
    if wrong.any():
        k = int(np.argmax(wrong))
        raise ValueError(f"Contact {k}: {says.format(values[k])}.")
