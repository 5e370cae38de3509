"""Small motion about an equilibrium: eigenvalues, what grows, responses to forces, growth in a run.

`modes` and `nearest_modes` have modes of the stability operator, `spectrum` its eigenvalues and what grows, `buckling`
the negative ones; of large packings
`all_eigenvalues` finds all, with `block_arnoldi`, and `fastest_growing` the ones that matter most. `normal_form` has
how two modes coalesce, `response` and `forcing` the motion under forces, `transient` its largest amplitude, `growth`
its growth in a LAMMPS run, `stable_timestep` the time step. `matrix_functions`, `oscillator`, `propagator` and
`energy_norm` contain the mathematics.

May import: `configuration`, `packing`, `operators`, `factors`.
"""
