import itertools

import numpy as np
import pytest

from oma import pair_modes
from oma.tracking.pairing import assign


def test_pairing_is_one_to_one_for_equal_mac() -> None:
    """Two model modes with the same shape at the sensors: frequency distinguishes them."""
    shape = np.array([[1.0, 0.0, 0.2], [1.0, 0.0, 0.2]])
    paired = pair_modes(np.array([10.0, 50.0]), shape, np.array([10.5, 49.0, 80.0]), np.vstack([shape, [[0, 1.0, 0]]]))
    assert paired.tolist() == [0, 1]


def test_mode_without_partner_is_left_unpaired() -> None:
    paired = pair_modes(
        np.array([10.0]), np.array([[1.0, 0.0]]), np.array([10.0, 11.0]), np.array([[0.0, 1.0], [0.1, 1.0]])
    )
    assert paired.tolist() == [-1]


@pytest.mark.parametrize("moves", [0.0, 1e-14, 1e-4])
def test_model_mode_without_motion_at_sensors_is_not_paired(moves: float) -> None:
    """Nor though it has a small part of the neighbouring mode, and is nearer to the measured one."""
    measured = np.array([[0.6, 0.8]])
    model = np.array([[0.6 * moves, 0.8 * moves], [0.5, 0.9]])  # the first moves across the sensors
    assert pair_modes(np.array([10.0]), measured, np.array([10.0, 10.5]), model).tolist() == [1]


@pytest.mark.parametrize("share", [0.1, 0.3, 1.0])
def test_assignment_has_most_pairs_and_of_these_least_cost(share: float) -> None:
    """Compared with all permutations, with and without a choice."""
    random = np.random.default_rng(3)
    for n_columns in (3, 4) * 20:
        cost, possible = random.random((4, n_columns)), random.random((4, n_columns)) < share
        columns = assign(cost, possible)
        rows = np.flatnonzero(columns >= 0)
        assert possible[rows, columns[rows]].all()
        assert len(set(columns[rows])) == len(rows)
        every = []
        for order in itertools.permutations(range(4), n_columns):
            pairs = possible[list(order), range(n_columns)]
            every.append((-pairs.sum(), cost[list(order), range(n_columns)][pairs].sum()))
        assert (-len(rows), cost[rows, columns[rows]].sum()) == pytest.approx(min(every))
