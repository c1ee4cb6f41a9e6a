"""A site's own thermometer: read from a file or a topic, into the log, and used for the evaluation of windows."""

import math
import socket
import threading
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from daq import Channel, Event, Recording, SystemClock
from monitor.analysis.temperature import SiteTemperature, reading
from monitor.analysis.window import IdentifiedWindow, RecordedWindow
from monitor.errors import SettingsError
from monitor.service.acquisition.thermometer import CsvThermometer, Thermometer, thermometer
from monitor.service.site import load_site
from monitor.service.startup.preflight import look_around
from monitor.settings import TemperatureSettings, parse_settings
from monitor.watch.memory import state_fingerprint
from monitor.watch.pipeline import Pipeline
from tests.support.daq.blocks import START, make_block
from updater import parse_structure, t_structure_toml

MINUTE = 60_000_000_000  # ns
EVER = 1e9  # min
SITE = """structure = "t_structure.toml"
[analysis]
window_seconds = 2
[[device]]
name = "beam_left"
driver = "epson-uart"
port = "/dev/none"
channels = {y = "beam_left_y"}
"""


def window(start: float, own: float = math.nan) -> Recording:
    """Return ten minutes from `start` [min], in which the devices measure a temperature of their own."""
    channels = (Channel(name="a", device="left", axis=0),)
    return Recording(
        channels=channels, data=np.zeros((600, 1)), rate=1.0, start=round(start * MINUTE), temperature=own, gaps=()
    )


def stated(*readings: tuple[float, float]) -> SiteTemperature:
    weather = SiteTemperature(60.0)
    for minute, celsius in readings:
        weather.take(reading(round(minute * MINUTE), celsius, "air"))
    return weather


def test_window_temperature_is_mean_of_its_or_last_earlier_reading() -> None:
    weather = stated((95, 2.0), (101, 4.0), (109, 6.0), (111, 50.0))
    assert weather.of(window(100)) == 5.0
    assert weather.of(window(112)) == 50.0
    assert stated((41, 3.0)).of(window(100)) == 3.0  # 59 minutes old


def test_device_temperature_replaces_a_failed_thermometer_without_a_step() -> None:
    """Devices in the sun measure 8 K more: with this offset removed their temperature continues, without a step."""
    weather = stated((101, 4.0), (111, 5.0))
    assert weather.of(window(100, own=12.0)) == 4.0
    assert weather.of(window(110, own=13.0)) == 5.0
    assert weather.of(window(300, own=10.0)) == pytest.approx(2.0)


def test_device_temperature_replaces_a_failed_thermometer_after_a_restart() -> None:
    weather = stated((101, 4.0))
    weather.of(window(100, own=12.0))
    assert SiteTemperature(60.0, weather.offset).of(window(300, own=10.0)) == pytest.approx(2.0)


@pytest.mark.parametrize("own", [21.0, math.nan])
def test_temperature_is_undefined_before_the_first_reading(own: float) -> None:
    assert math.isnan(stated().of(window(100, own)))


def test_pipeline_uses_the_thermometer_if_configured(monkeypatch: pytest.MonkeyPatch) -> None:
    """The devices measure 21.5 degC, the thermometer 3: windows have the latter, if the settings name one."""
    for section, expected in (("", 21.5), ('[temperature]\ncsv = "air.csv"\n', 3.0)):
        pipeline = Pipeline(parse_structure(t_structure_toml()), parse_settings(SITE + section))
        seen: list[float] = []

        def unidentified(recording: Recording, _: object) -> IdentifiedWindow:
            return IdentifiedWindow(recorded=RecordedWindow.of(recording), modes=SimpleNamespace(left_out={}))  # type: ignore[arg-type]

        def keep(*values: Any, seen: list[float] = seen) -> object:
            seen.append(values[3])
            return SimpleNamespace(synchronized=SimpleNamespace(channels=("beam_left_y",)))

        monkeypatch.setattr("monitor.watch.pipeline.identify_window", unidentified)
        monkeypatch.setattr("monitor.watch.pipeline.window_of", keep)
        monkeypatch.setattr(pipeline._judge, "modes", lambda _: [])
        monkeypatch.setattr(pipeline._judge, "evaluate", lambda *_: iter(()))
        list(pipeline.push(reading(START, 3.0, "air.csv")))
        for first in range(0, 6000, 250):
            list(pipeline.push(make_block("beam_left", first)))
        assert len(seen) >= 1
        assert seen == pytest.approx([expected] * len(seen))


