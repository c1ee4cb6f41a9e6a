"""`check`: devices looked at for a moment."""

import json
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from daq import DeviceIdentity, DriverError, Scans
from monitor.service.acquisition.probe import probe
from tests.support.monitor.cli import Commands, assert_refused
from tests.support.processes import script_process
from updater import t_structure_toml

pytestmark = pytest.mark.live

SITE = """structure = "t_structure.toml"
[analysis]
window_seconds = 60
baseline_windows = 10
[[device]]
name = "beam_left"
driver = "{driver}"
port = "{port}"
rate = 500
channels = {{y = "beam_left_y", z = "beam_left_z"}}
"""


class Clock:
    """A clock that is moved by hand."""

    def __init__(self) -> None:
        self.seconds = 0.0

    def __call__(self) -> float:
        return self.seconds


class Sending:
    """Sends a scan every 10 ms, 20 per read, counted modulo 256; skips some on request."""

    scale, modulus = 0.5, 256

    def __init__(self, clock: Clock, skipped: frozenset[int] = frozenset(), *, silent: bool = False) -> None:
        self._clock, self._skipped, self._silent, self._k = clock, skipped, silent, 0
        self.closed = False

    def open(self) -> DeviceIdentity:
        return DeviceIdentity(product="P", serial="S1")

    def read(self) -> Scans:
        self._clock.seconds += 0.2
        k = [i for i in range(self._k, self._k + 20) if i not in self._skipped and not self._silent]
        self._k += 20
        counts = np.array([[7 + (-1) ** i, 3] for i in k], np.int32).reshape(-1, 2)
        return Scans(counts=counts, counter=np.array(k, np.int32) % 256, temperature=20.0, bad_bytes=1)

    def close(self) -> None:
        self.closed = True


def test_probe_measures_rate_losses_and_levels_of_a_device() -> None:
    clock = Clock()
    device = Sending(clock, frozenset({700, 701, 1000}))
    found = probe(device, seconds=19.9, now=clock)
    assert found.rate == pytest.approx(100.0)  # what was lost included: the device counted it
    assert (found.lost, found.bad_bytes, found.temperature) == (3, 100, 20.0)
    np.testing.assert_allclose(found.mean, [3.5, 1.5], atol=1e-3)
    np.testing.assert_allclose(found.rms, [0.5, 0.0], atol=1e-6)
    assert found.rate_is(100.0)
    assert not found.rate_is(200.0)
    assert device.closed
    fast = probe(Sending(clock := Clock()), speed=10.0, seconds=1.0, now=clock)
    assert fast.rate == pytest.approx(10.0)


class Bursts(Sending):
    """Sends 20 scans at once, every 0.2 s; in between a read finds none."""

    def read(self) -> Scans:
        self._clock.seconds += 0.05
        if round(self._clock.seconds / 0.05) % 4:
            return Scans(
                counts=np.empty((0, 2), np.int32), counter=np.empty(0, np.int32), temperature=20.0, bad_bytes=0
            )
        self._clock.seconds -= 0.2
        return super().read()


@pytest.mark.parametrize("seconds", [0.9, 1.0, 1.1])
def test_probe_measures_the_rate_of_bursts(seconds: float) -> None:
    assert probe(Bursts(clock := Clock()), seconds=seconds, now=clock).rate == pytest.approx(100.0)


def test_probe_reports_a_device_without_scans() -> None:
    clock = Clock()
    device = Sending(clock, silent=True)
    with pytest.raises(DriverError, match="S1: answers, but sends no scans"):
        probe(device, seconds=1.0, now=clock)
    assert device.closed


@pytest.fixture
def site(tmp_path: Path) -> Path:
    (tmp_path / "t_structure.toml").write_text(t_structure_toml(), encoding="utf-8")
    return tmp_path / "site.toml"


@pytest.fixture
def port() -> Iterator[str]:
    """Return the port of an emulated device in a process of its own."""
    script = Path(__file__).parents[2] / "support" / "daq" / "emulated_ports.py"
    now = time.time_ns()
    with script_process(script, 1, 1, now, now) as (_, ports):
        yield str(json.loads(ports)[0])


def test_check_shows_settings_and_connected_devices(modalwatch: Commands, site: Path, port: str) -> None:
    site.write_text(SITE.format(driver="epson-uart", port=port))
    done = modalwatch("check", site)
    assert (done.code, done.err) == (0, ""), done
    for text in (
        "2, on 1 devices",
        "60 s, one every 60 s",
        "10 windows",
        "beam_left",
        "E0000000",
        "all devices answer",
    ):
        assert text in done.out
    assert str(site.parent / "log") in done.out
    assert not (site.parent / "log").exists()  # nothing is made


