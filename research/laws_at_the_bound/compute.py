r"""The same equilibrium under two laws: what grows, and with which loss.

An equilibrium of the smoothed law is one of every law that gives the contacts the same forces. So K of the standard law
can be asked at the same disks and the same contact forces :math:`f_n, f_t`. Its contact is a linear spring behind
Coulomb's slider that remembers its force (Cundall and Strack, Geotechnique 29, 47 (1979); with Hertz's contact the
mindlin_rescale/force of LAMMPS). With p = 3/2, of :math:`a = \partial f_t/\partial s` and
:math:`b = \partial f_t/\partial\delta`,

.. math::

    \text{sticks:}\quad a = -k_t \sqrt\delta, \quad b = 0 \text{ (closes)}, \ f_t/2\delta \text{ (parts)}; \qquad
    \text{slides on:}\quad a = 0, \quad b = 3 f_t/2\delta.

A small vibration closes and parts a contact in turn, and its first harmonic has the mean, :math:`b = f_t/4\delta`. A
contact at the bound gives way in the first periods, until the vibration no longer reaches the bound: it is shaken
down, and sticks. So the standard law has :math:`a = -k_t \sqrt\delta` and :math:`b = f_t/4\delta` at all contacts, and
a tangential dashpot at all contacts. The other derivatives stand beside it without loss.

The derivatives are written down here, apart from the law of the program, so that they can disagree with it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigvals

from faultgouge.analysis import Packing
from faultgouge.analysis.onset import force_bearing
from faultgouge.analysis.operators.stiffness import assemble_stiffness, contact_terms
from faultgouge.analysis.packing.law import Derivatives
from faultgouge.analysis.spectrum.spectrum import SAFETY, active_coordinates, mass_weighted, unit_rounding
from faultgouge.pywrap import Equilibrium, Scene
from faultgouge.pywrap.scenes.units import dashpot
from faultgouge.studies.modes.count_pairs import Counted, along_ramp
from faultgouge.studies.packing_tools import sliding_contacts
from research.modes.loss import TANGENTIAL, impact_velocity

RESTITUTIONS = (0.97, 0.9)

STANDARD = {"shaken": (0.25, False), "closing": (0.0, False), "parting": (0.5, False), "slides_on": (0.25, True)}
"""Derivatives of the standard law: b delta/f_t of contacts that stick, and whether those at the bound slide on."""


def both_laws(scene: Scene, rest: Equilibrium) -> dict[str, Any]:
    """Undamped pairs and growth with dashpots, by law, at the loads of [modes]; `rest` is the settled packing."""
    velocity = impact_velocity(scene)
    dashpots = {each: dashpot(scene.law.kn, each, 1.0, velocity) for each in RESTITUTIONS}

    def look(packing: Packing) -> dict[str, Any]:
        bearing = force_bearing(packing)
        slides = sliding_contacts(bearing)
        smooth = count_undamped(bearing, smooth_derivatives(bearing))
        standard = {
            name: count_undamped(bearing, standard_derivatives(bearing, share, slides & on))
            for name, (share, on) in STANDARD.items()
        }
        everywhere = np.ones_like(slides)
        smooth["damped"] = fastest_damped(bearing, smooth_derivatives(bearing), ~slides, dashpots)
        elastic = standard_derivatives(bearing, *STANDARD["shaken"])
        standard["shaken"]["damped"] = fastest_damped(bearing, elastic, everywhere, dashpots)
        counts = {"contacts": len(slides), "at_bound": int(slides.sum()), "modes": smooth.pop("modes")}
        for each in standard.values():
            del each["modes"]
        return counts | {"smooth": smooth, "standard": standard}

    return along_ramp(scene, lambda mu: rest, look)


def smooth_derivatives(packing: Packing) -> Derivatives:
    """Of the law that the packing has."""
    return packing.law.derivatives(packing.geometry.overlap, packing.contacts.slip)


def standard_derivatives(packing: Packing, share: float, slides: NDArray[np.bool_] | bool) -> Derivatives:
    """Of the standard law at the contact forces that the packing has.

    Parameters
    ----------
    packing : Packing
        In equilibrium, with p = 3/2.
    share : float
        b delta/f_t of contacts that stick: 0 while they close, 1/2 while they part, 1/4 for the mean.
    slides : ndarray of bool, shape (C,), or bool
        Contacts that slide on.
    """
    law, overlap = smooth_derivatives(packing), packing.geometry.overlap
    return law._replace(
        slip_derivative=np.where(slides, 0.0, -packing.law.kt * np.sqrt(overlap)),
        overlap_derivative=np.where(slides, 1.5, share) * law.tangential_force / overlap,
    )


def _assemble_stiffness(packing: Packing, law: Derivatives) -> Any:
    contacts, (normal, _, distance, _) = packing.contacts, packing.geometry
    pairs = len(contacts) - np.count_nonzero(contacts.floor)
    return assemble_stiffness(
        contact_terms(law, normal.T, distance, pairs), contacts.i, contacts.j[:pairs], len(packing)
    )


def count_undamped(packing: Packing, law: Derivatives) -> dict[str, Any]:
    """Pairs, share, growth rate, Q, and the drag 1/tau that stops all pairs; those within rounding count as real."""
    weighted = mass_weighted(_assemble_stiffness(packing, law), packing)
    active = active_coordinates(weighted)
    dense = weighted[active][:, active].toarray()
    values = np.asarray(eigvals(dense, check_finite=False), dtype=np.complex128)
    surely = np.sqrt(SAFETY * unit_rounding(dense) * np.abs(values).max(initial=0.0))
    values = np.where(np.abs(values.imag) > surely, values, values.real)
    counted = Counted.of(values)
    squares = counted.omega**2
    drag = squares.imag / np.sqrt(np.maximum(squares.real, np.finfo(float).tiny))
    return counted.as_dict() | {"modes": len(values), "drag_rate": float(drag.max(initial=0.0))}


def fastest_damped(
    packing: Packing, law: Derivatives, sticks: NDArray[np.bool_], dashpots: dict[float, float]
) -> list[list[float]]:
    """[restitution, largest Re s of s^2 M + s C + K, its Im s]; only contacts that stick have a tangential dashpot."""
    root, zero = np.sqrt(packing.geometry.overlap), np.zeros(len(packing.contacts))
    weighted = mass_weighted(_assemble_stiffness(packing, law), packing)
    active = active_coordinates(weighted)
    stiffness = weighted[active][:, active].toarray()
    size = len(stiffness)
    found = []
    for each, cn in dashpots.items():
        loss = Derivatives(zero, zero, cn * root, -TANGENTIAL * cn * root * sticks, zero)
        damping = mass_weighted(_assemble_stiffness(packing, loss), packing)[active][:, active].toarray()
        companion = np.block([[np.zeros((size, size)), np.eye(size)], [-stiffness, -damping]])
        rates = eigvals(companion, check_finite=False)
        fastest = complex(rates[np.argmax(rates.real)])
        found.append([each, fastest.real, abs(fastest.imag)])
    return found