class Csv:
    """A file that another program writes, and its reader."""

    def __init__(self, folder: Path, head: str = "time,humidity,temperature\n") -> None:
        self.path = folder / "air.csv"
        self.path.write_text(head)
        self.reader = CsvThermometer(TemperatureSettings(csv=str(self.path), stale_minutes=EVER), SystemClock())
        self._place = 0

    def add(self, text: str) -> list[tuple[int, float]]:
        with self.path.open("a") as file:
            file.write(text)
        return self.read()

    def read(self) -> list[tuple[int, float]]:
        self._place = self.reader.follow(self.path, self._place)
        events = [event for event in self.reader.read() if event.topic == "/measured/temperature"]
        return [(event.time, event.payload["celsius"]) for event in events]


def test_csv_file_is_read_line_by_line(tmp_path: Path) -> None:
    file = Csv(tmp_path)
    old = "".join(f"{1000 + k},50,{k % 30}\n" for k in range(9000))
    assert file.add(old) == [(9999 * 10**9, 29.0)]  # only the last of what was there before
    assert file.add("2026-01-01T00:00:00,50,-3.5\n2026-01-01T01:00:00+01:00,50,-4\n20") == [
        (1_767_225_600 * 10**9, -3.5),
        (1_767_225_600 * 10**9, -4.0),
    ]
    assert file.add("00,51,7\n") == [(2000 * 10**9, 7.0)]  # the line that was still being written
    file.path.write_text("time,humidity,temperature\n1,50,8.0\n")  # begun anew
    assert file.read() == [(10**9, 8.0)]


@pytest.mark.parametrize(
    "line",
    [
        "yesterday,50,3",
        "5,50",
        "5,50,warm",
        "5,50,nan",
        "5,50,4000",
        "inf,50,3",
        "-1e300,50,3",
        "5,50,'" + "9" * 200_000,
    ],
)
def test_invalid_line_is_reported_and_skipped(tmp_path: Path, line: str) -> None:
    file = Csv(tmp_path)
    file.add("1,50,8.0\n")
    assert file.add(f"{line}\n") == []
    assert file.reader.problem is not None
    assert str(file.path) in file.reader.problem
    assert file.add("2,50,8.5\n") == [(2 * 10**9, 8.5)]
    assert file.reader.problem is None


@pytest.mark.parametrize(
    ("shift", "says"),
    [(-5 * 3600.0, "5 h behind now: expected UTC"), (2 * 3600.0, "2 h ahead of now"), (None, "ahead of now")],
)
def test_reading_with_an_implausible_time_is_reported(tmp_path: Path, shift: float | None, says: str) -> None:
    """A logger by local time, or in milliseconds: its readings would never be used, or not fit into any log."""
    path = tmp_path / "air.csv"
    when = time.time() * 1000 if shift is None else time.time() + shift
    path.write_text(f"t,temperature\n{when:.0f},3\n{time.time():.0f},4\n{when:.0f},5\n")
    reader = CsvThermometer(TemperatureSettings(csv=str(path)), SystemClock())
    place = reader.follow(path, 14)
    assert [event.payload["celsius"] for event in reader.read() if event.topic == "/measured/temperature"] == [4.0]
    assert says in str(reader.problem)
    with path.open("a") as file:
        file.write(f"{time.time():.0f},6\n")
    reader.follow(path, place)
    assert reader.problem is None


def test_missing_column_is_named(tmp_path: Path) -> None:
    file = Csv(tmp_path, "time,humidity\n")
    with pytest.raises(ValueError, match="column: expected one of humidity, found 'temperature'"):
        file.add("1,50\n")


def until(true: Callable[[], object]) -> None:
    end = time.monotonic() + 5.0
    while not true():
        assert time.monotonic() < end
        time.sleep(0.01)


def test_source_failure_and_recovery_are_each_reported_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("monitor.service.acquisition.thermometer._POLL", 0.01)
    path, reported = tmp_path / "air.csv", list[Event]()

    def heard(topic: str, source: Thermometer) -> bool:
        reported.extend(source.read())
        return any(event.topic == topic for event in reported)

    with thermometer(TemperatureSettings(csv=str(path), stale_minutes=EVER), SystemClock()) as source:
        until(lambda: heard("/event/temperature_failed", source))
        path.write_text("t,temperature\n5,6.5\n")
        until(lambda: heard("/event/temperature_recovered", source))
    topics = [event.topic for event in reported]
    assert sorted(topics) == ["/event/temperature_failed", "/event/temperature_recovered", "/measured/temperature"]
    assert "No such file" in reported[0].payload["why"]


