"""Devices that are late: found from the phases of cross spectra, and no obstacle to identification."""

from dataclasses import replace

import numpy as np
import pytest

from daq import Channel, Recording
from oma import aligned, device_delays, identify_all, mac_matrix
from oma.errors import TooFewChannels
from tests.support.oma.structures import frame, simulate
from tests.support.thorough import few_of

LATE = {"beam_left": 4.1e-3, "beam_right": -2.3e-3}  # s: most of a period of the highest mode, 271 Hz
DEVICES = ("col_037", "col_074", "col_111", "beam_mid", "beam_left", "beam_right")
STEP = 4096 / 1000 / 2 / 65536  # s between the delays that are tried


def delayed(recording: Recording, late: dict[str, float]) -> Recording:
    return aligned(recording, {name: -late.get(name, 0.0) for name in DEVICES})


@pytest.mark.parametrize("seed", few_of([1, 2, 3]))
def test_device_delays_are_estimated_within_0_2_ms(seed: int) -> None:
    """Other windows scatter by 50 us, of noise; 0.2 ms leave modes up to 300 Hz as real as 0.87 (cos^2)."""
    found = device_delays(delayed(simulate(frame(), 40.0, 1000.0, seed), LATE))
    assert list(found) == sorted(DEVICES)
    assert found == pytest.approx({name: LATE.get(name, 0.0) for name in DEVICES}, abs=2e-4)


def test_number_of_modes_is_unaffected_by_device_delays() -> None:
    recording = simulate(frame(), 60.0, 1000.0, 4)
    plain, late = identify_all(recording), identify_all(delayed(recording, LATE))
    assert not any(plain.delays.values())
    assert late.delays["beam_left"] == pytest.approx(LATE["beam_left"], abs=2e-4)
    assert late.estimate.n_modes == plain.estimate.n_modes == 8
    np.testing.assert_allclose(late.estimate.frequency, plain.estimate.frequency, rtol=1e-3)
    assert np.all(np.diag(mac_matrix(late.estimate.shape, plain.estimate.shape)) > 0.95)


def test_small_delays_and_noise_device_are_not_corrected() -> None:
    recording = simulate(frame(), 40.0, 1000.0, 5)
    data = delayed(recording, {"beam_mid": 1e-4}).data
    data[:, -2:] = np.random.default_rng(6).standard_normal((len(data), 2))
    assert device_delays(replace(recording, data=data)) == dict.fromkeys(sorted(DEVICES), 0.0)


def test_time_shift_and_its_inverse_change_only_ends_and_gaps() -> None:
    recording = simulate(frame(), 5.0, 1000.0, 7)
    gap = recording.data.copy()
    gap[2000:2100, 8:10] = np.nan
    for data, n_lost in ((recording.data, 2 * 40), (gap, 2 * 40 + 40 + 100 + 40)):  # two shifts cost 4 + 16 each
        back = aligned(delayed(replace(recording, data=data), LATE), {n: LATE.get(n, 0.0) for n in DEVICES}).data
        lost = np.isnan(back)
        assert not lost[:, :8].any()
        assert lost[:, 8].sum() == n_lost
        there = ~lost & ~np.isnan(data)
        # the ends of a record of white noise ring in a band-limited shift: 1 / (pi 20) of a sample, 20 samples away
        np.testing.assert_allclose(back[there], data[there], atol=0.1 * float(np.nanstd(data)))


def test_delays_of_short_record_or_single_device_are_zero() -> None:
    recording = simulate(frame(), 1.0, 1000.0, 8)
    assert not any(device_delays(recording).values())
    alone = tuple(Channel(name=c.name, device="all", axis=0) for c in recording.channels)
    assert device_delays(replace(recording, channels=alone)) == {"all": 0.0}
    with pytest.raises(TooFewChannels):
        device_delays(replace(recording, data=np.zeros_like(recording.data)))
