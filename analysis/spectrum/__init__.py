"""Eigenvalues and modes of one packing: which pairs are complex, and how two modes coalesce (the normal form).

May import: `packing`, `operators`.
"""