def test_broker_refusal_is_reported_with_its_reason() -> None:
    url = f"mqtt://127.0.0.1:{broker(answer=5)}/site/air"
    with thermometer(TemperatureSettings(mqtt=url), SystemClock()) as source:
        until(lambda: source.problem)
        assert "Not authorized" in str(source.problem)


def broker(*payloads: bytes, answer: int = 0) -> int:
    """Speak as much MQTT 3.1.1 as a subscriber needs: CONNACK, SUBACK, then a PUBLISH of each payload."""
    listener = socket.create_server(("127.0.0.1", 0))

    def serve() -> None:
        connection, _ = listener.accept()
        with listener, connection:
            connection.recv(1024)
            connection.sendall(bytes([0x20, 2, 0, answer]))
            if answer:
                return
            subscribed = connection.recv(1024)
            connection.sendall(b"\x90\x03" + subscribed[2:4] + b"\x00")
            for payload in payloads:
                body = b"\x00\x08site/air" + payload
                connection.sendall(b"\x30" + bytes([len(body)]) + body)
            connection.recv(1024)

    threading.Thread(target=serve, daemon=True).start()
    return int(listener.getsockname()[1])


@pytest.mark.parametrize(
    ("payloads", "celsius"), [((b"-2.5",), -2.5), ((b"warm", b'{"temperature": 7, "rh": 40}'), 7.0)]
)
def test_mqtt_payload_is_a_number_or_an_object(payloads: tuple[bytes, ...], celsius: float) -> None:
    url = f"mqtt://127.0.0.1:{broker(*payloads)}/site/air"
    found: list[Event] = []

    def heard() -> bool:
        found.extend(event for event in source.read() if event.topic == "/measured/temperature")
        return bool(found)

    with thermometer(TemperatureSettings(mqtt=url), SystemClock()) as source:
        until(heard)
    assert [event.payload for event in found] == [{"celsius": celsius, "source": url.removesuffix("/site/air")}]


@pytest.mark.parametrize(
    ("section", "says"),
    [
        ("[temperature]\n", "expected one of `csv` and `mqtt`, found none"),
        ('[temperature]\ncsv = "a"\nmqtt = "mqtt://h/t"\n', "found csv and mqtt"),
        ('[temperature]\nmqtt = "mqtt://h"\n', "expected mqtt://HOST/TOPIC"),
        ('[temperature]\ncsv = "a"\nstale_minutes = 0\n', "temperature.stale_minutes"),
    ],
)
def test_invalid_temperature_settings_are_refused(section: str, says: str) -> None:
    with pytest.raises(SettingsError) as caught:
        parse_settings(SITE + section)
    assert says in str(caught.value)


def test_state_fingerprint_does_not_depend_on_the_site_folder(tmp_path: Path) -> None:
    """The analysis has the path as in the settings, a start as it is resolved: a restart must not learn again."""
    structure = parse_structure(t_structure_toml())
    (tmp_path / "t_structure.toml").write_text(t_structure_toml(), encoding="utf-8")
    (tmp_path / "site.toml").write_text(SITE + '[temperature]\ncsv = "air.csv"\n', encoding="utf-8")
    site = load_site(tmp_path / "site.toml")
    known = state_fingerprint(structure, parse_settings(site.site_text))
    assert state_fingerprint(structure, site.settings) == known
    other = parse_settings(SITE + '[temperature]\ncsv = "other.csv"\n')
    assert state_fingerprint(structure, other) != known


def test_check_reads_the_last_line(tmp_path: Path) -> None:
    (tmp_path / "t_structure.toml").write_text(t_structure_toml(), encoding="utf-8")
    (tmp_path / "site.toml").write_text(SITE + '[temperature]\ncsv = "air.csv"\n', encoding="utf-8")
    site = load_site(tmp_path / "site.toml")

    def reported() -> tuple[bool, str]:
        return next((f.well, f.text) for f in look_around(site) if f.what == "temperature")

    assert reported()[0] is False
    (tmp_path / "air.csv").write_text("t,temperature\n")
    assert reported() == (False, f"{tmp_path / 'air.csv'}: has no reading")
    (tmp_path / "air.csv").write_text("t,temperature\n1767225600,-3.25\n")
    assert (reported()[0], "behind now" in reported()[1]) == (False, True)
    (tmp_path / "air.csv").write_text(f"t,temperature\n{time.time():.0f},-3.25\n")
    assert (reported()[0], "-3.25 degC at 20" in reported()[1]) == (True, True)
