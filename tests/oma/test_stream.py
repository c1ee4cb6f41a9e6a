"""Identification of a stream, and by chosen references."""

import numpy as np
import pytest

from oma import CovarianceSSI, DataSSI, IdentificationStream, TooShort, identify, mac_matrix
from oma.errors import TooFewChannels
from tests.support.oma.structures import chain, frame, simulate
from tests.support.thorough import few_of

BAND = (1.0, 20.0)


@pytest.mark.parametrize("seed", few_of(range(2)))
def test_rolling_window_is_unaffected_by_dropped_blocks(seed: int) -> None:
    before, now = simulate(chain(first=2.2), 240.0, 50.0, seed), simulate(chain(), 300.0, 50.0, seed + 100)
    names = tuple(channel.name for channel in now.channels)
    rolling = IdentificationStream(names, 50.0, BAND, start=before.start)
    for block in (*np.array_split(before.data, 24), *np.array_split(now.data, 30)):
        rolling.add(block)
    rolling.drop(24)
    found = rolling.identify().estimate
    assert found.start - before.start == 240 * 10**9
    assert found.end - found.start == 300 * 10**9
    only = IdentificationStream(names, 50.0, BAND)
    for block in np.array_split(now.data, 30):
        only.add(block)
    expected = only.identify().estimate
    assert found.n_modes == expected.n_modes == 6
    # products across the seam, a lag span of 0.7 s in 300 s, are all that is left of the time before
    assert (np.abs(found.frequency - expected.frequency) < 0.3 * expected.frequency_std).all()
    assert (np.abs(found.damping - expected.damping) < 0.3 * expected.damping_std).all()


@pytest.mark.parametrize("method", [CovarianceSSI, DataSSI])
@pytest.mark.parametrize("seed", few_of(range(2)))
def test_modes_are_identified_with_two_reference_channels(method: type[CovarianceSSI], seed: int) -> None:
    truth = frame()
    found = identify(simulate(truth, 60.0, 1000.0, seed), method(references=("beam_left_y", "beam_left_z")))
    agreement = mac_matrix(found.shape, truth.shapes)
    partner = np.argmax(agreement, axis=1)
    assert len(set(partner)) == len(partner) >= 6  # what the two hardly see may be missed, but nothing is made up
    assert (np.abs(found.frequency - truth.frequency[partner]) < 5 * found.frequency_std).all()


def test_missing_reference_channels_are_refused() -> None:
    with pytest.raises(TooFewChannels, match="roof: a reference that is not there or carries no signal"):
        identify(simulate(chain(), 60.0, 50.0, 0), DataSSI(references=("roof",)))


def test_stream_of_ten_samples_is_too_short() -> None:
    stream = IdentificationStream(("a", "b"), 50.0, BAND)
    stream.add(np.zeros((10, 2)))
    with pytest.raises(TooShort):
        stream.identify()


def test_identification_leaves_global_state_and_output_unchanged(capfd: pytest.CaptureFixture[str]) -> None:
    np.random.seed(5)  # noqa: NPY002 - the global state is what must stay
    before = np.random.get_state(legacy=False)["state"]["key"].copy(), np.geterr()  # noqa: NPY002
    identify(simulate(chain(), 300.0, 50.0, 0))
    after = np.random.get_state(legacy=False)["state"]["key"], np.geterr()  # noqa: NPY002
    assert np.array_equal(before[0], after[0])
    assert before[1] == after[1]
    assert capfd.readouterr() == ("", "")
