"""Files of this folder, written by pyNastran 1.4.1 (with numpy below 2, in an environment of its own).

A cantilever of four beam elements, clamped by stiffness alone: KGG and MGG of six rows per grid point.
"""

import numpy as np
from pyNastran.bdf.bdf import BDF
from pyNastran.op2.result_objects.matrix import Matrix
from pyNastran.op4.op4 import OP4

LENGTH, ELEMENTS, E, G, RHO, A, SECOND, TORSION = 1.0, 4, 70e9, 26e9, 2700.0, 4e-4, 1.3e-8, 2.2e-8


def element(h: float) -> tuple[np.ndarray, np.ndarray]:
    """Return stiffness and mass (12, 12) of an Euler-Bernoulli element along x."""
    k, m = np.zeros((12, 12)), np.zeros((12, 12))
    for rows, stiffness, mass in (([0, 6], E * A, RHO * A), ([3, 9], G * TORSION, RHO * TORSION)):
        k[np.ix_(rows, rows)] = stiffness / h * np.array([[1, -1], [-1, 1]])
        m[np.ix_(rows, rows)] = mass * h / 6 * np.array([[2, 1], [1, 2]])
    bending = np.array([[12, 6, -12, 6], [6, 4, -6, 2], [-12, -6, 12, -6], [6, 2, -6, 4]], float)
    inertia = np.array([[156, 22, 54, -13], [22, 4, 13, -3], [54, 13, 156, -22], [-13, -3, -22, 4]], float)
    for rows, sign in (([1, 5, 7, 11], 1.0), ([2, 4, 8, 10], -1.0)):
        size = np.array([1, sign * h, 1, sign * h])
        k[np.ix_(rows, rows)] += E * SECOND / h**3 * bending * np.outer(size, size)
        m[np.ix_(rows, rows)] += RHO * A * h / 420 * inertia * np.outer(size, size)
    return k, m


n = 6 * (ELEMENTS + 1)
stiffness, mass = np.zeros((n, n)), np.zeros((n, n))
for e in range(ELEMENTS):
    here = slice(6 * e, 6 * e + 12)
    k, m = element(LENGTH / ELEMENTS)
    stiffness[here, here] += k
    mass[here, here] += m
for name, values in (("KGG", stiffness), ("MGG", mass)):
    matrix = Matrix(name, 6)
    matrix.data = values
    OP4(log=None, debug=False).write_op4(f"{name.lower()}.op4", {name: matrix}, precision="double", is_binary=False)
model = BDF(debug=False)
for node in range(ELEMENTS + 1):
    model.add_grid(10 * (node + 1), [LENGTH * node / ELEMENTS, 0.0, 0.0])
model.write_bdf("beam.bdf", size=8)
