"""Run of a site: starts its components and replaces them on reload."""

import gc
import shutil
import time
from collections.abc import Callable, Iterable, Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Self

from daq import Item, SystemClock
from daq.events import EventPayload
from daq.supervision import FAILURES, error_text
from monitor.errors import SettingsError
from monitor.results.innovations import ModeInnovations
from monitor.results.service_events import ClockChanged, InnovationsHigh, Reloaded, ReloadRefused, UncleanEnd
from monitor.results.site_status import FILE_NAME, Counters, PartProblems
from monitor.results.windows import Result
from monitor.service.acquisition.devices import Devices, Drivers, site_clock, site_drivers
from monitor.service.acquisition.thermometer import Thermometer, thermometer
from monitor.service.log_and_analysis import LogAndAnalysis, analysed_alike, logs_of, prepare_logs
from monitor.service.operator_commands import Inbox, inbox_of
from monitor.service.outputs import Outputs
from monitor.service.processes import trim_memory
from monitor.service.servers.live_view import LiveView
from monitor.service.site import Site
from monitor.service.status import MonitorStatus, Pace
from monitor.service.systemd.notify import SignsOfLife
from monitor.service.worker import LiveState
from monitor.settings import Settings
from monitor.watch.memory import LoadedState

_SWEEP = 60.0  # s
_QUIET_SECONDS = 60.0  # of data without innovations above the limit, before they are logged again
_POLL = 0.2  # s: of a turn that has failed
_STEP, _STEP_AGAIN = 2 * 10**9, 600.0  # ns by which a clock is set, from which on it is followed; s until it is again


