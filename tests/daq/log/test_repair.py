"""Repair of logs: whatever was cut or damaged, every whole chunk is kept and stock readers open the result."""

import resource
from pathlib import Path

import hypothesis.strategies as st
import pytest
from hypothesis import given, settings
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from daq import Item, LogError, McapWriter, inspect_log, read_attachments, read_log, repair_log
from daq.log import LogState, has_end
from tests.support.daq.blocks import START, contents, some_items

ATTACHED = {"site.toml": "state = 'x'\n", "structure.toml": "# Größe 3 m\n"}


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a finished log of `some_items`, a chunk every five."""
    path = tmp_path_factory.mktemp("log") / "whole.mcap"
    writer = McapWriter(path, ATTACHED)
    for k, item in enumerate(some_items()):
        writer.write(item)
        if k % 5 == 0:
            writer.flush()
    writer.close()
    return path


def stock_count(path: Path) -> int:
    """Return the messages a stock reader's summary names, once it has read them all."""
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        messages = list(reader.iter_messages(log_time_order=False))
        assert len(messages) == summary.statistics.message_count
        names = [a.name for a in reader.iter_attachments()]
        assert names == list(ATTACHED)[: len(names)]
    return len(messages)


def before(path: Path) -> list[Item]:
    """Return the items of the ordinary reader before the damage."""
    found: list[Item] = []
    try:
        found.extend(read_log(path))
    except LogError:
        items = read_log(path)
        found = []
        while True:
            try:
                found.append(next(items))
            except LogError:
                break
    return found


@given(st.data())
def test_repaired_cut_log_keeps_all_readable_items(whole: Path, data: st.DataObject) -> None:
    content = whole.read_bytes()
    at = data.draw(st.integers(300, len(content) - 1))
    path = whole.with_name("cut.mcap")
    path.write_bytes(content[:at])
    readable, attached = contents(read_log(path)), read_attachments(path)
    state = repair_log(path)
    assert not state.whole
    assert state.n_messages == len(readable) == stock_count(path)
    assert contents(read_log(path)) == readable
    assert read_attachments(path) == attached
    assert inspect_log(path).whole
    assert list(path.parent.glob(".*")) == []


def test_wrong_checksum_of_data_section_loses_no_items(whole: Path) -> None:
    content = bytearray(whole.read_bytes())
    at = content.rindex(b"\x0f\x04" + 7 * b"\0") + 9  # DataEnd: opcode, length, checksum; none is given
    content[at] ^= 1
    path = whole.with_name("damaged.mcap")
    path.write_bytes(content)
    assert contents(read_log(path)) == contents(some_items())


@settings(max_examples=40)
@given(st.data())
def test_damaged_log_loses_only_the_damaged_chunk(whole: Path, data: st.DataObject) -> None:
    content = bytearray(whole.read_bytes())
    at = data.draw(st.integers(300, len(content) - 1))
    content[at] ^= 1 << data.draw(st.integers(0, 7))
    path = whole.with_name("damaged.mcap")
    path.write_bytes(content)
    readable, every = contents(before(path)), contents(some_items())
    state = repair_log(path)
    mended = contents(read_log(path))
    assert mended[: len(readable)] == readable
    assert [item for item in every if item in mended] == mended  # none altered, none out of order
    assert len(mended) == stock_count(path)
    assert len(every) - 5 <= len(mended) <= len(every)  # five items per chunk at most
    assert state.lost_chunks or state.lost_bytes or mended == every
    assert inspect_log(path).whole


