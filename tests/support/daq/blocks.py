"""Blocks and readings that tests of daq share."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from daq import Block, Event, Flag, Item, McapWriter
from daq.drivers import EPSON_SCALE

START = 1_767_225_600_000_000_000  #: ns UTC


@dataclass
class HandClock:
    """A clock that is set by hand."""

    time: int = START
    speed: float = 1000.0  # so that time-outs of wall time are short

    def now(self, _: int = 0) -> int:
        return self.time


def make_block(device: str, first: int, *, n: int = 250, seed: int = 0, late: int = 0) -> Block:
    """Return a block of random counts over all of int32; its last scan arrives `late` ns after its time."""
    counts = np.random.default_rng([seed, first]).integers(-(2**31), 2**31, (n, 3)).astype(np.int32)
    return Block(
        device=device,
        rate=1000.0,
        first_index=first,
        counts=counts,
        scale=EPSON_SCALE,
        arrival_index=first + n - 1,
        arrival_time=START + (first + n - 1) * 1_000_000 + late,
        temperature=21.5,
        flags=Flag.NONE,
    )


def contents(items: Iterable[Item]) -> list[object]:
    """Return items as values that compare by every field."""
    return [
        (item.topic, item.time, item.payload)
        if isinstance(item, Event)
        else (
            item.device,
            item.rate,
            item.first_index,
            item.counts.tolist(),
            item.scale,
            item.arrival_index,
            item.arrival_time,
            item.temperature,
            item.flags,
        )
        for item in items
    ]


def some_items() -> list[Item]:
    """Return blocks of two devices and events, times not in order."""
    items: list[Item] = []
    for k in range(8):
        items += [make_block("a", 250 * k, seed=1), make_block("b", 70_000 + 250 * k, seed=2)]
        items.append(Event(topic="/event/note", time=START - k, payload={"k": k, "text": "ä", "list": [1.5, None]}))
    return items


def write_log(path: Path, blocks: list[Block]) -> Path:
    """Write a log of blocks and nothing else."""
    writer = McapWriter(path, {})
    for block in blocks:
        writer.write(block)
    writer.close()
    return path
