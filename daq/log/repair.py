"""Recovery of the data in a damaged log, and repair of the log."""

import contextlib
import mmap
import os
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import FileIO
from pathlib import Path
from typing import IO, cast

from mcap.exceptions import EndOfFile, McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, Header, Message, Metadata, Schema, Statistics
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, Writer
from zstandard import ZstdError

from daq.bounded_text import one_line
from daq.errors import LogError, reading
from daq.log.format.chunks import CHUNK_HEAD, FRAME, WholeReads, chunk_records, next_chunk
from daq.log.mcap_log import MAGIC, PROFILE, SCHEMAS
from daq.log.parts import lock
from daq.log.recovery import NotPlainError, PlainLog

_FOOTER = struct.Struct("<QQI")  # begin of the summary, of its offsets, checksum
_LAST_OPCODE = 0x0F  # of the format's records
_LARGEST_REST = 64 << 20  # bytes held in memory, to be put back if the disk takes no end
_DAMAGE = (McapError, ZstdError, struct.error, ValueError)


@dataclass(frozen=True, kw_only=True)
class LogState:
    """State of a log."""

    n_messages: int  #: messages in whole chunks
    lost_chunks: int  #: damaged chunks, whose content is lost
    lost_bytes: int  #: after the last whole record: half a chunk where a log was cut
    finished: bool  #: whether its summary and its indexes, required by stock readers, are valid

    @property
    def whole(self) -> bool:
        """Return whether no repair is needed."""
        return self.finished and not self.lost_chunks

    def __add__(self, other: "LogState") -> "LogState":
        """Return the combined state of two files."""
        return LogState(
            n_messages=self.n_messages + other.n_messages,
            lost_chunks=self.lost_chunks + other.lost_chunks,
            lost_bytes=self.lost_bytes + other.lost_bytes,
            finished=self.finished and other.finished,
        )

    def __str__(self) -> str:
        """Return a short text."""
        if self.whole:
            return "whole"
        chunks = f"{self.lost_chunks} {'chunk' if self.lost_chunks == 1 else 'chunks'} damaged"
        cut = f"cut, {self.lost_bytes} bytes of an unfinished chunk"
        end = cut if self.lost_bytes else "its summary or an index is missing or damaged"
        return ", ".join([end] * (not self.finished) + [chunks] * bool(self.lost_chunks))


@dataclass
class _Survey:
    """Findings of one pass through a log."""

    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    n_messages: int = 0
    n_chunks: int = 0  # that are whole
    damaged_chunks: int = 0
    stated_chunks: int = 0  # by the statistics at the end of the log
    good: int = 0  # bytes up to the end of the last whole record
    finished: bool = False
    ours: bool = False  # by our writer, whose indexes can be verified

    @property
    def lost_chunks(self) -> int:
        """Return the number of lost chunks: one whose opcode is damaged is found by the statistics only."""
        return max(self.damaged_chunks, self.stated_chunks - self.n_chunks if self.finished else 0)

    def note(self, record: object) -> None:
        if isinstance(record, Header):
            self.ours = record.library == "modalwatch"
        elif isinstance(record, Schema):  # those of a chunk precede their copies in the summary
            self.schemas.setdefault(record.id, record)
        elif isinstance(record, Channel):
            self.channels.setdefault(record.id, record)
        elif isinstance(record, Message):
            self.n_messages += 1
        elif isinstance(record, Statistics):
            self.stated_chunks = record.chunk_count


def inspect_log(path: Path) -> LogState:
    """Read a whole log and return its state.

    Raises
    ------
    LogError
        If it cannot be read or is not a log.
    """
    with reading(path, LogError), _open(path) as file:
        if log := _plain(file):
            return _plain_state(file, log)
    return _state(path, _survey(path))


def _open(path: Path) -> IO[bytes]:
    with reading(path, LogError):
        return path.open("rb")


def repair_log(path: Path) -> LogState:
    """Repair a log in place: keep every complete chunk and rebuild the summary for stock readers.

    An intact log is not changed. A log without a valid end gets one in place. Of any other, the valid parts are copied
    to a new file next to it, which replaces it. A log that is still being written by another process is refused.

    Returns
    -------
    LogState
        State of the log before the repair.

    Raises
    ------
    LogError
        If it cannot be read, is not a log, is being written, or the new one cannot be written.
    """
    try:
        return _completed(path) or _copied(path)
    except OSError as error:
        raise LogError(path, f"cannot be repaired: {error.strerror}") from error


