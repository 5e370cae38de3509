"""Motion under forces and from given starts: what single studies draw beside the verdict.

- `response`, `oscillator`, `matrix_functions`: linear motion under a force or from a displacement, exact at all times;
- `transient`, `propagator`: how far a stable packing moves away before it returns;
- `forcing`, `signals`: signals in time and in frequency; `normal_form`, `power_law`: two modes that coalesce;
- `growth`, `growth_of_run`: growth of D in a run of LAMMPS; `slips`: a layer that a spring draws.

May import: `configuration`, `packing`, `operators`, `factors`, `motion`.
"""
