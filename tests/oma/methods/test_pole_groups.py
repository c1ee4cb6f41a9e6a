"""Groups of poles: average linkage as that of scipy."""

import numpy as np
from scipy.cluster import hierarchy
from scipy.spatial.distance import squareform

from oma.mac import mac_matrix
from oma.selection.selection import groups


def test_groups_of_different_orders_are_those_of_average_linkage() -> None:
    random = np.random.default_rng(0)
    for n in random.integers(2, 120, 40).tolist():
        mode = random.integers(0, 12, n)
        frequency = random.uniform(1, 20, 12)[mode] * (1 + 0.01 * random.standard_normal(n))
        shape = random.standard_normal((12, 4))[mode] + 0.1 * random.standard_normal((n, 4)) + 0j
        found = groups(frequency, shape, np.arange(n), cut=0.04)  # no two poles of one model
        difference = np.abs(frequency[:, None] - frequency) / np.maximum(frequency[:, None], frequency)
        distance = difference + np.clip(1 - mac_matrix(shape, shape), 0, None)
        tree = hierarchy.average(squareform((distance + distance.T) / 2, checks=False))
        label = hierarchy.fcluster(tree, 0.04, criterion="distance")
        expected = sorted(np.flatnonzero(label == k).tolist() for k in np.unique(label))
        assert sorted(group.tolist() for group in found) == expected
