"""A site that is watched: its parts, and how each gives way to another while the rest goes on."""

import shutil
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack, suppress
from functools import partial
from pathlib import Path
from typing import Any, Self

from daq import Event, Item, LogError, LogThread, SystemClock
from monitor.analysing import Analysis, analysed_alike, blocks_a_second, logs_of, most_waiting, new_analysis
from monitor.devices import Devices, Drivers, site_clock, site_drivers
from monitor.errors import SettingsError
from monitor.inbox import Inbox, inbox_of
from monitor.live import LiveView
from monitor.memory import MEMORY, MemoryFile, Recalled, fitting
from monitor.outlets import Outlets
from monitor.result_events import result_event
from monitor.results import Result
from monitor.service_manager import SignsOfLife
from monitor.site import Site
from monitor.thermometer import Thermometer, thermometer
from monitor.vitals import NAME, Pace, Vitals
from monitor.worker import TOPIC_STOPPED, AnalysisError, Kept, Told, Worker
from updater import parse_structure

_POLL = 0.2  # s
_LAST_SECONDS = 80.0  # that a stop waits for the analysis; systemd kills after 90, see unit_file.py
_LAST_WORDS = 20.0  # s that one which gives way to another is waited for: the watchdog is fed four times a minute
_STEP, _STEP_AGAIN = 2 * 10**9, 600.0  # ns by which a clock is set, from which on it is followed; s until it is again
_REVIVE_FIRST, _REVIVE_LONGEST = 1.0, 600.0  # s until an analysis that died is started again; doubled each time


