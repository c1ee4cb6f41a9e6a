"""The monitoring service: start, loop, stop."""

import math
import shutil
import signal
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from daq import (
    CHANNELS,
    ChannelMap,
    DeviceReader,
    DiskGuard,
    Driver,
    DriverError,
    Event,
    HostClock,
    Item,
    LogAddress,
    LogKeeper,
    LogRecorder,
    LogThread,
    Retention,
    Rotation,
    ScaledClock,
    SystemClock,
    driver_names,
    make_driver,
    read_layout,
)
from monitor.errors import SettingsError, StartError
from monitor.history import HistoryRecorder, database_url
from monitor.inbox import taken
from monitor.live import LiveView
from monitor.memory import MEMORY, NOTHING, MemoryFile, Recalled
from monitor.notices import Courier, couriers
from monitor.result_events import result_event
from monitor.service_manager import ServiceManager, SignsOfLife
from monitor.settings import DeviceSettings, RecorderSettings, Settings, overrides, read_settings
from monitor.vitals import NAME, Vitals
from monitor.web import Source, web_process
from monitor.worker import TOPIC_STOPPED, Kept, Result, Worker
from updater import load_structure, portable_text

_POLL = 0.2  # s


@dataclass(frozen=True, eq=False, kw_only=True)
class Site:
    """Settings with the texts they come from, as they are attached to every log."""

    path: Path
    settings: Settings
    site_text: str
    structure_text: str

    @property
    def folder(self) -> Path:
        """Folder that relative paths in the settings start from."""
        return self.path.parent

    @property
    def name(self) -> str:
        """What it is called in notices: the structure file's name."""
        return Path(self.settings.structure).stem

    @property
    def source(self) -> Source:
        """Where others find its state."""
        return Source(name=self.name, state=self.state, url=database_url(self.settings.history.url, self.state))

    @property
    def state(self) -> Path:
        """Folder for what outlives a run."""
        return self.folder / self.settings.state


def load_site(path: Path, given: Sequence[str] = ()) -> Site:
    """Read SITE.toml and its structure.

    Parameters
    ----------
    path : of the file
    given : KEY=VALUE each, over what the file and the environment say

    Raises
    ------
    ArgumentError, SettingsError, StructureError, DbcError
        Naming file and key; also if a channel is not a sensor of the structure, or there is no such driver.
    """
    text, settings = read_settings(path, overrides(given))
    for device in settings.device:
        if device.dbc is not None:
            read_layout(device.dbc.sensor)
    structure_path = path.parent / settings.structure
    structure = load_structure(structure_path)
    for device in settings.device:
        if device.driver not in (drivers := driver_names()):
            raise SettingsError(
                path, f"device {device.name!r}: driver: expected one of {', '.join(drivers)}, found {device.driver!r}"
            )
    for channel in settings.channels:
        if channel.name not in structure.channels:
            known = ", ".join(structure.channels)
            raise SettingsError(path, f"channel {channel.name!r} is no sensor of {structure_path}; there are {known}")
    return Site(
        path=path,
        settings=settings,
        site_text=text,
        structure_text=portable_text(structure_path),
    )


@dataclass(frozen=True, kw_only=True)
class RunReport:
    """What a run leaves behind."""

    logs: tuple[Path, ...]  #: the files, in the order of writing
    dropped: int  #: items that the log's queue had no room for
    disk_failure: str | None

    @property
    def log(self) -> Path:
        """The log, or the folder of its files if there is more than one."""
        return self.logs[0] if len(self.logs) == 1 else self.logs[0].parent


