"""A thermometer that is no device: a file that another program writes, or a topic of a broker; read in a thread."""

import csv
import queue
import time
from abc import ABC, abstractmethod
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from daq import Event, HostClock, SystemClock
from daq.bounded_text import parse_json
from daq.supervision import SupervisedThread
from monitor.analysis.temperature import reading
from monitor.outputs.mqtt import MqttMissingError, mqtt_client, mqtt_connect, mqtt_topic, on_answer
from monitor.results.service_events import TemperatureFailed, TemperatureRecovered
from monitor.settings import TemperatureSettings
from monitor.settings.redaction import revealed, shown_address
from monitor.text.quantities import utc

if TYPE_CHECKING:
    from paho.mqtt.client import MQTTMessage

_POLL = 1.0  # s
_TAIL = 65536  # bytes: of a file that is there already, the last reading is enough
_COLDEST, _HOTTEST = -90.0, 100.0  # degC: plausible temperatures of a structure


class Thermometer(ABC):
    """Reads temperatures until it is stopped; nothing here is ever waited for.

    Parameters
    ----------
    settings : of the site
    clock : of the data
    """

    def __init__(self, settings: TemperatureSettings, clock: HostClock) -> None:
        self._settings, self._clock = settings, clock
        self._events: queue.SimpleQueue[Event] = queue.SimpleQueue()
        self._thread = SupervisedThread("temperature", self._run)
        self._stop = self._thread.ending
        self._told = False
        self._heard = time.monotonic()
        self.problem: str | None = None  #: why nothing comes

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Stop; a broker that does not answer is not waited for."""
        self._stop.set()
        self._thread.join(2 * _POLL)

    def read(self) -> Iterator[Event]:
        """Yield readings, and events of the source, since the last time."""
        while not self._events.empty():
            yield self._events.get()
        silent = time.monotonic() - self._heard
        if self.problem is None and silent > 60 * self._settings.stale_minutes:
            self.problem = f"no reading for {silent / 60:.0f} min"
        if bool(self.problem) != self._told:
            self._told = bool(self.problem)
            news = TemperatureFailed(why=self.problem) if self.problem else TemperatureRecovered()
            yield news.event(self._clock.now())

    @abstractmethod
    def _run(self) -> None:
        """Read until `_stop` is set."""

    def _put(self, when: int, celsius: float, source: str) -> None:
        """Hand on a reading.

        Raises
        ------
        ValueError
            If that is no temperature.
        """
        if not _COLDEST <= celsius <= _HOTTEST:
            raise ValueError(f"expected {_COLDEST:g} to {_HOTTEST:g} degC, found {celsius:g}")
        self._heard, self.problem = time.monotonic(), None
        self._events.put(reading(when, celsius, source))


class CsvThermometer(Thermometer):
    """A file that gets a line a reading: its columns have names; the first is the time.

    Of the existing lines only the last one counts. A file that has become shorter is read from the start.
    """

    def _run(self) -> None:
        path = Path(self._settings.csv or "")
        place = 0  # bytes that have been read
        while True:
            try:
                place = self.follow(path, place)
            except (OSError, ValueError, csv.Error) as error:
                self.problem = f"{path}: {_message(error)}"
            if self._stop.wait(_POLL):
                return

    def follow(self, path: Path, place: int) -> int:
        """Read the file from a place [bytes] on; return the end of the part that was read."""
        size = path.stat().st_size
        place = place if place <= size else 0
        if size == place:
            return place
        with path.open("rb") as file:
            names = next(csv.reader([file.readline().decode(errors="replace")]), [])
            begin = max(file.tell(), place or size - _TAIL)
            file.seek(begin)
            text = file.read()
        whole = text[: text.rfind(b"\n") + 1]  # a line that is still being written comes next time
        lines = [line for line in whole.decode(errors="replace").splitlines() if line.strip()]
        self._rows(names, lines if place else lines[-1:], path)
        return begin + len(whole)

    def _rows(self, names: list[str], lines: list[str], path: Path) -> None:
        number = _index(names, self._settings.column)
        for line in lines:
            try:
                fields = next(csv.reader([line]))
                self._put(self._near(_time(fields[0])), float(fields[number]), path.name)
            except (ValueError, IndexError, OverflowError, csv.Error) as error:
                self.problem = f"{path}: {line!r:.60}: {error}"  # the next line may be better

    def _near(self, when: int) -> int:
        """Return a time for which a reading may be used now.

        Raises
        ------
        ValueError
            If it is stale or lies ahead: a logger that writes its local time is of no use for as long as that is off.
        """
        ahead = (when - self._clock.now()) / 60e9
        if abs(ahead) > self._settings.stale_minutes:
            side = "ahead of" if ahead > 0 else "behind"
            raise ValueError(
                f"its time is {abs(ahead) / 60:.3g} h {side} now: expected UTC, in ISO 8601 or seconds of 1970"
            )
        return when


class MqttThermometer(Thermometer):
    """A topic with a number, or an object with one; its time is that of its arrival."""

    def _run(self) -> None:
        address = revealed(self._settings.mqtt)
        shown = shown_address(address)
        try:
            client = mqtt_client(address)
        except MqttMissingError as error:
            self.problem = str(error)
            return

        def taken(_client: object, _data: object, message: "MQTTMessage") -> None:
            try:
                content: Any = parse_json(bytes(message.payload))
                value = float(content[self._settings.column] if isinstance(content, dict) else content)
                self._put(self._clock.now(), value, shown)
            except (ValueError, LookupError, TypeError, ArithmeticError, RecursionError) as error:
                self.problem = f"{shown}: expected a number, or an object with {self._settings.column!r}: {error}"

        def answered(reason: str) -> None:
            if reason:
                self.problem = f"{shown}: {reason}"
            else:
                client.subscribe(mqtt_topic(address))

        def parted(*_: object) -> None:
            self.problem = self.problem or f"{shown}: the connection is lost"

        client.on_message, client.on_disconnect = taken, parted
        on_answer(client, answered)
        while not self._stop.is_set():
            try:
                mqtt_connect(client, address)
                client.loop_start()
                self._stop.wait()
            except (OSError, ValueError) as error:
                self.problem = f"{shown}: {error}"
                self._stop.wait(10 * _POLL)
        client.disconnect()
        client.loop_stop()


def thermometer(settings: TemperatureSettings, clock: HostClock) -> Thermometer:
    """Return the reader of a site's thermometer, not started yet."""
    return CsvThermometer(settings, clock) if settings.csv else MqttThermometer(settings, clock)


