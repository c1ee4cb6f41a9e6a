"""Conditions of the sites, in the order in which they need a person."""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from monitor.outputs.history import STATE_SECONDS, FleetRow
from monitor.text.quantities import duration_text

#: conditions of a site, the most urgent first, and their meaning
CONDITIONS = {
    "changed": "alarm, not acknowledged",
    "stale": "no state from the monitor, or no window when one was due",
    "faulty": "a part of the monitor has a problem",
    "acknowledged": "alarm, acknowledged",
    "watch": "one window over the limit",
    "learning": "the baseline is being learned",
    "normal": "nothing to do",
}
_RANK = {name: rank for rank, name in enumerate(CONDITIONS)}
PAGE_SITES = 48  #: sites of one page


@dataclass(frozen=True, kw_only=True)
class SiteView:
    """One site with its conditions."""

    row: FleetRow
    conditions: tuple[str, ...]  #: the most urgent first
    reasons: tuple[str, ...]  #: for being stale or faulty

    @property
    def window_age(self) -> float | None:
        """Time since the last window [s]."""
        state = self.row.state
        return None if state is None or state.window_age is None else state.window_age + self.row.age


@dataclass(frozen=True, kw_only=True)
class Wanted:
    """Sites that a page shows."""

    words: str = ""  #: all of them are parts of the name
    condition: str = ""  #: empty for all
    page: int = 1


@dataclass(frozen=True, kw_only=True)
class Overview:
    """All sites, and those of one page."""

    total: int
    counts: dict[str, int]  #: sites of each condition, among those with the words in their names
    found: int
    shown: Sequence[SiteView]
    page: int
    pages: int


def view_of(row: FleetRow) -> SiteView:
    """Return a site with its conditions."""
    stale, problems = list(_stale(row)), row.state.problems if row.state else ()
    conditions = [name for name, found in (("stale", stale), ("faulty", problems)) if found]
    of_alarm = _of_alarm(row)
    if of_alarm not in ("", "normal") or not conditions:
        conditions.append(of_alarm or "normal")
    return SiteView(row=row, conditions=tuple(sorted(conditions, key=_RANK.__getitem__)), reasons=(*stale, *problems))


def _stale(row: FleetRow) -> Iterator[str]:
    if row.state is None:
        yield "no state from the monitor yet"
    elif row.age > STATE_SECONDS:
        yield f"no state from the monitor for {duration_text(row.age)}"
    elif row.state.overdue:
        yield f"no window for {duration_text(row.state.window_age or 0.0)}" if row.state.window_age else "no window yet"


def _of_alarm(row: FleetRow) -> str:
    """Return the condition by the alarm; empty if it is unknown."""
    active = row.alarm if row.alarm and row.alarm.active else None
    state = row.state.state if row.state else "alarm" if active else ""
    if state == "alarm":
        return "acknowledged" if active and active.acknowledged else "changed"
    return state if state in CONDITIONS else ""


def overview(rows: Sequence[FleetRow], wanted: Wanted) -> Overview:
    """Return the sites that are wanted: by urgency, then those whose state has begun last."""
    words = wanted.words.casefold().split()
    named = [view_of(row) for row in rows if all(word in row.name.casefold() for word in words)]
    found = [view for view in named if not wanted.condition or wanted.condition in view.conditions]
    found.sort(key=lambda view: (_RANK[view.conditions[0]], view.row.lasts or 0.0, view.row.name))
    pages = max(1, -(-len(found) // PAGE_SITES))
    page = min(max(1, wanted.page), pages)
    counts = Counter(condition for view in named for condition in view.conditions)
    return Overview(
        total=len(rows),
        counts={name: counts[name] for name in CONDITIONS},
        found=len(found),
        shown=found[(page - 1) * PAGE_SITES : page * PAGE_SITES],
        page=page,
        pages=pages,
    )