@contextmanager
def stop_on_signals() -> Iterator[threading.Event]:
    """Turn SIGINT and SIGTERM into an event, for as long as the context lasts."""
    stop = threading.Event()
    before = {number: signal.signal(number, lambda *_: stop.set()) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield stop
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def run(
    site: Site,
    stop: threading.Event,
    on_result: Callable[[Result], None],
    live: LiveView | None = None,
    takers: Sequence[Callable[[Item], None]] = (),
    recalled: Recalled = NOTHING,
) -> RunReport:
    """Watch until `stop` is set: readers and writer in threads, analysis in a process.

    Parameters
    ----------
    site : what is connected and how it is watched
    stop : ends it; what has arrived by then is logged and analysed
    on_result : called in this thread with everything that is found
    live : shows what is logged, if given
    takers : called in the log's thread with all that is logged; they must not wait
    recalled : of the run before, to go on from

    Raises
    ------
    StartError
        If a device does not answer or the log cannot be made.
    """
    settings, clock = site.settings, _clock(site.settings)
    folder = site.folder / settings.recorder.folder
    folder.mkdir(parents=True, exist_ok=True)
    channel_map = ChannelMap(channels=settings.channels, on_grid=False)
    attachments = {
        "site.toml": site.site_text,
        "structure.toml": site.structure_text,
        CHANNELS: channel_map.to_json(),
    }
    if recalled.text:
        attachments[MEMORY] = recalled.text
    recorder = LogRecorder(folder, attachments, clock.now(), _rotation(settings.recorder))
    with ExitStack() as stack:
        worker = stack.enter_context(Worker(site.structure_text, site.site_text, recalled.text or "", keep=True))
        history = stack.enter_context(_history(site))
        told = stack.enter_context(couriers(settings.notify, site.state, site.name))
        vitals = _vitals(site, clock)
        if settings.web:
            web = settings.web
            stack.enter_context(web_process(site.source, web.bind, web.port, web.token_file))
        memory = stack.enter_context(MemoryFile(site.state / MEMORY))
        own = (worker.feed, history.put, vitals.take, *(c.put for c in told), memory.take)
        take = _all((*own, *((live.show,) if live else ()), *takers))
        keeper = LogKeeper(recorder, DiskGuard(folder, _retention(settings.recorder)), take)
        log = stack.enter_context(LogThread(keeper, take, chunk_seconds=settings.recorder.chunk_seconds))
        if live and live.problem:
            log.put(Event(topic="/event/no_viewer", time=clock.now(), payload={"why": live.problem}))
        if recalled.refused:
            log.put(Event(topic="/event/learning_anew", time=clock.now(), payload={"why": recalled.refused}))
        readers = _start_readers(settings, clock, log)
        manager = ServiceManager()
        manager.ready()
        while not stop.is_set():
            _report(worker, log, on_result, memory)
            for topic, payload in (*taken(site.state), *history.said(), *(s for c in told for s in c.said())):
                log.put(Event(topic=topic, time=clock.now(), payload=payload))
            if vitals.write(_more(log, keeper, history, told, memory, live, folder) | _queues(log, worker, readers)):
                manager.status(vitals.line)
            manager.feed(_signs(vitals, log, keeper))
        manager.stopping()
        for reader in readers:
            reader.stop()
        for reader in readers:
            reader.join()
        log.put(Event(topic=TOPIC_STOPPED, time=clock.now(), payload={"dropped": log.dropped}))
        while _report(worker, log, on_result, memory):
            pass
    return RunReport(logs=tuple(recorder.paths), dropped=log.dropped, disk_failure=keeper.problem)


def _vitals(site: Site, clock: HostClock) -> Vitals:
    names = tuple(device.name for device in site.settings.device)
    return Vitals(site.state / NAME, names, site.settings.step_seconds / clock.speed, clock)


def _signs(vitals: Vitals, log: LogThread, keeper: LogKeeper) -> SignsOfLife:
    return SignsOfLife(data=vitals.silence, disk=time.monotonic() - log.turned, losing=keeper.losing)


def _queues(log: LogThread, worker: Worker, readers: Sequence[DeviceReader]) -> dict[str, Any]:
    """Return what waits where, and what was damaged on its way."""
    return {
        "waiting": {"log": log.waiting, "analysis": worker.waiting},
        "bad_bytes": {reader.device: reader.bad_bytes for reader in readers},
    }


def _more(
    log: LogThread,
    keeper: LogKeeper,
    history: HistoryRecorder,
    told: Sequence[Courier],
    memory: MemoryFile,
    live: LiveView | None,
    logs: Path,
) -> dict[str, Any]:
    """Return what is well or not beside the devices and windows."""
    return {
        "dropped": log.dropped,
        "disk": keeper.problem,
        "disk_free": shutil.disk_usage(logs).free,
        "history": history.problem,
        "not_in_history": history.dropped,
        "notices": "; ".join(courier.problem for courier in told if courier.problem) or None,
        "memory": memory.problem,
        "viewer": live.problem if live else None,
    }


def _rotation(recorder: RecorderSettings) -> Rotation:
    return Rotation(size=recorder.rotate_mb * 1e6, seconds=recorder.rotate_minutes * 60)


def _retention(recorder: RecorderSettings) -> Retention:
    return Retention(
        seconds=(recorder.keep_days or math.inf) * 86400,
        size=(recorder.keep_gb or math.inf) * 1e9,
        least_free=recorder.min_free_gb * 1e9,
    )


def _history(site: Site) -> HistoryRecorder:
    url = database_url(site.settings.history.url, site.state)
    return HistoryRecorder(url, site.state / "history_spool.jsonl")


def _all(takers: Sequence[Callable[[Item], None]]) -> Callable[[Item], None]:
    """Return what hands each item to all of them, once it is logged."""

    def take(item: Item) -> None:
        for taker in takers:
            taker(item)

    return take


def _clock(settings: Settings) -> HostClock:
    scale = settings.clock
    if scale is None:
        return SystemClock()
    now = time.time_ns()
    wall = now if scale.origin_wall is None else scale.origin_wall
    return ScaledClock(speed=scale.speed, origin_wall=wall, origin=now if scale.origin is None else scale.origin)


def device_driver(device: DeviceSettings, speed: float) -> Driver:
    """Return the unopened driver of a device.

    Parameters
    ----------
    device : its settings
    speed : seconds of data a second, for logs that are played

    Raises
    ------
    ValueError
        If there is no driver of that name, or it has no such place or rate.
    """
    place = device.place
    if isinstance(place, LogAddress):
        place = replace(place, speed=speed)
    return make_driver(device.driver, place, device.rate)


def _start_readers(settings: Settings, clock: HostClock, log: LogThread) -> list[DeviceReader]:
    """Open all devices and start their threads; one that does not answer stops the start."""
    readers: list[DeviceReader] = []
    try:
        for device in sorted(settings.device, key=lambda device: device.waits_for_sync):
            driver = device_driver(device, clock.speed)
            reader = DeviceReader(device.name, driver, device.rate, clock, log.put)
            reader.connect()
            readers.append(reader)
            reader.start()
    except (DriverError, ValueError) as error:
        for reader in readers:
            reader.stop()
        raise StartError(f"device {device.name}: {error}") from error
    return readers


def _report(worker: Worker, log: LogThread, on_result: Callable[[Result], None], memory: MemoryFile) -> bool:
    """Log and hand on what the analysis has found; False once it has said its last word."""
    for result in worker.results(_POLL):
        if result is None:
            return False
        if isinstance(result, Kept):
            memory.expect(result.text)
            continue
        event = result_event(result)
        memory.after(event)
        log.put(event)
        on_result(result)
    memory.write()
    return True