def _completed(path: Path) -> LogState | None:
    """Write the end that a log lacks; None, and nothing done, if it lacks more or is no log of ours."""
    with _open(path) as file:
        locked, log = lock(file), _plain(file)
        if not log:
            return None
        state = _plain_state(file, log)
        if state.whole:
            return state
        if not locked or state.lost_bytes > _LARGEST_REST:
            return None
        with path.open("r+b", buffering=0) as end:  # a buffer would be written again on closing, with the refused data
            _end(end, log)
    return state


def _plain(file: IO[bytes]) -> PlainLog | None:
    """Return the contents of a log whose chunks and indexes are as our writer left them, or None."""
    if next(_records(file, _Survey()), None) != Header(PROFILE, "modalwatch"):
        return None
    try:
        return PlainLog(file)
    except NotPlainError:
        return None


def _plain_state(file: IO[bytes], log: PlainLog) -> LogState:
    file.seek(log.good)
    end = log.end()
    found = file.read(len(end) + 1)
    lost = 0 if found[:1] == bytes([Opcode.DATA_END]) else file.seek(0, os.SEEK_END) - log.good
    return LogState(n_messages=log.n_messages, lost_chunks=0, lost_bytes=lost, finished=found == end)


def _copied(path: Path) -> LogState:
    """Replace a log by its valid parts, unless it is intact."""
    survey = _survey(path)
    state = _state(path, survey)
    if state.whole:
        return state
    with path.open("rb") as file:
        if not lock(file):
            raise LogError(path, "is being written: it cannot be repaired now")
        _replace(path, survey)
    return state


def _end(file: FileIO, log: PlainLog) -> None:
    """Put the end in the place of an unfinished rest, or leave that as it was if the disk does not take it."""
    file.seek(log.good)
    rest = file.read()
    try:
        _put(file, log.good, log.end())
    except OSError:
        with contextlib.suppress(OSError):
            _put(file, log.good, rest)
        raise


def _put(file: FileIO, at: int, data: bytes) -> None:
    file.seek(at)
    left = memoryview(data)
    while left:
        left = left[file.write(left) :]
    file.truncate()
    os.fsync(file.fileno())


def has_end(path: Path) -> bool:
    """Return whether a log has the end of a finished one, without reading it; errors as for `inspect_log`."""
    with reading(path, LogError), path.open("rb") as file:
        file.seek(-min(len(MAGIC), path.stat().st_size), os.SEEK_END)
        return file.read() == MAGIC


def _replace(path: Path, survey: _Survey) -> None:
    """Replace a log by another one made of its valid parts."""
    temporary = path.with_name(f".{path.name}.repairing")
    try:
        with temporary.open("wb") as file:
            _copy(path, survey, file)
            file.flush()
            os.fsync(file.fileno())
        temporary.replace(path)
    except OSError:
        temporary.unlink(missing_ok=True)
        raise


def _survey(path: Path) -> _Survey:
    survey = _Survey()
    for record in _salvage(path, survey):
        survey.note(record)
    return survey


def _state(path: Path, survey: _Survey) -> LogState:
    return LogState(
        n_messages=survey.n_messages,
        lost_chunks=survey.lost_chunks,
        lost_bytes=path.stat().st_size - survey.good,
        finished=survey.finished and (survey.lost_chunks > 0 or not survey.ours),
    )


def _salvage(path: Path, survey: _Survey) -> Iterator[object]:
    """Yield all readable records, including those of chunks; note the others in the survey."""
    with reading(path, LogError), path.open("rb") as file:
        if file.read(len(MAGIC)) != MAGIC:
            raise LogError(path, "is not an MCAP log")
        file.seek(0)
        records = _records(file, survey)
        header = next(records, None)
        _check_header(path, header)
        yield header
        for record in records:
            if isinstance(record, Chunk):
                yield from _opened(record, survey)
            elif not isinstance(record, Message) or not survey.n_chunks:  # else it is a record with a wrong opcode
                yield record


def _check_header(path: Path, record: object) -> None:
    """Refuse files of other programs."""
    if not isinstance(record, Header):
        raise LogError(path, "is not an MCAP log: it has no header")
    if record.profile != PROFILE:
        raise LogError(path, f"is no modalwatch log: expected profile {PROFILE!r}, found {record.profile!r}")


def _records(file: IO[bytes], survey: _Survey) -> Iterator[object]:
    """Yield records in the order of the file, up to its end or damage without a chunk after it.

    A record that is damaged inside is stepped over, to the next chunk if its length is damaged.
    """
    stream = cast(IO[bytes], WholeReads(file))
    records = StreamReader(stream, emit_chunks=True).records
    while True:
        start = file.tell()
        try:
            record = next(records)
        except StopIteration:
            survey.finished, survey.good = _has_valid_summary(file), file.tell()
            return
        except (EndOfFile, *_DAMAGE):
            if not _step_over(file, start):
                return
            survey.damaged_chunks += 1
            records = StreamReader(stream, emit_chunks=True, skip_magic=True).records
            continue
        if isinstance(record, Chunk) and _has_other_length(file, start, record) and _step_over(file, start):
            records = StreamReader(stream, emit_chunks=True, skip_magic=True).records
        survey.good = file.tell()
        yield record


