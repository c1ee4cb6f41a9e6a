import numpy as np
import pytest
from oma_helpers import frame, simulate

from oma import identify, mac_matrix


@pytest.mark.parametrize("seed", range(3))
def test_all_eight_modes_of_a_frame_are_found_and_none_false(seed: int) -> None:
    truth = frame()
    found = identify(simulate(truth, 60.0, 1000.0, seed))
    assert found.n_modes == 8
    # 6 standard deviations of the law: the method's own efficiency is about 1.3
    law = np.sqrt(truth.frequency * truth.damping / (2 * np.pi * 60.0))
    assert np.all(np.abs(found.frequency - truth.frequency) < 6 * law)
    assert np.all(np.diag(mac_matrix(found.shape, truth.shapes)) > 0.95)
