"""Data of the pages: the state file of the monitor, and the history; no page accesses the monitor itself."""

import time
from dataclasses import dataclass, field, replace
from pathlib import Path

from monitor.outputs.history import AlarmRow, EventRow, HistoryError, Reader, Span, TrendPoint, WindowRow
from monitor.results.comparison import DiagnosisAnswer
from monitor.results.site_status import FILE_NAME, DeviceStatus, SiteStatus, read_status
from monitor.results.windows import ReferenceResult, SelfTestResult
from monitor.text.quantities import duration_text, utc

_STALE_SECONDS = 10.0  # without a new status file
_SILENT_SECONDS = 5.0  # without data of a device
_SHOWN = 300  # windows
_EVENTS = 12  # that are shown


@dataclass(frozen=True, kw_only=True)
class Past:
    """Recent contents of the history."""

    windows: list[WindowRow]
    trends: dict[int, list[TrendPoint]]
    alarms: list[AlarmRow]
    events: list[EventRow]
    reference: ReferenceResult | None
    reported: frozenset[int]  #: alarms with a diagnosis, by their beginning [ns UTC]
    places: list[tuple[float, float, float]]  #: positions of the active alarm's causes [m]


@dataclass(frozen=True, kw_only=True)
class Source:
    """Paths of a site's state."""

    name: str
    state: Path  #: folder
    url: str = field(repr=False)  #: address of the history, with its password
    history_site: str = ""  #: name of the site in the history; empty for the only one

    def token_path(self, file: str | None) -> Path:
        """Return the path of the token: a file next to the settings, by default in the state folder."""
        return self.state / "web_token" if file is None else self.state.parent / file

    def status(self) -> SiteStatus | None:
        """Return the newest status; None where no monitor of this version has ever run."""
        return read_status(self.state / FILE_NAME)

    def past(self) -> Past | None:
        """Return the last windows of the history; None if it is not available or empty.

        Times after the monitor's last window are of a clock that ran ahead: it is not the last.
        """
        status = self.status()
        last = status.window.end if status and status.window else None
        try:
            with Reader(self.url, self.history_site) as reader:
                whole = reader.span()
                if whole is not None and last is not None:
                    whole = replace(whole, end=min(whole.end, last))
                windows = reader.windows(whole, _SHOWN) if whole else []
                if whole is None or not windows:
                    return None
                late = Span(start=windows[0].end, end=whole.end)
                reference = reader.reference()
                alarms = reader.alarms(whole)[-5:]
                standing = [alarm.raised for alarm in alarms if alarm.cleared is None]
                found = reader.diagnosis(standing[-1]) if standing else None
                causes = DiagnosisAnswer.model_validate_json(found).causes if found else []
                return Past(
                    windows=windows,
                    trends={mode: reader.trend(mode, late, "window") for mode in reader.modes()},
                    alarms=alarms,
                    events=_newest(reader),
                    reported=frozenset(a.raised for a in alarms if reader.diagnosis(a.raised, a.cleared) is not None),
                    reference=ReferenceResult.model_validate_json(reference) if reference else None,
                    places=[cause.where.position for cause in causes if cause.where and cause.where.position],
                )
        except (HistoryError, ValueError):
            return None


def _newest(reader: Reader) -> list[EventRow]:
    """Return the last events and the last changes of the alarm in the order of time."""
    always = Span(start=0, end=2**62)
    rows = [*reader.events(always, _EVENTS), *reader.alarm_changes(always, _EVENTS)]
    return sorted(rows, key=lambda row: row.time)[-_EVENTS:]


def silence(status: SiteStatus | None) -> str:
    """Return why there is no present state of a monitor; empty if there is one."""
    if status is None:
        return "no monitor has run here yet"
    age = time.time() - status.time
    return f"no status of the monitor for {duration_text(age)}" if age > _STALE_SECONDS else ""


def measurement_problems(status: SiteStatus) -> list[str]:
    """Return the problems of a monitor that limit its present verdict."""
    found = [problem for name, device in status.devices.items() for problem in _device_problems(name, device)]
    if status.window_overdue:
        late, step = status.window_age, status.step_seconds
        found.append(f"no window has been analysed for {late:.0f} s; one is due every {step:.0f} s")
    if status.blind:
        found.append(status.blind)
    found += status.missing_channels
    if status.overload:
        found.append(status.overload)
    return found


def problems(status: SiteStatus | None) -> list[str]:
    """Return the problems of a monitor; empty for a healthy one."""
    if status is None or silence(status):
        return [silence(status)]
    found = measurement_problems(status)
    if status.counters.dropped:
        found.append(f"{status.counters.dropped} items did not reach the log")
    if status.self_test and not status.self_test.passed:
        found.append(self_test_text(status.self_test))
    found += [f"{name}: {problem}" for name, problem in status.problems.found.items()]
    return found


def self_test_text(test: SelfTestResult) -> str:
    """Return a text on the last self-test."""
    return f"{test.text} ({utc(test.time)})"


def _device_problems(name: str, device: DeviceStatus) -> list[str]:
    if device.lost:
        return [f"device {name} is lost"]
    if device.silent is None:
        return [f"device {name} has sent nothing yet"]
    silent = device.silent > _SILENT_SECONDS
    return [f"device {name} has been silent for {device.silent:.0f} s"] if silent else []
