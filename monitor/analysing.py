"""A log and the analysis of what stands in it, which begin together: a replay of the log repeats that analysis."""

import math
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from daq import (
    CHANNELS,
    ChannelMap,
    DiskGuard,
    Event,
    HostClock,
    LogKeeper,
    LogRecorder,
    Retention,
    Rotation,
)
from monitor.errors import StartError
from monitor.memory import MEMORY
from monitor.settings import RecorderSettings
from monitor.site import Site
from monitor.worker import Worker

_BLOCK_SECONDS = 0.2  # of data in a block of a device
_MOST_WINDOWS, _MOST_SECONDS = 10.0, 600.0  # that may wait: windows, but seconds of wall time at least


@dataclass(frozen=True, eq=False, kw_only=True)
class Analysis:
    """Both, not started yet: what is fed waits until the worker is."""

    keeper: LogKeeper
    worker: Worker


def new_analysis(site: Site, clock: HostClock, tell: Callable[[Event], None], memory: str) -> Analysis:
    """Begin a log, with everything attached that a replay needs, and what will analyse it.

    Parameters
    ----------
    site : that is watched
    clock : of the data
    tell : called with what befalls the disk, in the log's thread
    memory : text of what to go on from; empty for nothing

    Raises
    ------
    LogError
        If the log cannot be made.
    """
    recorder_settings = site.settings.recorder
    folder = logs_of(site)
    folder.mkdir(parents=True, exist_ok=True)
    attachments = {
        "site.toml": site.site_text,
        "structure.toml": site.structure_text,
        CHANNELS: ChannelMap(channels=site.settings.channels, on_grid=False).to_json(),
    }
    if memory:
        attachments[MEMORY] = memory
    recorder = LogRecorder(
        folder,
        attachments,
        clock.now(),
        _rotation(recorder_settings),
        view_rate=recorder_settings.view_rate,
    )
    return Analysis(
        keeper=LogKeeper(recorder, DiskGuard(folder, _retention(recorder_settings)), tell),
        worker=Worker(site.structure_text, site.site_text, memory, keep=True),
    )


def logs_of(site: Site) -> Path:
    """Return the folder of a site's logs."""
    return site.folder / site.settings.recorder.folder


def prepare_logs(site: Site) -> None:
    """Make the folder of a site's logs if need be, and try whether files can be made there.

    Raises
    ------
    StartError
        If not.
    """
    folder = logs_of(site)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except (OSError, ValueError) as error:
        raise StartError(f"recorder.folder: expected a folder that takes files: {error}") from error


def blocks_a_second(site: Site) -> float:
    """Return how many blocks come from all devices, a second of data."""
    return len(site.settings.device) / _BLOCK_SECONDS


def most_waiting(site: Site) -> float:
    """Return how many items may wait for the analysis before it will never catch up: so many windows, but minutes."""
    clock = site.settings.clock
    least = _MOST_SECONDS * (clock.speed if clock else 1.0)
    return blocks_a_second(site) * max(_MOST_WINDOWS * site.settings.step_seconds, least)


def analysed_alike(one: Site, other: Site) -> bool:
    """Tell whether two sites' settings ask for the same log and analysis."""
    return _key(one) == _key(other)


def _key(site: Site) -> tuple[object, ...]:
    settings = site.settings
    devices = tuple((device.name, device.driver, device.rate, device.channels) for device in settings.device)
    return site.structure_text, settings.recorder, settings.analysis, settings.alarm, settings.temperature, devices


def _rotation(recorder: RecorderSettings) -> Rotation:
    return Rotation(size=recorder.rotate_mb * 1e6, seconds=recorder.rotate_minutes * 60)


def _retention(recorder: RecorderSettings) -> Retention:
    return Retention(
        seconds=(recorder.keep_days or math.inf) * 86400,
        size=(recorder.keep_gb or math.inf) * 1e9,
        least_free=recorder.min_free_gb * 1e9,
    )
