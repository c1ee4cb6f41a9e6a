"""Groups of poles: average linkage as that of scipy."""

import numpy as np
import pytest
from scipy.cluster import hierarchy
from scipy.spatial.distance import squareform

from oma.mac import mac_matrix
from oma.selection.selection import MIN_MEMBERS, groups

SHAPES = np.random.default_rng(0).standard_normal((12, 4)).astype(np.complex128)


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


@pytest.mark.parametrize("n_orders", [MIN_MEMBERS - 1, MIN_MEMBERS, 8])
def test_two_modes_of_the_same_orders_stay_apart(n_orders: int) -> None:
    """Two poles of one shape, 1 % apart, in every order: average linkage alone joins them."""
    order = np.repeat(np.arange(n_orders), 2)
    frequency = np.tile([10.0, 10.1], n_orders)
    shape = np.repeat(SHAPES[:1], len(order), axis=0)
    found = [group.tolist() for group in groups(frequency, shape, order, cut=0.04)]
    alone = list(range(len(order)))
    assert found == ([alone] if n_orders < MIN_MEMBERS else [alone[::2], alone[1::2]])
    apart = groups(frequency, shape, np.arange(len(order)), cut=0.04)  # the same poles, of different orders
    assert [group.tolist() for group in apart] == [alone]


def test_groups_do_not_depend_on_the_order_of_poles_and_ties() -> None:
    """Orders with both modes, one and none, poles permuted; every distance of a mode's poles is the same: 0."""
    random = np.random.default_rng(1)
    for _ in range(20):
        mode, order = np.nonzero(random.random((6, 16)) < 0.9)
        frequency, shape = np.array([5.0, 5.05, 8.0, 8.2, 8.4, 20.0])[mode], SHAPES[mode // 2]
        found = groups(frequency, shape, order, cut=0.04)
        turned = random.permutation(len(mode))
        again = groups(frequency[turned], shape[turned], order[turned], cut=0.04)
        assert sorted(group.tolist() for group in found) == sorted(np.sort(turned[g]).tolist() for g in again)
        assert sorted(map(tuple, found)) == sorted(tuple(np.flatnonzero(mode == k)) for k in range(6))


def test_a_shape_that_is_not_finite_is_a_group_of_its_own() -> None:
    shape = np.repeat(SHAPES[:1], 9, axis=0)
    shape[4] = np.nan
    found = groups(np.full(9, 10.0), shape, np.arange(9), cut=0.04)
    assert [group.tolist() for group in found] == [[0, 1, 2, 3, 5, 6, 7, 8], [4]]
