"""Blocks as messages of a log, both directions side by side."""

import numpy as np

from daq.accel_block_pb2 import AccelBlock, PackedAxis
from daq.protocol.rice import PackedColumn, pack, unpack
from daq.recording import Block, Flag, IntArray


def encode_block(block: Block) -> bytes:
    """Return a block as protobuf; every int32 is kept exactly."""
    nominal = block.pair_time - round((block.pair_index - block.first_index) / block.rate * 1e9)
    return AccelBlock(
        time=nominal,
        rate=block.rate,
        first_index=block.first_index,
        n_axes=block.counts.shape[1],
        n_scans=block.n_scans,
        packed=[_axis(column) for column in pack(block.counts)] if block.n_scans else [],
        scale=block.scale,
        temperature=block.temperature,
        flags=int(block.flags),
        pair_index=block.pair_index,
        pair_time=block.pair_time,
        clock=block.clock,
    ).SerializeToString()


def _axis(column: PackedColumn) -> PackedAxis:
    return PackedAxis(order=column.order, start=column.start, n_low=column.n_low, low=column.low, high=column.high)


def decode_block(device: str, data: bytes) -> Block:
    """Return the block of a device from protobuf.

    Raises
    ------
    ValueError
        If its counts are not as many as it says.
    """
    message = AccelBlock.FromString(data)
    return Block(
        device=device,
        rate=message.rate,
        first_index=message.first_index,
        counts=_counts(message),
        scale=message.scale,
        pair_index=message.pair_index,
        pair_time=message.pair_time,
        temperature=message.temperature,
        flags=Flag(message.flags),
        clock=message.clock,
    )


def _counts(message: AccelBlock) -> IntArray:
    """Return counts (n_scans, n_axes); old logs keep first differences as they are."""
    if message.packed:
        columns = [PackedColumn(a.order, tuple(a.start), a.n_low, a.low, a.high) for a in message.packed]
        return unpack(columns, message.n_scans)
    difference = np.array(message.difference, np.int32).reshape(message.n_axes, -1)
    return np.cumsum(difference.view(np.uint32), axis=1, dtype=np.uint32).view(np.int32).T
