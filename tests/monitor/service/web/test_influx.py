"""Line protocol: types, escapes and times; a real InfluxDB takes what /influx returns."""

import math
import shutil
import time
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx
import pytest

from monitor.results.site_status import SiteStatus
from monitor.service.servers.web.influx import influx_lines
from tests.support.monitor.service.status import served_run, site_status
from tests.support.processes import free_port, server_process

DEPLOY = Path(__file__).parents[4] / "deploy"
ODD = 'east, "upper"=1 \\ ü'
needs_influxdb = pytest.mark.skipif(shutil.which("influxd") is None, reason="influxd is not installed")


@pytest.fixture
def status(tmp_path: Path) -> SiteStatus:
    """Return the status of a run in alarm with six modes."""
    return site_status(tmp_path)


def lines(status: SiteStatus | None, site: str = "bridge") -> list[str]:
    return influx_lines(status, site).splitlines()


def test_lines_of_a_run_in_alarm(status: SiteStatus) -> None:
    assert status.window is not None
    found = lines(status)
    kinds = [line.partition(",")[0] for line in found]
    assert kinds == [
        "modalwatch",
        "modalwatch_device",
        "modalwatch_device",
        "modalwatch_window",
        *["modalwatch_mode"] * 6,
    ]
    assert 'state="alarm",alarm=true,temperature=-3.5,' in found[0]
    assert found[0].startswith("modalwatch,site=bridge healthy=true,problems=0i,")
    assert found[0].endswith(f" {round(status.time * 1e9)}")
    assert found[1].startswith("modalwatch_device,device=left,site=bridge scan_rate=")
    assert "gaps=1i,bad_bytes=21i,lost=false," in found[1]
    mode = status.window.modes[2]
    assert found[5] == (
        f"modalwatch_mode,mode=2,site=bridge frequency={mode.frequency!r},frequency_std={mode.frequency_std!r},"
        f"damping={mode.damping!r},damping_std={mode.damping_std!r} {status.window.end}"
    )


def test_special_characters_of_a_name_are_escaped(status: SiteStatus) -> None:
    assert lines(status, ODD)[0].startswith('modalwatch,site=east\\,\\ "upper"\\=1\\ _\\ ü healthy=true,')
    assert lines(status, "two\nlines\\")[0].startswith("modalwatch,site=two_lines_ healthy=true,")


def test_values_that_are_not_finite_are_left_out(status: SiteStatus) -> None:
    assert status.window is not None
    unknown = status.window.modes[2].model_copy(update={"damping": math.nan, "damping_std": math.inf})
    window = status.window.model_copy(update={"modes": {2: unknown}})
    assert lines(status.model_copy(update={"window": window}))[-1] == (
        f"modalwatch_mode,mode=2,site=bridge frequency={unknown.frequency!r},frequency_std={unknown.frequency_std!r}"
        f" {window.end}"
    )
    nothing = unknown.model_copy(update={"frequency": math.nan, "frequency_std": math.nan})
    window = window.model_copy(update={"modes": {2: nothing}})
    assert lines(status.model_copy(update={"window": window}))[-1].startswith("modalwatch_window,")


def test_modes_of_a_window_while_learning_are_left_out(status: SiteStatus) -> None:
    assert status.window is not None
    window = status.window.model_copy(update={"phase": "learning"})
    assert not [line for line in lines(status.model_copy(update={"window": window})) if "modalwatch_mode" in line]


def test_site_that_never_ran_is_not_healthy() -> None:
    [line] = lines(None)
    assert line.startswith("modalwatch,site=bridge healthy=false ")


@contextmanager
def influxdb(folder: Path) -> Iterator[str]:
    """Run an InfluxDB 1 with an empty database; give its address."""
    port, backup = free_port(), free_port()
    (folder / "influxdb.conf").write_text(
        f"""reporting-disabled = true
bind-address = "127.0.0.1:{backup}"
[meta]
dir = "{folder}/meta"
[data]
dir = "{folder}/data"
wal-dir = "{folder}/wal"
[http]
bind-address = "127.0.0.1:{port}"
[monitor]
store-enabled = false
"""
    )
    url, end = f"http://127.0.0.1:{port}", time.monotonic() + 20.0
    with server_process(["influxd", "-config", "influxdb.conf"], folder) as output:
        while True:
            try:
                httpx.post(f"{url}/query", params={"q": "CREATE DATABASE site"}).raise_for_status()
                break
            except httpx.TransportError:
                assert time.monotonic() < end, output.read_text()
                time.sleep(0.1)
        yield url


def stored(url: str, measurement: str) -> list[dict[str, Any]]:
    """Return the points of a measurement, tags and fields."""
    query = {"q": f'SELECT * FROM "{measurement}"', "db": "site", "epoch": "ns"}
    [result] = httpx.get(f"{url}/query", params=query).json()["results"]
    [series] = result["series"]
    return [dict(zip(series["columns"], row, strict=True)) for row in series["values"]]


def write(url: str, text: str) -> None:
    answer = httpx.post(f"{url}/write", params={"db": "site"}, content=text.encode())
    assert answer.status_code == 204, answer.text


@pytest.mark.live
@needs_influxdb
def test_influxdb_stores_what_is_served(status: SiteStatus, tmp_path: Path) -> None:
    """As Telegraf with the shipped settings would: the answer is read twice, and windows and modes are stored once."""
    settings = tomllib.loads((DEPLOY / "telegraf.conf").read_text(encoding="utf-8"))
    [source] = settings["inputs"]["http"]
    assert source["data_format"] == "influx"
    [address] = source["urls"]
    (tmp_path / "state").mkdir()
    with influxdb(tmp_path) as url, served_run(tmp_path / "state") as port:
        served = address.replace("monitor:8765", f"127.0.0.1:{port}")
        assert served != address
        for wait in (3.5, 0.0):  # s: an answer may be 3 s old
            answer = httpx.get(served, headers={"Authorization": "Bearer 0123456789abcdef"}, timeout=30.0)
            assert answer.headers["content-type"] == "text/plain; charset=utf-8"
            write(url, answer.text)
            time.sleep(wait)
        assert len(stored(url, "modalwatch")) == 2
        assert {point["device"] for point in stored(url, "modalwatch_device")} == {"left", "right"}
        assert status.window is not None
        modes = {int(point.pop("mode")): point for point in stored(url, "modalwatch_mode")}
        place = {"time": status.window.end, "site": "bridge"}
        assert modes == {mode: place | found.model_dump() for mode, found in status.window.modes.items()}
        [window] = stored(url, "modalwatch_window")
        assert window["novelty"] > window["novelty_limit"]


@pytest.mark.live
@needs_influxdb
def test_influxdb_reads_escaped_names_back(status: SiteStatus, tmp_path: Path) -> None:
    with influxdb(tmp_path) as url:
        write(url, influx_lines(status, ODD))
        [point] = stored(url, "modalwatch")
        assert point["site"] == ODD.replace("\\", "_")
        assert (point["state"], point["alarm"], point["problems"]) == ("alarm", True, 0)
