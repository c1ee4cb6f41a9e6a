"""The log: all items are read back in order, also from a cut file."""

import gc
import tracemalloc
from dataclasses import replace
from pathlib import Path

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis.extra import numpy as hnp
from mcap.reader import make_reader
from mcap.writer import Writer
from mcap_protobuf.decoder import DecoderFactory

from daq import Block, Flag, IntArray, Item, LogError, McapWriter, read_attachments, read_log
from daq.log.format.accel_block_pb2 import AccelBlock
from daq.log.format.block_codec import decode_block, encode_block
from daq.log.format.rice import Packed, unpack
from tests.support.daq.blocks import START, contents, make_block, some_items

ATTACHED = {"site.toml": "state = 'x'\n", "structure.toml": "# Größe 3 m\n"}
INT32 = np.iinfo(np.int32)


def write_log(path: Path, items: list[Item], flush_every: int = 5) -> None:
    writer = McapWriter(path, ATTACHED)
    for k, item in enumerate(items):
        writer.write(item)
        if k % flush_every == 0:
            writer.flush()
    writer.close()


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a finished log of `some_items`."""
    path = tmp_path_factory.mktemp("log") / "whole.mcap"
    write_log(path, some_items())
    return path


counts_ = hnp.arrays(
    np.int32, st.tuples(st.integers(1, 30), st.integers(1, 4)), elements=st.integers(INT32.min, INT32.max)
)


@given(counts_, st.integers(2**20, 2**50), st.integers(-(2**20), 2**20), st.floats(width=32), st.integers(0, 7))
@example(np.array([[INT32.min], [INT32.max], [INT32.min], [0]], np.int32), 2**20, 0, float("nan"), 0)
def test_block_encoding_round_trip(counts: IntArray, first: int, pair: int, temperature: float, flags: int) -> None:
    block = Block(
        device="beam",
        rate=500.0,
        first_index=first,
        counts=counts,
        scale=1e-3,
        arrival_index=first + pair,
        arrival_time=START,
        temperature=temperature,
        flags=Flag(flags),
    )
    found = decode_block("beam", encode_block(block))
    np.testing.assert_array_equal(found.counts, counts)
    assert found.counts.dtype == np.int32
    assert (found.first_index, found.arrival_index, found.arrival_time) == (first, first + pair, START)
    assert (found.device, found.rate, found.scale, found.flags) == ("beam", 500.0, 1e-3, Flag(flags))
    np.testing.assert_equal(found.temperature, temperature)


def test_block_without_coding_for_each_axis_is_refused() -> None:
    message = AccelBlock(rate=500.0, scale=1e-3, n_axes=3, n_scans=2, coding=[0, 0], start=[1, 1], bits=b"")
    with pytest.raises(ValueError, match="coding: expected 3 axes, found 2"):
        decode_block("beam", message.SerializeToString())


def test_items_are_read_in_the_order_of_writing(whole: Path) -> None:
    assert contents(read_log(whole)) == contents(some_items())


def test_only_used_axes_of_used_devices_are_unpacked(tmp_path: Path) -> None:
    random = np.random.default_rng(7)
    lengths, path = (200, 3, 50, 200), tmp_path / "log.mcap"
    walks = [np.cumsum(random.integers(-900, 900, (n, 3)), axis=0).astype(np.int32) for n in lengths]
    walks[3][:, 1] = random.integers(-5, 5, 200)  # another order of differences
    blocks = [replace(make_block("ab"[k % 2], 1000 * k), counts=walk) for k, walk in enumerate(walks)]
    write_log(path, [*blocks], flush_every=9)
    found = [item for item in read_log(path, {"b": (1, 7)}) if isinstance(item, Block)]
    assert [block.device for block in found] == ["b", "b"]
    for block, whole in zip(found, blocks[1::2], strict=True):
        np.testing.assert_array_equal(block.counts[:, 1], whole.counts[:, 1])
        assert block.counts.shape[1] == 2
        assert not block.counts[:, 0].any()


def test_attachments_are_read_unchanged(whole: Path) -> None:
    assert read_attachments(whole) == ATTACHED


@settings(max_examples=150)
@given(st.data())
def test_cut_log_is_read_up_to_its_last_whole_chunk(whole: Path, data: st.DataObject) -> None:
    content = whole.read_bytes()
    at = data.draw(st.integers(8, len(content)))
    path = whole.with_name("cut.mcap")
    path.write_bytes(content[:at])
    found, expected = contents(read_log(path)), contents(some_items())
    assert found == expected[: len(found)]
    assert len(found) in {0, *range(1, len(expected), 5), len(expected)}  # whole chunks
    chunk = len(content) // 6  # and not fewer than the cut leaves: every chunk is smaller than this
    assert len(found) >= 5 * (at // chunk - 1) - 4


def test_cut_log_keeps_its_attachments(whole: Path) -> None:
    path = whole.with_name("cut2.mcap")
    path.write_bytes(whole.read_bytes()[: whole.stat().st_size // 2])
    assert read_attachments(path) == ATTACHED


def test_items_before_damage_are_read_and_damage_is_an_error(whole: Path) -> None:
    content = bytearray(whole.read_bytes())
    content[len(content) // 2] ^= 0x10
    path = whole.with_name("damaged.mcap")
    path.write_bytes(content)
    found: list[Item] = []
    with pytest.raises(LogError, match=r"damaged\.mcap: is damaged before byte \d+"):
        found.extend(read_log(path))
    items = read_log(path)
    before = [next(items) for _ in range(6)]
    assert contents(before) == contents(some_items()[:6])


def test_stock_reader_reads_a_finished_log(whole: Path) -> None:
    blocks = [item for item in some_items() if isinstance(item, Block)]
    with whole.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        summary = reader.get_summary()
        decoded = [m for *_, m in reader.iter_decoded_messages(topics=["/accel/a", "/accel/b"], log_time_order=False)]
    assert summary is not None
    assert summary.statistics is not None
    assert summary.statistics.message_count == len(some_items())
    assert [m.first_index for m in decoded] == [b.first_index for b in blocks]
    order, n_low = zip(*(divmod(code, 64) for code in decoded[0].coding), strict=True)
    packed = Packed(order, tuple(decoded[0].start), n_low, decoded[0].bits)
    np.testing.assert_array_equal(unpack(packed, decoded[0].n_scans), blocks[0].counts)
    assert [m.time for m in decoded[::2]] == [START + b.first_index * 1_000_000 for b in blocks[::2]]


def test_memory_use_per_chunk_of_open_log_is_small(tmp_path: Path) -> None:
    """Ten bytes per device and 77 of its own are stored in the file; the stock writer keeps 1300."""
    devices, chunks = [f"device_{k}" for k in range(6)], 150
    tracemalloc.start()
    try:
        writer = McapWriter(tmp_path / "log.mcap", {})
        for number in range(chunks):
            for device in devices:
                writer.write(make_block(device, 10 * number, n=10))
            writer.flush()
            if number == 50:
                gc.collect()  # and what the interpreter keeps to use again, as below
                before = tracemalloc.get_traced_memory()[0]
        gc.collect()
        kept = (tracemalloc.get_traced_memory()[0] - before) / (chunks - 51)
    finally:
        tracemalloc.stop()
    writer.close()
    assert kept < 250
    with (tmp_path / "log.mcap").open("rb") as file:
        reader = make_reader(file)
        summary = reader.get_summary()
        assert summary is not None
        assert len(summary.chunk_indexes) == chunks
        times = [message.log_time for *_, message in reader.iter_messages(topics=["/accel/device_3"])]
        assert times == [START + 1_000_000 * (10 * k + 9) for k in range(chunks)]


def test_missing_log_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(LogError, match=r"none\.mcap: cannot be read: No such file") as found:
        list(read_log(tmp_path / "none.mcap"))
    assert found.value.path == tmp_path / "none.mcap"


@pytest.mark.parametrize("content", [b"", b"\x89MCAP", b"t,x,y\n0,1,2\n" * 9])
def test_file_that_is_not_mcap_is_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "data.csv"
    path.write_bytes(content)
    with pytest.raises(LogError, match=r"data\.csv: is not an MCAP log"):
        list(read_log(path))
    with pytest.raises(LogError, match=r"data\.csv: is not an MCAP log"):
        read_attachments(path)


def test_log_of_another_program_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "robot.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start(profile="ros2")
        writer.finish()  # type: ignore[no-untyped-call]
    with pytest.raises(LogError, match="expected profile 'modalwatch', found 'ros2'"):
        list(read_log(path))


def test_existing_file_is_never_overwritten(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    path.write_text("precious")
    with pytest.raises(LogError, match="cannot be written: File exists"):
        McapWriter(path, {})
    assert path.read_text() == "precious"


def test_missing_folder_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(LogError, match="cannot be written: No such file"):
        McapWriter(tmp_path / "none" / "log.mcap", {})
