"""The analysis of packings of frictional grains: stability operator, spectrum, stability, onset, growth.

Functions take a :class:`Packing`, the disks of this package's law, or a :class:`Configuration`, the particles of any
code with their contacts to first order. The physics is in the docstrings of the modules:

- `contacts`, `assembly` and `configuration`: particles with contacts to first order, and their stability operator;
- `packing`: the contact law, geometry and forces of disks;
- `operators`: stiffness and damping matrix, sliders at Coulomb's bound;
- `factors`: factors of sparse and banded matrices;
- `motion`: eigenvalues, the verdict on stability, responses, growth in a run, time step;
- `windows`: the loads between which a motion grows;
- `elasticity`: stress, elastic moduli, vibrations, spheres of a material;
- `files`: run.h5, dumps, and the formats of other codes.

The names of this package are imported when they are used.
"""

from typing import TYPE_CHECKING

from .names_on_use import names_on_use

if TYPE_CHECKING:  # each is imported when it is used
    from .arrays import Complexes, Floats, Indices
    from .configuration import Configuration, Snapshot
    from .contacts import LinearisedContacts
    from .elasticity.dissipation import LostEnergy, lost_by_modes, lost_energy
    from .elasticity.material_spheres import Material, spheres_of_material, timestep_rules
    from .elasticity.moduli import ElasticModuli, elastic_moduli, stress
    from .elasticity.vibrations import PlaneWave, Vibrations, dispersion, softness, vibrations
    from .errors import BadInputError, FaultgougeError, NoEquilibriumError, OutputError, PackingFileError
    from .files.formats.lammps_dump import read_dump
    from .files.runfile import RunFile
    from .motion.buckling import nearest_modes, negative_eigenvalues
    from .motion.eigenvalues import Linear, mass_weighted
    from .motion.modes import Mode, Modes, closest_to_meeting, growth_rate, normal_modes
    from .motion.motion import Motion
    from .motion.one_sided import OneSidedMotion, one_sided_motion
    from .motion.random_state import fastest_growing
    from .motion.spectrum import (
        Spectrum,
        discrete_frequency,
        dynamical_matrix,
        eigenvalues,
        largest_frequency,
        spectrum,
    )
    from .motion.stability import Stability, stability
    from .motion.stable_timestep import rayleigh_timestep, stable_timestep
    from .operators.damping import damping_matrix
    from .operators.stiffness import stiffness_matrix
    from .packing.contacts import FLOOR, Contacts
    from .packing.geometry import ContactGeometry, nearest_image, touching
    from .packing.law import MindlinLaw
    from .packing.packing import Packing
    from .packing.solid_fraction import solid_fraction
    from .responses.growth import Growth, PowerLaw, fit_growth, fit_power_law, growth_of_run, mean_square_displacement
    from .responses.response import layer_force, linear_response
    from .responses.signals import Signal
    from .responses.slips import Slip
    from .responses.transient import NoGainError, TransientGain, transient_gain
    from .windows import Onset, OnsetError, Window, complex_windows, find_onset
    from .windows.pair_over_load import pair_eigenvalues

__all__ = [
    "FLOOR", "BadInputError", "Complexes", "Configuration", "ContactGeometry", "Contacts", "ElasticModuli",
    "FaultgougeError", "Floats", "Growth", "Indices", "Linear", "LinearisedContacts", "LostEnergy", "Material",
    "MindlinLaw", "Mode", "Modes", "Motion", "NoEquilibriumError", "NoGainError", "OneSidedMotion",
    "Onset", "OnsetError", "OutputError", "Packing", "PackingFileError", "PlaneWave", "PowerLaw",
    "RunFile", "Signal", "Slip", "Snapshot", "Spectrum", "Stability", "TransientGain", "Vibrations", "Window",
    "closest_to_meeting", "complex_windows", "damping_matrix", "discrete_frequency", "dispersion", "dynamical_matrix",
    "eigenvalues", "elastic_moduli", "fastest_growing", "find_onset", "fit_growth", "fit_power_law", "growth_of_run",
    "growth_rate", "largest_frequency", "layer_force", "linear_response", "lost_by_modes",
    "lost_energy", "mass_weighted", "mean_square_displacement", "nearest_image", "nearest_modes",
    "negative_eigenvalues", "normal_modes", "one_sided_motion", "pair_eigenvalues", "rayleigh_timestep", "read_dump",
    "softness", "solid_fraction", "spectrum", "spheres_of_material", "stability", "stable_timestep",
    "stiffness_matrix", "stress", "timestep_rules", "touching", "transient_gain", "vibrations",
]  # fmt: skip

if not TYPE_CHECKING:
    __getattr__, __dir__ = names_on_use(__name__, __file__)
