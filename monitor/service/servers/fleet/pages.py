"""HTML of the page of all sites, and of the history of one."""

import time
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import Any
from urllib.parse import urlencode

from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined

from monitor.outputs.history import FleetRow, Reader, Span
from monitor.outputs.history.schema import DAY
from monitor.outputs.history.summary import look
from monitor.service.servers.fleet.overview import CONDITIONS, Overview, SiteView, Wanted, view_of
from monitor.service.servers.web.status_page import (
    alarm_content,
    event_content,
    modes_content,
    novelty_content,
    novelty_course,
    novelty_text,
)
from monitor.settings.section import has_place
from monitor.text.quantities import duration_text, utc

SPANS = {"day": 1, "month": 30, "year": 365}  #: days of the charts of a site
_ENVIRONMENT = Environment(
    loader=ChoiceLoader([PackageLoader("monitor.service.servers.fleet"), PackageLoader("monitor.service.servers.web")]),
    undefined=StrictUndefined,
    autoescape=True,
)
_MAX_REASONS, _MAX_EVENTS, _MAX_ALARMS = 3, 20, 10
_HEIGHT = 40.0  # of a course on a card


def sites_html(found: Overview, wanted: Wanted, levels: Mapping[int, Sequence[float]], pages: Mapping[str, str]) -> str:
    """Return the part of the page that changes.

    Parameters
    ----------
    found : sites to show
    wanted : what they were selected by
    levels : novelty over its limit of the last windows of a site, by its number
    pages : address of the status page of a site, by name
    """
    return _ENVIRONMENT.get_template("sites.html").render(
        cards=[_card(view, levels.get(view.row.number, ()), pages) for view in found.shown],
        filters=_filters(found, wanted),
        found=found,
        previous=_address(wanted, page=found.page - 1) if found.page > 1 else "",
        next=_address(wanted, page=found.page + 1) if found.page < found.pages else "",
        now=datetime.now(UTC).strftime("%Y-%m-%d %H:%M:%S UTC"),
    )


def fleet_html(wanted: Wanted, content: str) -> str:
    """Return the page with its changing part, as of `sites_html`, already in it."""
    return _ENVIRONMENT.get_template("fleet.html").render(wanted=wanted, content=content)


def failed_html(problem: str) -> str:
    """Return the changing part while the states cannot be read."""
    return _ENVIRONMENT.get_template("failed.html").render(problem=problem)


def site_html(reader: Reader, row: FleetRow, span: str) -> str:
    """Return the history of a site over a span of `SPANS`.

    Raises
    ------
    HistoryError
        If no window has been analysed yet, or the database cannot be read.
    """
    now = time.time_ns()
    found = look(reader, Span(start=now - SPANS[span] * DAY, end=now))
    view = view_of(row)
    return _ENVIRONMENT.get_template("site.html").render(
        name=row.name,
        card=_card(view, (), {}),
        condition=view.conditions[0],
        spans=[{"name": name, "here": name == span} for name in SPANS],
        every=found.span.every,
        windows=found.windows.number,
        newest=utc(found.newest),
        novelty=novelty_content([level for _, level in found.windows.levels]),
        modes=modes_content(found.trends),
        alarms=[alarm_content(alarm) for alarm in reversed(found.alarms[-_MAX_ALARMS:])],
        events=[event_content(event) for event in reversed(found.events[-_MAX_EVENTS:])],
        now=datetime.now(UTC).strftime("%Y-%m-%d %H:%M:%S UTC"),
    )


def _card(view: SiteView, levels: Sequence[float], pages: Mapping[str, str]) -> dict[str, Any]:
    row, state, alarm = view.row, view.row.state, view.row.alarm
    own = f"/site/{row.number}" if row.number > 0 else ""  # else there is no history
    given = pages.get(row.name) or (state.url if state else "")
    return {
        "name": row.name,
        "url": given if has_place(given, ("http", "https")) else own,  # of the database: no other kind of address
        "own": own,
        "conditions": [{"name": name, "meaning": CONDITIONS[name]} for name in view.conditions],
        "condition": view.conditions[0],
        "state": state.state if state else "no state",
        "lasts": duration_text(row.lasts) if row.lasts is not None else "",
        "reasons": view.reasons[:_MAX_REASONS],
        "more_reasons": max(0, len(view.reasons) - _MAX_REASONS),
        "alarm": alarm.text if alarm and alarm.active else "",
        "last_alarm": f"{utc(alarm.raised)}: {alarm.text}" if alarm and not alarm.active else "",
        "window": f"last window {duration_text(view.window_age)} ago"
        if view.window_age
        else "no window since the start",
        "level": novelty_text(levels[-1]) if levels else "",
        "over": bool(levels) and levels[-1] > 1,
        "course": novelty_course(levels, _HEIGHT) if levels else "",
    }


def _filters(found: Overview, wanted: Wanted) -> list[dict[str, Any]]:
    named = [
        {
            "name": "all",
            "count": "",
            "meaning": "all sites",
            "here": not wanted.condition,
            "url": _address(wanted, condition=""),
        }
    ]
    return named + [
        {"name": name, "count": count, "meaning": CONDITIONS[name], "here": wanted.condition == name}
        | {"url": _address(wanted, condition=name)}
        for name, count in found.counts.items()
    ]


def _address(wanted: Wanted, *, condition: str | None = None, page: int = 1) -> str:
    fields = {
        "q": wanted.words,
        "state": wanted.condition if condition is None else condition,
        "page": page if page > 1 else "",
    }
    return "/?" + urlencode({name: value for name, value in fields.items() if value})
