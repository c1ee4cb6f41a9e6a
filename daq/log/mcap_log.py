"""The log: one MCAP file of the stock writer, readable by stock tools, whole up to the last flush after a kill.

Blocks are protobuf messages on /accel/DEVICE. Everything else (gaps, faults, decisions, results) is a JSON message on
its own topic. Settings and structure, required for a replay, are attached at the start, so that truncated files have
them.
"""

import contextlib
import io
import json
import os
import struct
import sys
import time
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, TYPE_CHECKING, Literal, TypeVar

from google.protobuf.message import DecodeError
from mcap.exceptions import EndOfFile, McapError
from mcap.records import Attachment, Channel, Chunk, Header, Message, Metadata
from mcap_protobuf.schema import build_file_descriptor_set
from zstandard import ZstdError

from daq.bounded_text import parse_json
from daq.errors import ItemError, LogError, reading, writing
from daq.log.format.accel_block_pb2 import AccelBlock
from daq.log.format.block_codec import AxesOfDevices, decode_blocks, encode_block
from daq.log.format.chunks import ChunkReader
from daq.log.format.file_index import LeanWriter, file_index
from daq.log.format.preview import ViewMessage
from daq.log.format.progress import report_progress
from daq.log.format.record_stream import RecordStream
from daq.log.format.ros_messages import ENCODING as VIEW_ENCODING
from daq.log.format.ros_messages import schema as view_schema
from daq.log.parts import END, PART, AnyLog, LogExcerpt, Part, files_of, lock
from daq.types import Block, Event, Item

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer


ACCEL = "/accel/"
PROFILE = "modalwatch"
_BUFFER = 1 << 20
# ns: largest difference between the time of a message and its content, or between blocks of two devices
_REACH = 10 * 10**9
SCHEMAS = {  # encoding of a channel's messages -> name, encoding and text of their schema
    "protobuf": ("modalwatch.AccelBlock", "protobuf", build_file_descriptor_set(AccelBlock).SerializeToString()),
    "json": ("modalwatch.Event", "jsonschema", b'{"type": "object"}'),
}
T = TypeVar("T")
_BATCH, _BATCH_BYTES = 128, 1 << 18  # messages that are decoded together, and their size
_Topical = tuple[str, Message]
_KINDS: dict[str, type[int] | type[float]] = {"missing": int, "exact": int, "index": int, "celsius": float}
MAGIC = b"\x89MCAP0\r\n"


@dataclass(frozen=True)
class Displacement:
    """Change that others have made to an open file."""

    how: Literal["moved", "deleted", "cut short"]
    to: str | None = None  #: present path, if known


