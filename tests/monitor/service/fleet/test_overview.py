"""Conditions of sites, their order, search, filter and pages."""

from dataclasses import replace
from typing import Any

import pytest

from monitor.outputs.history import STATE_SECONDS, FleetRow, LastAlarm, SiteState
from monitor.service.servers.fleet.overview import PAGE_SITES, Wanted, overview, view_of
from monitor.service.servers.web.status_page import novelty_text

STATE = SiteState(state="normal", window=0, window_age=5.0, overdue=False, problems=(), url="")
ALARM = LastAlarm(raised=0, active=True, acknowledged=False, text="mass added")


def site(
    name: str = "bridge", lasts: float = 60.0, age: float = 1.0, alarm: LastAlarm | None = None, **state: Any
) -> FleetRow:
    return FleetRow(number=1, name=name, state=replace(STATE, **state), age=age, lasts=lasts, alarm=alarm)


@pytest.mark.parametrize(
    ("row", "conditions", "reasons"),
    [
        (site(), ("normal",), ()),
        (site(state="watch"), ("watch",), ()),
        (site(state="learning"), ("learning",), ()),
        (site(state="alarm", alarm=ALARM), ("changed",), ()),
        (site(state="alarm"), ("changed",), ()),  # the history lags behind
        (site(state="alarm", alarm=replace(ALARM, acknowledged=True)), ("acknowledged",), ()),
        (site(alarm=replace(ALARM, active=False)), ("normal",), ()),
        (site(age=STATE_SECONDS - 1), ("normal",), ()),
        (site(age=STATE_SECONDS + 60), ("stale",), ("no state from the monitor for 3 min",)),
        (site(overdue=True, window_age=7200.0), ("stale",), ("no window for 2 h",)),
        (site(overdue=True, window_age=None), ("stale",), ("no window yet",)),
        (site(problems=("disk: full", "device left is lost")), ("faulty",), ("disk: full", "device left is lost")),
        (site(state="alarm", alarm=ALARM, age=7200.0), ("changed", "stale"), ("no state from the monitor for 2 h",)),
        (site(state="watch", problems=("disk: full",)), ("faulty", "watch"), ("disk: full",)),
        (replace(site(), state=None), ("stale",), ("no state from the monitor yet",)),
        (replace(site(alarm=ALARM), state=None), ("changed", "stale"), ("no state from the monitor yet",)),
    ],
)
def test_conditions_of_a_site(row: FleetRow, conditions: tuple[str, ...], reasons: tuple[str, ...]) -> None:
    view = view_of(row)
    assert (view.conditions, view.reasons) == (conditions, reasons)


def test_sites_that_need_a_person_come_first_and_each_is_on_one_page() -> None:
    rows = [site(f"tower {k}", lasts=float(k)) for k in range(3 * PAGE_SITES)]
    rows += [site("old alarm", 900.0, state="alarm", alarm=ALARM), site("new alarm", 9.0, state="alarm", alarm=ALARM)]
    rows += [site("lost", problems=("device left is lost",)), site("silent", age=9999.0)]
    pages = [overview(rows, Wanted(page=page)) for page in (1, 2, 3, 4)]
    names = [view.row.name for page in pages for view in page.shown]
    assert names[:4] == ["new alarm", "old alarm", "silent", "lost"]
    assert sorted(names) == sorted(row.name for row in rows)
    assert {page.pages for page in pages} == {4}
    assert overview(rows, Wanted(page=99)).page == 4
    assert overview([], Wanted()).shown == []


def test_search_and_filter_select_sites_and_counts_follow_the_search() -> None:
    rows = [
        site(f"{place} {k}", state=state) for place in ("Ulm", "Köln") for k, state in enumerate(("watch", "normal"))
    ]
    found = overview(rows, Wanted(words="KÖLN", condition="watch"))
    assert [view.row.name for view in found.shown] == ["Köln 0"]
    assert (found.total, found.found, found.counts["watch"], found.counts["normal"]) == (4, 1, 1, 1)
    assert overview(rows, Wanted(words="0 ulm")).found == 1


@pytest.mark.parametrize(("level", "text"), [(0.6, "0.60"), (2.0, "2.0"), (9.96, "10"), (42.3, "42")])
def test_novelty_has_two_digits(level: float, text: str) -> None:
    assert novelty_text(level) == f"{text} times the limit"
