"""Derivatives of the forces by displacements and by velocities: the stability operator K and the damping matrix C.

May import: `packing`.
"""
