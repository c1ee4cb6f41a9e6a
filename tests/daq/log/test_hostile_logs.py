"""Crafted logs: stated sizes are checked before memory is taken, and each is one error with its file."""

import io
import json
import resource
import struct
import time
from pathlib import Path

import numpy as np
import pytest
import zstandard
from mcap.writer import CompressionType, Writer

from daq import Channel, LogError, Recording, load_recordings, read_attachments, read_log, repair_log, write_recording
from daq.log import log_info
from daq.log.format.accel_block_pb2 import AccelBlock
from daq.log.format.rice import pack
from daq.log.repair import repair_folder

MAGIC = b"\x89MCAP0\r\n"
CHANNELS = (Channel(name="a", device="imu", axis=0),)


def log_of(*records: tuple[int, bytes]) -> bytes:
    """Return a log of records that are no part of the stock writer's: opcode and content."""
    header = struct.pack("<I", 10) + b"modalwatch" + struct.pack("<I", 0)
    content = b"".join(struct.pack("<BQ", opcode, len(data)) + data for opcode, data in ((1, header), *records))
    return MAGIC + content


def chunk(name: bytes, data: bytes, size: int) -> tuple[int, bytes]:
    """Return a chunk that states its uncompressed size."""
    head = struct.pack("<QQQII", 0, 0, size, 0, len(name))
    return 6, head + name + struct.pack("<Q", len(data)) + data


BOMB = zstandard.compress(bytes(300 << 20))
CHUNKS = [
    (chunk(b"zstd", zstandard.compress(bytes(64)), 6 * 10**9), "uncompressed size: expected up to"),
    (chunk(b"zstd", BOMB, 300 << 20), "uncompressed size: expected up to"),
    (chunk(b"zstd", BOMB, 1000), "expected 1000 bytes, found a frame of"),
    (chunk(b"zstd", b"junk", 1000), "damaged before byte"),
    (chunk(b"lz4", b"\x04\x22\x4d\x18junk", 1000), "damaged before byte"),
    (chunk(b"lz4", b"junk", 1000), "damaged before byte"),
    (chunk(b"gzip", b"junk", 1000), "expected compression by zstd or lz4"),
    (chunk(b"", bytes(4) + b"\xff" * 8, 12), "damaged before byte"),
]


@pytest.mark.parametrize(("record", "message"), CHUNKS)
def test_crafted_chunk_is_refused_without_using_memory(tmp_path: Path, record: tuple[int, bytes], message: str) -> None:
    path = tmp_path / "log.mcap"
    content = log_of(record, (15, bytes(4)))
    path.write_bytes(content)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(LogError, match=message) as refused:
        list(read_log(path))
    assert str(path) in str(refused.value)
    assert log_info(path).state.lost_chunks == 1
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 100_000  # kB
    assert path.read_bytes() == content
    assert len(list(repair_folder(tmp_path))) == 1


def written(path: Path, topic: str, data: bytes, *, log_time: int = 0, attachment: bytes | None = None) -> Path:
    """Write a log with one message by the stock writer."""
    file = io.BytesIO()
    writer = Writer(file, compression=CompressionType.ZSTD)
    writer.start(profile="modalwatch", library="x")
    if attachment is not None:
        writer.add_attachment(0, 0, "site.toml", "", attachment)
    schema = writer.register_schema("s", "protobuf", b"")
    channel = writer.register_channel(topic, "protobuf" if topic.startswith("/accel") else "json", schema)
    writer.add_message(channel, log_time, data, log_time)
    writer.finish()  # type: ignore[no-untyped-call]
    path.write_bytes(file.getvalue())
    return path


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"rate": 0.0}, "rate: expected"),
        ({"rate": 1e-300}, "rate: expected"),
        ({"rate": float("nan")}, "rate: expected"),
        ({"scale": float("inf")}, "scale: expected"),
        ({"n_axes": 2**31}, "n_axes: expected"),
        ({"first_index": 2**63}, "first_index: expected"),
        ({"pair_offset": -(2**63)}, "pair_offset: expected"),
        ({"time": 2**63 - 1}, "time: expected"),
    ],
)
def test_block_with_invalid_field_is_refused(tmp_path: Path, fields: dict[str, float], message: str) -> None:
    sound = {"time": 10**18, "rate": 100.0, "n_axes": 1, "scale": 1.0}
    block = AccelBlock(**{**sound, **fields})  # type: ignore[arg-type]
    path = written(tmp_path / "log.mcap", "/accel/imu", block.SerializeToString())
    with pytest.raises(LogError, match=f"message 0 of /accel/imu: {message}"):
        list(read_log(path))


