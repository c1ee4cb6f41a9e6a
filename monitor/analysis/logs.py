"""Logs of this program, whoever wrote them, as recordings."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from statistics import median
from types import MappingProxyType

from daq import AnyLog, Block, Channel, LogError, Recording, load_recordings, read_attachments, read_log
from daq.log import read_channel_map

EDGE_SAMPLES = 40  #: samples at the ends of a record, which the alignment of devices in time leaves out
_PAUSE = 5.0  # s of silence between two records
_PAUSING = 0.1  # share of silence in a log above which its logger is assumed to pause


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
    from monitor.settings import parse_attached  # slow to import, and few logs need it

    attached = read_attachments(log)
    if "site.toml" not in attached:
        raise LogError(str(log), "has no channel map and no settings: the sensors of its channels are unknown")
    return parse_attached(attached["site.toml"], f"{log}: site.toml").channels


def log_recordings(
    log: AnyLog, window_seconds: float | None = None, late: Mapping[str, float] = MappingProxyType({})
) -> Iterator[Recording]:
    """Yield the recordings of a log, the whole one unless a window [s] is given; else as `load_recordings`."""
    return load_recordings(log, window_seconds=window_seconds, channels=log_channels(log), late=late)


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


@dataclass(frozen=True, kw_only=True)
class Held:
    """Amount of data of a device in a log."""

    seconds: float  #: total length
    record: float  #: usual length of one record, between pauses; the total length if there are none


def log_held(log: AnyLog) -> Held:
    """Return the amount of data that all devices of a log have in common; errors as for `read_log`."""
    pieces: dict[str, list[float]] = {channel.device: [0.0] for channel in log_channels(log)}
    silent = dict.fromkeys(pieces, 0.0)
    ends: dict[str, int] = {}
    spans: dict[str, tuple[float, float]] = {}  # of each device, from its first to its last scan [s]
    rate = math.inf
    for item in read_log(log):
        if isinstance(item, Block) and item.device in pieces:
            gap = max(item.first_index - ends.get(item.device, item.first_index), 0) / item.rate
            ends[item.device] = item.end_index
            if gap > _PAUSE:
                silent[item.device] += gap
                pieces[item.device].append(0.0)
            pieces[item.device][-1] += item.n_scans / item.rate
            begin, end = (1e-9 * item.time_of(index) for index in (item.first_index, item.end_index))
            spans[item.device] = spans.get(item.device, (begin, end))[0], end
            rate = min(rate, item.rate)
    least = min(pieces, key=lambda device: sum(pieces[device]))
    edges = EDGE_SAMPLES / rate
    if len(spans) > 1:
        begins, stops = zip(*spans.values(), strict=True)
        edges += max(max(begins) - spans[least][0], 0.0) + max(spans[least][1] - min(stops), 0.0)
    seconds = max(sum(pieces[least]) - edges, 0.0)
    pauses = silent[least] > _PAUSING * seconds
    record = max(median(pieces[least]) - EDGE_SAMPLES / rate, 0.0)
    return Held(seconds=seconds, record=record if pauses else seconds)
