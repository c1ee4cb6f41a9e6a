"""Requirements of a run other than its devices, checked before it starts: history, notices, ports, disk, clock."""

import ctypes
import os
import shutil
import socket
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from urllib.parse import urlsplit

from monitor.outputs.history import HistoryError, Reader
from monitor.service.acquisition.thermometer import last_reading
from monitor.service.site import Site
from monitor.settings import NotifySettings, Settings, TemperatureSettings
from monitor.settings.redaction import revealed, shown_address
from oma import least_frequency, shortest_duration

_SECONDS = 3.0  # to wait for a server
_PORTS = {"http": 80, "https": 443, "mqtt": 1883, "mqtts": 8883}
_NOT_SYNCHRONISED = 5  # return value of adjtimex(2): TIME_ERROR
_AHEAD = 60.0  # s by which a file may be younger than now: the clocks of network drives
BYTES_A_SCAN = 4.4, 9.2  # of three axes in a log: a sensor at rest, and 10 mg rms (`make bench-log-crash`)


@dataclass(frozen=True, kw_only=True)
class Finding:
    """One thing that was looked at."""

    what: str
    text: str
    well: bool = True


def look_around(site: Site) -> Iterator[Finding]:
    """Yield how each thing is; nothing is sent, and nothing made."""
    yield _guarded("window", partial(_window, site.settings))
    yield _history(site)
    for number, target in enumerate(site.settings.notify, 1):
        yield _guarded(f"notify {number}", partial(_notify, target))
    if site.settings.home_assistant:
        broker = NotifySettings(mqtt=site.settings.home_assistant.mqtt)
        yield _guarded("home assistant", partial(_notify, broker))
    if site.settings.temperature:
        yield _guarded("temperature", partial(_temperature, site.settings.temperature))
    web, viewer = site.settings.web, site.settings.viewer
    if web:
        yield _guarded("web", partial(_port, web.bind, web.port))
    for port in (viewer.port, viewer.port + 1) if viewer else ():
        yield _guarded("viewer", partial(_port, "127.0.0.1", port))
    yield _guarded("disk", partial(_disk, site))
    yield _guarded("clock", partial(_clock, site))


def _guarded(what: str, look: Callable[[], str]) -> Finding:
    try:
        return Finding(what=what, text=look())
    except (OSError, ValueError) as error:
        return Finding(what=what, text=str(error), well=False)


def _window(settings: Settings) -> str:
    """Check that windows are long enough for modes to be sought in them."""
    seconds, rate = settings.analysis.window_seconds, min(device.rate for device in settings.device)
    least = 0.0 if settings.analysis.band else shortest_duration(rate)
    if seconds <= least:
        raise ValueError(
            f"analysis.window_seconds: expected more than {least:.3g} s at {rate:g} Hz, found {seconds:g}; "
            "no window would have modes"
        )
    low = settings.analysis.band[0] if settings.analysis.band else least_frequency(seconds)
    return f"modes from {low:.2g} Hz are sought"


def _history(site: Site) -> Finding:
    url = site.source.url
    file = url.removeprefix("sqlite:///")
    if file != url and not Path(file).exists():
        return Finding(what="history", text=f"{file}, made at the start")
    try:
        with Reader(url, site.source.history_site) as reader:
            span = reader.span()
    except HistoryError as error:
        return Finding(what="history", text=str(error), well=False)
    days = (span.end - span.start) / 86400e9 if span else 0.0
    return Finding(what="history", text=f"{file if file != url else urlsplit(url).hostname}, {days:.3g} days")


def _notify(target: NotifySettings) -> str:
    """Check that a target can be reached; nothing is sent."""
    if target.command:
        found = shutil.which(revealed(target.command[0]))
        if found is None:
            raise ValueError("command: expected a program as its first word, found none of that name")
        return f"command {found}"
    if target.mqtt and find_spec("paho") is None:
        raise ValueError("mqtt needs paho-mqtt: pip install 'modalwatch[fleet]'")
    address = revealed(target.webhook or target.mqtt)
    url = urlsplit(address)
    try:
        socket.create_connection((url.hostname or "", url.port or _PORTS[url.scheme]), _SECONDS).close()
    except OSError as error:
        raise ValueError(f"{shown_address(address)}: {error}") from error
    return f"{shown_address(address)} answers"


def _temperature(settings: TemperatureSettings) -> str:
    """Check that a thermometer can be read."""
    if settings.mqtt:
        return _notify(NotifySettings(mqtt=settings.mqtt))
    return last_reading(settings)


def _port(host: str, port: int) -> str:
    try:
        socket.create_server((host, port), family=socket.AF_INET6 if ":" in host else socket.AF_INET).close()
    except OSError as error:
        raise ValueError(f"{host}:{port}: {error.strerror}") from error
    return f"{host}:{port} is free"


def _disk(site: Site) -> str:
    """Check that logs and state can be written."""
    for folder in (site.folder / site.settings.recorder.folder, site.state):
        there = next(p for p in (folder, *folder.absolute().parents) if p.exists())
        if not os.access(there, os.W_OK | os.X_OK):
            raise ValueError(f"{folder} cannot be written by this user")
        free, least = shutil.disk_usage(there).free / 1e9, site.settings.recorder.min_free_gb
        if free < least:
            raise ValueError(f"{free:.3g} GB are free, less than recorder.min_free_gb = {least:g}")
    return "log and state can be written"


def _clock(site: Site) -> str:
    """Check that the host's clock is synchronised, and not behind recorded data."""
    if all(device.driver == "replay" for device in site.settings.device):
        return "times are those of the recorded devices"
    logs = site.folder / site.settings.recorder.folder
    newest = max((path.stat().st_mtime for path in logs.glob("*.mcap")), default=0.0)
    if newest > time.time() + _AHEAD:
        raise ValueError(f"{newest - time.time():.0f} s behind the newest log: it has run backwards")
    nothing_changed = ctypes.create_string_buffer(512)  # struct timex, modes = 0: read only
    if ctypes.CDLL(None).adjtimex(nothing_changed) == _NOT_SYNCHRONISED:
        return "not synchronised (NTP): times of alarms and of logs will drift"  # a warning only
    return "synchronised"


def disk_plan(settings: Settings, free: float) -> str:
    """Return a text on disk use per day, days until the disk is full, and the consequence.

    Parameters
    ----------
    settings : of the site
    free : room on the disk of the logs [bytes]
    """
    recorder = settings.recorder
    least, most = (sum(device.rate for device in settings.device) * 86400 * b * 1e-9 for b in BYTES_A_SCAN)
    takes = f"{_span(least, most)} GB per day"
    room = free * 1e-9 - recorder.min_free_gb
    if room <= 0:
        return f"{takes}; less than recorder.min_free_gb = {recorder.min_free_gb:g} is free now"
    allowed = min(room, recorder.keep_gb or room)
    days = allowed / most, allowed / least
    if recorder.keep_days and recorder.keep_days <= days[0]:
        return f"{takes}; the last {recorder.keep_days:g} days are kept"
    spared = recorder.min_free_gb > 0 or allowed < room
    then = "the oldest files are deleted" if spared else "the disk is full"
    return f"{takes}; room for {_span(*days)} days, then {then}"


def _span(low: float, high: float) -> str:
    """Return two figures as one where they print the same."""
    texts = f"{low:.2g}" if low < 100 else f"{low:.0f}", f"{high:.2g}" if high < 100 else f"{high:.0f}"
    return texts[0] if texts[0] == texts[1] else f"{texts[0]} to {texts[1]}"
