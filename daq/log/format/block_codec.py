"""Encoding and decoding of blocks as log messages."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import chain

import numpy as np

from daq.log.format.accel_block_pb2 import AccelBlock
from daq.log.format.rice import PackedBlocks, pack, unpack_blocks
from daq.types import Block, BoolArray, Flag, IndexArray, IntArray

_LEAST_SCALE = float(np.finfo(float).tiny)
_MAX_AXES = 10_000
_MAX_INDEX = 1 << 53
_MAX_TIME = 1 << 62  # ns: in the year 2116
_MAX_SCANS = 1 << 26
_MAX_SECONDS = 1e6  # of a block
_CODE = 64  # times the order of the differences
AxesOfDevices = Mapping[str, Collection[int]]  #: device -> some of its axes


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


def decode_blocks(messages: Sequence[tuple[str, bytes]], axes: AxesOfDevices | None = None) -> list[Block]:
    """Return the blocks of devices from protobuf, all counts unpacked together; errors as for `decode_block`.

    Parameters
    ----------
    messages : devices and their messages
    axes : device -> axes that are used; counts of its other axes are 0, axes behind the last used one are
        missing; all counts of a device without used axes are 0. Default: all
    """
    parsed = [AccelBlock.FromString(data) for _, data in messages]
    for message in parsed:
        _check(message)
    filled = [message for message in parsed if message.n_scans]
    packed = _packed(filled)
    if axes is not None:
        devices = [device for (device, _), message in zip(messages, parsed, strict=True) if message.n_scans]
        packed = replace(packed, used=_are_used(packed.n_axes, devices, axes))
    counts = iter(unpack_blocks(packed))
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
        flags=_flag(message.flags),
        clock=message.clock,
    )


_flag = lru_cache(maxsize=64)(Flag)


def _check(message: AccelBlock) -> None:
    """Refuse values that no device has: results would be not-a-number, no time, or too large."""
    n_scans, rate = message.n_scans, message.rate
    if (  # written out, because there are many blocks
        1e-6 <= rate <= 1e9
        and _LEAST_SCALE <= message.scale <= 1e12
        and message.n_axes <= _MAX_AXES
        and -_MAX_INDEX <= message.first_index <= _MAX_INDEX
        and -_MAX_INDEX <= message.pair_offset <= _MAX_INDEX
        and -_MAX_TIME <= message.time <= _MAX_TIME
        and n_scans <= _MAX_SCANS
        and n_scans <= rate * _MAX_SECONDS + 2
    ):
        return
    _refuse(message)


def _refuse(message: AccelBlock) -> None:
    """Raise ValueError for the first value that is out of bounds."""
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


def _packed(messages: Sequence[AccelBlock]) -> PackedBlocks:
    codings = [message.coding[:] for message in messages]  # lists: to take their values one by one is slow
    starts = [message.start[:] for message in messages]
    n_axes, n_start = list(map(len, codings)), list(map(len, starts))
    for message, n in zip(messages, n_axes, strict=True):
        if n != message.n_axes or not n:
            raise ValueError(f"coding: expected {message.n_axes} axes, found {n}")
    code = np.array(list(chain.from_iterable(codings)), np.intp)
    return PackedBlocks(
        order=code // _CODE,
        n_low=code % _CODE,
        start=np.array(list(chain.from_iterable(starts)), np.int64),
        n_axes=np.array(n_axes, np.intp),
        n_start=np.array(n_start, np.intp),
        n=np.array([message.n_scans for message in messages], np.intp),
        bits=[message.bits for message in messages],
        used=np.ones(len(code), np.bool_),
    )


def _are_used(n_axes: IndexArray, devices: Sequence[str], axes: AxesOfDevices) -> BoolArray:
    """Return which axes of all blocks are among the used ones of their device (n_axes_of_all,)."""
    blocks = list(zip(devices, n_axes.tolist(), strict=True))
    known = {(device, n): [axis in axes.get(device, ()) for axis in range(n)] for device, n in set(blocks)}
    return np.array(list(chain.from_iterable(map(known.__getitem__, blocks))), np.bool_)
