"""Faulty channels: named, excluded or repaired, and the results of the others are right."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from daq import Channel, FloatArray, Recording
from oma import IdentificationError, channel_faults, identify_all
from oma.preparation import cleaned
from oma.preparation.faults import without_spikes
from tests.support.oma.scenes import FAULTS, SCENES, faulty, pairs
from tests.support.oma.structures import chain, simulate

SCENE, SEED = SCENES["short"], 11
GIVEN_UP = {
    "dead": {"mass_3": "constant"},
    "lost": {"mass_3": "0% of the samples are there"},
    "drift": {"mass_3": "wanders: "},
    "clipped": {"mass_3": "clipped: "},
    "copy": {"mass_3": "the same as mass_6", "mass_6": "the same as mass_3"},
}
MENDED = {"spikes": {"mass_3": "spikes: 1."}, "scattered": {f"mass_{i}": "gaps: " for i in range(1, 9)}}
MENDED["overdriven"] = {"mass_3": "clipped: "}
MENDED["gaps"] = {f"mass_{i}": "gaps: " for i in (3, 5, 8)}  # where this seed puts them

UNHARMED: dict[str, dict[str, str]] = {"warming": {}}


@cache
def window() -> Recording:
    return SCENE.record(SEED)


@pytest.mark.parametrize("fault", FAULTS)
def test_channel_fault_is_reported_and_biases_no_mode(fault: str) -> None:
    found = identify_all(faulty(window(), fault, SEED))
    reported = {name: state for name, state in found.channels.items() if state != "ok"}
    expected = (GIVEN_UP | MENDED | UNHARMED)[fault]
    assert reported.keys() == expected.keys()
    assert all(reported[name].startswith(start) for name, start in expected.items())
    assert set(found.estimate.channels) == set(found.channels) - set(GIVEN_UP.get(fault, {}))
    kept = [SCENE.structure.channels.index(name) for name in found.estimate.channels]
    truth = replace(SCENE.structure, shapes=SCENE.structure.shapes[:, kept])
    couples = pairs(found.estimate.frequency, found.estimate.shape, truth)
    assert len(couples) == found.estimate.n_modes == 8
    for i, j in couples:
        # 16 errors a fault, ten faults: one in 1e5 beyond 4.5 standard deviations of thirty blocks each
        assert abs(found.estimate.frequency[i] - truth.frequency[j]) < 4.5 * found.estimate.frequency_std[i]
        assert abs(found.estimate.damping[i] - truth.damping[j]) < 4.5 * found.estimate.damping_std[i]


@pytest.mark.parametrize("seed", range(5))
def test_fault_free_channels_have_no_reported_fault(seed: int) -> None:
    recording = simulate(chain(), 60.0, 50.0, seed, noise=0.01)
    assert channel_faults(recording) == {}
    coarse = 0.2 * recording.data.std()  # a converter of few levels piles up nothing at its highest one
    assert channel_faults(replace(recording, data=coarse * np.round(recording.data / coarse))) == {}


def test_impacts_on_all_channels_are_not_spikes() -> None:
    recording = simulate(chain(), 60.0, 50.0, 3, noise=0.01, taps=20)
    assert channel_faults(recording) == {}


@pytest.mark.parametrize("seed", range(3))
def test_gain_is_restored_after_clipping_of_one_percent(seed: int) -> None:
    """Clipping takes its share of the samples off the gain, replacing them gives at least three quarters back."""
    recording = simulate(chain(), 60.0, 50.0, seed, noise=0.01)
    data = recording.data.copy()
    limit = np.quantile(np.abs(data[:, 4]), 0.99)
    clipped = np.clip(data[:, 4], -limit, limit)
    mended = data.copy()
    mended[:, 4] = clipped
    cleaned_data = cleaned(replace(recording, data=mended)).recording.data
    loss, left = (1 - data[:, 4] @ x / (data[:, 4] @ data[:, 4]) for x in (clipped, cleaned_data[:, 4]))
    print(f"seed {seed}: gain lost {loss:.4f}, after filling {left:.4f}")
    assert 0.005 < loss < 0.02
    assert abs(left) < 0.25 * loss


def test_spike_is_removed_with_adjacent_samples() -> None:
    data = window().data.copy()
    data[1000, 4] += 50 * data[:, 4].std()
    mended, taken = without_spikes(data)
    assert np.flatnonzero(np.isnan(mended[:, 4])).tolist() == [998, 999, 1000, 1001, 1002]
    assert taken[4] == 5 / len(data)
    assert not np.isnan(np.delete(mended, 4, axis=1)).any()


@pytest.mark.parametrize("between", range(4, 13))
def test_spikes_near_each_other_and_at_the_ends_are_removed_each_with_its_neighbours(between: int) -> None:
    data = window().data.copy()
    spikes = {4: (1, 1000), 2: (1000 + between, len(data) - 2)}
    for channel, places in spikes.items():
        data[list(places), channel] += 50 * data[:, channel].std()
    mended, taken = without_spikes(data.copy(), in_place=True)
    expected = {c: sorted({i + k for i in spikes[c] for k in range(-2, 3)} & {*range(len(data))}) for c in spikes}
    for channel, lost in expected.items():
        assert np.flatnonzero(np.isnan(mended[:, channel])).tolist() == lost
        assert taken[channel] == len(lost) / len(data)
    assert not np.isnan(np.delete(mended, [2, 4], axis=1)).any()


def test_channel_with_many_spikes_is_excluded() -> None:
    data = window().data.copy()
    data[::40, 4] += 50 * data[:, 4].std()  # with neighbours an eighth of the samples
    found = identify_all(replace(window(), data=data))
    assert found.channels["mass_5"].startswith("spikes: 12.")
    assert "mass_5" not in found.estimate.channels


def test_window_quality_is_reported() -> None:
    found = identify_all(window())
    assert found.quality.complete == 1.0
    assert found.quality.cycles == pytest.approx(60 * 2.0, rel=0.02)
    assert found.quality.remarks == (
        f"{found.quality.cycles:.0f} periods of the lowest mode: use longer windows for its damping",
    )
    growing = replace(window(), data=window().data * np.linspace(0.05, 1, 6000)[:, None] ** 2)
    assert any("varies" in remark for remark in identify_all(growing).quality.remarks)


@pytest.mark.parametrize(
    ("data", "says"),
    [
        (np.full((6000, 3), 9.81), r"0 usable channels, 2 needed \([^:]*, [^:]*: constant\)"),
        (np.zeros((6000, 3)), "0 usable channels, 2 needed .*constant"),
        (np.full((6000, 3), np.nan), "0 usable channels, 2 needed .*0% of the samples"),
        (np.full((6000, 3), np.inf), "0 usable channels, 2 needed .*0% of the samples"),
        (np.random.default_rng(0).standard_normal((6000, 1)), "no resonance is visible"),
        (np.full((6000, 1), 9.81), r"0 usable channels, 1 needed \(c0: constant\)"),
        (np.random.default_rng(0).standard_normal((6000, 2)) * [1.0, 0.0], "1 usable channels, 2 needed"),
        (
            np.random.default_rng(0).standard_normal((6000, 1)) * [1.0, -2.0],
            "0 usable channels, 2 needed .*the same as",
        ),
        (np.empty((6000, 0)), "0 usable channels, 2 needed"),
        (np.empty((0, 3)), "too short"),
        (np.random.default_rng(0).standard_normal((400, 3)), "too short: at least"),
    ],
)
def test_unusable_recording_gives_one_line_error(data: FloatArray, says: str) -> None:
    channels = tuple(Channel(name=f"c{i}", device="d", axis=0) for i in range(data.shape[1]))
    with pytest.raises(IdentificationError, match=says) as caught:
        identify_all(Recording(channels=channels, data=data, rate=100.0, start=0))
    assert "\n" not in str(caught.value)
