"""Delays of devices from phases: constants that windows share, and the wander of each window about them."""

import numpy as np
import pytest

from daq import FloatArray
from oma import ModalEstimate
from tests.support.updater.frames import t_frame
from updater import build_model, estimate_delays, learn_delays, remove_delays
from updater.modal_data import NO_DELAYS, DeviceDelays

MODEL = build_model(t_frame(), shear_flexible=True)
MODES = MODEL.modes(8)
CHANNELS = t_frame().channels
DEVICES = {channel: channel[:-2] for channel in CHANNELS}
NAMES = sorted(set(DEVICES.values()))
DELAYS = 1e-6 * np.array([-250, -50, 0, 40, 60, 200.0])  # [s], of NAMES; they sum to zero
PHASE_STD = 3e-3  # of an entry's imaginary part


def window(
    random: np.random.Generator, wander: float, *, stated: float = PHASE_STD, shared: FloatArray | float = 0.0
) -> tuple[ModalEstimate, FloatArray]:
    """Return a window's modes with delayed devices, and the delays (n_devices,), relative to their mean."""
    delay = DELAYS + wander * random.standard_normal(len(NAMES))
    tau = np.array([delay[NAMES.index(DEVICES[c])] for c in CHANNELS])
    shape = (MODEL.sensor_rows @ MODES.shape).T
    shape = shape / np.linalg.norm(shape, axis=1, keepdims=True)
    noise = PHASE_STD * (random.standard_normal(shape.shape) + 1j * random.standard_normal(shape.shape))
    late = (shape + noise + 1j * shared) * np.exp(-2j * np.pi * MODES.frequency[:, None] * tau)
    turned = late * np.exp(-0.5j * np.angle((late**2).sum(1)))[:, None]
    estimate = ModalEstimate(
        channels=CHANNELS,
        frequency=MODES.frequency,
        frequency_std=1e-3 * MODES.frequency,
        damping=np.full(8, 0.004),
        damping_std=np.full(8, 0.001),
        shape=turned / np.linalg.norm(turned, axis=1, keepdims=True),
        shape_std=np.full(shape.shape, stated),
        support=np.ones(8),
        law_ratio=np.ones(8),
        start=0,
        end=30 * 10**9,
    )
    return estimate, delay - delay.mean()


def error(estimate: ModalEstimate, truth: FloatArray, known: DeviceDelays) -> float:
    """Return the rms error of a window's delays [s]."""
    found = estimate_delays(estimate, DEVICES, known)
    return float(np.sqrt(np.mean((np.array([found[name] for name in NAMES]) - truth) ** 2)))


@pytest.mark.parametrize("stated", [1.0, 0.5], ids=["phases as sure as stated", "half as sure"])
def test_constant_delays_are_recovered_within_their_deviation(stated: float) -> None:
    """Chi-square of 5 free delays over 40 baselines: 200 +- 20 if the deviation is right; within 4 of that."""
    random = np.random.default_rng(3)
    chi_square = 0.0
    for _ in range(40):
        learnt = learn_delays([window(random, 50e-6, stated=stated * PHASE_STD)[0] for _ in range(10)], DEVICES)
        assert list(learnt.seconds) == NAMES
        off = np.array(list(learnt.seconds.values())) - DELAYS
        # deviations about a common mean have 5/6 of a free one's variance, six of them five degrees of freedom
        chi_square += float((off**2 / np.array(list(learnt.std.values())) ** 2).sum()) * 5 / 6
    # the deviation is learned from 10 windows (45 degrees of freedom), as in an F of that kind: mean 45 / 43
    assert chi_square == pytest.approx(200 * 45 / 43, abs=4 * 20 * np.sqrt(1 + 5 / 45) * 45 / 43)


def test_delay_deviations_have_correct_coverage_with_common_shape_errors() -> None:
    """Shapes that are off by as much as a window's noise, in all windows alike: 40 baselines of 30 windows.

    Of 200 free delays 190 +- 3 are within 1.96 deviations if these are right and known; the jackknife determines them
    to 1 / sqrt(2 x 5 x 7) = 12 % of 8 modes, of which the upper ones count most. With the noise alone the coverage is
    65 %.
    """
    random = np.random.default_rng(8)
    held = 0.0
    for _ in range(40):
        shared = PHASE_STD * random.standard_normal((8, len(CHANNELS)))
        learnt = learn_delays([window(random, 0.0, shared=shared)[0] for _ in range(30)], DEVICES)
        off = np.array(list(learnt.seconds.values())) - DELAYS
        held += float(np.mean(np.abs(off) <= 1.96 * np.array(list(learnt.std.values())))) / 40
    assert 0.87 < held < 0.99


@pytest.mark.parametrize("wander", [20e-6, 100e-6])
def test_delay_wander_is_separated_from_noise(wander: float) -> None:
    """12 windows, 5 free devices: 55 degrees of freedom determine a deviation to 1 / sqrt(110) = 10 %."""
    random = np.random.default_rng(4)
    learnt = learn_delays([window(random, wander)[0] for _ in range(12)], DEVICES)
    assert learnt.wander == pytest.approx(wander, rel=4 * 0.1)


def test_learnt_delays_improve_stable_clocks_without_harming_wandering_clocks() -> None:
    random = np.random.default_rng(5)
    gain = {}
    for wander in (0.0, 100e-6):
        learnt = learn_delays([window(random, wander)[0] for _ in range(12)], DEVICES)
        later = [window(random, wander) for _ in range(30)]
        alone, drawn = (np.mean([error(e, t, known) for e, t in later]) for known in (NO_DELAYS, learnt))
        gain[wander] = drawn / alone
    assert gain[0.0] < 0.6  # the noise of 12 windows' mean: 1 / sqrt(12) = 0.3, and what is left of the wander
    assert gain[100e-6] < 1.02


@pytest.mark.parametrize("late", [0.96e-3, 1.86e-3, 9e-3])
def test_delays_of_several_periods_are_as_accurate_as_small_delays(late: float) -> None:
    """A quarter, half and two and a half periods at 267 Hz; a large one costs nothing of a window's 3 to 10 us."""
    estimate, _ = window(np.random.default_rng(6), 0.0)
    delayed = remove_delays(estimate, DEVICES, {name: -late * (name == "beam_mid") for name in NAMES})
    truth = np.array([late * (name == "beam_mid") for name in NAMES]) + DELAYS
    small, large = error(estimate, DELAYS, NO_DELAYS), error(delayed, truth - truth.mean(), NO_DELAYS)
    assert small < 2e-5
    assert large == pytest.approx(small, rel=0.01)


def test_single_device_has_no_relative_delay() -> None:
    estimate, _ = window(np.random.default_rng(7), 0.0)
    assert learn_delays([estimate] * 3, dict.fromkeys(CHANNELS, "all")) is NO_DELAYS
    assert estimate_delays(estimate, dict.fromkeys(CHANNELS, "all")) == {"all": pytest.approx(0, abs=1e-15)}
