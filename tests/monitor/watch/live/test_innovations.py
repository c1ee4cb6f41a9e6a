"""Innovations of the modes, on the signals of a virtual rig with clocks of its own."""

import gc
import logging
from collections.abc import Iterable
from copy import deepcopy
from dataclasses import dataclass, replace
from math import ceil

import numpy as np
import pytest

from daq import Block, Recording
from monitor.results.innovations import ModeInnovations
from monitor.results.windows import ReferenceResult, Result, WindowResult
from monitor.rig import draw_t_frame
from monitor.settings import Settings
from monitor.watch.live.innovations import InnovationMonitor
from monitor.watch.live.levels import is_calm
from monitor.watch.pipeline import Pipeline
from tests.support.monitor.rig import ORIGIN, rig_blocks, rig_settings, t_frame
from updater import Reference

SEED = 101
LEARNED, CHANGE, END = 270.0, 280.3, 292.0  # s
WINDOW = 20.0  # s


@dataclass(frozen=True)
class Learned:
    """A monitor that has learned the signals of a rig, and the blocks that follow."""

    monitor: InnovationMonitor
    before: list[ModeInnovations]
    earlier: list[Block]
    later: list[Block]
    settings: Settings
    reference: Reference
    reported: ReferenceResult
    calm: WindowResult

    def innovations(self, blocks: Iterable[Block]) -> list[ModeInnovations]:
        """Return the innovations of the last blocks; nothing more is learned."""
        monitor = deepcopy(self.monitor)
        return [one for block in blocks for one in monitor.push(block)]

    def started(self, settings: Settings | None = None, reference: Reference | None = None) -> InnovationMonitor:
        """Return a monitor that has a reference, and no signals yet."""
        monitor = InnovationMonitor(settings or self.settings, lambda: reference or self.reference)
        monitor.take(self.reported)
        return monitor

    @property
    def windows(self) -> list[list[Block]]:
        """Earlier blocks, window by window."""
        found: dict[int, list[Block]] = {}
        for block in self.earlier:
            found.setdefault(int((block.arrival_time - ORIGIN) * 1e-9 // WINDOW), []).append(block)
        return list(found.values())

    @property
    def unchanged(self) -> list[Block]:
        """Blocks before the change."""
        return [block for block in self.later if block.arrival_time < ORIGIN + CHANGE * 1e9]


def seconds_of(innovations: ModeInnovations) -> float:
    return (innovations.time - ORIGIN) * 1e-9


@pytest.fixture(scope="module")
def learned() -> Learned:
    print(f"seed {SEED}")
    scenario = draw_t_frame("t_structure", SEED, duration=0, between=(CHANGE, CHANGE))
    settings = rig_settings(scenario, window=WINDOW, baseline_windows=8)
    pipeline = Pipeline(t_frame(), settings)
    monitor = InnovationMonitor(settings, lambda: pipeline.reference)
    found: list[ModeInnovations] = []
    earlier: list[Block] = []
    later: list[Block] = []
    results: list[Result] = []
    for block in rig_blocks(scenario, END):
        if block.arrival_time > ORIGIN + LEARNED * 1e9:
            later.append(block)
            continue
        earlier.append(block)
        found += monitor.push(block)
        for result in pipeline.push(block):
            monitor.take(result)
            results.append(result)
    reported = next(one for one in results if isinstance(one, ReferenceResult))
    calm = next(one for one in results if isinstance(one, WindowResult) and is_calm(one))
    assert pipeline.reference
    return Learned(monitor, found, earlier, later, settings, pipeline.reference, reported, calm)


def test_change_is_visible_within_seconds_and_nothing_before_it(learned: Learned) -> None:
    """164 g on 7.5 kg; docs/validation/detection/innovations.md has the rate of exceedances and other masses."""
    found = learned.before + learned.innovations(learned.later)
    before = [one for one in found if seconds_of(one) < CHANGE]
    after = [one for one in found if seconds_of(one) > CHANGE]
    assert len(before) > 20
    assert not any(one.over for one in before)
    first = next(one for one in after if one.over)
    assert seconds_of(first) < CHANGE + 4
    assert np.mean([one.over for one in after]) > 0.5
    numbers = {mode.id: mode.frequency for mode in learned.reported.modes}
    assert sorted(first.mode) == sorted(numbers)
    np.testing.assert_allclose(first.frequency, [numbers[mode] for mode in first.mode], rtol=1e-6)
    assert 0.8 < np.median([one.level for one in before]) < 1.25


def test_level_of_the_excitation_is_no_change(learned: Learned) -> None:
    """Signals of twice the size, offsets too: the power about a mode is relative to that of all innovations.

    The step excites the band-pass filter, three periods of 6.5 Hz.
    """
    loud = [replace(block, counts=2 * block.counts) for block in learned.unchanged]
    found = [one for one in learned.innovations(loud) if seconds_of(one) > LEARNED + 2]
    assert len(found) > 5
    assert not any(one.over for one in found)
    assert 1.6 < np.median([one.level for one in found]) < 2.4


def test_filter_starts_again_after_a_gap(learned: Learned) -> None:
    device, begin, end = learned.later[0].device, *(ORIGIN + t * 1e9 for t in (274.0, 274.5))
    kept = [block for block in learned.unchanged if not (block.device == device and begin < block.arrival_time < end)]
    found = learned.innovations(kept)
    assert not any(one.over for one in found)
    assert not any(274.5 < seconds_of(one) < 275 for one in found)
    assert any(seconds_of(one) > 277 for one in found)


def test_signals_of_the_baseline_are_learned_too(learned: Learned) -> None:
    """160 s of baseline: 60 s for the filter, the rest for its levels; a change right after the baseline is visible.

    The results are in the order of the pipeline: the last window of the baseline, the reference, then each window
    behind its blocks.
    """
    monitor = InnovationMonitor(learned.settings, lambda: learned.reference)
    for blocks in learned.windows[:8]:
        assert not [one for block in blocks for one in monitor.push(block)]
        monitor.take(learned.calm)
    monitor.take(learned.reported)
    alarm = learned.calm.model_copy(update={"phase": "alarm"})
    found: list[list[ModeInnovations]] = []
    for blocks in learned.windows[8:10]:
        found.append([one for block in blocks for one in monitor.push(block)])
        monitor.take(alarm)
    assert [len(of_window) > WINDOW / 2 for of_window in found] == [True, True]
    assert not any(one.over for of_window in found for one in of_window)


def n_recordings() -> int:
    """Return the number of recordings in memory."""
    return sum(isinstance(one, Recording) for one in gc.get_objects())


def test_memory_is_bounded_with_a_gap_in_each_window(learned: Learned) -> None:
    """The filter is never learned; blocks before the last gap are discarded, so that the work is bounded too."""
    monitor = learned.started()
    gc.collect()
    before, kept = n_recordings(), []
    for blocks in learned.windows:
        for block in [*blocks[:200], *blocks[204:]]:  # one block of each of the four devices is missing
            assert not list(monitor.push(block))
        monitor.take(learned.calm)
        kept.append(n_recordings() - before)
    print(kept)
    assert len(kept) == ceil(LEARNED / WINDOW)
    assert max(kept) < 3 * WINDOW  # of 1 s: the stretch since the last gap, and the last window
    monitor.take(learned.calm.model_copy(update={"phase": "alarm"}))
    assert n_recordings() <= before + 2  # those of the assembler


def found_in(learned: Learned, monitor: InnovationMonitor) -> list[ModeInnovations]:
    """Return the innovations of the earlier signals, all windows calm."""
    found: list[ModeInnovations] = []
    for blocks in learned.windows:
        found += [one for block in blocks for one in monitor.push(block)]
        monitor.take(learned.calm)
    return found


def test_innovations_exist_with_a_model_and_twelve_channels(learned: Learned) -> None:
    """The counterpart of the three tests below: one per second after 200 s, in which filter and levels are learned."""
    assert len(learned.settings.channels) == 12
    assert len(found_in(learned, learned.started())) == pytest.approx(LEARNED - 200, abs=WINDOW / 2)


def test_without_a_model_there_are_no_innovations(learned: Learned) -> None:
    monitor = InnovationMonitor(learned.settings, lambda: None)
    monitor.take(learned.reported)
    assert not found_in(learned, monitor)


def test_more_than_twelve_channels_have_no_innovations(learned: Learned) -> None:
    """The model has the first twelve; the thirteenth is another axis that was recorded."""
    *others, last = learned.settings.device
    (unused,) = {"x", "y", "z"} - set(last.channels)
    device = last.model_copy(update={"channels": {**last.channels, unused: "thirteenth"}})
    settings = learned.settings.model_copy(update={"device": (*others, device)})
    assert len(settings.channels) == 13
    assert not found_in(learned, learned.started(settings))


def test_two_measured_places_have_no_innovations(learned: Learned, caplog: pytest.LogCaptureFixture) -> None:
    """The errors of the shapes cannot be estimated; the reason is logged once."""
    kept = [name for name in learned.reference.baseline.channels if name.startswith(("beam_left", "beam_right"))]
    reference = learned.reference.without([name for name in learned.reference.baseline.channels if name not in kept])
    with caplog.at_level(logging.INFO):
        assert not found_in(learned, learned.started(reference=reference))
    (record,) = [one for one in caplog.records if "innovations" in one.message]
    assert record.message == "no innovations of the modes: measured places: expected at least 3, found 2"
