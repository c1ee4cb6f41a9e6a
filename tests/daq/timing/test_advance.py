"""An assembler that is advanced without counts has the clocks and window borders of one that makes the recordings."""

import copy
import pickle
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from daq import Assembler, Block, Channel, Event, Flag, Item, Recording
from daq.timing.scan_runs import UnreadCountsError
from tests.support.daq.blocks import START
from tests.support.thorough import few_of

RATES = {"a": 100.0, "b": 125.0}
CHANNELS = (
    Channel(name="a_x", device="a", axis=0),
    Channel(name="a_y", device="a", axis=1),
    Channel(name="b_z", device="b", axis=2),
)
_SECONDS = 120.0
_APART = 20  # items from one kept state to the next


def assembler(*, by_record: bool = True) -> Assembler:
    return Assembler(CHANNELS, RATES, window_seconds=6.0, step_seconds=3.0, by_record=by_record)


def history(random: np.random.Generator) -> list[Item]:
    """Return blocks and events of two devices: jitter, drift, gaps, losses with and without restart, common pauses."""
    pauses = [(at, at + random.uniform(0.3, 15.0)) for at in random.uniform(0, _SECONDS, 2)]
    items = [item for device in RATES for item in _of_device(device, pauses, random)]
    return sorted(items, key=lambda item: item.arrival_time if isinstance(item, Block) else item.time)


def _of_device(device: str, pauses: list[tuple[float, float]], random: np.random.Generator) -> Iterator[Item]:
    rate, drift = RATES[device], random.uniform(-1e-4, 1e-4)
    origin, index, flags, latest = 0.0, 0, Flag.RESTARTED, 0
    n_axes = 3
    while (time := origin + index / rate * (1 + drift)) < _SECONDS:
        n = int(random.integers(10, 40))
        event = random.random()
        if event < 0.01:  # lost, and later connected again, with new indices and perhaps fewer axes
            yield Event(
                topic="/event/device_failed", time=START + round((time + 0.1) * 1e9), payload={"device": device}
            )
            origin, index, flags = time + random.uniform(0.5, 20.0), 0, Flag.RESTARTED
            n_axes = int(random.integers(1, 4))
            continue
        if event < 0.03:  # a gap
            index += int(random.integers(1, 300))
            flags = Flag.AFTER_GAP
            continue
        counts = random.integers(-(1 << 20), 1 << 20, (n, n_axes), dtype=np.int32)
        arrival = START + round((time + n / rate + random.exponential(0.01)) * 1e9)
        latest = max(latest + 1, arrival)
        if not any(begin < time < end for begin, end in pauses):
            yield Block(
                device=device, rate=rate, first_index=index, counts=counts, scale=1e-6, arrival_index=index + n - 1,
                arrival_time=latest, temperature=random.uniform(10, 20), flags=flags,
            )  # fmt: skip
            flags = Flag.NONE
        index += n


def without_counts(item: Item) -> Item:
    return replace(item, counts=np.zeros_like(item.counts)) if isinstance(item, Block) else item


def pushed(target: Assembler, items: list[Item]) -> list[list[Recording]]:
    """Return the recordings that each item completes."""
    return [list(target.push(item) if isinstance(item, Block) else target.push_event(item)) for item in items]


def same(one: Recording, other: Recording) -> bool:
    return (one.start, one.gaps, one.temperature) == (other.start, other.gaps, other.temperature) and np.array_equal(
        one.data, other.data, equal_nan=True
    )


@pytest.mark.parametrize("by_record", [True, False])
@pytest.mark.parametrize("seed", few_of(range(40)))
def test_windows_after_an_advance_without_counts_are_those_of_the_whole(seed: int, by_record: bool) -> None:
    """From any item on: its state, and the blocks before it that are needed, give the same windows to the last bit."""
    random = np.random.default_rng(seed)
    items = history(random)
    whole = pushed(assembler(by_record=by_record), items)
    assert sum(map(len, whole)) > 10
    assert any(recording.gaps for some in whole for recording in some)
    blank = assembler(by_record=by_record)
    states = []
    for k, item in enumerate(items):
        if k % _APART == 0:
            states.append(pickle.dumps(blank))
        blank.advance(without_counts(item))
    for border in (_APART * random.integers(1, len(states), 4)).tolist():
        later: Assembler = pickle.loads(states[border // _APART])
        first = _first_needed(items[:border], later.n_needed()) // _APART * _APART
        state: Assembler = pickle.loads(states[first // _APART])
        state.mark()
        for item in items[first:border]:
            state.advance(item)
        state.refuse_marked()
        for found, expected in zip(pushed(state, items[border:]), whole[border:], strict=True):
            assert len(found) == len(expected)
            assert all(map(same, found, expected))


def _first_needed(items: list[Item], needed: dict[str, int]) -> int:
    """Return the first item such that as many blocks of each device follow."""
    missing = dict(needed)
    for k in range(len(items) - 1, -1, -1):
        if not any(n > 0 for n in missing.values()):
            return k + 1
        item = items[k]
        if isinstance(item, Block):
            missing[item.device] -= 1
    return 0


def test_window_that_needs_counts_that_were_not_read_is_an_error() -> None:
    """Not a window of zeros."""
    items = history(np.random.default_rng(1))
    blank = assembler()
    for item in items[:300]:
        blank.advance(without_counts(item))
    aware = copy.deepcopy(blank)
    aware.mark()
    aware.refuse_marked()
    with pytest.raises(UnreadCountsError, match="its counts were not read"):
        pushed(aware, items[300:])
