"""A server in its process, and clients that come, go and come again."""

import contextlib
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
import pytest
import rerun as rr

from daq import Block, Event, Item
from daq.drivers import EPSON_SCALE
from monitor.results.innovations import ModeInnovations
from monitor.results.residuals import ChannelResiduals
from monitor.results.windows import result_event
from monitor.service.servers.live_view import LiveView, live_urls, live_view
from monitor.settings import Settings, parse_settings
from monitor.views.viewer.live import LiveResults
from tests.support.monitor import answers
from tests.support.monitor import results as made
from tests.support.monitor.rrd_reader import Rrd
from updater import t_structure_toml

pytestmark = pytest.mark.live

RERUN = shutil.which("rerun", path=f"{Path(sys.executable).parent}{os.pathsep}{os.environ.get('PATH', '')}")
SITE = made.Site()
RUN = answers.with_findings(SITE, made.whole_run(SITE, n_learning=5, n_before=2, n_after=3))
RATE = 200.0


def free_port() -> int:
    """Return a port that is free, and the next one too."""
    while True:
        with socket.socket() as first, socket.socket() as second:
            first.bind(("127.0.0.1", 0))
            port = first.getsockname()[1]
            try:
                second.bind(("127.0.0.1", port + 1))
            except (OSError, OverflowError):
                continue
            return int(port)


def site_text(port: int) -> str:
    return f"""structure = "t_structure.toml"
[viewer]
port = {port}
memory_mb = 64
[[device]]
name = "beam_left"
driver = "epson-uart"
port = "/dev/none"
rate = {RATE}
channels = {{y = "beam_left_y"}}
"""


def results() -> Iterator[Event]:
    """Yield the run's results in the order of time; the reference first, as one that an earlier run has learned."""
    yield result_event(RUN["reference"])
    yield from sorted(map(result_event, [*RUN["windows"], *RUN["alarms"]]), key=lambda event: event.time)


def block(second: int) -> Block:
    index = np.arange(round(RATE) * second, round(RATE) * (second + 1), dtype=np.int32)
    return Block(
        device="beam_left",
        rate=RATE,
        first_index=int(index[0]),
        counts=np.column_stack([index] * 3),
        scale=EPSON_SCALE,
        arrival_index=int(index[-1]),
        arrival_time=made.START + round(int(index[-1]) / RATE * 1e9),
        temperature=20.0,
    )


def wait_until_served(port: int) -> None:
    end = time.monotonic() + 30
    while time.monotonic() < end:
        with contextlib.suppress(OSError):
            socket.create_connection(("127.0.0.1", port), 1).close()
            return
        time.sleep(0.1)
    raise AssertionError(f"nothing is served on port {port} within 30 s")


def reported(rrd: Rrd) -> list[int]:
    """Return the ends of the windows whose card was sent."""
    return [int(time) for time in rrd.rows("/now", "TextDocument:text")[0]]


def whole(rrd: Rrd) -> bool:
    """Return whether all windows were sent, and the layout that shows the last one."""
    return len(reported(rrd)) == len(RUN["windows"]) and any(view.name == "Diagnosis" for view in rrd.views)


class Client:
    """A stock client that saves the stream of a server, until it is stopped."""

    def __init__(self, url: str, path: Path) -> None:
        self._path = path
        wait_until_served(urlsplit(url).port or 0)
        quiet = subprocess.DEVNULL
        command = [str(RERUN), "--bind", "127.0.0.1", "--port", str(free_port()), "--save", str(path), url]
        self._process = subprocess.Popen(command, stdout=quiet, stderr=quiet)

    def saved(self, done: Callable[[Rrd], bool]) -> Rrd:
        """Return the saved stream once it is `done`."""
        end = time.monotonic() + 30
        try:
            while time.monotonic() < end:
                time.sleep(0.3)
                with contextlib.suppress(ValueError, RuntimeError, OSError):  # it is just being written
                    rrd = Rrd(self._path)
                    if done(rrd):
                        return rrd
        finally:
            self._process.kill()
            self._process.wait()
        raise AssertionError(f"the server did not send what was expected within 30 s: {self._path}")


def shown(live: LiveView, items: Sequence[Item]) -> None:
    for item in items:
        live.show(item)


