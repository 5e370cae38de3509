"""Sparse matrices whose eigenvalues are known."""

import numpy as np
from scipy.linalg import block_diag
from scipy.sparse import csr_array, eye_array

from faultgouge.analysis import Contacts, MindlinLaw, Packing
from faultgouge.analysis.arrays import derive_frozen


def turned(blocks, rng):
    """A sparse matrix with the eigenvalues of numbers and small blocks on the diagonal, turned by rotations of random
    planes."""
    matrix = csr_array(block_diag(*blocks))
    size = matrix.shape[0]
    for _ in range(3):
        pairs = rng.permutation(size)[: size // 2 * 2].reshape(-1, 2)
        angle = rng.uniform(0, 2 * np.pi, len(pairs))
        turn = eye_array(size).tolil()
        for (i, j), a in zip(pairs, angle, strict=True):
            turn[i, i] = turn[j, j] = np.cos(a)
            turn[i, j], turn[j, i] = np.sin(a), -np.sin(a)
        turn = csr_array(turn)
        matrix = csr_array(turn @ matrix @ turn.T)
    return matrix


def complex_block(real, imaginary):
    return np.array([[real, imaginary], [-imaginary, real]])


def of_stiffness(matrix, damping=None):
    """Disks of unit masses with this K and C, whose contacts are not known."""
    count, none = matrix.shape[0] // 3, csr_array(matrix.shape)
    law, contacts = MindlinLaw(1.0, 1.0, 1.0), Contacts([], [], [])
    disks = Packing(position=np.zeros((count, 2)), radius=np.ones(count), contacts=contacts, law=law).configuration
    return derive_frozen(disks, stiffness=matrix, damping=none if damping is None else damping)