class Running:
    """Readers and writer in threads, analysis in a process, and what is told of it.

    All methods but `_take` are for one thread.

    Parameters
    ----------
    site : what is connected and how it is watched
    on_result : called with everything that is found
    live : shows what is logged, if given
    takers : called in the log's thread with all that is logged
    recalled : of the run before, to go on from
    mended : what was done to logs that earlier runs left without an end, in words
    """

    def __init__(
        self,
        site: Site,
        on_result: Callable[[Result], None],
        live: LiveView | None,
        takers: Sequence[Callable[[Item], None]],
        recalled: Recalled,
        mended: Sequence[str],
    ) -> None:
        self._site, self._on_result, self._takers = site, on_result, takers
        self._clock = site_clock(site.settings)
        self._mended = mended
        self._refused, self._kept = recalled.refused, recalled.text or ""  # what to go on from, by now
        self._memory, self._inbox = MemoryFile(site.state / MEMORY), Inbox(site.state)
        self._analysis = new_analysis(site, self._clock, self._take, self._kept)
        self._worker: Worker | None = self._analysis.worker  # that the log's thread feeds
        self._keepers = [self._analysis.keeper]  # of all logs so far
        self._outlets = Outlets(site, live)
        self._thermometer = ExitStack()
        self._reads: Thermometer | None = None
        self.vitals = Vitals(site.state / NAME, _names(site), _pace(site), self._clock)
        seconds = site.settings.recorder.chunk_seconds
        self._log = LogThread(self._analysis.keeper, self._take, chunk_seconds=seconds)
        self._devices = Devices(self._clock, self._log.put)
        self._revive_at, self._revive_after = 0.0, _REVIVE_FIRST
        self._step_due = 0.0  # monotonic time from which on the clock may be followed again [s]

    def __enter__(self) -> Self:
        """Start everything; undo it if something does not start."""
        with ExitStack() as stack:
            stack.callback(lambda: self._analysis.worker.__exit__())
            self._analysis.worker.__enter__()
            stack.enter_context(self._outlets)
            stack.callback(lambda: self._thermometer.close())
            self._read_temperature()
            stack.enter_context(self._memory)
            with suppress(OSError):  # a state folder that takes nothing is told elsewhere
                inbox_of(self._site.state)
            stack.enter_context(self._log)
            if self._mended:
                self._say("unclean_end", {"why": "; ".join(self._mended)})
            self._say_refused()
            drivers = site_drivers(self._site.settings.device, self._clock.speed)
            self._devices.start(drivers, missing_is_lost=bool(self._kept))
            self._undo = stack.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        """End everything that still goes on."""
        self._devices.stop()
        self._undo.close()

    def turn(self) -> bool:
        """Log and hand on what is found, for a moment; tell whether a second is over since that was told last."""
        self._report()
        for topic, payload in (*self._inbox.taken(), *self._outlets.said(), *self.vitals.said()):
            self._log.put(Event(topic=topic, time=self._clock.now(), payload=payload))
        for reading in self._reads.read() if self._reads else ():
            self._log.put(reading)
        if self._revive_at and time.monotonic() >= self._revive_at:
            self._renew_analysis("the analysis had died")
        self._keep_up()
        self._follow_clock()
        return self.vitals.write(self._state())

    def finish(self) -> None:
        """Let what has arrived be logged, and analysed as far as that goes in a while: service managers do not wait."""
        self._devices.stop()
        self._log.put(self._event(TOPIC_STOPPED, {"dropped": self._log.dropped}))
        self._hear_out(_LAST_SECONDS)

    def _hear_out(self, seconds: float) -> None:
        """Wait for the analysis to say its last word, so long at most; what it leaves out then stands in the log."""
        end = time.monotonic() + seconds
        while self._report():
            if time.monotonic() > end:
                self._say_behind(self._analysis.worker.waiting)
                return

    def _say_behind(self, waiting: int) -> None:
        self._say("analysis_behind", {"left_out_s": round(waiting / blocks_a_second(self._site), 1)})

    @property
    def signs(self) -> SignsOfLife:
        """What tells that it works."""
        disk = time.monotonic() - self._log.turned
        return SignsOfLife(data=self.vitals.silence, disk=disk, losing=self._analysis.keeper.losing)

    @property
    def logs(self) -> tuple[Path, ...]:
        """The files, in the order of writing."""
        return tuple(path for keeper in self._keepers for path in keeper.paths)

    @property
    def dropped(self) -> int:
        """Items that the log's queue had no room for."""
        return self._log.dropped

    @property
    def disk_failure(self) -> str | None:
        """What is not in the log, and why."""
        return "; ".join(filter(None, (keeper.problem for keeper in self._keepers))) or None

    def reload(self, site: Site) -> None:
        """Go on with other settings: only what they change starts anew.

        Raises
        ------
        SettingsError
            If they take a restart; all goes on as it was.
        StartError
            If a driver has no such place or rate; likewise.
        """
        before, now = self._site.settings, site.settings
        for name in ("state", "clock"):
            if getattr(before, name) != getattr(now, name):
                raise SettingsError(site.path, f"{name}: expected as it was; to change it takes a restart")
        new = {device.name: device for device in now.device}
        changed = [device.name for device in before.device if new.get(device.name) != device]
        fresh = [device for device in now.device if device not in before.device]
        drivers = site_drivers(fresh, self._clock.speed)
        self._site, old = site, self._site
        self._renew_devices(old, changed, drivers)
        if before.temperature != now.temperature:
            self._read_temperature()
        alike = analysed_alike(old, site)
        said = [*self._outlets.renew(site, analysed_alike=alike), *(() if alike else ("log and analysis",))]
        said += [f"device {name}" for name in {*changed, *drivers}]
        self._say("reloaded", {"changed": ", ".join(sorted(said)) or "nothing"})

    def refuse(self, error: Exception) -> None:
        """Say that new settings cannot be used."""
        self._say("reload_refused", {"why": str(error)})

    def _renew_devices(self, old: Site, changed: Sequence[str], drivers: Drivers) -> None:
        """Stop devices and start those that come for them; with a log and an analysis of their own if they need one."""
        alike = analysed_alike(old, self._site)
        stopped = self._devices.stop(changed)
        self.vitals.follow(_names(self._site), _pace(self._site))
        if not alike:
            self._renew_analysis("other settings")
        self._devices.resume(drivers, stopped if alike else {})

    def _keep_up(self) -> None:
        """Leave out what the analysis will never catch up with: it goes on from now, with a log of its own."""
        waiting = self._worker.waiting if self._worker else 0
        if waiting <= most_waiting(self._site):
            return
        self._say_behind(waiting)
        self._log.put(self._event(TOPIC_STOPPED, {"dropped": self._log.dropped, "why": "the analysis was behind"}))
        self._worker = None
        self._renew_analysis("the analysis was behind")

    def _follow_clock(self) -> None:
        """Go on by the host's clock where that has been set: all devices are told their time anew, in another log."""
        clock = self._clock
        if not isinstance(clock, SystemClock) or abs(clock.off) < _STEP or time.monotonic() < self._step_due:
            return
        self._step_due = time.monotonic() + _STEP_AGAIN
        self._say("clock_set", {"by_s": round(clock.off * 1e-9, 1)})
        drivers = site_drivers(self._site.settings.device, clock.speed)
        self._devices.stop()
        clock.follow()
        self._renew_analysis("the clock was set")
        self._outlets.show_again()  # scans are counted anew
        self._devices.resume(drivers, {})

    def _renew_analysis(self, why: str) -> None:
        """Begin a new log and analysis amid the stream: each item goes into one of the logs, none into both.

        What comes while the old analysis says its last word stands in the old log, and is not analysed.
        """
        old = self._analysis
        if self._worker is not None:
            self._log.put(self._event(TOPIC_STOPPED, {"dropped": self._log.dropped, "why": why}))
            self._hear_out(_LAST_WORDS)
        try:
            new = new_analysis(self._site, self._clock, self._take, self._remembered())
        except LogError as error:
            self._mourn(error)  # the old log goes on, without an analysis, until there is room for another
            return
        self._analysis, self._revive_at = new, 0.0
        self._keepers.append(new.keeper)
        self._log.switch(new.keeper, partial(self._feed_to, new))
        new.worker.__enter__()
        old.worker.__exit__()
        self._say_refused()
        for name in self.vitals.lost:
            self._say("device_lost", {"device": name, "why": "it was lost before"})

    def _read_temperature(self) -> None:
        """Read the site's thermometer, if it has one, and no other one any more."""
        self._thermometer.close()
        settings = self._site.settings.temperature
        self._reads = self._thermometer.enter_context(thermometer(settings, self._clock)) if settings else None

    def _remembered(self) -> str:
        """Return what the new analysis goes on from: what the old one kept, as far as it is of the same watch."""
        if not self._kept:
            return ""
        structure = parse_structure(self._site.structure_text)
        found = fitting(self._kept, "what was learnt", structure, self._site.settings)
        self._refused, self._kept = found.refused, found.text or ""
        return self._kept

    def _say_refused(self) -> None:
        if self._refused:
            self._say("learning_anew", {"why": self._refused})
            self._refused = None

    def _feed_to(self, analysis: Analysis) -> None:
        self._worker = analysis.worker

    def _report(self) -> bool:
        """Log and hand on what the analysis has found; False once it has said its last word, or has died."""
        if self._worker is None:
            time.sleep(_POLL)
            return False
        try:
            for result in self._analysis.worker.results(_POLL):
                if result is None:
                    return False
                self._tell(result)
            self._memory.write()
        except AnalysisError as error:
            self._mourn(error)
            return False
        return True

    def _tell(self, result: Told) -> None:
        if isinstance(result, Kept):
            self._memory.expect(result.text)
            self._kept = result.text
            return
        event = result_event(result)
        self._memory.after(event)
        self._log.put(event)
        self._on_result(result)
        self._revive_after = _REVIVE_FIRST

    def _mourn(self, error: Exception) -> None:
        """Go on without an analysis for a while: one that dies at once, again and again, is not to fill the disk."""
        self._worker = None
        self._revive_at = time.monotonic() + self._revive_after
        self._say("analysis_died", {"why": str(error), "again_in_s": self._revive_after})
        self._revive_after = min(2 * self._revive_after, _REVIVE_LONGEST)

    def _take(self, item: Item) -> None:
        """Hand on an item once it is logged; in the log's thread."""
        if self._worker is not None:
            self._worker.feed(item)
        self._outlets.put(item)
        self.vitals.take(item)
        self._memory.take(item)
        for taker in self._takers:
            taker(item)

    def _say(self, what: str, payload: dict[str, Any]) -> None:
        self._log.put(self._event(f"/event/{what}", payload))

    def _event(self, topic: str, payload: dict[str, Any]) -> Event:
        return Event(topic=topic, time=self._clock.now(), payload=payload)

    def _state(self) -> dict[str, Any]:
        """Return what is well or not beside the devices and windows."""
        return self._outlets.problems | {
            "dropped": self._log.dropped,
            "disk": self._analysis.keeper.problem,
            "disk_free": _free(logs_of(self._site)),
            "memory": self._memory.problem,
            "temperature": self._reads.problem if self._reads else None,
            "analysis": None if self._worker else "its process has died; it is started again",
            "waiting": {
                "log": self._log.waiting,
                "analysis": self._worker.waiting if self._worker else 0,
                "view": self._outlets.waiting,
            },
            "bad_bytes": self._devices.bad_bytes,
        }


def _names(site: Site) -> tuple[str, ...]:
    return tuple(device.name for device in site.settings.device)


def _pace(site: Site) -> Pace:
    settings = site.settings
    speed = settings.clock.speed if settings.clock else 1.0
    return Pace(step=settings.step_seconds / speed, window=settings.analysis.window_seconds / speed)


def _free(folder: Path) -> int:
    try:
        return shutil.disk_usage(folder).free
    except OSError:
        return 0  # not there any more: writing tells
