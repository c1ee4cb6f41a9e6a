"""An index is sound only if every message is in it, once, with its channel and time."""

from pathlib import Path

import hypothesis.strategies as st
import pytest
from hypothesis import given, settings
from mcap.opcode import Opcode
from mcap.stream_reader import StreamReader

from daq import McapWriter
from daq.log.recovery import NotPlainError, PlainLog
from tests.support.daq.blocks import some_items


@pytest.fixture(scope="module")
def cut(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a log of `some_items` without its end, a chunk every five."""
    path = tmp_path_factory.mktemp("log") / "cut.mcap"
    writer = McapWriter(path, {})
    for k, item in enumerate(some_items()):
        writer.write(item)
        if k % 5 == 0:
            writer.flush()
    writer.flush()
    writer.abandon()
    return path


def places_of_indexes(content: bytes | bytearray) -> list[int]:
    """Return where the bytes of all message indexes are."""
    found: list[int] = []
    at = 8
    while at < len(content):
        end = at + 9 + int.from_bytes(content[at + 1 : at + 9], "little")
        if content[at] == Opcode.MESSAGE_INDEX:
            found += range(at, end)
        at = end
    return found


@settings(max_examples=300)
@given(st.data())
def test_any_wrong_bit_in_message_index_is_detected(cut: Path, data: st.DataObject) -> None:
    content = bytearray(cut.read_bytes())
    at = data.draw(st.sampled_from(places_of_indexes(content)))
    content[at] ^= 1 << data.draw(st.integers(0, 7))
    path = cut.with_name("damaged.mcap")
    path.write_bytes(content)
    with path.open("rb") as file, pytest.raises(NotPlainError):
        PlainLog(file)


def test_completed_end_of_log_equals_that_of_stock_writer(cut: Path) -> None:
    whole = cut.with_name("whole.mcap")
    writer = McapWriter(whole, {})
    for k, item in enumerate(some_items()):
        writer.write(item)
        if k % 5 == 0:
            writer.flush()
    writer.flush()
    writer.close()
    with cut.open("rb") as file:
        log = PlainLog(file)
    assert log.n_messages == len(some_items())
    kept = cut.read_bytes()
    mended = cut.with_name("mended.mcap")
    mended.write_bytes(kept[: log.good] + log.end())
    with whole.open("rb") as expected, mended.open("rb") as found:
        assert list(StreamReader(found).records) == list(StreamReader(expected).records)
