"""Motion under forces and from given starts: what single studies draw beside the verdict.

- `response`: linear motion under a force, from a displacement, and after an impulse;
- `transient`: how far a stable packing moves away before it returns; `normal_form`: two modes that coalesce;
- `growth`: growth of D in a run of LAMMPS; `slips`: a layer that a spring draws; `hysteresis`; `signals` in time.

May import: `configuration`, `packing`, `operators`, `factors`, `motion`.
"""
