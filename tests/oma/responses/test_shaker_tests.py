"""Modes of simulated tests with two shakers at once, weighed by multiple coherences as universal files have them."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from daq.files import FrequencyResponses, read_responses
from oma import identify_responses_all
from tests.support.daq.responses import MULTIPLE, frequency_response, write_sets
from tests.support.oma.impact_test import REFERENCES, tower
from tests.support.oma.shaker_test import ShakerTest

TRUTH = tower()
POOR = ShakerTest(poor=2)
N_TESTS = 2
N_NOISE = 16


def as_read(path: Path, test: ShakerTest, seed: int) -> FrequencyResponses:
    """Return a test that was written to a universal file and read from it; channel k is node k + 1."""
    line, response, multiple = test.h1(TRUTH, seed)
    sets: list[Any] = []
    for node in range(response.shape[1]):
        places: list[dict[str, Any]] = [{"rsp_node": node + 1, "ref_node": force + 1} for force in REFERENCES]
        sets += [frequency_response(response[:, node, k], line, **place) for k, place in enumerate(places)]
        sets.append(frequency_response(multiple[:, node], line, rsp_node=node + 1, **MULTIPLE))
    return read_responses(write_sets(path, sets))


def test_poor_sensor_weighs_less_by_its_multiple_coherence(tmp_path: Path) -> None:
    """One of eight sensors has ten times the noise: 62 ppm without, 15 ppm with coherences in ten tests (measured)."""
    print(f"seeds 0 to {N_TESTS - 1}")
    error: dict[bool, list[float]] = {False: [], True: []}
    for seed in range(N_TESTS):
        read = as_read(tmp_path / "test.uff", POOR, seed)
        for known in (None, read.coherence):
            found = identify_responses_all(
                read.frequency, read.response, read.outputs, read.inputs, (2.0, 75.0), coherence=known
            )
            assert found.weighted is (known is not None)
            error[found.weighted] += (found.estimate.frequency / TRUTH.frequency - 1).tolist()
    without, weighed = (float(np.sqrt(np.mean(np.square(error[known])))) for known in (False, True))
    print(f"{1e6 * without:.1f} ppm, {1e6 * weighed:.1f} ppm with coherences")
    assert weighed < 0.5 * without


@pytest.mark.thorough
def test_noise_of_responses_follows_from_multiple_coherences(tmp_path: Path) -> None:
    """Of each output and force alike: the median over lines of the variance over that of the coherence is one number.

    The variance of 16 tests scatters by 37 % of a line, the median of 600 lines by 2 %: five of these are allowed.
    """
    print(f"seeds 0 to {N_NOISE - 1}")
    read = [as_read(tmp_path / "test.uff", POOR, seed) for seed in range(N_NOISE)]
    response = np.array([one.response for one in read])
    stated = [(1 / one.coherence - 1) * np.abs(one.response) ** 2 for one in read if one.coherence is not None]
    ratio = np.median(response.var(axis=0, ddof=1) / np.mean(stated, axis=0), axis=0)
    print(ratio / np.median(ratio))
    assert (np.abs(np.log(ratio / np.median(ratio))) < 0.1).all()
