"""Publisher of the state of a site over MQTT: a connection to a broker in a thread of its own.

The states are for Home Assistant, the report is for pages of many sites.
"""

import json
import queue
import re
import time
from collections.abc import Iterator
from typing import TYPE_CHECKING, Self

from daq.events import EventPayload
from daq.supervision import Backoff, SupervisedThread
from monitor.errors import MonitorError
from monitor.outputs.history import StateSchedule
from monitor.outputs.home_assistant.discovery import (
    OFFLINE,
    ONLINE,
    Config,
    Topics,
    mode_configs,
    site_configs,
    states,
)
from monitor.outputs.mqtt import MqttMissingError, mqtt_client, mqtt_connect, mqtt_topic, on_answer
from monitor.outputs.site_report import SiteReport
from monitor.results.service_events import HomeAssistantFailed, HomeAssistantRecovered
from monitor.results.site_status import SiteStatus
from monitor.settings import HomeAssistantSettings
from monitor.settings.redaction import masked, revealed, secrets_of_address, shown_address

if TYPE_CHECKING:
    from paho.mqtt.client import Client

_LOOP_SECONDS = 0.2
_CONNECT_SECONDS = 5.0
_KEEPALIVE_SECONDS = 15  # the broker publishes the last will after 1.5 times that without a message
_END_SECONDS = 2.0  # longest wait for the last message
_RETRY_FIRST_SECONDS, _RETRY_LONGEST_SECONDS = 2.0, 60.0


class _BrokerError(MonitorError):
    """The broker has refused or ended the connection."""


class HomeAssistant:
    """Publishes discovery, states and availability, all retained; the last will is "offline".

    States are published once per window and with each change of the alarm. Only the newest status is kept while the
    broker is not available: Home Assistant shows the present, the history has the past.

    Parameters
    ----------
    settings : of the connection
    site : name of the site
    retry_seconds : before the second attempt to connect; doubled with each
    """

    def __init__(
        self, settings: HomeAssistantSettings, site: str, *, retry_seconds: float = _RETRY_FIRST_SECONDS
    ) -> None:
        self._address, self._site = revealed(settings.mqtt), site
        base = mqtt_topic(self._address) or f"modalwatch/{re.sub(r'[^A-Za-z0-9_-]', '_', site)}"
        self._topics = Topics(base=base, discovery=settings.discovery)
        self._backoff = Backoff(retry_seconds, _RETRY_LONGEST_SECONDS)
        self._events: queue.SimpleQueue[EventPayload] = queue.SimpleQueue()
        self._status: SiteStatus | None = None  # the newest
        self._site_report: SiteReport | None = None  # the newest
        self._thread = SupervisedThread("home assistant", self._run)
        self.problem: str | None = None  #: why nothing is published

    def show(self, status: SiteStatus, report: SiteReport | None = None) -> None:
        """Take the newest status, and the newest report for pages of many sites; never blocks."""
        self._status, self._site_report = status, report

    def events(self) -> Iterator[EventPayload]:
        """Yield failures and recoveries of the connection since the last call."""
        while not self._events.empty():
            yield self._events.get()

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def stop(self) -> None:
        """Request the end."""
        self._thread.ending.set()

    def __exit__(self, *_: object) -> None:
        """End, after no longer than a connection may take to begin and to end."""
        self.stop()
        self._thread.join(_CONNECT_SECONDS + _END_SECONDS)

    def _run(self) -> None:
        while not self._thread.ending.is_set():
            try:
                self._session(mqtt_client(self._address))
            except (MqttMissingError, _BrokerError, OSError, ValueError) as error:
                text = masked(str(error), secrets_of_address(self._address))
                self._report(f"{shown_address(self._address)}: {text}")
                self._thread.ending.wait(self._backoff.next())

    def _session(self, client: "Client") -> None:
        """Publish until the end, or until the connection is lost.

        Raises
        ------
        _BrokerError, OSError, ValueError
            If it cannot be made, or is lost.
        """
        session = _Session(client, self._topics, self._site)
        on_answer(client, session.answered)
        client.connect_timeout = _CONNECT_SECONDS
        client.will_set(self._topics.availability, OFFLINE, qos=1, retain=True)
        mqtt_connect(client, self._address, _KEEPALIVE_SECONDS)
        end = time.monotonic() + _CONNECT_SECONDS
        while not self._thread.ending.is_set():
            session.advance()
            if session.online:
                self._backoff.reset()
                self._report(None)
                session.publish(self._status)
                session.publish_report(self._site_report)
            elif time.monotonic() > end:
                raise _BrokerError("the broker does not answer")
        session.end()

    def _report(self, problem: str | None) -> None:
        before, self.problem = self.problem, problem
        if problem and not before:
            self._events.put(HomeAssistantFailed(why=problem))
        if before and not problem:
            self._events.put(HomeAssistantRecovered())


class _Session:
    """One connection to a broker; all methods are for one thread."""

    def __init__(self, client: "Client", topics: Topics, site: str) -> None:
        self._client, self._topics, self._site = client, topics, site
        self._modes: dict[str, Config] = {}  # discovery of modes that is published
        self._published: object = None  # window and state of the last states
        self._schedule = StateSchedule()  # of reports
        self._refused = ""
        self.online = False  #: whether the broker has accepted the connection

    def answered(self, reason: str) -> None:
        """Publish discovery and availability once the broker accepts; called by the client."""
        if reason:
            self._refused = f"the broker refuses: {reason}"
            return
        for topic, config in site_configs(self._topics, self._site).items():
            self._send(topic, json.dumps(config))
        self._send(self._topics.availability, ONLINE)
        self.online = True

    def advance(self) -> None:
        """Exchange data with the broker for a moment.

        Raises
        ------
        _BrokerError
            If the connection is refused or lost.
        """
        code = self._client.loop(_LOOP_SECONDS)
        if self._refused or code:
            raise _BrokerError(self._refused or f"the connection is lost: {code.name}")

    def publish(self, status: SiteStatus | None) -> None:
        """Publish states if there is a new window or a change of the alarm; before that, modes that are new or gone.

        Until a start has found its baseline, the retained states of the run before remain: an alarm continues.
        """
        key = status and (status.state, status.window and (status.window.end, status.window.index))
        if status is None or key == self._published or (status.state == "learning" and status.window is None):
            return
        window = status.window
        modes = {} if status.state == "learning" else dict(self._modes)
        modes |= mode_configs(self._topics, self._site, window.tracked if window else ())
        for topic in self._modes.keys() - modes.keys():
            self._send(topic, "")  # removes the entity
        for topic in modes.keys() - self._modes.keys():
            self._send(topic, json.dumps(modes[topic]))
        self._send(self._topics.state, json.dumps(states(status)))
        self._modes, self._published = modes, key

    def publish_report(self, report: SiteReport | None) -> None:
        """Publish the report if it has changed, or after a while."""
        if report is not None and self._schedule.is_due(report.content):
            self._send(self._topics.report, report.model_dump_json())
            self._schedule.note_written(report.content)

    def end(self) -> None:
        """Publish that the monitor is offline, and disconnect: a last will is for those that are killed."""
        if not self.online:
            return
        last, end = self._client.publish(self._topics.availability, OFFLINE, qos=1, retain=True), time.monotonic()
        while (
            not last.is_published() and time.monotonic() < end + _END_SECONDS and not self._client.loop(_LOOP_SECONDS)
        ):
            pass
        self._client.disconnect()

    def _send(self, topic: str, payload: str) -> None:
        self._client.publish(topic, payload, qos=1, retain=True)
