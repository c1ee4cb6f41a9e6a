"""Channels that are not synchronous though they are said to be of one device."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from daq import Channel, Recording, write_recording
from oma import aligned, identify_all, mpc
from tests.support.monitor.cli import Commands
from tests.support.oma.structures import frame, simulate
from tests.support.thorough import few_of
from updater.modal_data import asynchrony

LATE = {"col_037": 1.0e-3, "col_074": 2.2e-3, "beam_left": 5.0e-3}  # s


def merged(late: dict[str, float], seed: int) -> Recording:
    """Return the frame's channels, those of some devices late, all as channels of one device."""
    recording = simulate(frame(), 40.0, 1000.0, seed)
    shifted = aligned(recording, {c.device: -late.get(c.device, 0.0) for c in recording.channels})
    channels = tuple(Channel(name=c.name, device="all", axis=i) for i, c in enumerate(recording.channels))
    return replace(shifted, channels=channels, data=shifted.data[50:-50])


@pytest.mark.parametrize("seed", few_of(range(3)))
def test_delays_of_asynchronous_channels_are_found(seed: int) -> None:
    recording = merged(LATE, seed)
    estimate = identify_all(recording).estimate
    assert np.median(mpc(estimate.shape)) < 0.6
    found = asynchrony(recording, estimate)
    assert found is not None
    assert found.mpc_synchronous > 0.95
    true = {c.name: LATE.get(c.name.rsplit("_", 1)[0], 0.0) for c in recording.channels}  # the median channel has none
    for name, late in true.items():
        value, std = found.delays.get(name, (0.0, 2e-5))
        assert abs(value - late) < 4 * std, name


@pytest.mark.parametrize("seed", few_of(range(3)))
def test_synchronous_channels_have_no_delays(seed: int) -> None:
    recording = merged({}, seed)
    estimate = identify_all(recording).estimate
    assert asynchrony(recording, estimate) is None
    random = np.random.default_rng(seed)
    twisted = estimate.shape * np.exp(1j * random.uniform(0, np.pi, estimate.shape.shape))
    assert asynchrony(recording, replace(estimate, shape=twisted)) is None  # not real, but not for any delays


def test_complex_shapes_of_asynchronous_channels_are_marked(modalwatch: Commands, tmp_path: Path) -> None:
    write_recording(tmp_path / "log.mcap", merged(LATE, 3))
    done = modalwatch("identify", tmp_path / "log.mcap", "--json", tmp_path / "modes.json")
    assert (done.code, done.err) == (0, "")
    assert "! 0." in done.out
    assert "! MPC below 0.7: the channels do not move in phase" in done.out
    assert "channels are not synchronous: beam_left_" in done.out
    delays = json.loads((tmp_path / "modes.json").read_text())["window"]["delays"]
    assert delays["beam_left_y"]["value"] == pytest.approx(5e-3, abs=1e-4)
    assert set(delays) == {f"{place}_{axis}" for place in ("col_037", "col_074") for axis in "xy"} | {
        "beam_left_y",
        "beam_left_z",
    }
