import numpy as np
import pytest

from daq import FloatArray
from daq.drivers import EPSON_SCALE
from monitor.rig import DeviceSource
from tests.support.monitor.rig import ORIGIN, QUIET, SineWorld, nominal

#: -80 dB, and what rounding to counts adds to a tone of 1 m/s2: it is below -120 dB
STOP = 1e-4


def measure(
    world: SineWorld, n: int, *, rate: float = 1000.0, start: int = ORIGIN, seed: int = 0, **truth: object
) -> FloatArray:
    source = DeviceSource(world, nominal(seed, QUIET | truth), 2)
    source.start(start, rate)
    return np.asarray(source.read(0, n) * EPSON_SCALE)


def expected(world: SineWorld, n: int, *, rate: float = 1000.0, start: int = ORIGIN) -> FloatArray:
    delay = (round(16 * world.rate / rate) + 3) / world.rate  # of the linear-phase filter, in whole simulated samples
    return world.at((start - ORIGIN) * 1e-9 + np.arange(n) / rate - delay)


@pytest.mark.parametrize("rate", [1000.0, 200.0, 50.0])
@pytest.mark.parametrize("share", [0.52, 0.60, 0.75, 1.0, 1.5, 1.9])
def test_aliasing_frequencies_are_attenuated_by_80_db(rate: float, share: float) -> None:
    n = 2 * round(rate)
    assert np.abs(measure(SineWorld(share * rate), n, rate=rate)).max() < STOP


@pytest.mark.parametrize("rate", [1000.0, 200.0])
@pytest.mark.parametrize("share", [0.01, 0.1, 0.2, 0.271, 0.35])
def test_signal_in_the_passband_is_unchanged(rate: float, share: float) -> None:
    # 0.0009 dB of ripple (Kaiser window, -81 dB) and the interpolation, see `interpolate`: -77 dB at 350 Hz
    world = SineWorld(share * rate)
    interpolation = (2 * np.pi * world.frequency / world.rate) ** 6 / 720 * (0.5 * 1.5 * 2.5) ** 2
    error = measure(world, 2000, rate=rate) - expected(world, 2000, rate=rate)[:, None]
    assert np.abs(error).max() < 1e-4 + interpolation


@pytest.mark.parametrize("error", [-20e-6, 37e-6, 1e-3])
@pytest.mark.parametrize("start", [0, 123_456_789, 1_000_000_007])
def test_scans_are_taken_at_times_of_the_device_clock(error: float, start: int) -> None:
    # -70 dB at the highest mode: 1e-3 of clock error alone would be 500 turns of 360 degrees x 1e-3 = 3 rad after 2 s
    world = SineWorld(271.0)
    when = {"rate": 1000.0 * (1 + error), "start": ORIGIN + start}
    found, wanted = measure(world, 2000, **when), expected(world, 2000, **when)  # type: ignore[arg-type]
    assert np.abs(found - wanted[:, None]).max() < 10 ** (-70 / 20)


def test_counts_are_rounded_to_the_nearest_integer() -> None:
    world = SineWorld(20.0, amplitude=10 * EPSON_SCALE)
    counts = measure(world, 1000) / EPSON_SCALE
    np.testing.assert_allclose(counts, np.round(counts), atol=1e-9)
    assert np.abs(counts - expected(world, 1000)[:, None] / EPSON_SCALE).max() < 0.5 + 10 * 1e-4
    assert len(np.unique(np.round(counts))) == 21


def test_noise_has_the_specified_density() -> None:
    n, density = 20_000, 2e-6
    noise = measure(SineWorld(1.0, amplitude=0.0), n, noise_density=density)
    rms = np.hypot(density * np.sqrt(500), EPSON_SCALE / np.sqrt(12))  # one-sided, up to half the rate; and rounding
    np.testing.assert_allclose(noise.std(0), rms, rtol=4 / np.sqrt(2 * n))  # four standard deviations
    correlation = np.asarray(np.corrcoef(noise.T))[np.triu_indices(3, 1)]
    assert np.abs(correlation).max() < 4 / np.sqrt(n)


def test_gains_scatter_as_specified_and_are_constant() -> None:
    world = SineWorld(20.0)
    wanted = expected(world, 500)
    gains = []
    for seed in range(100):
        found = measure(world, 500, seed=seed, gain_scatter=0.005)
        gain = wanted @ found / (wanted @ wanted)
        np.testing.assert_allclose(found, wanted[:, None] * gain, atol=2e-4)
        gains.append(gain)
    scatter = np.std(gains)  # of 300: its relative standard deviation is 1 / sqrt(600)
    assert scatter == pytest.approx(0.005, rel=4 / np.sqrt(600))
    assert abs(np.mean(gains) - 1) < 4 * 0.005 / np.sqrt(300)


def test_a_device_can_be_started_again() -> None:
    world = SineWorld(20.0)
    source = DeviceSource(world, nominal(0, QUIET), 0)
    source.start(ORIGIN, 1000.0)
    source.read(0, 777)
    source.start(ORIGIN + 5_000_000_000, 500.0)
    again = source.read(0, 300) * EPSON_SCALE
    wanted = expected(world, 300, rate=500.0, start=ORIGIN + 5_000_000_000)
    np.testing.assert_allclose(again, np.repeat(wanted[:, None], 3, axis=1), atol=2e-4)


def test_scans_must_be_read_in_order() -> None:
    source = DeviceSource(SineWorld(20.0), nominal(), 0)
    source.start(ORIGIN, 1000.0)
    source.read(0, 10)
    with pytest.raises(ValueError, match="scans: expected the next one, 10, found 20"):
        source.read(20, 10)


@pytest.mark.parametrize("rate", [2000.0, 20.0])
def test_unsupported_rates_are_refused(rate: float) -> None:
    with pytest.raises(ValueError, match=f"rate: expected 32 to 1000 Hz, found {rate:g}"):
        DeviceSource(SineWorld(20.0), nominal(), 0).start(ORIGIN, rate)
