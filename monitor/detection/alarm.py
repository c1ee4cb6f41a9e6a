"""State machine of the alarm: windows over the limit raise it, windows under the limit end it."""

from dataclasses import dataclass, replace
from typing import Literal

State = Literal["normal", "watch", "alarm"]
Condition = Literal["normal", "watch", "alarm", "acknowledged", "latched"]
DetectorName = Literal["jump", "quick drift", "slow drift"]
Kind = Literal[
    "state",
    "acknowledged",
    "latched",
    "reopened",
    "flapping",
    "steady",
    "resumed",
    "accepting",
    "accepted",
    "undone",
    "seen_again",
    "changed_again",
    "changing",
    "change_ended",
    "refused",
    "failed",
    "trend",
    "trend_over",
]


@dataclass(frozen=True, kw_only=True)
class AlarmRules:
    """Rules that raise, clear and repeat an alarm."""

    hold_windows: int = 2  #: windows in a row over the limit that raise it
    clear_windows: int = 2  #: calm windows in a row that clear it
    clear_below: float = 1.0  #: a window is calm under this share of the limit; between the two it decides nothing [-]
    latched: bool = False  #: whether an alarm stays active until it is acknowledged, even if the windows are calm
    cooldown: int = 0  #: an alarm raised again within this time continues the previous alarm [ns]
    flapping_changes: int = 6  #: alarms raised and cleared within `flapping_span` from which on it flaps
    flapping_span: int = 0  #: [ns]

    def __post_init__(self) -> None:
        """Refuse rules by which an alarm could never be raised or never end."""
        for name in ("hold_windows", "clear_windows", "flapping_changes"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name}: expected at least 1, found {getattr(self, name)}")
        if not 0 < self.clear_below <= 1:
            raise ValueError(f"clear_below: expected more than 0, at most 1, found {self.clear_below}")


@dataclass(frozen=True, kw_only=True)
class Change:
    """Change of the alarm by a window or a person."""

    kind: Kind  #: "state": as in `state`; others do not change it
    state: State  #: new state
    lasted: int | None = None  #: duration of an alarm that ends [ns]
    quiet: bool = False  #: no notice is needed: it flaps, or continues


@dataclass(frozen=True, kw_only=True)
class Alarm:
    """Condition after some windows.

    `acknowledged`: raised, and a person knows it. `latched`: over, but not acknowledged. Both are the state "alarm".
    """

    rules: AlarmRules
    condition: Condition = "normal"
    run: int = 0  #: windows in a row that speak against the present condition
    raised: int | None = None  #: when the present or last alarm was [ns UTC]
    cleared: int | None = None  #: when the last alarm was [ns UTC]
    flips: tuple[int, ...] = ()  #: when alarms were raised and cleared of late [ns UTC]
    flapping: bool = False

    @property
    def state(self) -> State:
        """Assumed condition of the structure."""
        return self.condition if self.condition in ("normal", "watch") else "alarm"

    def evaluate(self, time: int, level: float) -> tuple["Alarm", tuple[Change, ...]]:
        """Return the condition after one more window, and its changes.

        Parameters
        ----------
        time : end of the window [ns UTC]; if it is before that of the last one, the clock was set back: later times are
            discarded, otherwise an alarm would be quiet for as long
        level : its novelty over the limit [-]; not-a-number decides nothing, but breaks every run
        """
        over, calm = level > 1, level < self.rules.clear_below
        if self.condition in ("normal", "watch"):
            after, changes = self._rise(time, over=over, calm=calm)
        elif self.condition == "latched":
            after, changes = self._relapse(over=over)
        else:
            after, changes = self._fall(time, calm=calm)
        return after._look_for_flapping(time, changes)

    def acknowledge(self, time: int) -> tuple["Alarm", tuple[Change, ...]]:
        """Return the condition after an acknowledgement; no change without an alarm."""
        if self.condition == "alarm":
            return replace(self, condition="acknowledged"), (Change(kind="acknowledged", state="alarm"),)
        if self.condition == "latched":
            after, changes = self._clear(time)
            return after._look_for_flapping(time, changes)
        return self, ()

    def accept(self, time: int) -> tuple["Alarm", Change]:
        """Return the condition once the changed state is the new reference; the next alarm is a new one."""
        lasted = self._lasted(time)
        after = replace(self, condition="normal", run=0, raised=None, cleared=None)
        return after, Change(kind="accepted", state="normal", lasted=lasted)

    def _rise(self, time: int, *, over: bool, calm: bool) -> tuple["Alarm", tuple[Change, ...]]:
        run = self.run + 1 if over else 0
        if run >= self.rules.hold_windows:
            return self._raise(time)
        stays = not over and not calm
        condition = self.condition if stays else "watch" if over else "normal"
        after = replace(self, condition=condition, run=run)
        change = () if condition == self.condition else (Change(kind="state", state=after.state),)
        return after, change

    def _raise(self, time: int) -> tuple["Alarm", tuple[Change, ...]]:
        again = self.cleared is not None and 0 <= time - self.cleared < self.rules.cooldown  # no end lies ahead of it
        raised = self.raised if again else time
        after = replace(self, condition="alarm", run=0, raised=raised, flips=(*self.flips, time))
        return after, (Change(kind="reopened" if again else "state", state="alarm", quiet=again or self.flapping),)

    def _fall(self, time: int, *, calm: bool) -> tuple["Alarm", tuple[Change, ...]]:
        run = self.run + 1 if calm else 0
        if run < self.rules.clear_windows:
            return replace(self, run=run), ()
        if self.rules.latched and self.condition == "alarm":
            return replace(self, condition="latched", run=0), (Change(kind="latched", state="alarm"),)
        return self._clear(time)

    def _clear(self, time: int) -> tuple["Alarm", tuple[Change, ...]]:
        after = replace(self, condition="normal", run=0, cleared=time, flips=(*self.flips, time))
        lasted = self._lasted(time)
        return after, (Change(kind="state", state="normal", lasted=lasted, quiet=self.flapping),)

    def _lasted(self, time: int) -> int | None:
        return None if self.raised is None else max(0, time - self.raised)

    def _relapse(self, *, over: bool) -> tuple["Alarm", tuple[Change, ...]]:
        run = self.run + 1 if over else 0
        if run < self.rules.hold_windows:
            return replace(self, run=run), ()
        return replace(self, condition="alarm", run=0), (Change(kind="reopened", state="alarm", quiet=True),)

    def _look_for_flapping(self, time: int, changes: tuple[Change, ...]) -> tuple["Alarm", tuple[Change, ...]]:
        flips = tuple(flip for flip in self.flips if 0 <= time - flip < self.rules.flapping_span)
        flapping = len(flips) >= self.rules.flapping_changes
        if flapping != self.flapping:
            changes = (*changes, Change(kind="flapping" if flapping else "steady", state=self.state))
        return replace(self, flips=flips, flapping=flapping), changes
