"""Choice of the logged items that are sent as notices: a pure function of the items before."""

from daq import Block, Event, Item
from monitor.results.windows import (
    TOPIC_ALARM,
    TOPIC_SELF_TEST,
    TOPIC_WINDOW,
    AlarmResult,
    SelfTestResult,
    WindowResult,
    event_result,
)
from monitor.text.causes import change_text
from monitor.text.events import event_name, event_text
from monitor.text.notices import Notice, NoticeKind
from monitor.text.quantities import utc
from monitor.watch.blindness import MAX_BLIND, BlindWindows

_ROUTINE = (
    "gap",
    "windows_left_out",
    "acknowledge",
    "accept",
    "accept_undone",
    "stopped",
    "notice_failed",
    "notice_recovered",
    "log_deleted",
    "device_open",
    "reloaded",
)


class NoticeFilter:
    """Filter of the items that are news.

    An alarm is sent when it is raised, and again only when its diagnosis names other causes or another member.
    """

    def __init__(self, site: str) -> None:
        self._site = site
        self._state = "normal"
        self._raised: int | None = None
        self._causes: tuple[str, ...] | None = ()  # causes of the last notice; None: by an earlier run
        self._behind = False  # windows are left out
        self._sight = BlindWindows()
        self._passed = True  # the last self-test
        self._failed = ""  # failure of the analysis, with its reason

    def of(self, item: Item) -> Notice | None:
        """Return the notice that an item of the log is worth; items in the log's order."""
        if isinstance(item, Block):
            return None
        if item.topic not in (TOPIC_ALARM, TOPIC_WINDOW, TOPIC_SELF_TEST):
            return self._trouble(item)
        result = event_result(item)
        if isinstance(result, SelfTestResult):
            before, self._passed = self._passed, result.passed
            return None if before == result.passed else self._notice("trouble", result.time, result.text)
        if isinstance(result, AlarmResult):
            return self._change(result)
        return self._of_window(result) if isinstance(result, WindowResult) else None

    def _trouble(self, event: Event) -> Notice | None:
        what = event.topic.removeprefix("/event/")
        if what in _ROUTINE or what == event.topic:
            return None
        details = event_text(event.payload)
        return self._notice(
            "trouble", event.time, f"{event_name(event.topic)}: {details}" if details else event_name(event.topic)
        )

    def _change(self, change: AlarmResult) -> Notice | None:
        before, self._state = self._state, change.state
        if change.raised:
            self._raised = change.time
        elif change.since is not None:
            self._raised, self._causes = change.since, self._causes or None
        if change.kind == "failed":
            known, self._failed = self._failed, change.text  # reported once, until it changes
            return None if change.text == known else self._notice("trouble", change.time, change.text)
        if change.quiet or change.state == "watch":
            return None
        if change.kind in ("flapping", "steady"):
            return self._notice("flapping", change.time, change.text)
        if change.kind == "acknowledged":
            return self._notice("acknowledged", change.time, change.text)
        if change.kind in ("trend", "trend_over"):
            return self._notice("trend", change.time, change.text)
        if change.kind in ("latched", "accepted"):
            return self._notice("recovery", change.time, change.text)
        if change.raised or change.kind == "changed_again":
            return self._notice("alarm", change.time, change.text)
        over = before == "alarm" and change.state == "normal"
        return self._notice("recovery", change.time, change.text) if over else None

    def _of_window(self, window: WindowResult) -> Notice | None:
        before, self._sight = self._sight, self._sight.after(window)
        if self._sight.dark == MAX_BLIND:
            return self._notice("trouble", window.end, self._sight.blind or "")
        if before.blind and not self._sight.dark:
            return self._notice(
                "trouble", window.end, f"windows have usable results again, after {before.dark} without"
            )
        behind, self._behind = self._behind, window.skipped
        if window.skipped and not behind:
            return self._notice("trouble", window.end, "windows are left out: the analysis has fallen behind")
        return self._sharper(window)

    def _sharper(self, window: WindowResult) -> Notice | None:
        found = window.diagnosis
        if found is None:
            return None
        causes = (found.verdict, *(f"{c.cause} {c.where.member if c.where else ''}" for c in found.causes))
        known, self._causes = self._causes, causes
        # the window that raises it comes first, and is reported with the alarm
        new = self._state == "alarm" and known is not None and causes != known
        return self._notice("update", window.end, change_text(found)) if new else None

    def _notice(self, kind: NoticeKind, time: int, text: str) -> Notice:
        alarm = None if kind in ("trouble", "trend") else self._raised
        return Notice(kind=kind, site=self._site, time=time, utc=utc(time), state=self._state, text=text, alarm=alarm)
