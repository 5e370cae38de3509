"""Factors of matrices, for linear solvers: bands, and sparse factors of symmetric and of other matrices.

`linear` chooses for Newton's method, `sparse_lu` is the one place where sparse factors come from, `ldlt` has our own.

May import: `packing`, `operators`.
"""