@pytest.mark.filterwarnings("ignore:RRD file has no footer")  # the client still writes it
def test_clients_can_reconnect_and_a_killed_server_is_reported(tmp_path: Path) -> None:
    port = free_port()
    text = site_text(port)
    with live_view(parse_settings(text), t_structure_toml(), text) as live:
        assert live.text == f"live view: modalwatch view rerun+http://127.0.0.1:{port}/proxy"
        items = list(results())
        shown(live, [block(s) for s in range(6)])
        shown(live, items[:-3])
        trend, raw = live_urls(port)
        ends = [w.end for w in RUN["windows"] if w.end <= items[-4].time]
        first = Client(trend, tmp_path / "first.rrd").saved(lambda r: len(reported(r)) > 6)
        assert (
            first.rows("/now", "TextDocument:text")[0].tolist()
            == ends[: len(first.rows("/now", "TextDocument:text")[0])]
        )
        shown(live, items[-3:])
        again = Client(trend, tmp_path / "again.rrd").saved(whole)
        check_results(again)
        check_signals(
            Client(raw, tmp_path / "raw.rrd").saved(lambda r: len(r.scalars("/signal/beam_left_y")[0]) >= 1000)
        )
        for number in (signal.SIGINT, signal.SIGTERM):  # of a whole group: the parent's business
            os.kill(live.pid, number)
        time.sleep(0.2)
        shown(live, items[-1:])
        assert live.problem is None
        os.kill(live.pid, signal.SIGKILL)
        end = time.monotonic() + 10
        while live.problem is None and time.monotonic() < end:
            shown(live, [*items[:1], block(7)])
            time.sleep(0.05)
        assert live.problem == f"its process ended with code {-signal.SIGKILL}"
        shown(live, items)
    assert live.dropped == 0


def check_results(rrd: Rrd) -> None:
    """The stream has the same content as a file: trends, states without repeats, the newest place."""
    windows = [w for w in RUN["windows"] if w.phase != "learning"]
    shifts = [(w.end, m.shift_percent, m.shift_std_percent) for w in windows for m in w.modes if m.id == 3]
    expected = [(end, shift / std) for end, shift, std in shifts if shift is not None and std]
    times, values = rrd.scalars("/trend/shift/mode_3")
    assert times.tolist() == [end for end, _ in expected]
    np.testing.assert_allclose(values, [shift for _, shift in expected], rtol=1e-12)
    _, states = rrd.rows("/state/structure", "StateChange:state")
    assert [s[0] for s in states] == ["unknown", "normal", "watch", "alarm"]
    times, places = rrd.rows("/structure/mass/body", "Points3D:positions")
    answered = [w for w in windows if w.answer]
    assert times.tolist() == [w.end for w in answered]
    np.testing.assert_allclose(places[-1][0], answered[-1].answer.position, atol=1e-6)
    assert {"/increments/y/members", "/modes/mode_6/shape", "/diagnosis", "/events"} <= rrd.entities()
    assert {"Diagnosis", "Structure", "beam_left_y [m/s²]"} <= {view.name for view in rrd.views}


def check_signals(rrd: Rrd) -> None:
    """Counts times scale at the device's own times; a thousandth of a sample is the clock's rounding."""
    times, values = rrd.scalars("/signal/beam_left_y")
    np.testing.assert_array_equal(values[:1000], EPSON_SCALE * np.arange(1000))
    np.testing.assert_allclose(times[:1000] - made.START, np.arange(1000) / RATE * 1e9, atol=1e-3 / RATE * 1e9)


def test_temperatures_are_drawn_on_after_the_clock_is_set_back(monkeypatch: pytest.MonkeyPatch) -> None:
    drawn: list[int] = []
    monkeypatch.setattr("monitor.views.viewer.live.draw_temperature", lambda *given: drawn.extend(given[3]))
    live = LiveResults(rr.RecordingStream("test"), "bridge", parse_settings(site_text(1)))
    for second in (7200, 7205, 7211, 3600, 3603):
        live.add_temperature("site", second * 10**9, 20.0)
    assert drawn == [second * 10**9 for second in (7200, 7211, 3600)]