class McapWriter:
    """Writes one file of a log; not for several threads (see `WriterThread`).

    Parameters
    ----------
    path : of the new file
    attachments : name -> text, written first
    part : number of the file in its run; None for the only one

    Raises
    ------
    LogError
        If the file exists or cannot be made.
    """

    def __init__(self, path: Path, attachments: Mapping[str, str], part: Part | None = None) -> None:
        with writing(path, LogError):
            self._end = _AppendedFile(path)
        self._file = io.BufferedWriter(self._end, _BUFFER)
        self._path = path
        lock(self._file)  # for as long as it is open: see `repair_log`
        self._writer = LeanWriter(self._file)
        self._safe = 0  # length after the last flush
        try:
            self._begin(attachments, part)
        except OSError as error:
            self.abandon()
            path.unlink(missing_ok=True)
            raise LogError(path, f"cannot be written: {error.strerror}") from error

    def _begin(self, attachments: Mapping[str, str], part: Part | None) -> None:
        """Write the records before the first item."""
        self._writer.start(profile=PROFILE, library="modalwatch")
        self._channels: dict[str, int] = {}
        self._written: dict[str, int] = {}
        if part:
            self._writer.add_metadata(PART, part.metadata())
        for name, text in attachments.items():
            self._writer.add_attachment(time.time_ns(), time.time_ns(), name, "text/plain", text.encode())
        self._accel = self._writer.register_schema(*SCHEMAS["protobuf"])
        self._json = self._writer.register_schema(*SCHEMAS["json"])
        self._shown: dict[str, int] = {}  # schemas of the view
        self.flush()
        _sync_folder(self._path.parent)

    def write(self, item: Item) -> None:
        """Append a block or an event to the open chunk.

        Raises
        ------
        ItemError
            If it cannot be encoded; the file is as before.
        """
        if isinstance(item, Block):
            data = _encoded(encode_block, item)
            self._add(ACCEL + item.device, self._accel, "protobuf", item.arrival_time, data)
        else:
            self._add(item.topic, self._json, "json", item.time, _encoded(_event_json, item))

    def show(self, message: ViewMessage) -> None:
        """Append a scan for stock viewers to the open chunk; readers of the log pass over it."""
        if message.kind not in self._shown:
            self._shown[message.kind] = self._writer.register_schema(*view_schema(message.kind))
        self._add(message.topic, self._shown[message.kind], VIEW_ENCODING, message.time, message.data)

    def _add(self, topic: str, schema: int, encoding: str, log_time: int, data: bytes) -> None:
        if topic not in self._channels:
            self._channels[topic] = self._writer.register_channel(topic, encoding, schema)
            self._written[topic] = 0
        self._written[topic] += 1
        self._writer.add_message(
            self._channels[topic], log_time=log_time, publish_time=log_time, data=data, sequence=self._written[topic]
        )

    def hand_over(self) -> None:
        """Close the chunk and write it to the system, which keeps it if this process is killed."""
        self._writer.flush()  # type: ignore[no-untyped-call]
        self._file.flush()

    def flush(self) -> None:
        """Close the chunk and flush it to the disk."""
        self.hand_over()
        os.fdatasync(self._file.fileno())
        self._safe = self._end.written

    def close(self) -> None:
        """Write the summary, flush it to the disk and close the file."""
        self._writer.finish()  # type: ignore[no-untyped-call]
        self._file.flush()
        os.fdatasync(self._file.fileno())
        self._file.close()

    @property
    def size(self) -> int:
        """Length of the file up to the last flush [bytes]."""
        return self._safe

    def abandon(self) -> None:
        """Close the file as it was after its last flush: the disk accepts no more data."""
        number = os.dup(self._file.fileno())  # whatever its path leads to by now
        try:
            self.forsake()
            with contextlib.suppress(OSError):
                os.ftruncate(number, self._safe)
        finally:
            os.close(number)

    def forsake(self) -> None:
        """Close the file as it is."""
        with contextlib.suppress(OSError):
            self._file.close()

    @property
    def cut_short(self) -> bool:
        """True if another program has shortened the file."""
        return os.fstat(self._file.fileno()).st_size < self._end.written

    def displacement(self) -> "Displacement | None":
        """Return the change made to the file by other programs since it was begun; None if its path is still valid."""
        own = os.fstat(self._file.fileno())
        try:
            there = self._path.stat()
        except OSError:
            there = None
        if there is None or (there.st_dev, there.st_ino) != (own.st_dev, own.st_ino):
            return Displacement("moved", _path_of(self._file.fileno())) if own.st_nlink else Displacement("deleted")
        return Displacement("cut short") if self.cut_short else None


class _AppendedFile(io.FileIO):
    """New file that is always written at its end, so that it stays too short if others cut it between two writes."""

    def __init__(self, path: Path) -> None:
        super().__init__(path, "xb", opener=lambda name, flags: os.open(name, flags | os.O_APPEND, 0o666))
        self.written = 0  #: [bytes]

    def write(self, data: "ReadableBuffer", /) -> int:
        """Write at the end of the file and count the bytes."""
        n_bytes = super().write(data)
        self.written += n_bytes
        return n_bytes


def _path_of(number: int) -> str | None:
    """Return the present path of an open file, if the system provides it."""
    try:
        return os.readlink(f"/proc/self/fd/{number}")
    except OSError:
        return None


def _event_json(event: Event) -> bytes:
    return json.dumps(event.payload, separators=(",", ":")).encode()


def _encoded(encode: Callable[[T], bytes], item: T) -> bytes:
    try:
        return encode(item)
    except Exception as error:
        raise ItemError(f"an item that no log can hold: {type(error).__name__}: {error}") from error


def _sync_folder(folder: Path) -> None:
    """Bring the name of a new file to the disk, which its own sync does not."""
    if sys.platform == "win32":
        return  # folders cannot be opened there
    number = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(number)
    finally:
        os.close(number)


def read_events(log: AnyLog, topics: Collection[str] | None = None) -> Iterator[Event]:
    """Yield the events alone, all or those of some topics, which is faster; else as `read_log`."""

    def wanted(topic: str) -> bool:
        return topic in topics if topics is not None else not _is_signal(topic)

    yield from (item for item in _read(log, wanted) if isinstance(item, Event))


