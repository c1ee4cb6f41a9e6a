"""Our decoding of signals compared with cantools': every position, order, sign and kind; and back."""

from typing import Any

import numpy as np
import pytest
from cantools.database import Database, Message, Signal
from cantools.database.conversion import BaseConversion
from hypothesis import given
from hypothesis import strategies as st

from daq.protocol.can_signals import CanSignal

FACTORS = st.sampled_from([1.0, 0.00390625, 0.1, -2.5, 1e-6])
OFFSETS = st.sampled_from([0.0, -16.0, 0.3])


@st.composite
def signals(draw: st.DrawFn) -> CanSignal:
    """Return a signal anywhere in eight bytes."""
    is_float = draw(st.booleans())
    length = draw(st.sampled_from([16, 32, 64]) if is_float else st.integers(1, 64))
    shift = draw(st.integers(0, 64 - length))
    big_endian = draw(st.booleans())
    first = 64 - shift - length  # bits before the greatest of a big-endian signal
    return CanSignal(
        name="s",
        start=8 * (first // 8) + 7 - first % 8 if big_endian else shift,
        length=length,
        big_endian=big_endian,
        signed=not is_float and draw(st.booleans()),
        is_float=is_float,
        factor=draw(FACTORS),
        offset=draw(OFFSETS),
    )


def theirs(signal: CanSignal) -> Message:
    """Return cantools' message with the signal."""
    conversion = BaseConversion.factory(scale=signal.factor, offset=signal.offset, is_float=signal.is_float)
    peer = Signal(
        name="s",
        start=signal.start,
        length=signal.length,
        byte_order="big_endian" if signal.big_endian else "little_endian",
        is_signed=signal.signed,
        conversion=conversion,
    )
    message = Message(frame_id=1, name="m", length=8, signals=[peer])
    Database(messages=[message])  # which checks that it fits
    return message


def decoded(message: Message, frame: bytes, *, scaling: bool) -> Any:
    """Return cantools' decoding of a frame."""
    found = message.decode(frame, scaling=scaling)
    assert isinstance(found, dict)
    return found["s"]


@given(signals(), st.lists(st.binary(min_size=8, max_size=8), min_size=1, max_size=5))
def test_decoded_signals_equal_those_of_cantools(signal: CanSignal, frames: list[bytes]) -> None:
    message = theirs(signal)
    data = np.frombuffer(b"".join(frames), np.uint8).reshape(-1, 8)
    raw = [decoded(message, frame, scaling=False) for frame in frames]
    with np.errstate(over="ignore", invalid="ignore"):  # random bits of a float may be any
        ours = signal.physical(data)
        expected = [float(decoded(message, frame, scaling=True)) for frame in frames]
    np.testing.assert_array_equal(signal.raw(data).tolist(), raw)
    # physical values are computed in doubles by both; cantools keeps integers whole, beyond 2^53 too
    np.testing.assert_allclose(ours, expected, rtol=4e-16, atol=1e-15 * abs(signal.offset))


@given(signals(), st.binary(min_size=8, max_size=8), st.binary(min_size=8, max_size=8))
def test_encoded_signal_is_decoded_unchanged_and_other_bits_are_kept(
    signal: CanSignal, before: bytes, source: bytes
) -> None:
    data = np.frombuffer(before, np.uint8).reshape(1, 8).copy()
    wanted = signal.raw(np.frombuffer(source, np.uint8).reshape(1, 8))
    if signal.is_float and np.isnan(wanted[0]):
        return  # which of the many bit patterns of NaN is kept is the processor's choice
    signal.put(data, wanted)
    assert signal.raw(data).tolist() == wanted.tolist()
    signal.put(data, signal.raw(np.frombuffer(before, np.uint8).reshape(1, 8)))
    if not (signal.is_float and np.isnan(signal.raw(data)[0])):
        assert data.tobytes() == before


@pytest.mark.parametrize(
    ("start", "length", "big_endian"), [(60, 5, False), (56, 2, True), (64, 1, False), (0, 0, False), (56, 16, True)]
)
def test_signal_outside_eight_bytes_is_refused(start: int, length: int, big_endian: bool) -> None:
    with pytest.raises(ValueError, match=f"signal s: bit {start}, {length} long, is not inside 8 bytes"):
        CanSignal(name="s", start=start, length=length, big_endian=big_endian)


def test_float_signal_of_unsupported_length_is_refused() -> None:
    with pytest.raises(ValueError, match="expected a float of 16, 32 or 64 bits, found 24"):
        CanSignal(name="s", start=0, length=24, is_float=True)
