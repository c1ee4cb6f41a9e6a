"""Log writer that survives disk failures: buffers, reports, and writes the buffer on recovery."""

import contextlib
import errno
import time
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from daq.errors import ItemError, LogError
from daq.events import (
    DiskLow,
    DiskRecovered,
    EventPayload,
    LogDeleted,
    LogFileLost,
    RecordingFailed,
    RecordingRecovered,
)
from daq.log.mcap_log import Displacement
from daq.log.repair import repair_log
from daq.log.retention import DiskGuard, ExpiredFile
from daq.log.rotating_writer import RotatingWriter
from daq.supervision import error_text
from daq.types import Block, Event, Item

_KEPT = 20_000  # items in memory while the disk takes none: at four blocks per second of 32 devices, some 2.5 minutes
_RETRY_SECONDS = 5.0
_LOOK_SECONDS = 1.0  # between looks at whether the open file is still where it was begun


class ResilientWriter:
    """Writes a run's log for as long as there is a disk, and makes room on it; not for several threads.

    Data since the last flush are kept in memory. If the disk fails, the open file is truncated to that flush, and a new
    one is begun with the kept data as soon as possible; data that did not fit in memory are counted. The truncated file
    is then completed, if the disk has room.

    Events: /event/log_deleted before a file is deleted; /event/disk_low and /event/disk_recovered if no file may be
    deleted; /event/recording_failed and /event/recording_recovered, with the loss; /event/log_file_lost if another
    program has moved, deleted or truncated the open file, with the loss.

    Parameters
    ----------
    recorder : the log
    guard : selects the files to delete
    tell : called with these events at once, in the caller's thread
    kept : number of items held in memory while the disk accepts none
    """

    def __init__(
        self, recorder: RotatingWriter, guard: DiskGuard, tell: Callable[[Event], None], *, kept: int = _KEPT
    ) -> None:
        self._recorder, self._guard, self._tell, self._room = recorder, guard, tell, kept
        self._pending: deque[Item] = deque()  # not known to be on the disk
        self._stopped: str | None = None  # why nothing is written
        self._low = False
        self._retry = 0.0
        self._look = 0.0  # monotonic time of the next look at where the open file is
        self._cut: Path | None = None  # the file that has no end
        self._lost_now: Counter[str] = Counter()
        self.lost: Counter[str] = Counter()  #: device -> scans (events: their number) that no file has

    @property
    def paths(self) -> tuple[Path, ...]:
        """Return the files so far, in the order of writing."""
        return tuple(self._recorder.paths)

    @property
    def problem(self) -> str | None:
        """Data that are missing in the log, and the reason why nothing is written; None if all is well."""
        lost = ", ".join(f"{count} of {name}" for name, count in (self.lost + self._lost_now).items())
        return "; ".join(filter(None, (self._stopped, lost and f"lost: {lost}"))) or None

    @property
    def losing(self) -> bool:
        """Return whether data are being lost: the disk is not writable, and the memory buffer is full."""
        return bool(self._lost_now)

    def write(self, item: Item) -> None:
        """Accept an item; it is in a file after the next flush, if the disk accepts it.

        Raises
        ------
        ItemError
            If no log can hold it: it is lost, and counted.
        """
        if len(self._pending) >= self._room and self._stopped:
            self._lost_now[_name(item)] += _amount(item)
            return
        self._pending.append(item)
        if not self._stopped:
            try:
                self._recorder.write(item)
            except ItemError:
                self._pending.pop()
                self.lost[_name(item)] += _amount(item)
                raise
            except Exception as error:  # noqa: BLE001 - whatever stops this file, the next one may take it
                self._stop(error)

    def hand_over(self) -> None:
        """Pass the data to the system, if the disk is writable."""
        if not self._stopped:
            try:
                self._recorder.hand_over()
            except Exception as error:  # noqa: BLE001 - likewise
                self._stop(error)

    def flush(self) -> None:
        """Write the data to the disk, free space if necessary, or retry after a failure."""
        if self._stopped:
            if time.monotonic() >= self._retry:
                self._resume()
            return
        if time.monotonic() >= self._look or self._recorder.cut_short:
            self._look = time.monotonic() + _LOOK_SECONDS
            displaced = self._recorder.displacement()
            if displaced:
                self._begin_anew(displaced)
                return
        try:
            self._recorder.flush()
        except Exception as error:  # noqa: BLE001 - likewise
            self._stop(error)
            return
        self._pending.clear()
        with contextlib.suppress(OSError):  # a folder that cannot be read: writing will show it
            self._tidy()

    def _begin_anew(self, displaced: Displacement) -> None:
        """Begin a new file after another program has removed the open one; unflushed data are written to the new one.

        One that was moved is finished where it is. Of one that was deleted or cut short all is lost, and counted.
        """
        file, first, bytes_written = self._recorder.paths[-1], self._recorder.first, self._recorder.size
        unwritten = Counter[str]()
        for item in self._pending:
            unwritten[_name(item)] += _amount(item)
        loss = LogFileLost(file=file.name, how=displaced.how)
        if displaced.how == "moved":
            loss = replace(loss, to=displaced.to)
            with contextlib.suppress(OSError):
                self._recorder.close()
            self._pending.clear()
        else:
            lost = self._recorder.contents - unwritten
            self.lost += lost
            loss = replace(loss, lost=dict(lost), bytes=bytes_written, from_=first, until=self._recorder.newest)
            self._recorder.forsake()
            self._cut = file if displaced.how == "cut short" else None
        self._stopped = f"{file}: {displaced.how}"
        self._resume()
        self._report(loss)

    def _tidy(self) -> None:
        """Delete expired files, each after its event is on the disk; report if that is not enough."""
        while not self._stopped and (surplus := self._guard.surplus()):
            self._delete(surplus)
        low = self._guard.short
        if low != self._low:
            self._low = low
            free_gb = round(self._guard.free / 1e9, 3)
            self._report(DiskLow(free_gb=free_gb) if low else DiskRecovered(free_gb=free_gb))

    def _delete(self, surplus: ExpiredFile) -> None:
        self._report(LogDeleted(file=surplus.path.name, bytes=surplus.size, why=surplus.why))
        if not self._stopped:
            try:
                self._recorder.flush()
                self._pending.clear()
            except Exception as error:  # noqa: BLE001 - likewise
                self._stop(error)
        surplus.path.unlink(missing_ok=True)

    def _stop(self, error: Exception) -> None:
        """Leave the open file as after its last flush; continue at once if space can be freed."""
        self._recorder.abandon()
        self._cut = self._recorder.paths[-1]
        self._stopped = str(error) if isinstance(error, OSError | LogError) else error_text(error)
        self._report(RecordingFailed(why=self._stopped))
        self._resume()

    def _resume(self) -> None:
        """Begin a new file with the kept data, if the disk is writable; the oldest is deleted if there is no room.

        A disk that fails otherwise takes no more for a file less.
        """
        while error := self._refused():
            surplus = self._surplus() if _is_full(error) else None
            if surplus is None or not self._gone(surplus):
                self._retry = time.monotonic() + _RETRY_SECONDS
                return
        self._stopped = None
        kept, lost = len(self._pending), dict(self._lost_now)
        self.lost += self._lost_now
        self._lost_now.clear()
        self._pending.clear()
        self._report(RecordingRecovered(kept=kept, lost=lost))
        if self._cut and self._cut.exists():
            with contextlib.suppress(LogError):  # else the next start does
                repair_log(self._cut)
        self._cut = None

    def _surplus(self) -> ExpiredFile | None:
        try:
            return self._guard.surplus(full=True)
        except OSError:
            return None  # not even the folder can be read

    def _gone(self, surplus: ExpiredFile) -> bool:
        """Delete a file; return whether it was deleted."""
        try:
            self._delete(surplus)
        except OSError:
            return False
        return True

    def _refused(self) -> Exception | None:
        """Return why a new file has not accepted the kept data, None if it has; a rejected file is removed."""
        try:
            self._recorder.begin_next()
        except (OSError, LogError) as error:
            return error
        try:
            for item in self._pending:
                self._recorder.write(item)
            self._recorder.flush()
        except Exception as error:  # noqa: BLE001 - likewise
            self._recorder.discard()
            return error
        return None

    def _report(self, payload: EventPayload) -> None:
        event = payload.event(self._recorder.newest)
        self._tell(event)
        self.write(event)

    def close(self) -> None:
        """Write the data to the disk and finish the file; data that cannot be written are lost, and counted."""
        self._retry = self._look = 0.0
        self.flush()
        if self._stopped:
            for item in self._pending:
                self._lost_now[_name(item)] += _amount(item)
            self._pending.clear()
            return
        try:
            self._recorder.close()
        except OSError:
            self._recorder.abandon()  # all of it is there but the summary, which the next start writes

    def abandon(self) -> None:
        """Close the open file as it is."""
        self._recorder.abandon()


def _is_full(error: Exception) -> bool:
    """Return whether there is no room, on the disk or in the user's quota."""
    reason = error.__cause__ if isinstance(error, LogError) else error
    return isinstance(reason, OSError) and reason.errno in (errno.ENOSPC, errno.EDQUOT)


def _amount(item: Item) -> int:
    return item.n_scans if isinstance(item, Block) else 1


def _name(item: Item) -> str:
    return item.device if isinstance(item, Block) else "events"
