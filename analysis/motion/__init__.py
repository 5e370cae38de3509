"""Small motion about an equilibrium: eigenvalues, and what grows.

- `stability`, `verdict`: does a packing at rest move? Four classes lead from a packing to its verdict: `Motion`, its
  operators; `Linear`, what is known of linear motion; `OneSidedSystem`, the equations with contacts at Coulomb's bound;
  `Stability`. In three parts: `linear`; `one_sided`, `pushes` and `rising_load`; `reach`, up to which push that holds;
- `linear`: LAPACK, `certificate` (no fast motion grows, and slow ones one by one), `random_state` (what grows in any
  number of coordinates, and whether motion decays where there is no certificate);
- `motion`: the matrices of small motion, and its energy as a sum of squares; `eigenvalues`: what grows beyond rounding;
- `spectrum`, `modes`, `all_eigenvalues`, `buckling`: eigenvalues of K and their vectors, of large packings in slices,
  nearest to a shift, and negative; `stable_timestep`: the time step.

May import: `configuration`, `packing`, `operators`, `factors`.
"""