@pytest.mark.thorough
def test_wrong_opcode_or_length_bit_loses_at_most_one_chunk(whole: Path) -> None:
    """Of each record after the attachments: at most its own chunk is lost, and the state has the loss."""
    content, every = whole.read_bytes(), contents(some_items())
    path = whole.with_name("damaged_frame.mcap")
    first = next(at for opcode, at in places(content) if opcode == 6)
    frames = [at for opcode, at in places(content) if at >= first and opcode != 7] + [
        next(at for opcode, at in places(content) if opcode == 7)
    ]
    for at in frames:
        for byte, bit in [(at, k) for k in range(8)] + [(at + 1 + k, k) for k in range(8)]:
            damaged = bytearray(content)
            damaged[byte] ^= 1 << bit
            path.write_bytes(damaged)
            state = repair_log(path)
            mended = contents(read_log(path))
            assert not state.whole, (byte, bit)
            assert [item for item in every if item in mended] == mended, (byte, bit)
            assert len(mended) >= len(every) - 5, (byte, bit)
            lost = state.lost_chunks or state.lost_bytes  # the last chunk with a length beyond the file: it is cut
            assert lost or mended == every, (byte, bit)
            assert stock_count(path) == len(mended)
            assert inspect_log(path).whole


def test_wrong_chunk_times_are_repaired(whole: Path) -> None:
    """Indexed readers choose chunks by them."""
    content = bytearray(whole.read_bytes())
    content[[at for opcode, at in places(content) if opcode == 6][1] + 9 + 3] ^= 1
    path = whole.with_name("damaged_times.mcap")
    path.write_bytes(content)
    assert not repair_log(path).whole
    assert contents(read_log(path)) == contents(some_items())
    with path.open("rb") as repaired, whole.open("rb") as before:
        found, expected = make_reader(repaired).get_summary(), make_reader(before).get_summary()
    assert found is not None
    assert expected is not None
    assert found.statistics is not None
    assert expected.statistics is not None
    assert found.statistics.message_start_time == expected.statistics.message_start_time


def test_damaged_summary_is_rewritten(whole: Path) -> None:
    """Bits all over it: our reader needs none of it, stock readers do."""
    content, every = whole.read_bytes(), contents(some_items())
    start = int.from_bytes(content[-28:-20], "little")
    path = whole.with_name("damaged_summary.mcap")
    for at in range(start, len(content) - len(b"\x89MCAP0\r\n"), 19):
        damaged = bytearray(content)
        damaged[at] ^= 1 << at % 8
        path.write_bytes(damaged)
        state = repair_log(path)
        assert not state.whole, at
        assert contents(read_log(path)) == every
        assert stock_count(path) == len(every)
        assert inspect_log(path).whole


@settings(max_examples=25)
@given(st.data())
def test_cut_and_damaged_log_is_repaired(whole: Path, data: st.DataObject) -> None:
    content = bytearray(whole.read_bytes()[: data.draw(st.integers(1000, whole.stat().st_size - 1))])
    at = data.draw(st.integers(300, len(content) - 1))
    content[at] ^= 1 << data.draw(st.integers(0, 7))
    path = whole.with_name("cut_and_damaged.mcap")
    path.write_bytes(content)
    readable, every = contents(before(path)), contents(some_items())
    repair_log(path)
    mended = contents(read_log(path))
    assert mended[: len(readable)] == readable
    assert [item for item in every if item in mended] == mended
    assert len(mended) == stock_count(path)
    assert inspect_log(path).whole


@pytest.mark.parametrize("rest", [b"", b"\0" * 4096, b"\6\0\1"], ids=["none", "zeros of a power cut", "half a chunk"])
def test_missing_end_of_log_is_written_in_place(whole: Path, rest: bytes) -> None:
    path = whole.with_name("in_place.mcap")
    writer = McapWriter(path, ATTACHED)
    for item in some_items():
        writer.write(item)
        writer.flush()
    writer.abandon()
    kept = path.read_bytes()
    path.write_bytes(kept + rest)
    number = path.stat().st_ino
    state = repair_log(path)
    assert (state.lost_bytes, state.lost_chunks, state.n_messages) == (len(rest), 0, len(some_items()))
    assert path.read_bytes()[: len(kept)] == kept
    assert path.stat().st_ino == number
    assert stock_count(path) == len(some_items())
    assert contents(read_log(path)) == contents(some_items())
    path.unlink()


