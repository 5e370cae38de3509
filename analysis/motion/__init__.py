"""Small motion about an equilibrium: eigenvalues, what grows, responses to forces, growth in a run.

- `motion`: the matrices of small motion; `rates`: its eigenvalues s, with dissipation;
- `spectrum`, `modes`, `nearest_modes`, `buckling`: eigenvalues of K and their vectors, which of them grow, and the
  negative ones; `all_eigenvalues`, `block_arnoldi`, `fastest_growing`, `slow_motions`: those of large packings;
- `stability`, `verdict`: does a packing at rest move? `linear`: by eigenvalues; `one_sided`, `pushes`: with contacts
  at Coulomb's bound; `reach`: up to which push; `rising_load`: under a load that rises; `decay`: other motion that
  eigenvalues do not decide;
- `normal_form`: two modes that coalesce; `response`, `forcing`: motion under forces; `transient`, `propagator`: its
  largest amplitude; `growth`, `growth_of_run`: growth in a run of LAMMPS; `slips`: a layer that a spring draws;
  `stable_timestep`: the time step;
- `matrix_functions`, `oscillator`, `energy_norm`: the mathematics.

May import: `configuration`, `packing`, `operators`, `factors`.
"""