def read_log(log: AnyLog, axes: AxesOfDevices | None = None, *, others: bool = False) -> Iterator[Item]:
    """Yield blocks and events in the order in which they were written, in bounded memory.

    A file cut anywhere is read up to its last whole chunk. Of an excerpt only chunks near its range are read, where the
    file has an index; blocks across its ends are shortened.

    Parameters
    ----------
    log : its path, all files of a run, or an excerpt
    axes : device -> axes that are used, which is faster: blocks of other devices are left out, counts of other axes
        are 0, axes behind the last used one are missing. Default: all
    others : blocks of other devices are yielded too, all their counts 0

    Raises
    ------
    LogError
        If it cannot be read, is not a log, or is damaged inside (earlier items are yielded first).
    """

    def wanted(topic: str) -> bool:
        return axes is None or others or not _is_signal(topic) or topic.removeprefix(ACCEL) in axes

    yield from _read(log, wanted, axes)


def log_start(log: AnyLog) -> int | None:
    """Return the time of the first scan of a log [ns UTC]; None if it has no scans.

    Raises
    ------
    LogError
        If it cannot be read, is not a log, or is damaged where it is read.
    """
    return next((time for path in files_of(log) if (time := _start_of(path)) is not None), None)


def log_span(log: AnyLog) -> tuple[int, int] | None:
    """Return the times of the first scan of a log and after its last one [ns UTC]; None if it has no scans.

    Raises
    ------
    LogError
        If it cannot be read, is not a log, or is damaged where it is read.
    """
    start = log_start(log)
    end = next((time for path in reversed(files_of(log)) if (time := _end_of(path)) is not None), None)
    return None if start is None or end is None else (start, end)


def _start_of(path: Path) -> int | None:
    """Return the time of the first scan in a file [ns UTC]; that of a device may come slightly after another one's."""
    start: int | None = None
    for block in _blocks(_parsed(path, _records(path, _is_signal), _is_signal)):
        first = block.time_of(block.first_index)
        start = first if start is None else min(start, first)
        if block.arrival_time > start + _REACH:
            break
    return start


def _end_of(path: Path) -> int | None:
    """Return the time after the last scan in a file [ns UTC]; with an index, from the last chunks."""
    index = file_index(path)
    if index is None:
        return _latest(_parsed(path, _records(path, _is_signal), _is_signal))
    end: int | None = None
    for chunk in reversed(index.with_topics(_is_signal)):
        if end is not None and chunk.message_end_time < end - _REACH:
            break
        latest = _latest(_parsed(path, (*index.channels, *index.messages(chunk, _items_of(_is_signal))), _is_signal))
        end = max((time for time in (end, latest) if time is not None), default=None)
    return end


def _latest(items: Iterable[Item]) -> int | None:
    return max((block.time_of(block.end_index) for block in _blocks(items)), default=None)


def _blocks(items: Iterable[Item]) -> Iterator[Block]:
    return (item for item in items if isinstance(item, Block) and item.n_scans)


def _is_signal(topic: str) -> bool:
    return topic.startswith(ACCEL)


def _items_of(wanted: Callable[[str], bool]) -> Callable[[Channel], bool]:
    """Return whether the messages of a channel are items of wanted topics."""
    return lambda channel: channel.message_encoding != VIEW_ENCODING and wanted(channel.topic)


def _read(log: AnyLog, wanted: Callable[[str], bool], axes: AxesOfDevices | None = None) -> Iterator[Item]:
    """Yield the items of some topics; of signals, some axes."""
    if not isinstance(log, LogExcerpt):
        for path in files_of(log):
            yield from _parsed(path, _records(path, wanted), wanted, axes)
        return
    for path in files_of(log.log):
        for item in _parsed(path, _records_within(path, log, wanted), wanted, axes):
            kept = item.within(log.start, log.stop) if isinstance(item, Block) else item
            if isinstance(kept, Block) or (kept is not None and log.start <= kept.time < log.stop):
                yield kept


def _records_within(path: Path, log: LogExcerpt, wanted: Callable[[str], bool]) -> Iterator[object]:
    """Yield channels and the messages near a range; all records of a file without an index."""
    index = file_index(path)
    if index is None:
        yield from _records(path, wanted)
        return
    yield from index.channels
    chunks = [
        chunk
        for chunk in index.with_topics(wanted)
        if chunk.message_start_time < log.stop + _REACH and chunk.message_end_time > log.start - _REACH
    ]
    for number, chunk in enumerate(chunks, 1):
        yield from index.messages(chunk, _items_of(wanted))
        report_progress(path, number, len(chunks))


def _parsed(
    path: Path, records: Iterable[object], wanted: Callable[[str], bool], axes: AxesOfDevices | None = None
) -> Iterator[Item]:
    """Yield the items of some topics among the records of a file; of signals, some axes."""
    for messages in _batches(records, wanted):
        items: Iterable[Item]
        try:
            items = _items(messages, axes)
        except (DecodeError, ValueError):  # those before the damaged one are yielded
            items = (_own_item(path, topic, message, axes) for topic, message in messages)
        yield from items


