"""Lanes of states, and the texts of events."""

from collections.abc import Iterator, Sequence

import rerun as rr

from monitor.results.run_results import RunResults
from monitor.views.palette import ALARM, GREY, LEARN, OK, WARN, Colour
from monitor.views.viewer.primitives import at, clock

_LISTED, _COMPARED = 30, 300  # events
_Lane = dict[str, tuple[str, Colour]]
_DAEMON: _Lane = {"learning": ("learning", LEARN), "watching": ("watching", OK), "problem": ("no modes", WARN)}
_STRUCTURE: _Lane = {
    "unknown": ("not known yet", GREY),
    "normal": ("normal", OK),
    "watch": ("watch", WARN),
    "alarm": ("ALARM", ALARM),
}
_LEVEL = {"normal": "INFO", "watch": "WARN", "alarm": "ERROR"}


_LANES = {"/state/daemon": _DAEMON, "/state/structure": _STRUCTURE}


def draw_states(recording: rr.RecordingStream, run_results: RunResults) -> None:
    """Draw the lanes: state of the daemon, state of the structure."""
    name_states(recording)
    for change in state_changes(run_results):
        log_state(recording, *change)


def name_states(recording: rr.RecordingStream) -> None:
    """Give the lanes the words and colours of their states."""
    for path, lane in _LANES.items():
        labels, colours = [text for text, _ in lane.values()], [colour for _, colour in lane.values()]
        recording.log(path, rr.StateConfiguration(values=list(lane), labels=labels, colors=colours), static=True)


def state_changes(run_results: RunResults) -> Iterator[tuple[str, int, str]]:
    """Return lane, time [ns UTC] and state of each change."""
    for path, changes in (
        ("/state/daemon", daemon_states(run_results)),
        ("/state/structure", structure_states(run_results)),
    ):
        for time, state in changes:
            yield path, time, state


def log_state(recording: rr.RecordingStream, path: str, time: int, state: str) -> None:
    """Log one change."""
    at(recording, time)
    recording.log(path, rr.StateChange(state=state))


def daemon_states(run_results: RunResults) -> Iterator[tuple[int, str]]:
    """Return when the daemon's state changed [ns UTC], and to which."""
    before, reached = None, 0
    for window in run_results.windows:
        state = "problem" if window.problem else "learning" if window.phase == "learning" else "watching"
        if state != before:
            yield max(window.start, reached), state
        before, reached = state, window.end


def structure_states(run_results: RunResults) -> Iterator[tuple[int, str]]:
    """Return when the structure's state changed [ns UTC], and to which; unknown until a baseline is learned."""
    reference = run_results.reference
    changes = [(run_results.start, "unknown")] if reference is None or reference.time > run_results.start else []
    if reference:
        changes.append((max(reference.time, run_results.start), "normal"))
    changes += [
        (max(alarm.time, run_results.start), alarm.state)
        for alarm in run_results.alarms
        if reference or alarm.state != "normal"
    ]
    before = None
    for time, state in changes:
        if state != before:
            yield time, state
        before = state


def write_events(recording: rr.RecordingStream, run_results: RunResults) -> None:
    """Write events in the order of time."""
    happened = sorted(events(run_results), key=lambda event: event[0])
    for number, event in enumerate(happened, 1):
        write_event(recording, *event)
        write_event_list(recording, happened[:number])


def write_event(recording: rr.RecordingStream, time: int, level: str, words: str) -> None:
    """Write one event at its time [ns UTC]."""
    at(recording, time)
    recording.log("/events", rr.TextLog(f"{clock(time)}  {words}", level=level))


def write_event_list(recording: rr.RecordingStream, happened: Sequence[tuple[int, str, str]]) -> None:
    """Write the last of some events as a text, at the time of the last one; the newest first.

    The viewer's list of events has one line for each and does not wrap it. Here an event that recurs is one line.
    """
    at(recording, happened[-1][0])
    recording.log("/event_list", rr.TextDocument(event_list(happened), media_type="text/markdown"))


def event_list(happened: Sequence[tuple[int, str, str]]) -> str:
    """Return the last events as a text, the newest first; one that recurs once, at its last time, with its number.

    Parameters
    ----------
    happened : time [ns UTC], level and words of each, in the order of time
    """
    times: dict[str, list[int]] = {}
    for time, _, words in reversed(happened[-_COMPARED:]):
        times.setdefault(words, []).append(time)
    lines = []
    for words, found in list(times.items())[:_LISTED]:
        often = f" ({len(found)} times since {clock(found[-1])})" if len(found) > 1 else ""
        lines.append(f"**{clock(found[0])}** {words}{often}".replace(" ± ", "\u00a0±\u00a0"))
    return "\n\n".join(lines)


def events(run_results: RunResults) -> Iterator[tuple[int, str, str]]:
    """Return time [ns UTC], level and words of each event."""
    first = run_results.windows[0]
    yield run_results.start, "INFO", f"started: {len(first.channels)} channels"
    for window in run_results.windows:
        if window.problem:
            yield window.end, "WARN", f"window {window.index + 1} gave no modes: {window.problem}"
    for time, sentence in run_results.device_events:
        if time >= run_results.start:
            yield time, "WARN", sentence
    for alarm in run_results.alarms:
        yield max(alarm.time, run_results.start), _LEVEL[alarm.state], alarm.text
