"""Signals of a view that has missed blocks, as after a restart of a device while its queue was full."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import rerun as rr

from daq import Block, Channel
from daq.timing import ScanClocks
from monitor.views.viewer.signals.traces import SignalStream
from tests.support.daq.blocks import START, make_block

CHANNELS = (Channel(name="left_y", device="left", axis=1),)


@pytest.mark.parametrize("clock", ["", "SYNC of a bus"])
def test_blocks_in_any_order_raise_no_error(clock: str) -> None:
    """The block that reports a restart of a device has been dropped; an hour is missing; a gap within a second."""
    recording = rr.RecordingStream("test", send_properties=False)
    stream = SignalStream(recording, CHANNELS)
    firsts = [900_000, 900_250, 0, 250, 500, 750, 1000, 5_000_000, 5_000_250, 5_000_400, 3, 253, 10**12, 10**12 + 250]
    for first in firsts * 2:
        stream.add(replace(make_block("left", first), clock=clock))
    stream.add(replace(make_block("left", 10**12 + 500), counts=np.zeros((250, 2), np.int32), clock=clock))
    for first in range(0, 2000, 250):
        stream.add(replace(make_block("left", first), clock=clock))


def test_restarted_device_gets_new_times_although_its_first_block_is_missing() -> None:
    """Scans are at their true times, and ascend: the clock from before the restart does not apply to them."""
    clocks, late = ScanClocks(), 3600 * 10**9
    blocks: list[Block] = [make_block("left", first) for first in range(100_000, 102_000, 250)]
    blocks += [make_block("left", first, late=late) for first in range(250, 2250, 250)]
    for block in blocks:
        clock = clocks.add(block)
    times = clock.times(np.arange(250, 2250))
    np.testing.assert_allclose(times, START + late + np.arange(250, 2250) * 10**6, atol=10**5)
    assert all(a < b for a, b in pairwise(times.tolist()))


def test_times_do_not_depend_on_neighbouring_indices() -> None:
    clocks = ScanClocks()
    for first in (0, 250, 500, 750):
        clock = clocks.add(make_block("left", first))
    index = np.array([999, 0, 10**9, 500])
    np.testing.assert_allclose(clock.times(index) - START, index * 1e6, atol=1e5)
