"""A structure that changes within a record is reported, with the time of the change; a stationary one is not."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from daq import FloatArray, Recording
from monitor.analysis.states.stationarity import FrequencyChange, change_point, frequency_change
from oma.windows import identify_windows
from tests.support.monitor.cli import Commands
from tests.support.oma.structures import Structure, chain, simulate
from tests.support.thorough import few_of

CHAIN, RATE, SECONDS = chain(5, first=2.0), 40.0, 240.0
SHIFT = np.array([1.0, 0.3, 1.0, 0.0, 0.6])  # of the modes, of what the most sensitive one loses


def changed(shift: float, share: float, seed: int) -> Recording:
    """Return a record whose frequencies fall by `shift` after a share of it."""
    after = replace(CHAIN, frequency=CHAIN.frequency * (1 - shift * SHIFT))
    parts: list[tuple[Structure, float, int]] = [(CHAIN, share, seed), (after, 1 - share, 1000 + seed)]
    first, second = (simulate(s, SECONDS * part, RATE, n) for s, part, n in parts)
    return replace(first, data=np.concatenate([first.data, second.data]))


def found_in(recording: Recording, n_windows: int) -> FrequencyChange | None:
    n = len(recording.data) // n_windows
    windows = [
        replace(recording, data=recording.data[k : k + n], start=recording.start + round(k / RATE * 1e9))
        for k in range(0, n * n_windows, n)
    ]
    return frequency_change(identify_windows(windows), lambda: windows)


@pytest.mark.parametrize(("shift", "share", "n_windows"), few_of([(0.03, 0.75, 4), (0.012, 0.5, 1), (0.07, 0.5, 1)]))
def test_frequency_step_is_found_with_its_time_and_size(shift: float, share: float, n_windows: int) -> None:
    recording = changed(shift, share, 11)
    change = found_in(recording, n_windows)
    assert change is not None
    off = (change.time - recording.start) * 1e-9 - share * SECONDS
    assert abs(off) < 4 * change.time_std
    near = np.abs(np.log(change.before.frequency[:, None] / CHAIN.frequency)).argmin(axis=1)
    lost = 1 - change.after.frequency / change.before.frequency
    std = np.hypot(change.before.frequency_std, change.after.frequency_std) / change.before.frequency
    assert len(near) >= 4
    assert (np.abs(lost - shift * SHIFT[near]) < 4 * std).all()


@pytest.mark.parametrize("n_windows", [1, 8])
def test_stationary_record_has_no_frequency_change(n_windows: int) -> None:
    """Uneven forces and taps included; docs/howto/data/identify.md has the rate over many more records."""
    for seed in range(4):
        recording = simulate(CHAIN, SECONDS, RATE, seed, taps=10 * (seed % 2))
        louder = np.linspace(0.2 if seed % 3 else 1.0, 1.0, len(recording.data))[:, None]
        assert found_in(replace(recording, data=recording.data * louder), n_windows) is None, seed


def stepped(size: float, random: np.random.Generator) -> FloatArray:
    series = random.standard_normal((4, 30)) * random.lognormal(0, 0.5, 30)
    series[:, 18:] += size * random.choice([-1, 1], (4, 1))
    series[1, :5] = np.nan
    return series


def test_p_value_of_a_change_point_is_uniform_without_a_step() -> None:
    random = np.random.default_rng(3)
    p = np.array([change_point(stepped(0.0, random))[2] for _ in range(60)])
    assert np.mean(p < 0.1) < 0.1 + 3 * np.sqrt(0.09 / 60)
    assert 0.3 < np.mean(p < 0.5) < 0.7
    column, spread, probability = change_point(stepped(3.0, random))
    assert abs(column - 18) <= 1
    assert spread < 2
    assert probability < 1e-3


@pytest.mark.thorough
def test_identify_reports_the_time_of_change_in_the_example_log(modalwatch: Commands, tmp_path: Path) -> None:
    path = Path(__file__).parents[4] / "replay_data" / "t_frame_added_mass.mcap"
    event = 1767225733923178045  # ns UTC: replay_data/manifest.toml
    done = modalwatch("identify", path, "--json", tmp_path / "modes.json")
    assert (done.code, done.err) == (0, "")
    assert "the structure changed within the record, at 2026-01-01T00:02:1" in done.out
    change = json.loads((tmp_path / "modes.json").read_text())["window"]["change"]
    assert abs(change["time"] - event) < 4e9 * max(change["time_std"], 0.5)
    before, after = (np.array([f["value"] for f in change["frequencies"][side]]) for side in ("before", "after"))
    assert (after < before).all()  # mass was added
