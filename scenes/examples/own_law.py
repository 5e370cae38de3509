# A column of two disks with a contact law of one's own: the analysis needs forces and derivatives, and no law.
# python own_law.py
"""A column of two disks with a law that no program has.

Two disks stand one above the other on a plane, under a weight. The law is f_n = k a (exp(overlap / a) - 1), with a
tangential spring k_t. The two vertical modes are known: their eigenvalues are (3 -+ sqrt 5)/2 times k_n / m. One
eigenvalue is negative: the column falls over.
"""

import numpy as np

from faultgouge.analysis import Configuration, LinearisedContacts, spectrum

K, A, K_T, WEIGHT, RADIUS = 1e4, 0.01, 3e3, 2.0, 0.5

overlap = A * np.log(1 + WEIGHT / (K * A))  # where the law gives the weight
stiffness = K * np.exp(overlap / A)  # d f_n / d overlap
zero, up = np.zeros(2), np.array([[0, 1, 0], [0, 1, 0]])
contacts = LinearisedContacts(
    i=[0, 1],  # the lower disk with the plane, the upper disk with the lower one
    j=[-1, 0],
    normal=up,
    distance=[np.inf, 2 * RADIUS - overlap],
    overlap=[overlap, overlap],
    slip_arm=np.full((2, 2), RADIUS),
    lever_arm=np.full((2, 2), RADIUS),
    lever_slope=zero,
    normal_force=[WEIGHT, WEIGHT],
    tangential_force=np.zeros((2, 3)),
    normal_stiffness=[stiffness, stiffness],
    tangential_stiffness=[K_T, K_T],
    closing=np.zeros((2, 3)),
    parting=np.zeros((2, 3)),
    friction=[0.5 * WEIGHT, 0.5 * WEIGHT],
    sliding=[False, False],
    normal_dashpot=zero,
    tangential_dashpot=zero,
)
load = np.zeros((2, 2, 3))
load[1, 0, 1] = -WEIGHT
column = Configuration(
    dimension=2,
    position=np.array([[0, RADIUS - overlap], [0, 3 * RADIUS - 2 * overlap]]),
    radius=np.full(2, RADIUS),
    mass=np.ones(2),
    inertia=np.full(2, 0.5 * RADIUS**2),
    contacts=contacts,
    box=np.diag([4.0, 4.0, 1.0]),
    origin=np.array([-2.0, 0.0, -0.5]),
    periodic=np.zeros(3, bool),
    load=load,
)
found = np.sort(spectrum(column).eigenvalues.real)
print(f"residual {column.residual:.1e}, eigenvalues {found.round(2).tolist()}")
print("vertical modes:", *(f"{stiffness * (3 + sign * 5**0.5) / 2:.2f}" for sign in (-1, 1)))
