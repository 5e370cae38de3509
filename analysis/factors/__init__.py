"""Factors of matrices, for linear solvers: bands, and sparse factors of symmetric and of other matrices.

`linear_solver` chooses for Newton's method, `sparse_lu` makes all sparse factors, `lanczos` finds eigenvectors slice by
slice.

May import: `packing`, `operators`.
"""