@pytest.mark.parametrize(
    "text", [b"[1]", b"7", b"[" * 30_000, b'{"a":' * 3000, b"\xff", b"1" * 6000, b'{"device": []}', b'{"missing": "x"}']
)
def test_invalid_event_payload_is_refused_with_short_error(tmp_path: Path, text: bytes) -> None:
    path = written(tmp_path / "log.mcap", "/event/gap", text)
    with pytest.raises(LogError, match="message 0 of /event/gap: ") as refused:
        list(read_log(path))
    assert len(str(refused.value)) < 1100


def test_message_time_after_year_2262_is_refused(tmp_path: Path) -> None:
    path = written(tmp_path / "log.mcap", "/event/gap", b"{}", log_time=2**64 - 1)
    with pytest.raises(LogError, match="expected a time before the year 2262"):
        list(read_log(path))


def test_attachment_not_in_utf_8_is_refused(tmp_path: Path) -> None:
    path = written(tmp_path / "log.mcap", "/event/gap", b"{}", attachment=b"\xff\xfe")
    with pytest.raises(LogError, match=r"attachment site\.toml: expected text in UTF-8"):
        read_attachments(path)


@pytest.mark.parametrize("content", [b"", MAGIC, MAGIC * 2, b"\x89MCAP0", b"x" * 99, MAGIC + b"\xff" * 99, log_of()])
def test_invalid_files_in_log_folder_are_reported(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "a.mcap").write_bytes(content)
    (tmp_path / "b.mcap").mkdir()
    assert all("mcap" in message for message in repair_folder(tmp_path))


def test_log_with_pause_of_years_is_processed_quickly(tmp_path: Path) -> None:
    path, year = tmp_path / "log.mcap", round(365 * 86400e9)
    data = np.random.default_rng(0).standard_normal((3000, 1))
    write_recording(path, Recording(channels=CHANNELS, data=data, rate=100.0, start=10**18))
    later = tmp_path / "later.mcap"
    file = later.open("wb")
    writer = Writer(file)
    writer.start(profile="modalwatch", library="x")
    known = {"channels": [{"name": "a", "device": "imu", "axis": 0}], "on_grid": False}
    writer.add_attachment(0, 0, "channels.json", "", json.dumps(known).encode())
    schema = writer.register_schema("s", "protobuf", b"")
    channel = writer.register_channel("/accel/imu", "protobuf", schema)
    ramp = pack(np.arange(1, 101, dtype=np.int32)[:, None])
    for number in range(60):
        begin = 10**18 + number * 10**9 + 20 * year * (number >= 30)
        block = AccelBlock(
            time=begin,
            rate=100.0,
            first_index=100 * number + 100 * 20 * 365 * 86400 * (number >= 30),
            n_axes=1,
            n_scans=100,
            scale=1.0,
            coding=[64 * ramp.order[0] + ramp.n_low[0]],
            start=ramp.start,
            bits=ramp.bits,
        )
        writer.add_message(channel, begin, block.SerializeToString(), begin)
    writer.finish()  # type: ignore[no-untyped-call]
    file.close()
    begun = time.process_time()
    windows = list(load_recordings(later, window_seconds=5.0))
    assert 8 <= len(windows) <= 12
    assert windows[-1].start - windows[0].start > 20 * year
    assert time.process_time() - begun < 2
    assert repair_log(later).whole
