"""Texts on changes of the alarm."""

from daq.notebook import number_text
from monitor.detection.alarm import Change
from monitor.results.service_events import AcceptanceUndone, Acknowledged
from monitor.results.windows import AcceptedShift, WindowResult
from monitor.text.causes import change_text, increment_text
from monitor.text.modal_change import modal_change_text
from monitor.text.quantities import duration_text, utc


def alarm_change_text(change: Change, result: WindowResult) -> str:
    """Return the change of a window, with its location."""
    score = result.novelty
    figures = f"novelty {score.t2:.1f}, limit {score.limit:.1f}" if score else ""
    if change.kind == "latched":
        return f"below the limit again, but the alarm stays active until it is acknowledged: {figures}"
    if change.kind in ("flapping", "steady"):
        return _FLAPPING[change.kind]
    if change.state == "alarm":
        again = " again, after a short interruption" if change.kind == "reopened" else ""
        return f"ALARM{again}: the structure has changed ({figures}){location_text(result)}"
    if change.state == "watch":
        return f"one window over the limit: {figures}"
    after = "" if change.lasted is None else f" after {duration_text(change.lasted * 1e-9)} of alarm"
    return f"back to normal{after}: {figures}"


def changed_again_text(before: int, after: int) -> str:
    """Return the text of a further change between the starts of two windows [ns UTC] while the alarm is active."""
    return f"the structure changed again between {utc(before)} and {utc(after)}; the answer is for the state since"


def changing_text(n_windows: int) -> str:
    """Return the text of a change that goes on."""
    return f"the structure changes gradually: the answer is for its state in the last {n_windows} windows"


def change_ended_text(start: int) -> str:
    """Return the text of the end of a gradual change by the start of a window [ns UTC]."""
    return f"the gradual change has ended by {utc(start)}; the answer is for the state since"


def waiting_text(cause: str, needed: int, n_windows: int, *, gradual: bool) -> str:
    """Return the text of an acceptance that waits for windows of the state after the change."""
    if gradual:
        return f"to be accepted as {cause!r} once {needed} windows show the state after the gradual change"
    return f"to be accepted as {cause!r} once there are {needed} windows since the change; there are {n_windows}"


def acknowledged_text(change: Change, request: Acknowledged) -> str:
    """Return the text of an acknowledgement, with name and note."""
    if change.kind in ("flapping", "steady"):
        return _FLAPPING[change.kind]
    who, why = _who_and_why(request)
    after = "" if change.lasted is None else f", back to normal after {duration_text(change.lasted * 1e-9)} of alarm"
    return f"acknowledged{who}{after}{why}"


def resumed_text(n_windows: int, learned: int, since: int | None) -> str:
    """Return the text of a restart, with an alarm active `since` [ns UTC] if there is one."""
    alarm = f"; the alarm raised {utc(since)} is still active" if since is not None else ""
    return f"monitoring continues with the baseline of {n_windows} windows learned until {utc(learned)}{alarm}"


def model_added_text(hidden: list[int]) -> str:
    """Return the text on a structure file that was added, and on the tracks that its model lacks."""
    rest = f"; {_modes(hidden)} without a mode of the model, and not monitored" if hidden else ""
    return f"the model of the structure file is learned from this baseline{rest}"


def acceptance_text(change: AcceptedShift) -> str:
    """Return the text of an acceptance, with the frequency shifts."""
    shown = [mode for mode, shift in enumerate(change.shift_percent) if shift is not None]
    hidden = _hidden(change)
    moved = ", ".join(_moved(change, mode) for mode in shown)
    by = f" by {change.by}" if change.by else ""
    learned = f"the reference from now on, learned from {change.n_windows} windows"
    gone = (
        f"; {_modes(hidden)} not identified, and not monitored until identified in most windows again" if hidden else ""
    )
    return f"accepted{by} as {change.cause!r} ({change.found}): {learned}; frequencies moved by {moved}{gone}"


def restored_text(before: AcceptedShift, now: AcceptedShift) -> str:
    """Return the text on modes that are monitored again after an acceptance, with their shifts."""
    again = sorted(set(_hidden(before)) - set(_hidden(now)))
    moved = ", ".join(_moved(now, mode) for mode in again)
    return (
        f"{_modes(again)} monitored again, not identified since {now.cause!r} was accepted: frequency moved by {moved}"
    )


def _hidden(change: AcceptedShift) -> list[int]:
    return [mode for mode, shift in enumerate(change.shift_percent) if shift is None]


def _moved(change: AcceptedShift, mode: int) -> str:
    shift, std = change.shift_percent[mode], change.shift_std_percent[mode]
    return "not identified" if shift is None else f"{number_text(shift, std or 0.0, sign=True)} %"


def _modes(tracks: list[int]) -> str:
    """Name modes by their numbers."""
    return f"{'mode' if len(tracks) == 1 else 'modes'} {', '.join(str(track + 1) for track in tracks)}"


def undone_text(change: AcceptedShift, request: AcceptanceUndone) -> str:
    """Return the text of an undone acceptance, with name and note."""
    who, why = _who_and_why(request)
    undone = f"the acceptance as {change.cause!r} of {utc(change.time)} undone{who}"
    return f"{undone}, the earlier reference is used again{why}"


def _who_and_why(request: Acknowledged | AcceptanceUndone) -> tuple[str, str]:
    return f" by {request.by}" if request.by else "", f": {request.note}" if request.note else ""


_FLAPPING = {
    "flapping": "the alarm is raised and cleared repeatedly: no further notices until it is steady",
    "steady": "the alarm has become steady",
}


def location_text(result: WindowResult) -> str:
    """Return location and size of the change of a window, after a colon."""
    found = [change_text(result.diagnosis)] if result.diagnosis else []
    found += [increment_text(result.increments)] if result.increments else []
    found += [modal_change_text(result.change)] if result.change else []
    return f": {'; '.join(found)}" if found else "; location not yet known"
