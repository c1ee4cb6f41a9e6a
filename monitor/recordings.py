"""Logs of this program, whoever wrote them, as recordings."""

from collections.abc import Iterator

from daq import (
    AnyLog,
    Block,
    Channel,
    LogError,
    Recording,
    load_recordings,
    read_attachments,
    read_channel_map,
    read_log,
)
from monitor.settings import parse_settings


def log_channels(log: AnyLog) -> tuple[Channel, ...]:
    """Return which axis of which device is which sensor: from the log's channel map, else its settings.

    Raises
    ------
    LogError
        If the log cannot be read or has neither.
    """
    stored = read_channel_map(log)
    if stored is not None:
        return stored.channels
    attached = read_attachments(log)
    if "site.toml" not in attached:
        raise LogError(
            str(log), "does not say which channel is which sensor: no channel map and no settings are attached"
        )
    return parse_settings(attached["site.toml"], f"{log}: site.toml").channels


def log_recordings(log: AnyLog, window_seconds: float | None = None) -> Iterator[Recording]:
    """Yield the recordings of a log, the whole one unless a window [s] is given; errors as for `load_recordings`."""
    return load_recordings(log, window_seconds=window_seconds, channels=log_channels(log))


def log_rate(log: AnyLog) -> float:
    """Return the rate of the device that a log begins with [Hz].

    Raises
    ------
    LogError
        If it holds no samples; others as for `read_log`.
    """
    rate = next((item.rate for item in read_log(log) if isinstance(item, Block)), None)
    if rate is None:
        raise LogError(str(log), "holds no samples")
    return rate


def log_duration(log: AnyLog) -> float:
    """Return how much a log holds of the device that it holds least of [s]; errors as for `read_log`."""
    devices = {channel.device for channel in log_channels(log)}
    seconds = dict.fromkeys(devices, 0.0)
    for item in read_log(log):
        if isinstance(item, Block) and item.device in devices:
            seconds[item.device] += item.n_scans / item.rate
    return min(seconds.values())
