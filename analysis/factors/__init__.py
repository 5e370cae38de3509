"""Factors of matrices, for all who solve with them: bands, sparse factors of symmetric matrices and of others.

`linear` chooses for Newton's method, `sparse_lu` is the one place where sparse factors come from, `ldlt` has our own.

May import: `packing`, `operators`.
"""
