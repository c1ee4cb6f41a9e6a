"""Steps of a log: its events and identified windows, in order, as compact bytes that any process can read."""

import hashlib
import io
import json
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import zstandard

from daq import AnyLog, Event, LogError, Recording
from monitor.analysis.window import IdentifiedWindow, identify_window
from monitor.archive.run_state import (
    PieceStart,
    RunState,
    TimeLimit,
    analysed_items,
    begin_piece,
    is_temporary,
    read_counts,
)
from monitor.results.windows import Spectrum
from monitor.settings import Settings
from monitor.watch.memory.codec import decode, encode

_LEVEL = 3  # of compression
_BEGINNING = PieceStart()  # of a log


class Packer:
    """Packed lines, so far."""

    def __init__(self) -> None:
        self._packer = zstandard.ZstdCompressor(level=_LEVEL).compressobj()
        self._parts: list[bytes] = []

    def add(self, entry: dict[str, Any]) -> None:
        """Add one line."""
        self._parts.append(self._packer.compress(json.dumps(entry).encode() + b"\n"))

    def finish(self) -> bytes:
        """Return all lines; none can be added any more."""
        return b"".join([*self._parts, self._packer.flush()])


def unpack(packed: bytes) -> Iterator[dict[str, Any]]:
    """Yield the entries that a `Packer` has packed."""
    with io.TextIOWrapper(zstandard.ZstdDecompressor().stream_reader(packed), encoding="utf-8") as lines:
        for line in lines:
            yield json.loads(line)


Step = int | Event | IdentifiedWindow  #: arrival of the first block [ns UTC], an event, or a window


@dataclass(frozen=True, kw_only=True)
class LogSteps:
    """Steps of one log, packed."""

    packed: bytes
    n_windows: int
    seconds: float  #: of data in the windows
    problem: str | None  #: reason why the log was not read to its end
    retry: bool = False  #: whether this reason is the limit of time or the storage: the next run begins anew


def identify_log(
    log: AnyLog,
    settings: Settings,
    limit: float = math.inf,
    start: PieceStart = _BEGINNING,
    lead: Sequence[Path] = (),
) -> LogSteps:
    """Identify all windows of a log, or of a piece of one; of a damaged one those up to the damage.

    Parameters
    ----------
    log : its path, or an object in a storage
    settings : of the site
    limit : on the time that this may take [s]; what is identified by then is kept
    start : of the piece
    lead : the last files before the piece, as many as `start` states
    """
    packer, n_windows, seconds, problem, retry = Packer(), 0, 0.0, None, False
    try:
        for step in _steps(log, settings, start, lead, TimeLimit(limit)):
            if isinstance(step, IdentifiedWindow):
                n_windows += 1
                seconds += (step.recorded.end - step.recorded.start) * 1e-9
            packer.add(_encoded(step))
    except LogError as error:
        problem, retry = str(error), is_temporary(error)
    return LogSteps(packed=packer.finish(), n_windows=n_windows, seconds=seconds, problem=problem, retry=retry)


def no_steps(problem: str) -> LogSteps:
    """Return the steps of a log that could not be identified this time."""
    return LogSteps(packed=Packer().finish(), n_windows=0, seconds=0.0, problem=problem, retry=True)


def _steps(
    log: AnyLog, settings: Settings, start: PieceStart, lead: Sequence[Path], limit: TimeLimit
) -> Iterator[Step]:
    """Yield the steps of a log in the order in which `Pipeline.push` takes them."""
    state = _state_before(log, settings, start, lead, limit)
    assembler = state.assembler
    for item in analysed_items(log, settings, state, limit):
        if isinstance(item, Event):
            yield item
            windows: Iterable[Recording] = assembler.push_event(item)
        else:
            windows = assembler.push(item)
            if not state.begun:
                yield item.arrival_time
        state.count(item)
        for window in windows:
            yield identify_window(window, settings.analysis.band)


def _state_before(
    log: AnyLog, settings: Settings, start: PieceStart, lead: Sequence[Path], limit: TimeLimit
) -> RunState:
    """Return the state at the beginning of a piece; behind a damaged file, the piece begins as a log does."""
    if start.state:
        try:
            return read_counts(start, lead, settings, limit)
        except LogError as error:
            if is_temporary(error):
                raise
            start = PieceStart(after_damage=True)  # the damage is a problem of the piece before
    return begin_piece(log, settings, start)


def _encoded(step: Step) -> dict[str, Any]:
    if isinstance(step, int):
        return {"first": step}
    if isinstance(step, Event):
        return {"topic": step.topic, "time": step.time, "payload": step.payload}
    spectrum = step.spectrum.model_dump(mode="json") if step.spectrum else None
    return {"window": encode(replace(step, spectrum=None, signals=None)), "spectrum": spectrum}


def unpacked(packed: bytes) -> Iterator[Step]:
    """Yield the steps in bytes of `identify_log`."""
    for entry in unpack(packed):
        if "first" in entry:
            yield int(entry["first"])
        elif "topic" in entry:
            yield Event(**entry)
        else:
            window: IdentifiedWindow = decode(IdentifiedWindow, entry["window"])
            spectrum = entry["spectrum"]
            yield replace(window, spectrum=Spectrum.model_validate(spectrum) if spectrum else None)


def read_steps(path: Path) -> LogSteps | None:
    """Return the kept steps of a log; None if there are none, or they are damaged."""
    try:
        head, _, packed = path.read_bytes().partition(b"\n")
        about = json.loads(head)
        if about.pop("sha256") != hashlib.sha256(packed).hexdigest():
            return None
        return LogSteps(packed=packed, **about)
    except (OSError, ValueError, KeyError, TypeError):
        return None


def write_steps(path: Path, steps: LogSteps) -> None:
    """Keep the steps of a log."""
    about: dict[str, Any] = {"n_windows": steps.n_windows, "seconds": steps.seconds, "problem": steps.problem}
    about["sha256"] = hashlib.sha256(steps.packed).hexdigest()
    unfinished = path.with_suffix(".part")
    unfinished.write_bytes(json.dumps(about).encode() + b"\n" + steps.packed)
    unfinished.replace(path)