def test_damaged_length_does_not_exhaust_memory(whole: Path) -> None:
    """One bit of the length of a chunk's records changed: a terabyte, in a record whose own length is valid."""
    content = bytearray(whole.read_bytes())
    at = 8
    while content[at] != 6:  # opcode of a chunk
        at += 9 + int.from_bytes(content[at + 1 : at + 9], "little")
    name = at + 9 + 28  # after two times, a size and a checksum: the compression, by its length and letters
    length = name + 4 + int.from_bytes(content[name : name + 4], "little")
    content[length + 5] ^= 1
    path = whole.with_name("damaged_length.mcap")
    path.write_bytes(content)
    assert not inspect_log(path).whole
    assert len(contents(before(path))) < len(contents(some_items()))
    assert repair_log(path).lost_chunks


def places(content: bytes | bytearray) -> list[tuple[int, int]]:
    """Return opcode and place of each record of a log."""
    found, at = [], 8
    while at + 9 <= len(content) - 8:
        found.append((content[at], at))
        at += 9 + int.from_bytes(content[at + 1 : at + 9], "little")
    return found


def test_records_after_an_unreadable_chunk_are_kept(whole: Path) -> None:
    """The second chunk cannot be parsed at all: its compression has a name that is no text."""
    content = bytearray(whole.read_bytes())
    chunks = [at for opcode, at in places(content) if opcode == 6]
    content[chunks[1] + 9 + 28 + 4] ^= 0x80  # first letter of the compression
    path = whole.with_name("stepped.mcap")
    path.write_bytes(content)
    lost = len(some_items()) - inspect_log(path).n_messages
    assert 0 < lost <= 5
    state = repair_log(path)
    assert (state.lost_chunks, state.lost_bytes, state.finished) == (1, 0, True)
    assert str(state) == "1 chunk damaged"
    mended, every = contents(read_log(path)), contents(some_items())
    first = next(k for k, (a, b) in enumerate(zip(mended, every, strict=False)) if a != b)
    assert mended == every[:first] + every[first + lost :]
    assert read_attachments(path) == ATTACHED


def test_schema_lost_with_its_chunk_is_restored(tmp_path: Path) -> None:
    """The first chunk has the schemas and the channel of its message; a cut log repeats neither in a summary."""
    path = tmp_path / "log.mcap"
    writer = McapWriter(path, {})
    for item in some_items():
        writer.write(item)
        writer.flush()
    writer.abandon()
    content = bytearray(path.read_bytes())
    content[next(at for opcode, at in places(content) if opcode == 6) + 60] ^= 1  # in the data of the first chunk
    path.write_bytes(content)
    state = repair_log(path)
    assert (state.lost_chunks, state.finished) == (1, False)
    assert contents(read_log(path)) == contents(item for item in some_items() if getattr(item, "device", "") != "a")
    with path.open("rb") as file:
        names = {schema.name for schema, *_ in make_reader(file).iter_messages() if schema}
    assert names == {"modalwatch.AccelBlock", "modalwatch.Event"}


def test_foreign_messages_without_schema_are_dropped(tmp_path: Path) -> None:
    """As those of the view: their schema is none of a log's own."""
    path = tmp_path / "log.mcap"
    with path.open("wb") as file:
        writer = Writer(file, compression=CompressionType.NONE)
        writer.start(profile="modalwatch", library="modalwatch")
        schema = writer.register_schema("sensor_msgs/msg/Imu", "ros2msg", b"x")
        own = writer.register_schema("modalwatch.Event", "jsonschema", b"{}")
        writer.flush()  # type: ignore[no-untyped-call]
        for topic, encoding, number in (("/imu", "cdr", schema), ("/event/x", "json", own)):
            channel = writer.register_channel(topic, encoding, number)
            writer.add_message(channel, START, b"{}", START)
            writer.flush()  # type: ignore[no-untyped-call]
    content = bytearray(path.read_bytes())
    content[next(at for opcode, at in places(content) if opcode == 6) + 60] ^= 1
    path.write_bytes(content)
    assert repair_log(path).lost_chunks == 1
    with path.open("rb") as file:
        assert [channel.topic for _, channel, _ in make_reader(file).iter_messages()] == ["/event/x"]


