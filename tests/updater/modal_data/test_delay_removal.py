"""The whitener of phases without one mode, and delays put back where they are news."""

import numpy as np
import pytest

from oma import ModalEstimate
from tests.support.updater.reference_frame import measure, t_frame, true_model
from updater import remove_delays
from updater.inference import without_mode
from updater.modal_data import DeviceDelays, remove_device_delays, without_known

CHANNELS = t_frame().channels
DEVICES = {channel: channel.rsplit("_", 1)[0] for channel in CHANNELS}


@pytest.mark.parametrize("seed", range(3))
def test_whitener_without_a_mode_matches_the_remaining_covariance(seed: int) -> None:
    """Three modes, four channels, errors that all share: the inverse of the others' own covariance remains."""
    random = np.random.default_rng(seed)
    root = random.standard_normal((12, 12))
    covariance = root @ root.T + np.eye(12)
    found = without_mode(np.linalg.inv(np.linalg.cholesky(covariance)), 1, 4)
    others = np.r_[0:4, 8:12]
    expected = np.zeros((12, 12))
    expected[np.ix_(others, others)] = np.linalg.inv(covariance[np.ix_(others, others)])
    np.testing.assert_allclose(found.T @ found, expected, atol=1e-9)


def windows(random: np.random.Generator, late: dict[str, float], n: int) -> list[ModalEstimate]:
    model = true_model(np.random.default_rng(7))
    back = {device: -tau for device, tau in late.items()}
    return [remove_delays(measure(model, random, np.ones(12)), DEVICES, back) for _ in range(n)]


def apart(estimate: ModalEstimate, device: str) -> float:
    """Mean slope of the phase of a device's channels against the others' over frequency, as a delay [s]."""
    own = np.array([DEVICES[c] == device for c in estimate.channels])
    parts = [estimate.shape[:, chosen] for chosen in (own, ~own)]
    phase = np.array([np.angle((part**2).sum(1)) / 2 for part in parts])
    off = (phase[0] - phase[1] + np.pi / 2) % np.pi - np.pi / 2
    weight = estimate.frequency * np.minimum(*(np.linalg.norm(part, axis=1) for part in parts))
    return float(-(weight * off).sum() / (weight * 2 * np.pi * estimate.frequency).sum())


def test_device_delay_beyond_its_baseline_value_is_restored() -> None:
    """0.1 ms before, 0.5 ms now; identification took 0.3 ms out of each window already."""
    random = np.random.default_rng(11)
    taken = dict.fromkeys(DEVICES.values(), 0.0) | {"col_074": 3e-4}
    now = windows(random, dict.fromkeys(taken, 0.0) | {"col_074": 5e-4 - 3e-4}, 4)
    found = remove_device_delays(now, [taken] * 4, DEVICES)
    assert all(abs(apart(e, "col_074")) < 2e-5 for e in found.estimates)
    before = DeviceDelays(
        seconds=dict.fromkeys(taken, 0.0) | {"col_074": 1e-4}, std=dict.fromkeys(taken, 0.0), wander=0.0, noise_factor=1
    )
    with_new_delays = found.with_new_delays(before)
    assert with_new_delays is not None
    assert np.mean([apart(e, "col_074") for e in with_new_delays]) == pytest.approx(4e-4, abs=2e-5)


def test_known_channel_delays_are_removed_completely() -> None:
    """A device 0.5 ms late of which identification removed 0.3 ms, and the structure file states 0.5 ms."""
    random = np.random.default_rng(12)
    (window,) = windows(random, dict.fromkeys(DEVICES.values(), 0.0) | {"beam_left": 2e-4}, 1)
    late = {c: 5e-4 if DEVICES[c] == "beam_left" else 0.0 for c in CHANNELS}
    own, removed = without_known(window, {"beam_left": 3e-4}, DEVICES, late)
    found = remove_device_delays([own] * 3, [removed] * 3, DEVICES)
    assert abs(apart(found.estimates[0], "beam_left")) < 2e-5
    known = DeviceDelays(seconds=dict.fromkeys(DEVICES.values(), 0.0), std={}, wander=1e-5, noise_factor=1)
    assert found.with_new_delays(known) is None
