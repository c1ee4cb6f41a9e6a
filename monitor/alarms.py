"""When a window's novelty becomes an alarm: a pure state machine."""

from dataclasses import dataclass, replace
from typing import Literal

State = Literal["normal", "watch", "alarm"]


@dataclass(frozen=True, kw_only=True)
class Alarm:
    """State after some windows."""

    hold_windows: int  #: windows in a row that raise it, and that clear it
    state: State = "normal"
    run: int = 0  #: windows in a row that speak against the present state

    def consider(self, *, over: bool) -> "Alarm":
        """Return the state after one more window, whose novelty was over its limit or not.

        The first window over the limit puts a normal structure under watch; `hold_windows` in a row raise the alarm;
        as many in a row under the limit clear it. A watch is over with the first window under the limit.
        """
        if self.state == "alarm":
            run = 0 if over else self.run + 1
            return replace(self, state="normal" if run >= self.hold_windows else "alarm", run=run % self.hold_windows)
        run = self.run + 1 if over else 0
        if run >= self.hold_windows:
            return replace(self, state="alarm", run=0)
        return replace(self, state="watch" if over else "normal", run=run)