def test_sum_of_log_states_adds_counts_and_losses() -> None:
    one = LogState(n_messages=7, lost_chunks=1, lost_bytes=0, finished=True)
    other = LogState(n_messages=5, lost_chunks=2, lost_bytes=30, finished=False)
    assert one + other == LogState(n_messages=12, lost_chunks=3, lost_bytes=30, finished=False)
    assert str(one + other) == "cut, 30 bytes of an unfinished chunk, 3 chunks damaged"


def test_complete_log_is_not_modified(whole: Path) -> None:
    was = whole.stat().st_mtime_ns, whole.stat().st_ino, whole.stat().st_size
    state = repair_log(whole)
    assert state.whole
    assert str(state) == "whole"
    assert state.n_messages == len(some_items())
    assert (whole.stat().st_mtime_ns, whole.stat().st_ino, whole.stat().st_size) == was


def test_state_of_log_cut_by_kill_is_described(whole: Path) -> None:
    path = whole.with_name("killed.mcap")
    path.write_bytes(whole.read_bytes()[:-3000])
    state = inspect_log(path)
    assert not state.finished
    assert str(state) == f"cut, {state.lost_bytes} bytes of an unfinished chunk"


@pytest.mark.parametrize("content", [b"", b"t,a\n0,1\n", b"\x89MCAP0\r\n" + b"x" * 50])
def test_repair_of_missing_or_non_mcap_file_is_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "log.mcap"
    path.write_bytes(content)
    with pytest.raises(LogError, match=r"log\.mcap: is not an MCAP log"):
        repair_log(path)
    assert path.read_bytes() == content
    with pytest.raises(LogError, match=r"none\.mcap: cannot be read: No such file"):
        repair_log(tmp_path / "none.mcap")


def test_failed_fsync_during_repair_leaves_log_unchanged(whole: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = whole.with_name("full.mcap")
    content = whole.read_bytes()[:-3000]
    path.write_bytes(content)

    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(LogError, match=r"full\.mcap: cannot be repaired: No space left on device"):
        repair_log(path)
    assert path.read_bytes() == content
    assert list(path.parent.glob(".*")) == []


def test_full_disk_while_writing_end_leaves_log_unchanged(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    writer = McapWriter(path, ATTACHED)
    for item in some_items():
        writer.write(item)
        writer.flush()
    writer.abandon()
    content = path.read_bytes() + b"\6\0\1"
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    for room in (0, 1, 10, 1000):
        path.write_bytes(content)
        resource.setrlimit(resource.RLIMIT_FSIZE, (len(content) + room, hard))
        try:
            with pytest.raises(LogError, match=r"log\.mcap: cannot be repaired: File too large"):
                repair_log(path)
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        assert path.read_bytes() == content
    assert repair_log(path).lost_bytes == 3
    assert contents(read_log(path)) == contents(some_items())


def test_log_being_written_is_not_repaired(whole: Path) -> None:
    path = whole.with_name("open.mcap")
    writer = McapWriter(path, {})
    for item in some_items():
        writer.write(item)
    writer.flush()
    content = path.read_bytes()
    with pytest.raises(LogError, match=r"open\.mcap: is being written: it cannot be repaired now"):
        repair_log(path)
    assert path.read_bytes() == content
    assert not has_end(path)
    writer.abandon()
    assert repair_log(path).n_messages == len(some_items())
    assert has_end(path)
    assert contents(read_log(path)) == contents(some_items())


def test_message_times_are_kept_by_repair(whole: Path) -> None:
    path = whole.with_name("times.mcap")
    path.write_bytes(whole.read_bytes()[:-3000])
    repair_log(path)
    with whole.open("rb") as one, path.open("rb") as other:
        first = [(m.log_time, m.publish_time, m.sequence) for *_, m in make_reader(one).iter_messages()]
        second = [(m.log_time, m.publish_time, m.sequence) for *_, m in make_reader(other).iter_messages()]
    assert set(second) <= set(first)
    assert min(time for time, _, _ in second) >= START - 8
