"""Windows that were left out of late because the analysis had fallen behind."""

from collections import deque
from typing import Any

_LAST = 10  # windows over which an overload is reported: one window in time does not end it

Said = tuple[str, dict[str, Any]]  #: topic and payload of an event


class Overload:
    """Count of the windows that were left out."""

    def __init__(self) -> None:
        self._last: deque[bool] = deque(maxlen=_LAST)
        self._since = 0  # windows left out since the overload began
        self.total = 0  #: windows left out since the start

    def take(self, *, left_out: bool) -> Said | None:
        """Take a window, or a stretch of windows, that was left out or not; return an event if that is news."""
        before = any(self._last)
        self._last.append(left_out)
        self.total += left_out
        self._since = self._since * before + left_out
        if left_out and not before:
            return "/event/windows_left_out", {"why": "the analysis has fallen behind"}
        if before and not any(self._last):
            return "/event/analysis_caught_up", {"left_out": self._since}
        return None

    @property
    def problem(self) -> str | None:
        """Number of the last windows that were left out; None if none was."""
        n = sum(self._last)
        if not n:
            return None
        return f"{n} of the last {len(self._last)} windows left out: the analysis has fallen behind"