def last_reading(settings: TemperatureSettings) -> str:
    """Return a text on the file's last line.

    Raises
    ------
    OSError, ValueError
        If it cannot be read, or has no reading.
    """
    reader = CsvThermometer(settings, SystemClock())
    reader.follow(Path(settings.csv or ""), 0)
    if reader.problem:
        raise ValueError(reader.problem)
    readings = list(reader.read())
    if not readings:
        raise ValueError(f"{settings.csv}: has no reading")
    return f"{settings.csv}: {readings[-1].payload['celsius']:g} degC at {utc(readings[-1].time)}"


def _index(names: list[str], column: str) -> int:
    stripped = [name.strip() for name in names]
    if column not in stripped[1:]:
        raise ValueError(f"column: expected one of {', '.join(stripped[1:])}, found {column!r}")
    return stripped.index(column)


def _time(text: str) -> int:
    """Return a time [ns UTC] from ISO 8601, UTC by default, or from seconds since 1970."""
    try:
        return round(float(text) * 1e9)
    except ValueError:
        found = datetime.fromisoformat(text.strip())
        return round((found if found.tzinfo else found.replace(tzinfo=UTC)).timestamp() * 1e9)


def _message(error: Exception) -> str:
    return error.strerror or str(error) if isinstance(error, OSError) else str(error)
