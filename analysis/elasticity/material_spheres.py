r"""Spheres of one elastic material, from places and radii alone, and the rules that users have for a time step.

The contacts are those of Hertz and Mindlin between like materials of Young's modulus E and Poisson's ratio nu, as in
LAMMPS, LIGGGHTS, YADE and MercuryDPM: with the overlap :math:`\delta` and :math:`1/R^* = 1/R_i + 1/R_j`,

.. math::

    f_n = \tfrac23 \frac{E}{1 - \nu^2} \sqrt{R^*}\, \delta^{3/2}, \qquad
    k_n' = \frac{E}{1 - \nu^2} \sqrt{R^* \delta}, \qquad
    k_t' = \frac{2 (1 - \nu)}{2 - \nu}\, k_n' .

A restitution coefficient e makes dashpots :math:`c = 2 \sqrt{5/6}\, \beta \sqrt{k' m^*}` (without 5/6 for springs),
:math:`\beta = -\ln e / \sqrt{\ln^2 e + \pi^2}` (Y. Tsuji, T. Tanaka and T. Ishida, Powder Technol. 71, 239, 1992).
Where contacts are not given, those are taken that overlap, with tangential forces that are not known.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Floats, Indices, derive_frozen, ratio
from ..configuration import UNKNOWN_SLIPS, Configuration
from ..contacts import LinearisedContacts
from ..errors import BadInputError
from ..motion.stable_timestep import StableTimestep, rayleigh_timestep, stable_timestep
from ..operators.gaps import near_pairs


class Material(NamedTuple):
    """A contact law of spheres and what else makes them heavy and lossy; none has all of it.

    Attributes
    ----------
    young, poisson : float
        Young's modulus, force / area, and Poisson's ratio: Hertz's and Mindlin's stiffnesses.
    kn, kt : float
        In place of young: with exponent 1.5, f_n = kn sqrt(R*) delta^(3/2) and k_t' = kt sqrt(R* delta), as LAMMPS's
        hertz/history has them; with exponent 1, f_n = kn delta and k_t' = kt. kt = 2/7 kn by default.
    exponent : float
        1.5 or 1.
    density, friction, restitution : float
        Mass / volume; coefficient of friction; restitution.
    gamma, gamma_t : float
        In place of restitution: dashpots gamma m* sqrt(R* delta) of Hertz's law, gamma m* of springs, as LAMMPS's
        gran/* styles have them; gamma_t = gamma/2 by default.
    rescales : float
        1 if the tangential force of a given slip grows with the overlap (gran/hertz/history, LIGGGHTS), 0 if each
        increment of force stays as it is (mindlin/force, YADE, MercuryDPM), the default.
    """

    young: float | None = None
    poisson: float = 0.3
    kn: float | None = None
    kt: float | None = None
    exponent: float = 1.5
    density: float | None = None
    friction: float = 0.5
    restitution: float = 1.0
    rescales: float = 0.0
    gamma: float | None = None
    gamma_t: float | None = None

    def checked(self) -> "Material":
        """The same with kn and kt.

        Raises
        ------
        BadInputError
            If a number is none that a material has; its name is in the sentence.
        """
        if (self.young is None) == (self.kn is None):
            raise BadInputError("The material needs young, or kn in its place, and not both.")
        allowed = {
            "young": (0, np.inf), "kn": (0, np.inf), "density": (0, np.inf), "poisson": (-1, 0.5),
            "restitution": (0, 1), "exponent": (0, 1.5),
            **dict.fromkeys(("gamma", "gamma_t", "kt", "friction"), (-TINY, np.inf)),
        }  # fmt: skip
        for name, (low, high) in allowed.items():
            value = getattr(self, name)
            if value is not None and (not low < value <= high or value == np.inf):
                raise BadInputError(f"The material has {name} = {value:g}: it must be from {low:g} to {high:g}.")
        if self.exponent not in (1.0, 1.5):
            raise BadInputError(f"The material has exponent = {self.exponent:g}: 1.5 is Hertz's law, 1 a spring.")
        if self.young is None or self.kn is not None:
            return self._replace(kt=2 / 7 * (self.kn or 0.0) if self.kt is None else self.kt)
        plane = self.young / (1 - self.poisson**2)
        return self._replace(young=None, kn=2 / 3 * plane, kt=2 * (1 - self.poisson) / (2 - self.poisson) * plane)


TINY = np.finfo(float).tiny


def spheres_of_material(
    position: ArrayLike,
    radius: ArrayLike,
    material: Material,
    *,
    box: ArrayLike | None = None,
    origin: ArrayLike = (0.0, 0.0, 0.0),
    periodic: ArrayLike = (False, False, False),
    mass: ArrayLike | None = None,
    contacts: tuple[Indices, Indices, Floats] | None = None,
    **forces: Any,
) -> Configuration:
    """Spheres of a material with their contacts to first order.

    Parameters
    ----------
    position : array_like, shape (N, 3) or (N, 2)
        Centres, length; with two columns the spheres move in a plane.
    radius, mass : array_like, shape (N,)
        Length; and mass, by default that of the material's density.
    material : Material
        Of all spheres.
    box, origin, periodic : array_like
        As in `Configuration`; by default the box that just holds all spheres.
    contacts : tuple of (i, j, branch), optional
        Pairs in contact, j = -1 for a wall, and the vectors from j, or from the wall, to i, shape (C, 3); by default
        those that overlap.
    **forces
        What is known of these contacts: normal_force, from which overlaps and stiffnesses then follow;
        tangential_force; lever_slope.

    Returns
    -------
    Configuration
        Without known slips, unless tangential forces are given; the load balances the contacts.

    Raises
    ------
    BadInputError
        If the material has no density and masses are not given.
    """
    place, radius = np.asarray(position, float), np.asarray(radius, float)
    dimension = place.shape[1]
    place = np.column_stack([place, np.zeros((len(place), 3 - dimension))])
    material = material.checked()
    kn, kt = float(material.kn or 0.0), float(material.kt or 0.0)
    if mass is None and material.density is None:
        raise BadInputError("Nothing says how heavy the spheres are: give the density of the material, or masses.")
    mass = 4 / 3 * np.pi * radius**3 * (material.density or 0.0) if mass is None else np.asarray(mass, float)
    if box is None:
        origin = (place - radius[:, None]).min(axis=0)
        box = np.diag((place + radius[:, None]).max(axis=0) - origin)
    box = np.asarray(box, float)
    i, j, branch = near_pairs(place, radius, box, periodic) if contacts is None else contacts
    distance = np.linalg.norm(branch, axis=1)
    if not distance.all():
        k = int(np.argmin(distance))
        raise BadInputError(f"Spheres {i[k] + 1} and {j[k] + 1}, counted from 1, are in one place: separate them.")
    normal, wall = branch / distance[:, None], j < 0
    other = np.where(wall, np.inf, radius[j])
    overlap = np.maximum(np.where(wall, radius[i], radius[i] + radius[j]) - distance, 0.0)
    reduced, heavy = 1 / (1 / radius[i] + 1 / other), np.where(wall, mass[i], mass[i] * mass[j] / (mass[i] + mass[j]))
    normal_force = forces.pop("normal_force", None)
    hertz = material.exponent == 1.5
    if normal_force is not None:  # a force has more digits than the difference of two places
        per_force = 1 / (kn * np.sqrt(reduced) if hertz else kn)
        overlap = (np.maximum(normal_force, 0.0) * per_force) ** (1 / material.exponent)
    area = np.sqrt(reduced * overlap) if hertz else np.ones(len(i))
    stiff, shear = material.exponent * kn * area, kt * area * (material.friction > 0)
    normal_force = stiff * overlap / material.exponent if normal_force is None else np.asarray(normal_force, float)
    log = -np.log(material.restitution)
    viscous = 2 * np.sqrt(5 / 6 if hertz else 1.0) * log / np.hypot(log, np.pi) * np.sqrt(heavy)
    dashpots = [viscous * np.sqrt(stiff), viscous * np.sqrt(shear)]
    if material.gamma is not None:
        across = material.gamma / 2 if material.gamma_t is None else material.gamma_t
        dashpots = [each * heavy * area for each in (material.gamma, across * (material.friction > 0))]
    known = "tangential_force" in forces or not material.friction or not len(i)
    none = np.zeros((len(i), 3))
    tangential = np.asarray(forces.pop("tangential_force", none), float)
    coupling = ratio(tangential, 2 * overlap[:, None]) if hertz and material.rescales > 0 else none
    arms = np.column_stack([radius[i], np.where(wall, 0.0, radius[j])])
    given: dict[str, Any] = {
        "i": i, "j": j, "normal": normal, "distance": np.where(wall, np.inf, distance), "overlap": overlap,
        "slip_arm": arms, "lever_arm": arms, "lever_slope": np.zeros(len(i)), "normal_force": normal_force,
        "tangential_force": tangential, "normal_stiffness": stiff, "tangential_stiffness": shear, "closing": coupling,
        "parting": coupling, "friction": material.friction * np.maximum(normal_force, 0.0),
        "normal_dashpot": dashpots[0], "tangential_dashpot": dashpots[1],
    }  # fmt: skip
    made = Configuration(
        dimension=dimension, position=place[:, :dimension], radius=radius, mass=mass, inertia=0.4 * mass * radius**2,
        contacts=LinearisedContacts(**given | forces), box=box, origin=np.asarray(origin),
        periodic=np.asarray(periodic), slips_known=known,
        load=np.zeros((len(radius), 2, 3)), remarks=() if known else (UNKNOWN_SLIPS,),
    )  # fmt: skip
    return derive_frozen(made, load=-made.contact_force)


def timestep_rules(configuration: Configuration) -> tuple[StableTimestep, dict[str, float | None]]:
    r"""The largest stable time step of a packing, and what users take in its place.

    Returns
    -------
    step : StableTimestep
        Of velocity Verlet with the packing's own contacts and dashpots, with its `error` and a `certain` step.
    rules : dict
        `rayleigh`: Rayleigh's formula, all of it (Li, Xu and Thornton 2005); `o_sullivan_bray`:
        :math:`0.17 \sqrt{m/k}` of the lightest particle and the stiffest contact (C. O'Sullivan and J. D. Bray, Eng.
        Comput. 21, 278, 2004: three dimensions with rotation); `oscillator`: :math:`2 \sqrt{m/k}`, what one sphere on
        one spring could take; `p_wave`: :math:`R \sqrt{\rho/E}`, the time of a sound wave through the smallest sphere
        of a material (YADE's PWaveTimeStep). None where a rule does not apply.
    """
    c = configuration.contacts
    touch = np.intersect1d(np.union1d(c.i, c.j[~c.wall]), np.flatnonzero(configuration.free))
    stiffest = float(np.maximum(c.normal_stiffness, c.tangential_stiffness).max(initial=0.0))
    root = float(np.sqrt(configuration.mass[touch].min() / stiffest)) if stiffest and len(touch) else None
    shares = {"o_sullivan_bray": 0.17, "oscillator": 2.0, "p_wave": float(np.sqrt(3 / (4 * np.pi)))}
    rules = {name: None if root is None else share * root for name, share in shares.items()}
    return stable_timestep(configuration), {"rayleigh": rayleigh_timestep(configuration)} | rules
