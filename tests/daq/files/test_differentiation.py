import numpy as np
import pytest

from daq import Channel, FloatArray, Gap, Recording
from daq.files import differentiated

RATE = 100.0
TIME = np.arange(1000) / RATE


def recording(*columns: FloatArray) -> Recording:
    channels = tuple(Channel(name=name, device=name, axis=0) for name, _ in zip("abc", columns, strict=False))
    return Recording(channels=channels, data=np.column_stack(columns), rate=RATE, start=0)


@pytest.mark.parametrize(("frequency", "within"), [(0.5, 1e-3), (5.0, 1e-4), (20.0, 1e-4), (42.0, 1e-4)])
def test_derivative_of_sine_is_cosine(frequency: float, within: float) -> None:
    omega = 2 * np.pi * frequency
    found = differentiated(recording(np.sin(omega * TIME), np.sin(omega * TIME)), ["b"]).data
    np.testing.assert_array_equal(found[:, 0], np.sin(omega * TIME))
    np.testing.assert_allclose(found[32:-32, 1], omega * np.cos(omega * TIME)[32:-32], atol=within * omega)
    assert np.isnan(found[:32, 1]).all()
    assert np.isnan(found[-32:, 1]).all()


def test_gap_is_widened_by_half_the_filter_length() -> None:
    velocity = 3.0 * TIME
    velocity[500:510] = np.nan
    found = differentiated(recording(velocity, TIME), ["a"])
    assert Gap(device="a", start=500 - 32, stop=510 + 32) in found.gaps
    # of a constant acceleration: at frequency zero the filter is 1.2e-3 too large
    assert np.nanmax(np.abs(found.data[:, 0] - 3.0)) < 4e-3


def test_unknown_channel_or_too_short_record_is_refused() -> None:
    with pytest.raises(ValueError, match="expected some of a, found 'z'"):
        differentiated(recording(TIME), ["z"])
    with pytest.raises(ValueError, match="at least 65 samples to differentiate, found 1"):
        differentiated(recording(TIME[:1]), ["a"])