def test_residuals_are_drawn_and_laid_out_from_the_first_block_on(tmp_path: Path) -> None:
    recording = rr.RecordingStream("test")
    recording.save(tmp_path / "live.rrd")
    live = LiveResults(recording, "bridge", parse_settings(site_text(1)))
    live.add(RUN["windows"][0])
    for second in (10, 11):
        live.add_residuals(
            ChannelResiduals(
                time=made.START + second * 10**9, seconds=2.0, ratio={"a": 1.5}, deviation={"a": second / 2}, limit=6.0
            )
        )
    recording.disconnect()
    rrd = Rrd(tmp_path / "live.rrd")
    times, values = rrd.scalars("/channels/residuals/a")
    assert (times - made.START).tolist() == [10 * 10**9, 11 * 10**9]
    assert values.tolist() == [5.0, 5.5]
    assert set(rrd.scalars("/channels/residuals/limit")[1].tolist()) == {6.0}
    assert "/channels/residuals" in {view.origin for view in rrd.views}


def test_innovations_are_drawn_and_laid_out_from_the_first_block_on(tmp_path: Path) -> None:
    recording = rr.RecordingStream("test")
    recording.save(tmp_path / "live.rrd")
    live = LiveResults(recording, "bridge", parse_settings(site_text(1)))
    live.add(RUN["windows"][0])
    for second in (10, 11):
        live.add_innovations(
            ModeInnovations(
                time=made.START + second * 10**9, seconds=1.0, level=1.0, mode=[1, 2, 3],
                frequency=[10.881, 10.882, 39.1], deviation=[second / 2, 1.0, 0.0], limit=6.0,
            )
        )  # fmt: skip
    live.add(RUN["reference"].model_copy(update={"time": made.START + 12 * 10**9}))
    recording.disconnect()
    rrd = Rrd(tmp_path / "live.rrd")
    times, values = rrd.scalars(r"/channels/innovations/mode\ 1")
    assert (times - made.START).tolist() == [10 * 10**9, 11 * 10**9]
    assert values.tolist() == [5.0, 5.5]
    assert rrd.scalars(r"/channels/innovations/mode\ 2")[1].tolist() == [1.0, 1.0]
    cleared, _ = rrd.rows("/channels/innovations", "Clear:is_recursive")
    assert (cleared - made.START).tolist() == [12 * 10**9]
    assert set(rrd.scalars("/channels/innovations/limit")[1].tolist()) == {6.0}
    assert "/channels/innovations" in {view.origin for view in rrd.views}


def test_port_in_use_is_reported_and_no_view_is_served() -> None:
    port = free_port()
    with socket.socket() as other:
        other.bind(("127.0.0.1", port + 1))
        other.listen()
        text = site_text(port)
        with live_view(parse_settings(text), t_structure_toml(), text) as live:
            assert live.text == f"no live view: port {port + 1} of 127.0.0.1 is in use"
            live.show(block(0))
            assert not live.served


def test_missing_viewer_section_serves_no_view() -> None:
    text = site_text(9876).replace("[viewer]\nport = 9876\nmemory_mb = 64\n", "")
    settings: Settings = parse_settings(text)
    with live_view(settings, t_structure_toml(), text) as live:
        assert live.text == ""
        live.show(block(0))


def test_items_beyond_the_queue_limit_are_dropped_and_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    """With room for three items and a server that has not started yet, the rest has no room, and nobody waits."""
    monkeypatch.setattr("monitor.service.servers.live_view._WAITING", 3)
    text = site_text(free_port())
    with live_view(parse_settings(text), t_structure_toml(), text) as live:
        start = time.monotonic()
        shown(live, [block(0)] * 50)
        assert time.monotonic() - start < 0.5
        assert live.dropped >= 50 - 3
        assert 1 <= live.waiting <= 3


def test_port_occupied_after_the_check_ends_the_view_without_a_traceback(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("monitor.service.servers.live_view._free", lambda _: True)
    port = free_port()
    with socket.socket() as other, socket.socket() as beside:
        for number, taken in enumerate((other, beside)):
            taken.bind(("127.0.0.1", port + number))
            taken.listen()
        text = site_text(port)
        items = [item for item in results() if not isinstance(item, Block)]
        with live_view(parse_settings(text), t_structure_toml(), text) as live:
            end = time.monotonic() + 30
            while not live.problem and time.monotonic() < end:
                shown(live, [block(0), items[0]])
                time.sleep(0.2)
            assert live.problem == "its process ended with code 1"
    assert "Traceback" not in capfd.readouterr().err
