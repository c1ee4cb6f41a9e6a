"""Status page: the changing part, rendered every two seconds."""

import json
import math
from collections.abc import Collection, Mapping, Sequence
from datetime import UTC, datetime
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from monitor.outputs.history import AlarmRow, EventRow, TrendPoint
from monitor.results.site_status import SiteStatus
from monitor.service.servers.web.source import Past, Source, measurement_problems, problems, self_test_text, silence
from monitor.service.servers.web.svg import course_svg, structure_svg
from monitor.text.detection import detectable_text, single_mode_text, trend_text, unsure_text
from monitor.text.events import event_sentence
from monitor.text.quantities import aligned, counted, duration_text, last_value, percent, utc

_ENVIRONMENT = Environment(
    loader=PackageLoader("monitor.service.servers.web"), undefined=StrictUndefined, autoescape=True
)
_SILENT = 3.0  # s
_RESIDUALS = 4  # channels that are listed
_FIGURE_SPACE = "\u2007"  # as wide as a digit
_NO_PAST = "the history is empty"
_NOT_EVALUATED = "No window is evaluated before the baseline is learned."
_HEADLINE = {
    "learning": "Learning the baseline",
    "normal": "Normal",
    "watch": "Watch: one window over the limit",
    "alarm": "ALARM: the structure has changed",
}


def page_html(name: str, state: str) -> str:
    """Return the frame of a site, with the present state, as of `state_html`, already in it."""
    return _ENVIRONMENT.get_template("page.html").render(name=name, content=Markup(state))


def state_html(source: Source) -> str:
    """Return the changing part."""
    return _ENVIRONMENT.get_template("state.html").render(**_content(source))


def _content(source: Source) -> dict[str, Any]:
    status, past = source.status(), source.past()
    standing = [alarm for alarm in past.alarms if alarm.cleared is None] if past else []
    state = status.state if status else "learning"  # the history may lag behind, or be down
    unsure = _unsure(status) if status and state == "normal" else ""
    silent = silence(status)
    degraded = bool(status and state == "normal" and measurement_problems(status))
    return {
        "name": source.name,
        "state": state,
        "colour": "silent" if silent else "watch" if unsure or degraded else state,
        "headline": _headline(state, silent=bool(silent), degraded=degraded, estimated=bool(unsure)),
        "unsure": unsure,
        "trend": trend_text(status.trend) if status and status.trend else "",
        "detectable": detectable_text(status.detectable) if status and status.detectable else "",
        "learning": _learning(status) if status and state == "learning" and not silent else None,
        "left_out": _left_out(status, past),
        "problems": problems(status) + ([] if past or (status and status.problems.history) else [_NO_PAST]),
        "alarm": alarm_content(standing[-1], past.reported) if past and standing else None,
        "alarms": [alarm_content(alarm, past.reported) for alarm in reversed(past.alarms)] if past else [],
        "structure": _structure(past) if past else None,
        "novelty": novelty_content(_levels(past)) if past else None,
        "residuals": _residuals(status) if status else None,
        "modes": modes_content(past.trends) if past else [],
        "devices": _devices(status) if status else [],
        "events": [event_content(event) for event in reversed(past.events)] if past else [],
        "window": utc(past.windows[-1].end) if past else None,
        "self_test": self_test_text(status.self_test) if status and status.self_test else None,
        "now": datetime.now(UTC).strftime("%Y-%m-%d %H:%M:%S UTC"),
    }


def _headline(state: str, *, silent: bool, degraded: bool, estimated: bool) -> str:
    """Return the verdict, and whether it is limited."""
    if silent:
        return "No present state" + (f"; the last one: {_HEADLINE[state]}" if state in ("alarm", "watch") else "")
    return (
        ("Degraded; the last window: " if degraded else "") + _HEADLINE[state] + (" (estimated)" if estimated else "")
    )


def _structure(past: Past) -> Markup | None:
    """Return the picture of the structure, if there is one to draw."""
    return structure_svg(past.reference, past.places) if past.reference and past.reference.has_geometry else None


def _learning(status: SiteStatus) -> dict[str, Any]:
    """Return the progress of the baseline and a text on it."""
    progress, left = status.learning, status.learning_left
    if progress is None or left is None:
        return {"progress": None, "text": f"No usable window yet. {_NOT_EVALUATED}"}
    text = f"{progress.windows} of {progress.target} windows"
    text += f", about {duration_text(left)} left" if left else ""
    return {"progress": progress, "text": f"{text}. {_NOT_EVALUATED}"}


def _left_out(status: SiteStatus | None, past: Past | None) -> str:
    """Return how many windows gave no result and why the last one did not; empty if all did."""
    parts = []
    if status and status.windows_left_out:
        parts.append(
            f"{counted(status.windows_left_out, 'window')} left out since the start, because the analysis was behind"
        )
    bare = [window for window in past.windows if window.problem] if past else []
    if past and bare:
        last = bare[-1]
        parts.append(
            f"{len(bare)} of the last {counted(len(past.windows), 'window')} without modes, the last one at "
            f"{utc(last.end)}: {last.problem}"
        )
    return "; ".join(parts)