class SiteRun:
    """Run of a site: readers and writer in threads, analysis in a process, outputs.

    All methods but `_take` are for one thread.

    Parameters
    ----------
    site : devices and settings
    on_result : called with everything that is found
    live : shows the log, if given
    takers : called in the log's thread with all that is logged
    recalled : state of the run before, to be continued
    repairs : repairs of logs that earlier runs left without an end, as texts
    """

    def __init__(
        self,
        site: Site,
        on_result: Callable[[Result], None],
        live: LiveView | None,
        takers: Sequence[Callable[[Item], None]],
        recalled: LoadedState,
        repairs: Sequence[str],
    ) -> None:
        self._site, self._takers = site, takers
        self._clock = site_clock(site.settings)
        self._repairs = repairs
        self._inbox, self._outputs = Inbox(site.state), Outputs(site, live)
        settings = site.settings
        path, pace = site.state / FILE_NAME, pace_of(settings)
        self.status = MonitorStatus(path, _names(site), pace, self._clock, settings.device_of)
        #: the log that is written and the analysis that is fed, and all before them
        self.logs = LogAndAnalysis(
            site, self._clock, on_result, self._take_state, self._take, lambda: self.status.lost, recalled
        )
        self._over_until = 0  # end of the last block with innovations above the limit [ns UTC]
        self._thermometer = ExitStack()
        self._reads: Thermometer | None = None
        self._devices = Devices(self._clock, self.logs.put)
        self._step_due = 0.0  # monotonic time from which on the clock may be followed again [s]
        self._second_over = False  # since the status was written last
        self._sweep_due = 0.0  # likewise, for the next full look for garbage

    def __enter__(self) -> Self:
        """Start everything; undo it if something does not start."""
        with ExitStack() as stack:
            stack.enter_context(self._outputs)
            stack.callback(lambda: self._thermometer.close())
            self._read_temperature()
            with suppress(OSError):  # a state folder without write permission is reported elsewhere
                inbox_of(self._site.state)
            stack.enter_context(self.logs)
            if self._repairs:
                self.logs.report(UncleanEnd(why="; ".join(self._repairs)))
            drivers = site_drivers(self._site.settings.device, self._clock.speed)
            self._devices.start(drivers, missing_is_lost=self.logs.learnt)
            self._undo = stack.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        """End everything that is still running."""
        self._devices.stop()
        self._undo.close()

    def poll(self) -> bool:
        """Log and pass on results, for a moment; return whether a second is over since the last time."""
        if not FAILURES.attempt("log and analysis", self.logs.poll):
            time.sleep(_POLL)
        for part, events in (
            ("inbox", self._inbox.taken),
            ("outputs", self._outputs.events),
            ("status", self.status.events),
            ("threads", FAILURES.events),
        ):
            FAILURES.attempt(part, self._log_events, events)
        FAILURES.attempt("temperature", self._log_temperature)
        FAILURES.attempt("clock", self._follow_clock)
        if time.monotonic() >= self._sweep_due:
            gc.collect()  # circular references: with few objects Python does that once in hours
            trim_memory()  # what that frees in pieces
            self._sweep_due = time.monotonic() + _SWEEP
        return FAILURES.attempt("status", self._write_status) and self._second_over

    def _log_events(self, events: Callable[[], Iterable[EventPayload]]) -> None:
        for payload in events():
            self.logs.report(payload)

    def _log_temperature(self) -> None:
        for reading in self._reads.read() if self._reads else ():
            self.logs.put(reading)

    def _write_status(self) -> None:
        status = self.status.write(self._problems, self._counters)
        self._second_over = status is not None
        if status:
            self._outputs.put_status(status)

    def finish(self) -> None:
        """Log the received data, and analyse them as far as possible in a while."""
        self._devices.stop()
        self.logs.finish()

    @property
    def signs(self) -> SignsOfLife:
        """Signs that the run works."""
        disk = time.monotonic() - self.logs.turned
        return SignsOfLife(data=self.status.silence, disk=disk, losing=self.logs.losing)

    def reload(self, site: Site) -> None:
        """Continue with other settings: only affected parts are restarted.

        Parts that may be refused are tested before anything is changed. A part that fails nevertheless is named in the
        event, and does not affect the others.

        Raises
        ------
        SettingsError
            If they require a restart; everything continues as before.
        StartError
            If a driver has no such place or rate, or no log can be written there; likewise.
        """
        before, now = self._site.settings, site.settings
        for name in ("state", "clock"):
            if getattr(before, name) != getattr(now, name):
                raise SettingsError(site.path, f"{name}: expected no change; a change requires a restart")
        new = {device.name: device for device in now.device}
        changed = [device.name for device in before.device if new.get(device.name) != device]
        fresh = [device for device in now.device if device not in before.device]
        drivers = site_drivers(fresh, self._clock.speed)
        alike = analysed_alike(self._site, site)
        if not alike:
            prepare_logs(site)
        self._site, self.logs.site, old = site, site, self._site
        parts = [*(() if alike else ("log and analysis",)), *(f"device {name}" for name in {*changed, *drivers})]
        failed = []
        steps: dict[str, Callable[[], object]] = {
            "devices": lambda: self._renew_devices(old, changed, drivers),
            "temperature": self._read_temperature if before.temperature != now.temperature else lambda: None,
            "outputs": lambda: parts.extend(self._outputs.renew(site, analysed_alike=alike)),
        }
        for name, step in steps.items():
            try:
                step()
            except Exception as error:  # noqa: BLE001 - the watch goes on with all the others
                failed.append(f"{name}: {error_text(error)}")
        changes = ", ".join(sorted(parts)) or "nothing"
        self.logs.report(Reloaded(changed=changes, failed="; ".join(failed) or None))

    def refuse(self, why: str) -> None:
        """Report that new settings are invalid."""
        self.logs.report(ReloadRefused(why=why))

    def _renew_devices(self, old: Site, changed: Sequence[str], drivers: Drivers) -> None:
        """Stop devices and start those that come for them; with a log and an analysis of their own if they need one."""
        alike = analysed_alike(old, self._site)
        stopped = self._devices.stop(changed)
        settings = self._site.settings
        self.status.follow(_names(self._site), pace_of(settings), settings.device_of)
        if not alike:
            self.logs.renew("other settings")
        self._devices.resume(drivers, stopped if alike else {})

    def _follow_clock(self) -> None:
        """Follow the host's clock after it was set: all devices get new times, in another log."""
        clock = self._clock
        if not isinstance(clock, SystemClock) or abs(clock.off) < _STEP or time.monotonic() < self._step_due:
            return
        self._step_due = time.monotonic() + _STEP_AGAIN
        self.logs.report(ClockChanged(by_s=round(clock.off * 1e-9, 1)))
        drivers = site_drivers(self._site.settings.device, clock.speed)
        self._devices.stop()
        clock.follow()
        self.logs.renew("the clock was set")
        self._outputs.show_again()  # scans are counted from the start
        self._devices.resume(drivers, {})

    def _read_temperature(self) -> None:
        """Read the site's thermometer, if it has one, and no other one any more."""
        self._thermometer.close()
        settings = self._site.settings.temperature
        self._reads = self._thermometer.enter_context(thermometer(settings, self._clock)) if settings else None

    def _take(self, item: Item) -> None:
        """Hand on an item once it is logged; in the log's thread. One that fails takes it from no other."""
        self._outputs.put(item)
        FAILURES.attempt("status", self.status.take, item)
        for taker in self._takers:
            FAILURES.attempt("journal", taker, item)

    def _take_state(self, state: LiveState) -> None:
        if isinstance(state, ModeInnovations):
            self._report_innovations(state)
        else:
            self.status.take_residuals(state)
        self._outputs.show(state.event())

    def _report_innovations(self, innovations: ModeInnovations) -> None:
        """Log innovations above the limit, unless some were within the last minute of data."""
        if innovations.over:
            if innovations.time - self._over_until > _QUIET_SECONDS * 1e9:
                deviation, frequency = innovations.largest
                event = InnovationsHigh(frequency=frequency, deviation=deviation).event(innovations.time)
                self.logs.put(event)
            self._over_until = innovations.time

    @property
    def _problems(self) -> PartProblems:
        temperature = self._reads.problem if self._reads else None
        found = self._outputs.problems | self.logs.problems | {"temperature": temperature, "threads": FAILURES.problem}
        return PartProblems(**found)

    @property
    def _counters(self) -> Counters:
        return Counters(
            dropped=self.logs.dropped,
            history_dropped=self._outputs.history_dropped,
            disk_free=_free(logs_of(self._site)),
            waiting=self.logs.waiting | {"view": self._outputs.waiting},
            bad_bytes=self._devices.bad_bytes,
            thread_failures=FAILURES.counts,
        )


def _names(site: Site) -> tuple[str, ...]:
    return tuple(device.name for device in site.settings.device)


def pace_of(settings: Settings) -> Pace:
    """Return how often windows come by the settings, and whether there are self-tests."""
    speed = settings.clock.speed if settings.clock else 1.0
    step, window = settings.step_seconds / speed, settings.analysis.window_seconds / speed
    return Pace(step=step, window=window, tests=settings.alarm.self_test_days > 0)


def _free(folder: Path) -> int:
    try:
        return shutil.disk_usage(folder).free
    except OSError:
        return 0  # no longer there: writing will show it
