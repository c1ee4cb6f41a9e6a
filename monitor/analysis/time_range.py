"""Ranges of time that commands are limited to."""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np

from daq import AnyLog, LogError, LogExcerpt
from daq.log import BEGINNING, END, PartedLog, log_span
from monitor.errors import ArgumentError

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_SECOND = 10**9  # ns
_MIN_SECONDS = 2.0  # that the fit of a device's clock needs
_NUMBER = r"(\d+(?:\.\d*)?|\.\d+)"
_OFFSET = re.compile(rf"(-?)(?=[\d.])(?:{_NUMBER}d)?(?:{_NUMBER}h)?(?:{_NUMBER}m)?(?:{_NUMBER}s)?")
_BARE = re.compile(rf"-?{_NUMBER}")  # seconds
_MAX_SECONDS = 1e12  # longer than any log, and finite
_UNITS = (86400, 3600, 60, 1)  # s
_EXPECTED = "seconds from the start of the log (90, 1h30m; -10m from its end) or a time (2026-01-31T12:00:00Z)"


@dataclass(frozen=True)
class Moment:
    """A time as a person gives it."""

    text: str
    time: int  #: [ns], UTC if absolute, else from the start of a log; negative: from its end
    absolute: bool

    def within(self, start: int, end: int) -> int:
        """Return the time [ns UTC] for a log from `start` to `end` [ns UTC]."""
        if self.absolute:
            return self.time
        return self.time + (end if self.text.startswith("-") else start)


@dataclass(frozen=True, kw_only=True)
class TimeRange:
    """A range of time within logs, from `start` up to but without `stop`."""

    start: Moment | None = None  #: None: from the beginning
    stop: Moment | None = None  #: None: to the end
    options: tuple[str, str] = ("--from", "--to")  #: names of the options that give both, for errors

    @property
    def whole(self) -> bool:
        """Return whether no limit is given."""
        return self.start is None and self.stop is None

    def of_log(self, log: Path | PartedLog, say: Callable[[str], object] = lambda _: None) -> AnyLog:
        """Return the part of one log within the range; else as `of_logs`."""
        return self.of_logs([log], say)[0]

    def of_logs(
        self, logs: Sequence[Path | PartedLog], say: Callable[[str], object] = lambda _: None
    ) -> Sequence[AnyLog]:
        """Return the parts of logs within the range, without logs that are outside it.

        Several logs are one record here: offsets count from the first scan of the earliest one, or from the end of the
        latest one. A range is limited to the record.

        Parameters
        ----------
        logs : of one structure
        say : called with the range as a text, if there is one

        Raises
        ------
        ArgumentError
            If the range is reversed or shorter than two seconds, or the logs hold nothing of it.
        LogError
            If a log cannot be read, or none holds samples.
        """
        if self.whole:
            return logs
        found = [(log, span) for log in logs if (span := log_span(log)) is not None]
        if not found:
            raise LogError(", ".join(map(str, logs)), "holds no samples")
        begin, end = min(span[0] for _, span in found), max(span[1] for _, span in found)
        start, stop = self._limits(begin, end, ", ".join(map(str, logs)))
        inside = [(log, min(stop, span[1]) - max(start, span[0])) for log, span in found]
        held = sum(length for _, length in inside if length > 0) / _SECOND
        text = f"{_seconds(start - begin)} to {_seconds(stop - begin)} s"
        if held < _MIN_SECONDS:
            raise self._error(f"expected at least {_MIN_SECONDS:g} s of samples, found {held:.3g} s in {text}")
        say(f"range: {text} of {_seconds(end - begin)} s, {_utc(start)} to {_utc(stop)}")
        return [
            LogExcerpt(
                log=log,
                start=start if start > begin else BEGINNING,
                stop=stop if stop < end else END,
                text=text,
            )
            for log, length in inside
            if length > 0
        ]

    def _limits(self, begin: int, end: int, name: str) -> tuple[int, int]:
        """Return start and stop within a record from `begin` to `end` [ns UTC]."""
        start = self.start.within(begin, end) if self.start else begin
        stop = self.stop.within(begin, end) if self.stop else end
        holds = f"{name} holds 0 to {_seconds(end - begin)} s, {_utc(begin)} to {_utc(end)}"
        for option, moment, outside in (
            (self.options[0], self.start, start >= end),
            (self.options[1], self.stop, stop <= begin),
        ):
            if moment and outside:
                raise ArgumentError(option, f"{moment.text} is outside the log: {holds}")
        if self.start and self.stop and start >= stop:
            raise self._error(f"expected a start before the end, found {self.start.text} and {self.stop.text}; {holds}")
        return max(start, begin), min(stop, end)

    def _error(self, message: str) -> ArgumentError:
        given = (self.options[0] if self.start else "", self.options[1] if self.stop else "")
        return ArgumentError(", ".join(filter(None, given)), message)


def time_range(start: str | None, stop: str | None, options: tuple[str, str] = ("--from", "--to")) -> TimeRange:
    """Return the range that two options give.

    Raises
    ------
    ArgumentError
        If one of them is no time.
    """
    return TimeRange(
        start=None if start is None else _moment(start, options[0]),
        stop=None if stop is None else _moment(stop, options[1]),
        options=options,
    )


WHOLE = TimeRange()


def instant(text: str) -> int:
    """Return a time [ns UTC] from ISO 8601; without a zone it is UTC.

    Raises
    ------
    ValueError
        If it is not a time, or before 1970.
    """
    try:
        time = datetime.fromisoformat(text)
    except ValueError as error:
        raise ValueError(f"expected a time as 2026-01-31T12:00:00Z, found {text!r}") from error
    time = time if time.tzinfo else time.replace(tzinfo=UTC)
    if time < _EPOCH:
        raise ValueError(f"expected a time after 1970, found {text!r}")
    return (time - _EPOCH) // timedelta(microseconds=1) * 1000


def _moment(text: str, option: str) -> Moment:
    found = _OFFSET.fullmatch(f"{text}s" if _BARE.fullmatch(text) else text)
    if found:
        sign, *parts = found.groups()
        seconds = sum(float(part) * unit for part, unit in zip(parts, _UNITS, strict=True) if part)
        seconds = min(seconds, _MAX_SECONDS)
        return Moment(text, round((-seconds if sign else seconds) * _SECOND), absolute=False)
    try:
        return Moment(text, instant(text), absolute=True)
    except ValueError as error:
        raise ArgumentError(option, f"expected {_EXPECTED}, found {text!r}") from error


def _seconds(time: int) -> str:
    """Return a duration [ns] in seconds, to hundredths."""
    return f"{time / _SECOND:.2f}".rstrip("0").rstrip(".")


def _utc(time: int) -> str:
    return f"{np.datetime_as_string(np.datetime64(time // _SECOND, 's'))}Z"
