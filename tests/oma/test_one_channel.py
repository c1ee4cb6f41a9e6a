"""One channel alone: frequencies and damping, no shapes."""

from dataclasses import replace

import numpy as np
import pytest

from daq import Recording
from oma import METHODS, identify_all
from tests.support.oma.structures import chain, simulate
from tests.support.thorough import few_of

CHAIN = chain(4)


def one_channel(seed: int, column: int) -> Recording:
    recording = simulate(CHAIN, 600.0, 40.0, seed)
    return replace(recording, channels=recording.channels[column : column + 1], data=recording.data[:, [column]])


@pytest.mark.parametrize("draws", few_of([2, 4]))
@pytest.mark.parametrize("name", ["ssi-data", "fsdd"])
def test_all_modes_are_identified_from_one_channel(name: str, draws: int) -> None:
    z = []
    for seed, column in ((0, 0), (1, 3), (2, 0), (3, 3))[:draws]:
        estimate = identify_all(one_channel(seed, column), METHODS[name]()).estimate
        assert estimate.n_modes == 4, (seed, estimate.frequency)
        z.append((estimate.frequency - CHAIN.frequency) / estimate.frequency_std)
        z.append((estimate.damping - 0.01) / estimate.damping_std)
        np.testing.assert_allclose(np.abs(estimate.shape), 1.0)
    # stated deviations are real within 1.3, as measured; the rms of n normal values is 1 +- 1 / sqrt(2 n)
    assert np.sqrt(np.mean(np.square(z))) < 1.3 * (1 + 2.5 / np.sqrt(2 * np.size(z)))