def _unsure(status: SiteStatus) -> str:
    """Return the detectable change in the last window, if the law was uncertain."""
    novelty = status.window.novelty if status.window else None
    if novelty is None:
        return ""
    unsure = f"in the last window, {unsure_text([novelty.unsure])}" if novelty.unsure else ""
    single = single_mode_text(novelty.single_mode) if novelty.single_mode else ""
    return "; ".join(filter(None, (unsure, single)))


def alarm_content(alarm: AlarmRow, reported: Collection[int] = ()) -> dict[str, Any]:
    """Return the texts of an alarm, and the address of its report if it is among the reported ones."""
    lasted = "active" if alarm.cleared is None else f"lasted {duration_text(alarm.lasted or 0.0)}"
    return {
        "raised": utc(alarm.raised),
        "lasted": lasted,
        "text": alarm.text,
        "report": f"/report/{alarm.raised}" if alarm.raised in reported else None,
        "acknowledged": utc(alarm.acknowledged) if alarm.acknowledged else None,
    }


def _levels(past: Past) -> list[float | None]:
    """Return the novelty of the windows over its limit; None for windows without modes."""
    judged = (w for w in past.windows if w.problem or (w.t2 is not None and w.limit))
    return [None if w.problem or w.t2 is None or not w.limit else w.t2 / w.limit for w in judged]


def novelty_content(levels: Sequence[float | None]) -> dict[str, Any] | None:
    """Return text and course of the novelty over its limit, in the order of time; None without any."""
    known = [level for level in levels if level is not None]
    if not known:
        return None
    return {
        "text": novelty_text(known[-1]),
        "over": known[-1] > 1,
        "missing": len(levels) > len(known),
        "course": novelty_course(levels, 64.0),
    }


def novelty_text(level: float) -> str:
    """Return the novelty over its limit in words."""
    return f"{level:.0f} times the limit" if level >= 9.95 else f"{level:#.2g} times the limit"


def novelty_course(levels: Sequence[float | None], height: float) -> Markup:
    """Return a picture of the novelty over its limit, on a logarithmic scale."""
    return course_svg([None if level is None else math.log10(max(level, 1e-2)) for level in levels], 0.0, height)


def modes_content(trends: Mapping[int, Sequence[TrendPoint]]) -> list[dict[str, Any]]:
    """Return the last figures of each mode, and the course of its shift."""
    shown = {m: points for m, points in trends.items() if any(p.shift_percent is not None for p in points)}
    last = [points[-1] for points in shown.values()]
    damping = [[percent(p.damping) for p in points] for points in shown.values()]
    shifts = [[p.shift_percent for p in points] for points in shown.values()]
    columns = {
        "frequency": [last_value([p.frequency for p in points], points[-1].frequency_std) for points in shown.values()],
        "damping": [last_value(course, percent(p.damping_std)) for course, p in zip(damping, last, strict=True)],
        "shift": [last_value(c, p.shift_std_percent, sign=True) for c, p in zip(shifts, last, strict=True)],
    }
    rows = zip(*(aligned(column) for column in columns.values()), strict=True)
    return [
        {"id": mode, "course": course_svg([shift for shift in course if shift is not None])}
        | {name: figure.replace(" ", _FIGURE_SPACE) for name, figure in zip(columns, figures, strict=True)}
        for mode, course, figures in zip(shown, shifts, rows, strict=True)
    ]


def _residuals(status: SiteStatus) -> dict[str, Any] | None:
    """Return the largest residuals of channels against their prediction from the others; None if none are known."""
    residuals = status.residuals
    if residuals is None:
        return None
    largest = sorted(residuals.deviation, key=lambda channel: -residuals.deviation[channel])[:_RESIDUALS]
    ratios = [f"{residuals.ratio[channel]:#.3g}" for channel in largest]
    deviations = [f"{residuals.deviation[channel]:+z.1f}" for channel in largest]
    return {
        "over": bool(residuals.over),
        "text": f"{deviations[0]} standard deviations",
        "course": course_svg(status.residual_course, residuals.limit, 64.0),
        "rows": list(zip(largest, ratios, deviations, strict=True)),
        "block": f"{residuals.seconds:.3g}",
        "limit": f"{residuals.limit:g}",
    }


def _devices(status: SiteStatus) -> list[dict[str, Any]]:
    return [
        {
            "name": name,
            "rate": f"{device.rate:.0f}",
            "gaps": device.gaps,
            "state": "lost" if device.lost else _age(device.silent),
        }
        for name, device in status.devices.items()
    ]


def _age(silent: float | None) -> str:
    if silent is None:
        return "nothing yet"
    return "ok" if silent < _SILENT else f"silent {duration_text(silent)}"


def event_content(event: EventRow) -> dict[str, str]:
    """Return the texts of an event, or of a change of the alarm."""
    if event.topic.startswith("/alarm/"):
        state, text = event.topic.removeprefix("/alarm/"), str(json.loads(event.json)["text"])
        named = text.lower().startswith(state)
        return {"time": utc(event.time), "what": "" if named else state, "text": text}
    return {"time": utc(event.time), "what": "", "text": event_sentence(event.topic, json.loads(event.json))}
