"""Innovations of the modes, on the signals of a virtual rig with clocks of its own."""

from collections.abc import Iterable
from copy import deepcopy
from dataclasses import dataclass, replace

import numpy as np
import pytest

from daq import Block
from monitor.results.innovations import ModeInnovations
from monitor.rig import draw_t_frame
from monitor.watch.live.innovations import InnovationMonitor
from monitor.watch.pipeline import Pipeline
from tests.support.monitor.rig import ORIGIN, rig_blocks, rig_settings, t_frame

SEED = 101
LEARNED, CHANGE, END = 390.0, 400.3, 412.0  # s


@dataclass(frozen=True)
class Learned:
    """A monitor that has learned the signals of a rig, and the blocks that follow."""

    monitor: InnovationMonitor
    before: list[ModeInnovations]
    later: list[Block]

    def innovations(self, blocks: Iterable[Block]) -> list[ModeInnovations]:
        """Return the innovations of the last blocks; nothing more is learned."""
        monitor = deepcopy(self.monitor)
        return [one for block in blocks for one in monitor.push(block)]

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
    settings = rig_settings(scenario, window=20.0, baseline_windows=8)
    pipeline = Pipeline(t_frame(), settings)
    monitor = InnovationMonitor(settings, lambda: pipeline.reference)
    found: list[ModeInnovations] = []
    later: list[Block] = []
    for block in rig_blocks(scenario, END):
        if block.arrival_time > ORIGIN + LEARNED * 1e9:
            later.append(block)
            continue
        found += monitor.push(block)
        for result in pipeline.push(block):
            monitor.take(result)
    return Learned(monitor, found, later)


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
    device, begin, end = learned.later[0].device, *(ORIGIN + t * 1e9 for t in (394.0, 394.5))
    kept = [block for block in learned.unchanged if not (block.device == device and begin < block.arrival_time < end)]
    found = learned.innovations(kept)
    assert not any(one.over for one in found)
    assert not any(394.5 < seconds_of(one) < 395 for one in found)
    assert any(seconds_of(one) > 397 for one in found)


def test_without_a_model_there_are_no_innovations(learned: Learned) -> None:
    scenario = draw_t_frame("t_structure", SEED, duration=0, between=None)
    monitor = InnovationMonitor(rig_settings(scenario, window=20.0, baseline_windows=8), lambda: None)
    assert not [one for block in learned.later for one in monitor.push(block)]
