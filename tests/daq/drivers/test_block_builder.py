"""Scans into blocks: exact gaps, harmless false counters, indices that continue over a restart."""

import itertools
from collections.abc import Iterable, Iterator

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given

from daq import Block, Flag, IntArray, Scans
from daq.drivers.block_builder import BlockBuilder
from tests.support.thorough import few_of

START = 1_767_225_600_000_000_000  # ns UTC
RATE = 1000.0
N = 250


def cut(
    index: IntArray, reads: Iterable[int], *, first_counter: int = 65_400, blocks: BlockBuilder | None = None
) -> Iterator[Block]:
    """Yield blocks of scans whose counts are their indices, a number per read, 0.2 ms after the last one."""
    blocks = BlockBuilder("d", RATE, 1.0, 1 << 16, N) if blocks is None else blocks
    start = now = 0
    for n in reads:
        part = index[start : start + n]
        if len(part):
            now = START + int(part.max()) * 1_000_000 + 200_000
            counter = ((part + first_counter) % 65536).astype(np.int32)
            yield from blocks.add(Scans(part[:, None].astype(np.int32), counter, 20.0, 0), now)
        start += n
    yield from blocks.flush(now)


def assert_true(blocks: list[Block]) -> None:
    """Assert that every scan has its own index and no arrival is before its scan."""
    for block in blocks:
        np.testing.assert_array_equal(block.counts[:, 0], block.first_index + np.arange(block.n_scans))
        assert block.arrival_time >= START + block.arrival_index * 1_000_000
        assert block.first_index <= block.arrival_index < block.end_index


gaps = st.lists(st.tuples(st.integers(1, 300), st.integers(0, 200_000)), min_size=1, max_size=12)


@given(gaps, st.lists(st.integers(1, 80), min_size=1, max_size=5))
def test_gaps_are_exact_over_any_number_of_counter_wraps(runs: list[tuple[int, int]], reads: list[int]) -> None:
    parts, at = [], 0
    for n, missing in runs:
        parts.append(np.arange(at, at + n, dtype=np.int32))
        # The device's counter cannot tell a gap of a whole round from none, nor a read which of its scans are old.
        at += n + (missing if missing % 65536 else missing + 1)
    blocks: list[Block] = []
    index = np.concatenate(parts)
    sizes = [n for part in parts for n in _sizes(len(part), reads)]
    blocks.extend(cut(index, sizes))
    assert_true(blocks)
    assert sum(b.n_scans for b in blocks) == len(index)
    after = [b.first_index for b in blocks if b.flags & Flag.AFTER_GAP]
    assert after == [int(b[0]) for a, b in itertools.pairwise(parts) if b[0] != a[-1] + 1]


def _sizes(total: int, reads: list[int]) -> Iterator[int]:
    k = 0
    while total > 0:
        yield min(reads[k % len(reads)], total)
        total -= reads[k % len(reads)]
        k += 1


def test_gap_within_one_read_is_exact() -> None:
    index = np.concatenate([np.arange(105), np.arange(107, 900), np.arange(5_000, 5_010)]).astype(np.int32)
    blocks = list(cut(index, [50] * 30))
    assert_true(blocks)
    assert [(b.first_index, b.end_index) for b in blocks if b.flags & Flag.AFTER_GAP] == [
        (107, 352),
        (5000, 5010),
    ]  # a block ends with the read that brings it nearest to its length


def test_scans_buffered_during_stall_keep_their_indices() -> None:
    index = np.concatenate([np.arange(500), np.arange(90_000, 90_300)]).astype(np.int32)
    blocks = list(cut(index, [100, 100, 250, 100, 250]))  # the fourth read: 50 old scans, then new ones
    assert_true(blocks)
    assert sum(b.n_scans for b in blocks) == len(index)


@pytest.mark.parametrize("false", few_of([1, 32_769, -3, 12_345, 60_000], 3))
@pytest.mark.parametrize("at", few_of([2_003, 2_000, 2_009]))  # first, amid, last of a read
def test_wrong_counter_value_loses_at_most_two_reads(false: int, at: int) -> None:
    blocks = BlockBuilder("d", RATE, 1.0, 1 << 16, N)
    found: list[Block] = []
    for start in range(0, 80_000, 10):
        index = np.arange(start, start + 10, dtype=np.int32)
        counter = index % 65536
        counter[index == at] = (at + false) % 65536
        now = START + int(index[-1]) * 1_000_000 + 200_000
        found.extend(blocks.add(Scans(index[:, None], counter, 20.0, 0), now))
    index = np.concatenate([np.arange(b.first_index, b.end_index) for b in found])
    counts = np.concatenate([b.counts[:, 0] for b in found])
    assert np.count_nonzero(counts != index) <= 1  # the false one itself
    assert len(counts) >= 80_000 - N - 20  # two reads around it, and what no block holds yet
    assert all(b.arrival_time >= START + b.arrival_index * 1_000_000 for b in found)


def test_block_arrival_time_is_from_the_least_delayed_read() -> None:
    blocks = BlockBuilder("d", RATE, 1.0, 1 << 16, 100)
    late = [900_000, 300_000, 100_000, 700_000]
    found: list[Block] = []
    for k, extra in enumerate(late):
        index = np.arange(25 * k, 25 * k + 25, dtype=np.int32)
        now = START + int(index[-1]) * 1_000_000 + extra
        found.extend(blocks.add(Scans(index[:, None], index, 20.0, 0), now))
    assert [(b.arrival_index, b.arrival_time) for b in found] == [(74, START + 74_000_000 + 100_000)]


def test_block_with_damaged_bytes_is_flagged() -> None:
    blocks = BlockBuilder("d", RATE, 1.0, 1 << 16, 10)
    index = np.arange(10, dtype=np.int32)
    (first,) = blocks.add(Scans(index[:, None], index, 20.0, 24), START)
    (second,) = blocks.add(Scans(index[:, None] + 10, index + 10, 20.0, 0), START + 10_000_000)
    assert (first.flags, second.flags) == (Flag.BAD_FRAMES, Flag.NONE)


def test_indices_continue_by_host_clock_after_restart() -> None:
    blocks = BlockBuilder("d", RATE, 1.0, 1 << 16, N)
    before = list(cut(np.arange(600, dtype=np.int32), [100] * 6, blocks=blocks))
    assert [b.n_scans for b in before] == [200, 200, 200]
    blocks.restart(START + 5_000_000_000)
    scans = np.arange(100, dtype=np.int32)
    after: list[Block] = []
    for k in range(6):
        now = START + 5_000_000_000 + 100_000_000 * (k + 1)
        after.extend(blocks.add(Scans(scans[:, None], 40_000 + 100 * k + scans, 20.0, 0), now))
    assert [b.flags for b in after] == [Flag.RESTARTED, Flag.NONE, Flag.NONE]
    assert [b.n_scans for b in after] == [200, 200, 200]
    assert after[0].first_index == pytest.approx(5_000, abs=2)
    assert after[1].first_index == after[0].end_index