def _has_other_length(file: IO[bytes], start: int, chunk: Chunk) -> bool:
    """Return whether the length of a chunk's record, which ends here, is not that of its content."""
    end = file.tell()
    file.seek(start)
    opcode = file.read(1)[0]
    file.seek(end)
    length = CHUNK_HEAD + len(chunk.compression) + 8 + len(chunk.data)
    return opcode == Opcode.CHUNK and end - start != length  # else a record of an unknown kind was skipped before it


def _has_valid_summary(file: IO[bytes]) -> bool:
    """Return whether the checksum of the summary, and of the footer's fields before it, is right; 0 is none."""
    end = file.tell()
    file.seek(end - _FOOTER.size - len(MAGIC))
    start, _, checksum = _FOOTER.unpack(file.read(_FOOTER.size))
    stop = end - len(MAGIC) - 4  # the checksum itself
    valid = not checksum
    if checksum and start < stop:
        file.seek(start or end - _FOOTER.size - len(MAGIC) - 9)  # without a summary: from the footer's record on
        valid = zlib.crc32(file.read(stop - file.tell())) == checksum
    file.seek(end)
    return valid


def _step_over(file: IO[bytes], start: int) -> bool:
    """Go to the record behind that at `start`, or to the next chunk if that is nearer; False if there is neither."""
    file.seek(start)
    frame = file.read(FRAME)
    if not frame:
        return False
    with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        behind = start + FRAME + int.from_bytes(frame[1:], "little")
        chunk = next_chunk(data, start)
        is_record = len(frame) == FRAME and behind + FRAME <= len(data) and 0 < data[behind] <= _LAST_OPCODE
    places = [place for place in (behind if is_record else None, chunk) if place is not None]
    if places:
        file.seek(min(places))
    return bool(places)


def _opened(chunk: Chunk, survey: _Survey) -> list[object]:
    """Return the records of a chunk; none if it is damaged."""
    try:
        records: list[object] = [*chunk_records(chunk)]
    except _DAMAGE:
        survey.damaged_chunks += 1
        return []
    survey.n_chunks += 1
    return records


def _copy(path: Path, survey: _Survey, file: IO[bytes]) -> None:
    """Copy the valid parts of a log to a new one."""
    writer = Writer(file, compression=CompressionType.ZSTD)
    writer.start(profile=PROFILE, library="modalwatch")
    schemas: dict[int, int] = {0: 0}  # number in the old file -> in the new one; 0 is none
    channels: dict[int, int] = {}
    for record in _salvage(path, _Survey()):
        if isinstance(record, Attachment):
            writer.add_attachment(record.create_time, record.log_time, record.name, record.media_type, record.data)
        elif isinstance(record, Metadata):
            writer.add_metadata(record.name, record.metadata)
        elif isinstance(record, Message) and record.channel_id in survey.channels:
            channel = survey.channels[record.channel_id]
            if channel.schema_id not in survey.schemas and channel.message_encoding not in SCHEMAS:
                continue  # of the view, which `log expand` makes again
            if channel.schema_id not in schemas:
                schemas[channel.schema_id] = writer.register_schema(*_schema(survey, channel))
            if channel.id not in channels:
                channels[channel.id] = writer.register_channel(
                    channel.topic, channel.message_encoding, schemas[channel.schema_id], channel.metadata
                )
            writer.add_message(channels[channel.id], record.log_time, record.data, record.publish_time, record.sequence)
    writer.finish()  # type: ignore[no-untyped-call]


def _schema(survey: _Survey, channel: Channel) -> tuple[str, str, bytes]:
    """Return name, encoding and text of a channel's schema; ours if its chunk is lost."""
    schema = survey.schemas.get(channel.schema_id)
    return (schema.name, schema.encoding, schema.data) if schema else SCHEMAS[channel.message_encoding]


def repair_folder(folder: Path) -> Iterator[str]:
    """Repair the unfinished logs of a folder; yield a text for each.

    A log that is still being written, or cannot be repaired, is left as it is.
    """
    for path in sorted(folder.glob("*.mcap")):
        try:
            if not has_end(path):
                state = repair_log(path)
                yield f"{path}: repaired, {state.n_messages} messages kept"
        except LogError as error:
            yield str(error)
        except Exception as error:  # noqa: BLE001 - no file of the folder may prevent a start
            yield one_line(f"{path}: cannot be repaired: {type(error).__name__}: {error}")
