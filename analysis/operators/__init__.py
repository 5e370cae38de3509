"""What a small displacement and a small velocity do to the forces: the stability operator K and the damping matrix C.

May import: `packing`.
"""
