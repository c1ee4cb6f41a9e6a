"""A whole log as recordings."""

import itertools
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from daq.errors import LogError
from daq.events import DeviceFailed
from daq.log.channel_map import CHANNELS, ChannelMap, parse_channel_map
from daq.log.mcap_log import read_attachments, read_log
from daq.log.naming import as_logs
from daq.log.parts import BEGINNING, AnyLog, LogExcerpt, PartedLog, files_of
from daq.timing.resampling import NO_DELAYS, Assembler
from daq.types import Block, Channel, Event, Recording, find_gaps

HOW_TO_PLACE = (  #: advice if a site should contain the devices of an imported log
    "`modalwatch import DATA -o LOG.mcap --site SITE.toml` puts a file's channels on the devices of a site; --new-site "
    "writes one"
)
_MAX_VALUES = 1 << 28  # of a window: 2 GB
_LARGEST_SHARE = 20  # largest ratio of a log's length to its content, for one recording
_ABSENT_SECONDS = 2.0  # of silence where an excerpt begins, after which a device counts as lost
_PIECE_SECONDS = 60.0  # clocks of devices are fitted separately for each piece


def load_recordings(
    logs: AnyLog | str | Sequence[Path | str],
    *,
    window_seconds: float | None = None,
    channels: tuple[Channel, ...] | None = None,
    late: Mapping[str, float] = NO_DELAYS,
) -> Iterator[Recording]:
    """Yield the recordings of logs, cut in windows of equal length.

    Parameters
    ----------
    logs : a log, a folder of logs, or several of either; the files of one run are one log, in any order
    window_seconds : length of a window [s]. Default: each log is one window
    channels : device axis of each sensor. Default: the channel map of each log
    late : device -> delay of its scans, which is removed [s]

    Yields
    ------
    Recording
        NaN where a device has a gap or is missing. An incomplete last window of a log is left out, unless it is the
        only one.

    Raises
    ------
    LogError
        If a folder holds no log, the logs have different channels, or a log cannot be read, has no channel map, has no
        scan of its channels, or, requested as one recording, is almost nothing but an outage.
    ValueError
        If the window is not positive.
    """
    if window_seconds is not None and not window_seconds > 0:
        raise ValueError(f"window_seconds: expected a positive number, found {window_seconds}")
    names: frozenset[str] | None = None
    for log in _logs(logs):
        known, rates = _known(log, channels, late)
        found = frozenset(channel.name for channel in known.channels)
        if names is not None and found != names:
            raise LogError(
                str(log), f"expected the same channels in all logs, found others: {', '.join(sorted(found ^ names))}"
            )
        names = found
        rate = min(rates.values())
        length = max(1, round((window_seconds or _PIECE_SECONDS) * rate))
        pieces = _cut(log, known, rates, length / rate, late, by_record=window_seconds is not None)
        if window_seconds is None:
            yield from _joined(log, pieces)
        else:
            yield from _whole(pieces, length)


def _logs(logs: AnyLog | str | Sequence[Path | str]) -> Sequence[AnyLog]:
    if isinstance(logs, PartedLog | LogExcerpt):
        return [logs]
    return as_logs([Path(path) for path in ([logs] if isinstance(logs, str | Path) else logs)])


def _known(
    log: AnyLog, channels: tuple[Channel, ...] | None, late: Mapping[str, float]
) -> tuple[ChannelMap, dict[str, float]]:
    """Return the channels of a log, and the rates of their devices [Hz]."""
    stored = read_channel_map(log)
    if channels is None and stored is None:
        raise LogError(str(log), "has no channel map: the sensors of its channels are unknown")
    on_grid = bool(stored and stored.on_grid) and not any(late.values())
    known = ChannelMap(channels=channels or stored.channels, on_grid=on_grid)  # type: ignore[union-attr]
    return known, _rates(log, known.channels)


def read_channel_map(log: AnyLog) -> ChannelMap | None:
    """Return the channel map attached to a log, None if there is none; errors as for `read_log`."""
    text = read_attachments(log).get(CHANNELS)
    return None if text is None else parse_channel_map(text, files_of(log)[0])


