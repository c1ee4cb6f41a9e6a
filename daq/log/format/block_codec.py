"""Encoding and decoding of blocks as log messages."""

from collections.abc import Sequence

import numpy as np

from daq.log.format.accel_block_pb2 import AccelBlock
from daq.log.format.rice import Packed, pack, unpack_many
from daq.types import Block, Flag, IntArray

_LEAST_SCALE = float(np.finfo(float).tiny)
_MAX_AXES = 10_000
_MAX_INDEX = 1 << 53
_MAX_TIME = 1 << 62  # ns: in the year 2116
_MAX_SCANS = 1 << 26
_MAX_SECONDS = 1e6  # of a block
_CODE = 64  # times the order of the differences


def encode_block(block: Block) -> bytes:
    """Return a block as protobuf; every int32 is kept exactly."""
    offset = block.arrival_index - block.first_index
    message = AccelBlock(
        time=block.arrival_time - _after(offset, block.rate),
        rate=block.rate,
        first_index=block.first_index,
        n_axes=block.counts.shape[1],
        n_scans=block.n_scans,
        scale=block.scale,
        temperature=block.temperature,
        flags=int(block.flags),
        clock=block.clock,
        pair_offset=offset,
    )
    if block.n_scans:
        packed = pack(block.counts)
        message.coding.extend(_CODE * order + n_low for order, n_low in zip(packed.order, packed.n_low, strict=True))
        message.start.extend(packed.start)
        message.bits = packed.bits
    return message.SerializeToString()


def _after(n_scans: int, rate: float) -> int:
    """Return how long scans take at their nominal rate [ns]."""
    return round(n_scans / rate * 1e9)


def decode_block(device: str, data: bytes) -> Block:
    """Return the block of a device from protobuf.

    Raises
    ------
    ValueError
        If a field is out of bounds, or the counts do not fit n_scans and n_axes.
    """
    return decode_blocks([(device, data)])[0]


def decode_blocks(messages: Sequence[tuple[str, bytes]]) -> list[Block]:
    """Return the blocks of devices from protobuf, all counts unpacked together; errors as for `decode_block`."""
    parsed = [AccelBlock.FromString(data) for _, data in messages]
    for message in parsed:
        _check(message)
    filled = [message for message in parsed if message.n_scans]
    counts = iter(unpack_many([_packed(message) for message in filled], [message.n_scans for message in filled]))
    return [
        _block(device, message, next(counts) if message.n_scans else np.zeros((0, message.n_axes), np.int32))
        for (device, _), message in zip(messages, parsed, strict=True)
    ]


def _block(device: str, message: AccelBlock, counts: IntArray) -> Block:
    return Block(
        device=device,
        rate=message.rate,
        first_index=message.first_index,
        counts=counts,
        scale=message.scale,
        arrival_index=message.first_index + message.pair_offset,
        arrival_time=message.time + _after(message.pair_offset, message.rate),
        temperature=message.temperature,
        flags=Flag(message.flags),
        clock=message.clock,
    )


def _check(message: AccelBlock) -> None:
    """Refuse values that no device has: results would be not-a-number, no time, or too large."""
    bounds: tuple[tuple[str, float, float, float], ...] = (
        ("rate", message.rate, 1e-6, 1e9),
        ("scale", message.scale, _LEAST_SCALE, 1e12),
        ("n_axes", message.n_axes, 0, _MAX_AXES),
        ("first_index", message.first_index, -_MAX_INDEX, _MAX_INDEX),
        ("pair_offset", message.pair_offset, -_MAX_INDEX, _MAX_INDEX),
        ("time", message.time, -_MAX_TIME, _MAX_TIME),
        ("n_scans / rate", message.n_scans, 0, min(_MAX_SCANS, message.rate * _MAX_SECONDS + 2)),
    )
    for name, value, least, greatest in bounds:
        if not least <= value <= greatest:  # NaN too
            raise ValueError(f"{name}: expected {least:g} to {greatest:g}, found {value:g}")


def _packed(message: AccelBlock) -> Packed:
    if len(message.coding) != message.n_axes or not message.n_axes:
        raise ValueError(f"coding: expected {message.n_axes} axes, found {len(message.coding)}")
    coding = list(message.coding)
    order, n_low = tuple([code // _CODE for code in coding]), tuple([code % _CODE for code in coding])
    return Packed(order, tuple(message.start), n_low, message.bits)
