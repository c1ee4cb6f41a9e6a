"""Present states of many sites from an MQTT broker: the retained reports of their monitors."""

import threading
import time
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from itertools import count
from typing import TYPE_CHECKING, Self

from monitor.errors import MonitorError
from monitor.outputs.history import STATE_SECONDS, FleetRow, LastAlarm, SiteState
from monitor.outputs.home_assistant.discovery import OFFLINE, Topics
from monitor.outputs.mqtt import MqttMissingError, mqtt_client, mqtt_connect, mqtt_topic, on_answer
from monitor.outputs.site_report import SiteReport, parse_report
from monitor.settings.redaction import masked, secrets_of_address, shown_address

if TYPE_CHECKING:
    from paho.mqtt.client import Client, MQTTMessage

_FIRST_SECONDS = 5.0  # to wait for the connection
_MAX_SITES = 10_000
_RETRY_SECONDS = 1, 30  # shortest and longest time between two attempts to connect
_TOPICS = Topics(base="", discovery="")


class FleetBrokerError(MonitorError):
    """The broker cannot be used; names its address."""


@dataclass(frozen=True, kw_only=True)
class _Received:
    """Report of a site."""

    report: SiteReport
    number: int
    at: float  # when it arrived, by time.monotonic [s]


class FleetBroker:
    """Reports of all sites below a topic, followed over losses of the connection.

    Parameters
    ----------
    address : mqtt://USER:PASSWORD@HOST:PORT/TOPIC, or mqtts:// with TLS; without a topic all are received

    Raises
    ------
    FleetBrokerError
        If the broker does not respond or refuses; `sites` raises it while the connection is lost.
    """

    def __init__(self, address: str) -> None:
        self.url = shown_address(address)
        self._address, self._lock = address, threading.Lock()
        self._reports: dict[str, _Received] = {}  # by topic of the site
        self._numbers = count(-1, -1)
        self._offline: set[str] = set()  # topics of sites whose monitor is not connected
        self._problem: str | None = "does not respond"
        self._answered = threading.Event()
        try:
            self._client = mqtt_client(address)
        except MqttMissingError as error:
            raise FleetBrokerError(f"{self.url}: {error}") from error
        on_answer(self._client, self._connected)
        self._client.on_disconnect = self._disconnected
        self._client.on_message = self._take
        self._client.connect_timeout = _FIRST_SECONDS
        self._client.reconnect_delay_set(*_RETRY_SECONDS)
        self._client.max_queued_messages_set(0)

    def __enter__(self) -> Self:
        try:
            mqtt_connect(self._client, self._address)
        except (OSError, ValueError) as error:
            raise self._error(str(error)) from error
        self._client.loop_start()
        if not self._answered.wait(_FIRST_SECONDS) or self._problem:
            self.__exit__()
            raise self._error(self._problem or "does not respond")
        return self

    def __exit__(self, *_: object) -> None:
        """Close the connection."""
        self._client.disconnect()
        self._client.loop_stop()

    def _error(self, text: str) -> FleetBrokerError:
        return FleetBrokerError(f"{self.url}: {masked(text, secrets_of_address(self._address))}")

    def _connected(self, refused: str) -> None:
        with self._lock:
            self._problem = f"refuses: {refused}" if refused else None
        if not refused:
            topic = mqtt_topic(self._address)
            self._client.subscribe(f"{topic}/#" if topic else "#", qos=1)
        self._answered.set()

    def _disconnected(self, *_: object) -> None:
        with self._lock:
            self._problem = self._problem or "the connection is lost"

    def _take(self, _client: "Client", _data: object, message: "MQTTMessage") -> None:
        base, name = message.topic.rpartition("/")[::2]
        with self._lock:
            if f"/{name}" == _TOPICS.availability:
                if message.payload != OFFLINE.encode():
                    self._offline.discard(base)
                elif len(self._offline) < _MAX_SITES:
                    self._offline.add(base)
            elif f"/{name}" == _TOPICS.report:
                self._take_report(base, bytes(message.payload))

    def _take_report(self, base: str, payload: bytes) -> None:
        if not payload:  # a retained report that was removed
            self._reports.pop(base, None)
            return
        report, known = parse_report(payload), self._reports.get(base)
        if report is None or (known is None and len(self._reports) >= _MAX_SITES):
            return
        number = known.number if known else next(self._numbers)
        self._reports[base] = _Received(report=report, number=number, at=time.monotonic())

    def sites(self) -> list[FleetRow]:
        """Return all sites that have reported, by name; their numbers are negative, as no database has them.

        Of reports with one name, only the recent ones are used, as after a change of a topic. If several are recent,
        each name has its topic behind it.

        Raises
        ------
        FleetBrokerError
            If the connection is lost.
        """
        with self._lock:
            if self._problem:
                raise self._error(self._problem)
            rows = {topic: _row(found, offline=topic in self._offline) for topic, found in self._reports.items()}
        return sorted(_with_own_names(rows), key=lambda row: row.name)

    def levels(self, sites: Sequence[int]) -> dict[int, list[float]]:
        """Return the novelty of the last evaluated windows of some sites over its limit, in the order of time."""
        wanted = set(sites)
        with self._lock:
            return {r.number: list(r.report.levels) for r in self._reports.values() if r.number in wanted}


def _with_own_names(rows: Mapping[str, FleetRow]) -> Iterator[FleetRow]:
    """Yield the rows of topics that are shown, each with a name of its own."""
    topics = defaultdict(list)
    for topic, row in sorted(rows.items(), key=lambda item: item[1].age):
        topics[row.name].append(topic)
    for name, same in topics.items():
        recent = [topic for topic in same if rows[topic].age <= STATE_SECONDS]
        if len(recent) < 2:
            yield rows[same[0]]
        else:
            yield from (replace(rows[topic], name=f"{name} ({topic})") for topic in recent)


def _row(found: _Received, *, offline: bool) -> FleetRow:
    """Return the row of a site; one whose monitor is not connected has no state any more."""
    report, age = found.report, time.monotonic() - found.at
    alarm = None
    if found.report.alarm:
        alarm = LastAlarm(active=True, **found.report.alarm.model_dump())
    return FleetRow(
        number=found.number,
        name=report.site,
        state=SiteState(**{field.name: getattr(report, field.name) for field in fields(SiteState)}),
        age=max(age, STATE_SECONDS + 1) if offline else age,
        lasts=report.lasts + age,
        alarm=alarm,
    )
