"""A packing as a material: stress and elastic moduli, vibrations, spheres of a material, where energy goes.

- `moduli`: stress, elastic moduli over frequency, wave speeds;
- `material_spheres`: spheres of a table with Hertz's and Mindlin's law, and the rules for their time step;
- `vibrations`: density of states, modes, softness, dispersion;
- `dissipation`: the energy that dashpots and sliders take from a motion.

May import: `configuration`, `packing`, `operators`, `factors`, `motion`.
"""