def absent_devices(log: AnyLog, devices: Collection[str]) -> set[str]:
    """Return the devices without data at the start of an excerpt: their loss may be reported before it."""
    absent: set[str] = set()
    if isinstance(log, LogExcerpt) and log.start > BEGINNING:
        absent |= set(devices)
        until: float | None = None
        for item in read_log(log):
            if isinstance(item, Block):
                until = item.time_of(item.first_index) + _ABSENT_SECONDS * 1e9 if until is None else until
                if item.arrival_time > until:
                    break
                absent.discard(item.device)
    return absent


def used_axes(channels: Collection[Channel], devices: Iterable[str]) -> dict[str, set[int]]:
    """Return the axes of devices that an assembler uses: those of the channels, and the first one."""
    return {device: {channel.axis for channel in channels if channel.device == device} | {0} for device in devices}


def _rates(log: AnyLog, channels: tuple[Channel, ...]) -> dict[str, float]:
    """Return the rates of the channels' devices [Hz], as far as the log has them."""
    devices = {channel.device for channel in channels}
    rates: dict[str, float] = {}
    for item in read_log(log):
        if isinstance(item, Block) and item.device in devices:
            rates.setdefault(item.device, item.rate)
        if len(rates) == len(devices):
            break
    if not rates:
        raise LogError(str(log), f"holds no scan of {', '.join(sorted(devices))}")
    return rates


def _cut(
    log: AnyLog,
    known: ChannelMap,
    rates: dict[str, float],
    seconds: float,
    late: Mapping[str, float],
    *,
    by_record: bool,
) -> Iterator[Recording]:
    """Yield windows one after the other, the last one shorter."""
    devices = {c.device for c in known.channels}
    missing = devices - rates.keys()
    all_rates = rates | dict.fromkeys(missing, min(rates.values()))
    values = seconds * min(rates.values()) * (1 + max(channel.axis for channel in known.channels)) * len(devices)
    if values > _MAX_VALUES:
        raise LogError(str(log), f"a window of {seconds:g} s has {values:.3g} samples, expected up to {_MAX_VALUES:g}")
    assembler = Assembler(
        known.channels,
        all_rates,
        window_seconds=seconds,
        step_seconds=seconds,
        on_grid=known.on_grid,
        late=late,
        by_record=by_record,
    )
    for device in missing | absent_devices(log, devices):
        yield from assembler.push_event(DeviceFailed(device=device).event(0))
    try:
        for item in read_log(log, used_axes(known.channels, rates)):
            if isinstance(item, Event):
                yield from assembler.push_event(item)
            else:
                yield from assembler.push(item)
        yield from assembler.finish()
    except (ArithmeticError, ValueError) as error:
        raise LogError(str(log), f"holds scans and times that do not fit together: {error}") from error


def _whole(pieces: Iterable[Recording], n: int) -> Iterator[Recording]:
    """Yield pieces of `n` samples; the first one however long."""
    pieces = iter(pieces)
    yield from itertools.islice(pieces, 1)
    yield from filter(lambda piece: len(piece.data) == n, pieces)  # keeps no piece while the next one is made


def _joined(log: AnyLog, pieces: Iterable[Recording]) -> Iterator[Recording]:
    """Yield pieces joined to one recording; nothing if there are none."""
    parts = list(pieces)
    if not parts:
        return
    first = parts[0]
    places = [round((part.start - first.start) * 1e-9 * first.rate) for part in parts]
    held = sum(len(part.data) for part in parts)
    if places[-1] > _LARGEST_SHARE * held:
        raise LogError(str(log), f"is {places[-1] / held:.0f} times as long as what it holds: give a window")
    data = np.full((places[-1] + len(parts[-1].data), len(first.channels)), np.nan)
    for place, part in zip(places, parts, strict=True):
        data[place : place + len(part.data)] = part.data
    known = [part.temperature for part in parts if np.isfinite(part.temperature)]
    temperature = float(np.mean(known)) if known else float("nan")
    yield replace(first, data=data, temperature=temperature, gaps=find_gaps(first.channels, data))
