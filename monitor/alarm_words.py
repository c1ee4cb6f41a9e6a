"""Texts on changes of the alarm."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from daq import IndexArray
from monitor.accepted import Accepted
from monitor.alarms import Change
from monitor.detection import Shift
from monitor.results import WindowResult
from monitor.words import change_text, increment_text, utc

_UNITS = ((86400.0, "d"), (3600.0, "h"), (60.0, "min"))


def change_said(change: Change, result: WindowResult) -> str:
    """Return what a window changed, and where."""
    score = result.novelty
    figures = f"novelty {score.t2:.1f}, limit {score.limit:.1f}" if score else ""
    if change.kind == "latched":
        return f"calm again, but the alarm stands until it is acknowledged: {figures}"
    if change.kind in ("flapping", "steady"):
        return _FLAPPING[change.kind]
    if change.state == "alarm":
        again = " still, after a pause" if change.kind == "reopened" else ""
        return f"ALARM{again}: the structure has changed ({figures}){_where(result)}"
    if change.state == "watch":
        return f"over the limit once: {figures}"
    after = "" if change.lasted is None else f" after {duration_text(change.lasted * 1e-9)} of alarm"
    return f"back to normal{after}: {figures}"


def acknowledged_said(change: Change, said: Mapping[str, Any]) -> str:
    """Say what a person who knows of the alarm changed; they may have left name and note."""
    if change.kind in ("flapping", "steady"):
        return _FLAPPING[change.kind]
    by, note = (str(said.get(name) or "") for name in ("by", "note"))
    who = f" by {by}" if by else ""
    why = f": {note}" if note else ""
    after = "" if change.lasted is None else f", back to normal after {duration_text(change.lasted * 1e-9)} of alarm"
    return f"acknowledged{who}{after}{why}"


def resumed_said(n_windows: int, learnt: int, since: int | None) -> str:
    """Say where a watch goes on after a restart, with an alarm that stands `since` [ns UTC] if there is one."""
    stands = f"; the alarm of {utc(since)} stands" if since is not None else ""
    return f"watching goes on, by the baseline of {n_windows} windows learnt until {utc(learnt)}{stands}"


def accepted_said(change: Accepted) -> str:
    """Say what has become the reference, and what the courses of the modes jump by."""
    seen = np.flatnonzero(np.isfinite(change.shift.log_frequency))
    moved = ", ".join(_moved(change.shift, mode) for mode in seen)
    by = f" by {change.by}" if change.by else ""
    learnt = f"the reference from now on, learnt from {len(change.windows)} windows"
    gone = f"; {_modes(change.hides)} not seen, and not watched until seen in most windows again"
    hidden = gone if len(change.hides) else ""
    return f"accepted{by} as {change.cause!r} ({change.found}): {learnt}; frequencies moved by {moved}{hidden}"


def seen_again_said(before: Accepted, now: Accepted) -> str:
    """Say which modes that an accepted change hid are watched again, and what they had moved by."""
    again = np.setdiff1d(before.hides, now.hides)
    moved = ", ".join(_moved(now.shift, mode) for mode in again)
    return f"{_modes(again)} watched again, not seen since {now.cause!r} was accepted: frequency moved by {moved}"


def _moved(shift: Shift, mode: np.intp) -> str:
    return f"{100 * np.expm1(shift.log_frequency[mode]):+.2f} ± {100 * shift.std[mode]:.2f} %"


def _modes(tracks: IndexArray) -> str:
    """Name modes by their numbers."""
    return f"{'mode' if len(tracks) == 1 else 'modes'} {', '.join(map(str, tracks + 1))}"


def undone_said(change: Accepted, said: Mapping[str, Any]) -> str:
    """Say what is no longer accepted; a person may have left name and note."""
    by, note = (str(said.get(name) or "") for name in ("by", "note"))
    who, why = f" by {by}" if by else "", f": {note}" if note else ""
    return f"the acceptance as {change.cause!r} of {utc(change.time)} undone{who}, the reference is that of before{why}"


def duration_text(seconds: float) -> str:
    """Return a duration in its largest two units, such as 3 h 20 min."""
    for (unit, name), (smaller, below) in zip(_UNITS, (*_UNITS[1:], (1.0, "s")), strict=True):
        if seconds >= unit:
            whole = int(seconds // unit)
            rest = int((seconds - whole * unit) // smaller)
            return f"{whole} {name} {rest} {below}" if rest else f"{whole} {name}"
    return f"{seconds:.0f} s"


_FLAPPING = {
    "flapping": "the alarm is raised and cleared again and again: until it is steady, nobody is told of that any more",
    "steady": "the alarm has become steady",
}


def _where(result: WindowResult) -> str:
    found = [change_text(result.diagnosis)] if result.diagnosis else []
    found += [increment_text(result.increments)] if result.increments else []
    return f": {'; '.join(found)}" if found else "; where, the next windows will tell"
