"""Sparse factors of crystals, ours, by SuperLU and by MUMPS: of a shifted symmetric operator, and in an increment.

    python benchmarks/factors.py COLUMNS

A square crystal of so many columns. Processor time in one thread; python-mumps is needed.
"""

import os

os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"

import sys
import time

import numpy as np
from mpi4py import MPI
from scipy.sparse import csc_array, eye_array

from faultgouge.analysis import Packing
from faultgouge.analysis.factors import sparse_lu
from faultgouge.analysis.factors.sparse_lu import minimum_degree, symmetric_lu
from faultgouge.analysis.onset import LIMITS, full_operator
from faultgouge.assessment.stability.cases.packings import crystal
from faultgouge.pywrap import Engine, Equilibrium, equilibrate
from faultgouge.pywrap.equilibria.quasistatic import rounding_floor

clock = time.process_time


def shifted(packing: Packing) -> csc_array:
    """S - shift in an order of elimination, the shift within the spectrum."""
    operator = csc_array(full_operator(packing))
    matrix = csc_array(0.5 * (operator + operator.T))
    place = minimum_degree(csc_array(matrix + 2 * abs(matrix).sum(axis=0).max() * eye_array(matrix.shape[0])))
    order = np.argsort(place)
    return csc_array(matrix[order][:, order] - 1.0123 * matrix.diagonal().mean() * eye_array(len(order)))


def factors(matrix: csc_array, mumps: bool) -> str:
    """Times of factors and solutions."""
    begin = clock()
    made = symmetric_lu(matrix, ordered=True, symmetric=True, mumps=mumps)
    below = made.negative
    known = clock()
    right = np.random.default_rng(1).standard_normal((matrix.shape[0], LIMITS.block))
    left = made.solve(right)
    each, residual = 1e3 * (clock() - known) / LIMITS.block, abs(matrix @ left - right).max()
    return f"factors {known - begin:.2f} s, {each:.1f} ms a vector, residual {residual:.1g}, {below} eigenvalues below"


def increment(packing: Packing) -> str:
    """Times of two increments after a first one."""
    with Engine(packing, MPI.COMM_SELF) as engine:
        here = equilibrate(engine, Equilibrium(packing, packing.residual, rounding_floor(packing), 0), 0.0)
        times = []
        for k in range(1, 4):
            begin = clock()
            here = equilibrate(engine, here, 2 * k / len(packing))
            times.append(clock() - begin)
    return f"increments {times[1]:.1f} and {times[2]:.1f} s"


def main() -> None:
    """Print a line for each back end."""
    columns = int(sys.argv[1])
    packing = crystal(columns, columns)
    matrix = shifted(packing)
    own, never = sparse_lu.library, matrix.shape[0] + 1
    for name, smallest, library in (("L D L^T", never, own), ("SuperLU", never, lambda: None), ("MUMPS", 0, own)):
        sparse_lu.MUMPS_FROM, sparse_lu.library = smallest, library
        print(f"{name}: {len(packing)} disks, {factors(matrix, smallest == 0)}; {increment(packing)}", flush=True)


if __name__ == "__main__":
    main()
