"""State of a run between two of its files: what the windows of the next files depend on beyond these files.

A long run is divided into pieces of whole files, which are identified in parallel. Windows cross the borders of files,
and clocks are fitted to the minutes before. So the assembler is first advanced through the files alone: counts are not
unpacked, and nothing is interpolated, which is several times faster than an identification. Its state at a border has
no counts. The identification of the next piece therefore begins some files earlier, at the last border behind which
lies every block that its first window can need, and advances through these files with their counts.
"""

import hashlib
import math
import pickle
import time
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path

import zstandard

from daq import AnyLog, Assembler, Block, Event, Item, LogError, LogExcerpt, read_log, timing, types
from daq.events import DeviceFailed
from daq.log import BEGINNING, absent_devices, files_of
from monitor.results.service_events import Stopped
from monitor.results.windows import event_result
from monitor.settings import Settings
from monitor.watch import pipeline

_LEVEL = 3  # of compression
# errors of a file, and of bytes that another version of Python or of a library has written
_UNREADABLE: tuple[type[Exception], ...] = (OSError, pickle.UnpicklingError, zstandard.ZstdError, EOFError, ImportError)
_UNREADABLE += (AttributeError, LookupError, TypeError, ValueError)


class TimeLimit:
    """Limit on the time that a task may take, from now on.

    Parameters
    ----------
    seconds : of the limit [s]
    """

    def __init__(self, seconds: float = math.inf) -> None:
        self._seconds, self._end = seconds, time.monotonic() + seconds

    def check(self, log: AnyLog) -> None:
        """Raise LogError, caused by a TimeoutError, if the time is over."""
        if time.monotonic() > self._end:
            reason = f"was not analysed within {self._seconds:g} s: the rest is left out"
            raise LogError(str(log), reason) from TimeoutError()


@dataclass(kw_only=True)
class RunState:
    """State between two items of a run."""

    assembler: Assembler
    begun: bool = False  #: whether there was a block
    stopped: bool = False  #: what follows belongs to no run
    n_blocks: Counter[str] = field(default_factory=Counter)  #: device -> blocks so far

    def advance(self, item: Item) -> None:
        """Take an item, without making windows."""
        self.assembler.advance(item)
        self.count(item)

    def count(self, item: Item) -> None:
        """Count an item that the assembler has taken."""
        if isinstance(item, Block):
            self.begun = True
            self.n_blocks[item.device] += 1

    def pack(self) -> bytes:
        """Return it as bytes, for another process of this version."""
        return zstandard.compress(pickle.dumps(self), _LEVEL)

    @staticmethod
    def unpack(packed: bytes) -> "RunState":
        """Return the state that `pack` has made bytes of."""
        state: RunState = pickle.loads(zstandard.decompress(packed))
        return state


@dataclass(frozen=True, kw_only=True)
class Border:
    """Border between two files."""

    state: bytes  #: of the run there, packed
    n_blocks: Mapping[str, int]  #: device -> blocks before it
    n_files: int = 0  #: files of the run since


@dataclass(frozen=True, kw_only=True)
class PieceStart:
    """Beginning of a piece of a run."""

    state: bytes = b""  #: of the run there, packed; empty where a state begins anew
    borders: tuple[Border, ...] = ()  #: from the last one behind which lies what the next window can need
    after_damage: bool = False  #: whether what comes before in the run was lost

    @property
    def n_files(self) -> int:
        """Number of files before the piece that its identification begins with."""
        return self.borders[0].n_files if self.borders else 0


def read_start(path: Path) -> PieceStart | None:
    """Return the beginning of a piece in a file; None if there is none, or it is damaged or of another version.

    The file holds Python objects, and its hash is no signature: the folder must be one that only trusted users write.
    """
    try:
        head, _, content = path.read_bytes().partition(b"\n")
        if head != _head(content):
            return None
        start: PieceStart = pickle.loads(content)
        if start.state:
            RunState.unpack(start.state)
    except _UNREADABLE:
        return None
    return start


def write_start(path: Path, start: PieceStart) -> None:
    """Keep the beginning of a piece in a file."""
    content, unfinished = pickle.dumps(start), path.with_suffix(".part")
    unfinished.write_bytes(_head(content) + b"\n" + content)
    unfinished.replace(path)


