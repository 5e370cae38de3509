"""Small motion about an equilibrium, with and without dissipation: growth, responses to forces, transient gain.

`response` and `forcing` compute the motion, `transient` its largest amplitude, `growth` its growth in a LAMMPS run.
`matrix_functions`, `oscillator`, `propagator` and `state_space` contain the mathematics.

May import: `packing`, `operators`, `spectrum`.
"""