def test_check_of_a_replay_device(modalwatch: Commands, site: Path) -> None:
    """A recorded device at twice its speed; paths are relative to the site's file."""
    recorded = Path(__file__).parents[3] / "replay_data" / "t_frame_added_mass.mcap"
    (site.parent / "recorded.mcap").symlink_to(recorded)
    played = SITE.format(driver="replay", port="").replace(
        'port = ""', 'log = {file = "recorded.mcap", device = "beam_left"}'
    )
    site.write_text(played + "[clock]\nspeed = 2\n")
    done = modalwatch("check", site)
    assert (done.code, done.err) == (0, ""), done
    assert "replay beam_left recorded.mcap" in done.out
    assert "all devices answer" in done.out
    site.write_text(played.replace('device = "beam_left"', 'device = "beam_lft"'))
    done = modalwatch("check", site)
    assert done.code == 3
    assert "device beam_lft: cannot be played: the log has no scan of this device; there are beam_left, " in done.err


def test_check_reports_a_low_grade_device(modalwatch: Commands, site: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    clock = Clock()
    found = probe(Sending(clock), seconds=1.0, now=clock)
    monkeypatch.setattr(
        "monitor.cli.site.site_check.probe_devices", lambda _: {"beam_left": replace(found, rate=200.0)}
    )
    message = "device beam_left is of low grade: scans have no number"
    for driver, is_low in (("witmotion", True), ("epson-uart", False)):
        text = SITE.format(driver=driver, port="/dev/none").replace("{y =", "{x =").replace(", z =", ", y =")
        site.write_text(text.replace("rate = 500", "rate = 200"))
        assert (message in modalwatch("check", site).out) == is_low


def test_check_reports_a_missing_thermometer(modalwatch: Commands, site: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    clock = Clock()
    found = probe(Sending(clock), seconds=1.0, now=clock)
    text = SITE.format(driver="epson-uart", port="/dev/none").replace("{y =", "{x =").replace(", z =", ", y =")
    site.write_text(text)
    for celsius, lacks in ((20.0, False), (float("nan"), True)):
        probed = {"beam_left": replace(found, rate=500.0, temperature=celsius)}
        monkeypatch.setattr("monitor.cli.site.site_check.probe_devices", lambda _, probed=probed: probed)
        assert ("a thermometer is needed" in modalwatch("check", site).out) == lacks


def test_check_exits_3_if_a_device_does_not_respond(modalwatch: Commands, site: Path) -> None:
    site.write_text(SITE.format(driver="epson-uart", port=site.parent / "no-such-port"))
    done = modalwatch("check", site)
    assert done.code == 3
    assert done.err.startswith("error: device beam_left: ")
    assert "no-such-port" in done.err
    assert "no answer" in done.out


def test_each_device_that_does_not_respond_has_a_line(modalwatch: Commands, site: Path) -> None:
    port = site.parent / "no-such-port"
    other = (
        f'[[device]]\nname = "second"\ndriver = "epson-uart"\nport = "{port}-2"\nchannels = {{y = "beam_right_y"}}\n'
    )
    site.write_text(SITE.format(driver="epson-uart", port=port) + other)
    done = modalwatch("check", site)
    assert done.code == 3
    starts = [line.split(": ")[:2] for line in done.err.splitlines()]
    assert starts == [["error", "device beam_left"], ["error", "device second"]]


def test_check_refuses_invalid_settings(modalwatch: Commands, site: Path) -> None:
    good = SITE.format(driver="epson-uart", port="/dev/none")
    for old, new, says in (
        ("window_seconds", "windw_seconds", "analysis.windw_seconds: no such setting, did you mean 'window_seconds'?"),
        ("rate = 500", "rate = -1", "device.0.rate"),
        ("epson-uart", "epsom-uart", "device 'beam_left': driver: expected one of can-dbc, epson-can, "),
        ("beam_left_z", "left_z", "channel 'left_z' is no sensor of"),
        ("[analysis]", "[analysis", "at line 2"),
    ):
        site.write_text(good.replace(old, new))
        assert_refused(modalwatch("check", site), f"{site}: ", says)
    site.write_text(good.replace("t_structure.toml", "none.toml"))
    assert_refused(modalwatch("check", site), site.parent / "none.toml", "cannot be read")
    assert_refused(modalwatch("check", site.parent / "none.toml"), site.parent / "none.toml", "cannot be read")
