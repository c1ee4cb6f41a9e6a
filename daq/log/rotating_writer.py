"""Log writer with files of bounded size and duration."""

import contextlib
import math
import uuid
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from daq.log.format.preview import View, ViewMessage
from daq.log.mcap_log import Displacement, McapWriter
from daq.log.naming import log_path
from daq.log.parts import Part
from daq.supervision import FAILURES
from daq.types import Block, Item


@dataclass(frozen=True, kw_only=True)
class Rotation:
    """Limits at which a new file is begun; the first that is reached counts."""

    size: float = math.inf  #: size of a file [bytes]
    seconds: float = math.inf  #: data in a file [s]


class RotatingWriter:
    """Writes one run as a sequence of files, each with all attachments; not for several threads (see `WriterThread`).

    Files change between two items after a flush. The new file exists before the old one is finished: every item is in
    one of them, once, and in order.

    Parameters
    ----------
    folder : of the files; they are named by the time of their first data
    attachments : name -> text, written to each
    started : time of the start [ns UTC]
    rotation : when a new file is begun
    view_rate : scans per second that are written for stock viewers too [Hz]; 0 for none

    Raises
    ------
    LogError
        If the first file exists or cannot be made.
    """

    def __init__(
        self,
        folder: Path,
        attachments: Mapping[str, str],
        started: int,
        rotation: Rotation | None = None,
        *,
        view_rate: float = 0.0,
    ) -> None:
        self._folder, self._attachments, self._rotation = folder, attachments, rotation or Rotation()
        self._part = Part(run=uuid.uuid4().hex, started=started, number=0)
        self._view = View(view_rate) if view_rate else None
        self.newest = started  #: time of the newest data [ns UTC]
        self.first = started  #: the same of the first data in the open file
        self._holds, self._full = 0, False  # items in the open file; whether it takes no more
        self.contents: Counter[str] = Counter()  #: content of the open file: device -> scans, "events" -> their number
        self.paths = [log_path(folder, started)]  #: paths of all files so far
        self._writer = McapWriter(self.paths[0], attachments, self._part)

    def write(self, item: Item) -> None:
        """Append a block or an event to the open chunk."""
        if isinstance(item, Block):  # events may lie behind or ahead
            self.newest = max(self.newest, item.arrival_time)
        if self._full:
            finished = self._writer
            self.begin_next()
            try:
                finished.close()
            except OSError:
                finished.abandon()  # without space for its summary it stays as after its last flush, for repair
        self._writer.write(item)
        self._holds += 1
        self.contents[item.device if isinstance(item, Block) else "events"] += (
            item.n_scans if isinstance(item, Block) else 1
        )
        if self._view and isinstance(item, Block):
            self._write_view(self._view, item)

    def _write_view(self, view: View, block: Block) -> None:
        """Write scans for stock viewers; failures are counted, and do not affect the archive."""
        messages: list[ViewMessage] = []
        FAILURES.attempt("view in the log", lambda: messages.extend(view.add(block)))
        for message in messages:
            self._writer.show(message)

    def hand_over(self) -> None:
        """Close the chunk and write it to the system."""
        self._writer.hand_over()

    def flush(self) -> None:
        """Close the chunk and flush it to the disk; if the file is full now, the next item begins a new one."""
        self._writer.flush()
        seconds = (self.newest - self.first) * 1e-9
        large = self._writer.size >= self._rotation.size or seconds >= self._rotation.seconds
        self._full = large and self._holds > 0

    def begin_next(self) -> None:
        """Begin a new file in addition to the open one, which is neither finished nor closed here.

        Raises
        ------
        LogError
            If it cannot be made; nothing of it is left.
        """
        part = Part(run=self._part.run, started=self._part.started, number=self._part.number + 1)
        with contextlib.suppress(OSError):  # reading the file will show it
            self._folder.mkdir(parents=True, exist_ok=True)
        path = log_path(self._folder, self.newest)
        self._writer = McapWriter(path, self._attachments, part)
        self._part, self.first, self._holds, self._full = part, self.newest, 0, False
        self.contents = Counter()
        self.paths.append(path)

    def discard(self) -> None:
        """Remove the open file again: the disk did not accept its first data."""
        self._writer.abandon()
        self.paths.pop().unlink(missing_ok=True)

    def close(self) -> None:
        """Finish the open file."""
        self._writer.close()

    @property
    def size(self) -> int:
        """Length of the open file up to the last flush [bytes]."""
        return self._writer.size

    @property
    def cut_short(self) -> bool:
        """True if another program has shortened the open file since its last flush."""
        return self._writer.cut_short

    def displacement(self) -> Displacement | None:
        """Return the change made to the open file by other programs; None if its path is still valid."""
        return self._writer.displacement()

    def forsake(self) -> None:
        """Close the open file as it is, whatever others have done to it."""
        self._writer.forsake()

    def abandon(self) -> None:
        """Close the open file as it is: the disk accepts no more data."""
        self._writer.abandon()