def _batches(records: Iterable[object], wanted: Callable[[str], bool]) -> Iterator[list[_Topical]]:
    """Yield the messages of some topics with their topics, some at a time; those before an error are yielded first."""
    topics, is_wanted = dict[int, str](), _items_of(wanted)
    batch: list[_Topical] = []
    size = 0
    try:
        for record in records:
            if isinstance(record, Channel) and is_wanted(record):
                topics[record.id] = record.topic
            elif isinstance(record, Message) and record.channel_id in topics:
                batch.append((topics[record.channel_id], record))
                size += len(record.data) + _BATCH_BYTES // _BATCH
                if size >= _BATCH_BYTES:
                    yield batch
                    batch, size = [], 0
    except LogError:
        yield batch
        raise
    yield batch


def _items(messages: Sequence[_Topical], axes: AxesOfDevices | None) -> list[Item]:
    """Return the items of messages, in their order."""
    signals = [(topic.removeprefix(ACCEL), message.data) for topic, message in messages if _is_signal(topic)]
    blocks = iter(decode_blocks(signals, axes))
    return [next(blocks) if _is_signal(topic) else _event(topic, message) for topic, message in messages]


def _own_item(path: Path, topic: str, message: Message, axes: AxesOfDevices | None) -> Item:
    try:
        [item] = _items([(topic, message)], axes)
    except (DecodeError, ValueError) as error:
        raise LogError(path, f"message {message.sequence} of {topic}: {error}") from error
    return item


def _event(topic: str, message: Message) -> Event:
    if message.log_time > END:
        raise ValueError(f"expected a time before the year 2262, found {message.log_time} ns")
    payload = parse_json(message.data)
    if not isinstance(payload, dict):
        raise ValueError(f"expected a JSON object, found {payload!r:.40}")
    for name, kind in _KINDS.items():
        if not isinstance(payload.get(name, kind()), kind | int):
            raise ValueError(f"{name}: expected {kind.__name__}, found {payload[name]!r:.40}")
    if not isinstance(payload.get("device", ""), str):
        raise ValueError(f"device: expected a name, found {payload['device']!r:.40}")
    return Event(topic=topic, time=message.log_time, payload=payload)


def read_attachments(log: AnyLog) -> dict[str, str]:
    """Return name -> text of the attachments, for a run those of its first file; errors as for `read_log`."""
    found: dict[str, str] = {}
    for record in _records(files_of(log)[0]):
        if isinstance(record, Attachment):
            try:
                found[record.name] = record.data.decode()
            except UnicodeDecodeError as error:
                raise LogError(
                    files_of(log)[0], f"attachment {record.name}: expected text in UTF-8: {error}"
                ) from error
        elif isinstance(record, Message):
            break  # attachments come before the first message
    return found


def read_part(path: Path) -> Part | None:
    """Return the run and number of a log file, None for a single file; errors as for `read_log`."""
    for record in _records(path):
        if isinstance(record, Metadata) and record.name == PART:
            try:
                return Part.parse(record.metadata)
            except (KeyError, ValueError) as error:
                raise LogError(path, f"has no number of its file in the run: {error}") from error
        if isinstance(record, Attachment | Channel | Message):
            break  # it would come before these
    return None


def _records(path: Path, wanted: Callable[[str], bool] = lambda _: True) -> Iterator[object]:
    """Yield the records of a file; messages in chunks only if they are items of wanted topics."""
    with reading(path, LogError), path.open("rb") as file:
        size = file.seek(0, os.SEEK_END)
        file.seek(0)
        if file.read(len(MAGIC)) != MAGIC:
            raise LogError(path, "is not an MCAP log (`modalwatch import` converts tables of measurements)")
        yield from _until_cut(path, file, size, ChunkReader(_items_of(wanted)))


def _until_cut(path: Path, file: IO[bytes], size: int, chunks: ChunkReader) -> Iterator[object]:
    """Yield records until the file's end, planned or not."""
    stream = RecordStream(file)
    records = iter(stream)
    while True:
        try:
            record = next(records)
            opened = chunks.records(record) if isinstance(record, Chunk) else (record,)
        except (StopIteration, EndOfFile):
            return
        except (McapError, ZstdError, struct.error, ValueError) as error:
            raise LogError(
                path,
                f"is damaged before byte {stream.position} (`modalwatch repair` keeps every whole chunk): {error}",
            ) from error
        if isinstance(record, Header) and record.profile != PROFILE:
            raise LogError(path, f"is no modalwatch log: expected profile {PROFILE!r}, found {record.profile!r:.80}")
        if isinstance(record, Channel):
            chunks.channel(record)
        yield from opened
        if isinstance(record, Chunk):
            report_progress(path, stream.position, size)
