"""Small motion about an equilibrium, with and without dissipation: growth, responses to forces, transient gain.

`response` and `forcing` give the motion, `transient` its largest amplitude, `growth` what a run in LAMMPS shows of it.
`matrix_functions`, `oscillator`, `propagator` and `state_space` are the mathematics.

May import: `packing`, `operators`, `spectrum`.
"""
