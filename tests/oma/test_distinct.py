import numpy as np
import pytest

from oma.selection import Mode, Selection, distinct

SHAPE = np.array([0.6, 0.8, 0.0], dtype=np.complex128)
TURNED = np.array([0.6, 0.6, 0.53], dtype=np.complex128)  # MAC 0.7
ACROSS = np.array([0.8, -0.6, 0.0], dtype=np.complex128)


def mode(frequency: float, shape: np.ndarray, support: float) -> Mode:
    return Mode(
        frequency=frequency,
        frequency_std=0.02,
        damping=0.01,
        damping_std=0.002,
        shape=shape,
        shape_std=np.full(3, 0.1),
        support=support,
        law_ratio=1.0,
        frequency_moves=np.zeros(30),
    )


@pytest.mark.parametrize(
    ("frequency", "shape", "support", "n"),
    [
        (10.02, TURNED, 0.4, 1),  # within the scatter, alike, and no order shows both: one
        (10.02, TURNED, 0.7, 2),  # some orders show both
        (10.05, TURNED, 0.4, 1),  # 1.8 standard deviations of the difference
        (10.06, TURNED, 0.4, 2),  # farther than the scatter
        (10.02, ACROSS, 0.4, 2),  # another shape
        (10.15, SHAPE, 0.9, 1),  # 1.5 % and the same shape: seen at two rates
        (10.30, SHAPE, 0.9, 2),
    ],
)
def test_only_duplicate_modes_are_removed(frequency: float, shape: np.ndarray, support: float, n: int) -> None:
    assert len(distinct([mode(10.0, SHAPE, 0.5), mode(frequency, shape, support)], Selection())) == n
