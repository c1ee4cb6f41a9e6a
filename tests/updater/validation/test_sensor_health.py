"""Gain, polarity and delay of every channel at once, each with a deviation with the right coverage."""

from dataclasses import replace

import numpy as np
import pytest

from daq import FloatArray
from oma import ModalEstimate
from tests.support.thorough import few_of
from tests.support.updater.reference_frame import measure, t_frame, true_model
from updater import Model, build_model, learn_reference, matched, sensor_health, stack_tracks
from updater.validation import SensorHealth

TRACK = np.arange(8)
CHANNELS = t_frame().channels


def heard(model: Model, random: np.random.Generator, gain: FloatArray, late: FloatArray) -> ModalEstimate:
    found = measure(model, random, gain)
    return replace(found, shape=found.shape * np.exp(-2j * np.pi * found.frequency[:, None] * late))


def health(
    seed: int, gain: FloatArray, late: FloatArray, stiffness: float = 1.0, *, phases: bool = True
) -> SensorHealth:
    """Five windows with a baseline of eight; gains and delays change by factors and seconds (12,)."""
    random = np.random.default_rng(seed)
    own, before = 1 + 0.005 * random.standard_normal(12), 2e-5 * random.standard_normal(12)
    model = true_model(np.random.default_rng((seed, 1)))
    reference = learn_reference(t_frame(), [heard(model, random, own, before) for _ in range(8)], [TRACK] * 8)
    support = model.structure.support[0]
    softer = {axis: k * stiffness for axis, k in support.stiffness.items()}
    changed = model.structure.model_copy(update={"support": (support.model_copy(update={"stiffness": softer}),)})
    now = build_model(changed, shear_flexible=True, mass="consistent")
    windows = [heard(now, random, own * gain, before + late) for _ in range(5)]
    event = reference.mean_of(stack_tracks(windows, [TRACK] * 5))
    if not phases:
        event = replace(event, imaginary=np.full_like(event.imaginary, np.nan))
    return sensor_health(reference, event)


@pytest.mark.parametrize("rigs", few_of([4, 10]))
def test_stated_deviations_match_the_scatter(rigs: int) -> None:
    """Gains off by 2 % and delays by 0.05 ms at every channel, and a gross fault at one, of each rig.

    The data do not determine the scale of all channels along x relative to all along y: two errors per rig, of which n
    rigs have a mean square of 1 +- 1 / sqrt(n); three of that, and less than 5 % of all channels beyond three
    deviations.
    """
    off_gain, off_delay = [], []
    for seed in range(rigs):
        print(f"seed {seed}")
        random = np.random.default_rng((seed, 2))
        gain, late = np.exp(0.02 * random.standard_normal(12)), 5e-5 * random.standard_normal(12)
        gain[seed] *= 0.7
        late[(seed + 5) % 12] += 4e-4
        found = health(seed, gain, late)
        off_gain.append((found.gain - gain) / found.gain_std)
        off_delay.append((found.delay - late) / found.delay_std)
    for off in (np.array(off_gain), np.array(off_delay)):
        print(np.mean(off**2), np.max(np.abs(off)))
        assert 0.3 < np.mean(off**2) < 1 + 3 / np.sqrt(rigs)
        assert np.mean(np.abs(off) > 3) < 0.05


@pytest.mark.parametrize("stiffness", few_of([0.3, 1.0]))
def test_reversed_and_delayed_channels_are_found_for_any_foot_stiffness(stiffness: float) -> None:
    gain, late = np.ones(12), np.zeros(12)
    gain[3], gain[8], late[10] = -1.0, 0.8, 1e-3
    found = health(31, gain, late, stiffness)
    assert found.reversed == (CHANNELS[3],)
    assert np.all(np.abs(found.gain - gain) < 4 * found.gain_std)
    assert np.all(np.abs(found.delay - late) < 4 * found.delay_std)
    assert found.gain_std[8] < 0.05
    assert found.delay_std[10] < 5e-5


def test_device_delay_of_half_a_period_is_found() -> None:
    """Both channels of a device 2 ms late, half a period of the modes at 250 Hz; a third has no data."""
    gain, late = np.ones(12), np.zeros(12)
    pair = [CHANNELS.index("beam_left_y"), CHANNELS.index("beam_left_z")]
    gain[2], late[pair] = 0.0, 2e-3
    found = health(41, gain, late)
    assert not found.reversed
    assert np.all(np.abs(found.gain - gain) < 4 * found.gain_std)
    assert found.gain_std[2] < 0.05
    speaking = gain > 0
    assert np.all(np.abs(found.delay - late)[speaking] < 4 * found.delay_std[speaking])


def test_gains_are_found_where_phases_are_unknown() -> None:
    """As in tables of real mode shapes."""
    gain = np.ones(12)
    gain[3], gain[8] = -1.0, 0.8
    found = health(31, gain, np.zeros(12), phases=False)
    assert found.reversed == (CHANNELS[3],)
    assert np.all(np.abs(found.gain - gain) < 4 * found.gain_std)
    assert np.isnan(found.delay).all()


def test_delay_of_a_further_sensor_is_not_known() -> None:
    """The baseline has no phase of it to compare with."""
    random, bare = np.random.default_rng(521), true_model(np.random.default_rng(522))
    known = CHANNELS[:-2]

    def measured(channels: tuple[str, ...], n: int) -> list[ModalEstimate]:
        windows = [measure(bare, random, np.ones(12)) for _ in range(n)]
        k = len(channels)
        return [replace(w, channels=channels, shape=w.shape[:, :k], shape_std=w.shape_std[:, :k]) for w in windows]

    reference = learn_reference(t_frame(), measured(known, 8), [TRACK] * 8)
    event = matched(reference.baseline, reference.mean_of(stack_tracks(measured(CHANNELS, 5), [TRACK] * 5)))
    health = sensor_health(reference, event)
    assert health.channels == CHANNELS
    assert np.isnan(health.delay).tolist() == [False] * 10 + [True] * 2
    assert np.isnan(health.delay_std).tolist() == [False] * 10 + [True] * 2
    assert (np.abs(health.gain - 1) < 4 * health.gain_std).all()