def _head(content: bytes) -> bytes:
    """Return the line before the content of a file: one of other classes is not unpickled."""
    return f"{_code()} {hashlib.sha256(content).hexdigest()}".encode()


@cache
def _code() -> str:
    """Return the hash of the code that a state depends on."""
    return hashlib.sha256(b"".join(path.read_bytes() for path in code_files())).hexdigest()


def code_files() -> list[Path]:
    """Return the code of all classes in a state, and of the function that begins one."""
    modules = (__file__, types.__file__, pipeline.__file__)
    return [*map(Path, modules), *sorted(Path(timing.__file__).parent.glob("*.py"))]


def begin_piece(log: AnyLog, settings: Settings, start: PieceStart) -> RunState:
    """Return the state at the beginning of a piece, without counts."""
    if start.state:
        return RunState.unpack(start.state)
    state = RunState(assembler=pipeline.assembler_of(settings))
    devices = {device.name for device in settings.device}
    if start.after_damage and not isinstance(log, LogExcerpt):
        log = LogExcerpt(log=log, start=BEGINNING + 1, text="")  # the loss of a device may be reported before it
    for device in absent_devices(log, devices):
        state.advance(DeviceFailed(device=device).event(0))  # before any data: completes no window
    return state


def read_counts(start: PieceStart, lead: Sequence[Path], settings: Settings, limit: TimeLimit) -> RunState:
    """Return the state at the beginning of a piece with the counts that its windows need.

    Parameters
    ----------
    start : of the piece, with a state
    lead : the last files before it, as many as the start states
    settings : of the site
    limit : on the time of the task

    Raises
    ------
    LogError
        If a file before the piece is damaged or cannot be read now, or the time is over.
    """
    state = RunState.unpack(start.borders[0].state)
    state.assembler.mark()
    for path in lead:
        for item in analysed_items(path, settings, state, limit):
            state.advance(item)
    state.assembler.refuse_marked()
    return state


def advance(log: AnyLog, settings: Settings, start: PieceStart, limit: TimeLimit) -> PieceStart:
    """Return the beginning of the piece after this one; after a damaged one, a state begins anew.

    Raises
    ------
    LogError
        If it cannot be read now, as when a storage does not respond, or the time is over.
    """
    try:
        state, borders = begin_piece(log, settings, start), list(start.borders)
        for path in files_of(log):
            borders.append(Border(state=state.pack(), n_blocks=Counter(state.n_blocks)))
            for item in analysed_items(path, settings, state, limit, axes={}):
                state.advance(item)
            borders = [replace(border, n_files=border.n_files + 1) for border in borders]
            needed = state.assembler.n_needed()
            while len(borders) > 1 and _covers(borders[1], state, needed):
                del borders[0]
    except LogError as error:
        if is_temporary(error):
            raise
        return PieceStart(after_damage=True)
    return PieceStart(state=state.pack(), borders=tuple(borders))


def is_temporary(error: LogError) -> bool:
    """Return whether a later run may read the log: the storage did not respond, or the time was over."""
    return isinstance(error.__cause__, OSError)


def _covers(border: Border, state: RunState, needed: Mapping[str, int]) -> bool:
    """Return whether the blocks of each device that are needed lie behind a border."""
    return all(n <= state.n_blocks[device] - border.n_blocks.get(device, 0) for device, n in needed.items())


def analysed_items(
    log: AnyLog,
    settings: Settings,
    state: RunState,
    limit: TimeLimit,
    axes: Mapping[str, Collection[int]] | None = None,
) -> Iterator[Item]:
    """Yield the blocks and events of a log that its analysis takes, up to the end of the run.

    Raises
    ------
    LogError
        If the log is damaged or cannot be read now, or the time is over.
    """
    devices = {device.name for device in settings.device}
    if state.stopped:
        return
    for item in read_log(log, axes, others=True):
        limit.check(log)
        if isinstance(item, Event):
            if event_result(item) is not None:
                continue
            if item.topic == Stopped.topic:
                state.stopped = True
                return
        elif item.device not in devices:
            raise LogError(str(log), f"holds device {item.device!r}; the settings have {', '.join(sorted(devices))}")
        yield item
