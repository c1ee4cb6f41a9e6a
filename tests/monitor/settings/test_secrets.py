"""Secrets of a site: marked ones in every setting that may hold some, and a search of all that is written or served."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from http import HTTPStatus
from pathlib import Path
from typing import Any, get_args

import httpx
import pytest
import zstandard
from mcap.records import Chunk
from mcap.stream_reader import StreamReader
from pydantic import BaseModel, SecretStr

from daq import McapWriter, read_attachments
from monitor.errors import SettingsError
from monitor.outputs.notices import NoticeError, make_sender
from monitor.rig import T_DEVICES
from monitor.settings import NotifySettings, attachable, parse_settings
from monitor.settings.reading import section_of
from monitor.settings.redaction import masked, redacted_topic, shown_address
from monitor.settings.schema import Settings
from monitor.watch.memory import check_saved_state, memory_text
from monitor.watch.pipeline import Pipeline
from tests.support.monitor.cli import Commands, assert_refused
from tests.support.monitor.history import run_events
from tests.support.monitor.notices import NOTICE, Server
from tests.support.monitor.played_windows import Played
from updater import t_structure_toml

RECORDED = Path(__file__).parents[3] / "replay_data" / "t_frame_added_mass.mcap"
PORT = 40_000 + os.getpid() % 9_000
MARK = "Hush7Secret"
SPEED, WINDOW = 4.0, 5.0
DEVICE = """[[device]]
name = "beam_left"
driver = "epson-uart"
port = "/dev/none"
channels = {y = "beam_left_y"}
"""
SECRETS = f"""# webhook = "https://chat.example.org/{MARK}old"
[history]
keep_events = 1000
url = "postgresql://{MARK}user:{MARK}pw@127.0.0.1:1/db?application_name={MARK}query"
[temperature]
mqtt = "mqtt://{MARK}user:{MARK}pw@127.0.0.1:1/{MARK}topic"
[home_assistant]
mqtt = "mqtt://{MARK}user:{MARK}pw@127.0.0.1:1/{MARK}topic"
[[notify]]
webhook = "http://{MARK}user:{MARK}pw@127.0.0.1:%d/{MARK}path?token={MARK}query"
headers = {{X-Api-Key = "{MARK}key"}}
[[notify]]
command = ["{sys.executable}", "-c", "raise SystemExit(3)", "{MARK}argument"]
[[notify]]
command = ["/nowhere/{MARK}program"]
[[notify]]
mqtt = "mqtts://{MARK}user:{MARK}pw@127.0.0.1:1/{MARK}topic?{MARK}query"
"""
FAILURES = (
    b"history: postgresql://127.0.0.1:1/db: ",
    b"webhook: 403 Forbidden",
    b"command: exit status 3",
    b"command: cannot be started: No such file or directory",
    b"mqtt: ",
    b"temperature: mqtt://127.0.0.1:1: ",
    b"home_assistant: mqtt://127.0.0.1:1: ",
)
ENVIRONMENT = {"MODALWATCH_NOTIFY__0__HEADERS__AUTHORIZATION": f"Bearer {MARK}bearer"}


def secret_places(section: type[BaseModel], place: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    """Yield the settings that are secrets."""

    def holds(annotation: Any) -> bool:
        return annotation is SecretStr or any(map(holds, get_args(annotation)))

    for name, field in section.model_fields.items():
        below = section_of(field.annotation)
        if below is not None:
            yield from secret_places(below, (*place, name))
        elif holds(field.annotation):
            yield *place, name


def test_no_secret_setting_is_attached_to_logs() -> None:
    text = 'structure = "a.toml"\n' + DEVICE + SECRETS % 1
    for place in secret_places(Settings):
        assert f"{place[-1]} = " in SECRETS, place
    once = attachable(text)
    assert MARK not in once
    assert MARK not in repr(parse_settings(text))
    assert attachable(once) == once
    kept = parse_settings(once)
    assert (kept.history.keep_events, kept.notify, kept.home_assistant) == (1000, (), None)
    assert kept.device == parse_settings(text).device
    assert attachable("no = [toml") == ""


@pytest.mark.parametrize(
    ("setting", "says"),
    [
        (f'[[notify]]\nwebhook = "htp://h/{MARK}"', "notify.0.webhook: expected http://"),
        (f'[[notify]]\nwebhook = "http://h:{MARK}/"', "notify.0.webhook: expected http://"),
        (f'[[notify]]\nwebhook = "http://u:{MARK}\u2100@h/"', "notify.0.webhook: expected http://"),
        (f'[[notify]]\nwebhook = ["http://h/{MARK}"]', "notify.0.webhook: expected a valid string"),
        (f'[[notify]]\nwebhok = "http://h/{MARK}"', "notify.0.webhok: no such setting, did you mean 'webhook'?"),
        (f'[[notify]]\ncommand = "curl {MARK}"', "notify.0.command: expected a list in brackets"),
        (f'[[notify]]\nwebhook = "http://h/"\nheaders = {{a = "{MARK}\\n"}}', "notify.0.headers: a: expected ASCII"),
        (f'notify = "http://h/{MARK}"', "notify: expected a list in brackets"),
        (f'[home_assistant]\nmqtt = "mqtt://h/{MARK}#"', "home_assistant.mqtt: expected mqtt://HOST/TOPIC"),
        (f'[history]\nurl = "mysql://{MARK}@h/x"', "history.url: expected postgresql://"),
        (f'history = "postgresql://{MARK}@h/x"', "history: expected a table"),
        (f'[temperature]\nmqtt = "mqtt://{MARK}@h"', "temperature.mqtt: expected mqtt://HOST/TOPIC"),
    ],
)
def test_error_of_a_secret_setting_does_not_show_its_value(setting: str, says: str) -> None:
    text = f'structure = "a.toml"\n{setting}\n{DEVICE}'
    with pytest.raises(SettingsError) as found:
        parse_settings(text)
    assert says in str(found.value)
    assert MARK not in str(found.value)
    assert MARK not in str(found.value.__cause__)


def test_webhook_error_does_not_quote_the_response() -> None:
    with Server().running() as server:
        server.answer = 418
        target = NotifySettings(webhook=f"{server.url}/{MARK}", headers={"Authorization": f"Bearer {MARK}"})
        with pytest.raises(NoticeError, match="webhook: 418 " + HTTPStatus(418).phrase):
            make_sender(target)([NOTICE], 0)


def test_secrets_are_masked_in_texts_and_addresses() -> None:
    secrets = ("/hooks/a%20bcd", "abc", "x\\yz")
    assert masked("to /hooks/a bcd or /hooks/a%20bcd by abc or b'x\\\\yz'", secrets) == "to *** or *** by abc or b'***'"
    assert shown_address(f"https://u:{MARK}@[::1]:8/{MARK}?{MARK}#{MARK}") == "https://[::1]:8"
    one, other = (redacted_topic(f"mqtt://u:{MARK}@h/{topic}") for topic in "ab")
    assert one != other
    assert redacted_topic(one) == one
    assert one.startswith("mqtt://h/redacted-")


def test_credentials_are_removed_from_memory_of_an_earlier_version(monkeypatch: pytest.MonkeyPatch) -> None:
    """The thermometer is the same, so that nothing is learned again, and the continued state has no secret."""
    played = Played(1, monkeypatch)
    url = f"mqtt://u:{MARK}@h/air"
    settings = parse_settings(f'{played.text}\n[temperature]\nmqtt = "{url}"')
    now = Pipeline(played.structure, settings).memory
    then = replace(now, state_fingerprint=now.state_fingerprint | {"the thermometer": url})
    found = check_saved_state(memory_text(then), "", played.structure, settings)
    assert found.text == memory_text(now)
    assert MARK not in memory_text(now)
    other = replace(now, state_fingerprint=now.state_fingerprint | {"the thermometer": f"mqtt://u:{MARK}@other/air"})
    refused = check_saved_state(memory_text(other), "", played.structure, settings).refused or ""
    assert ("the thermometer" in refused, MARK in refused) == (True, False)


def test_memory_with_a_csv_file_named_mqtt_is_loaded(monkeypatch: pytest.MonkeyPatch) -> None:
    played = Played(1, monkeypatch)
    settings = parse_settings(f'{played.text}\n[temperature]\ncsv = "mqtt_air.csv"')
    text = memory_text(Pipeline(played.structure, settings).memory)
    assert check_saved_state(text, "", played.structure, settings).text == text


def site_of(folder: Path, webhook_port: int) -> Path:
    """Write settings with marked secrets that play the recorded log as one device, fast."""
    (folder / "t_structure.toml").write_text(read_attachments(RECORDED)["structure.toml"], encoding="utf-8")
    (folder / "recorded.mcap").symlink_to(RECORDED)
    lines = ['structure = "t_structure.toml"', "[analysis]", f"window_seconds = {WINDOW}", "baseline_windows = 30"]
    lines += ["[recorder]", "min_free_gb = 0", "[clock]", f"speed = {SPEED}", "[web]", f"port = {PORT}"]
    for name, (_, axes) in list(T_DEVICES.items())[:1]:
        mapped = ", ".join(f'{axis} = "{name}_{axis}"' for axis in axes)
        lines += ["[[device]]", f'name = "{name}"', 'driver = "replay"', "rate = 500", f"channels = {{{mapped}}}"]
        lines += [f'log = {{file = "recorded.mcap", device = "{name}"}}']
    (folder / "site.toml").write_text("\n".join(lines) + "\n" + SECRETS % webhook_port, encoding="utf-8")
    return folder / "site.toml"


def until(true: Any, process: subprocess.Popen[bytes]) -> Any:
    end = time.monotonic() + 60
    while time.monotonic() < end and process.poll() is None:
        if found := true():
            return found
        time.sleep(0.3)
    raise AssertionError((process.poll(), page("/healthz"), page("/state")))


def page(path: str) -> bytes:
    """Return a response with its headers; empty before there is any."""
    try:
        answer = httpx.get(f"http://127.0.0.1:{PORT}{path}", timeout=20.0)
    except httpx.HTTPError:
        return b""
    return str(answer.headers).encode() + answer.content


def written(folder: Path) -> Iterator[tuple[Path, bytes]]:
    """Yield every file of a folder but the settings and the token; of logs also the packed content of their chunks."""
    for path in sorted(folder.rglob("*")):
        if path.is_symlink() or not path.is_file() or path.name in {"site.toml", "web_token"}:
            continue
        yield path, path.read_bytes()
        if path.suffix == ".mcap":
            with path.open("rb") as stream:
                for record in StreamReader(stream, emit_chunks=True).records:
                    if isinstance(record, Chunk):
                        packed = zstandard.ZstdDecompressor()
                        yield path, packed.decompress(record.data, record.uncompressed_size)


@pytest.mark.thorough
@pytest.mark.live
def test_written_files_and_served_pages_contain_no_secrets(
    tmp_path: Path, modalwatch: Commands, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A monitor with failing database, broker, webhook and commands, a refused reload; then all readers of its log."""
    for name, value in ENVIRONMENT.items():
        monkeypatch.setenv(name, value)
    output = tmp_path / "output"
    command = [sys.executable, "-c", "from monitor.cli.main import main; main()", "run", "--json-log"]
    with Server().running() as server, output.open("wb") as stream:
        server.answer = 403
        site = site_of(tmp_path, int(server.url.split(":")[2].split("/")[0]))
        environment = os.environ | {"PYTHONPATH": str(Path(__file__).parents[3]), "PYTHONUNBUFFERED": "1"}
        with subprocess.Popen([*command, str(site)], stdout=stream, stderr=stream, env=environment) as process:
            try:
                until(lambda: all(why in page("/healthz") for why in FAILURES), process)
                until(lambda: b"No window is evaluated before the baseline is learned" in page("/state"), process)
                text = site.read_text(encoding="utf-8")
                site.write_text(text.replace("postgresql:", "mysql:"), encoding="utf-8")
                process.send_signal(signal.SIGHUP)
                until(lambda: b"reload_refused" in output.read_bytes(), process)
                site.write_text(text, encoding="utf-8")
                served = {
                    path: page(path) for path in ("/", "/state", "/healthz", "/metrics", "/influx", "/page.js", "/none")
                }
            finally:
                process.terminate()
                process.wait(60)
    assert server.refused
    assert all(served.values())
    log = next((tmp_path / "log").iterdir())
    reported = [
        modalwatch("check", site),
        modalwatch("settings", site),
        modalwatch("history", site),
        modalwatch("log", "info", log),
        modalwatch("replay", log, "-o", tmp_path / "watched.mcap", "--json", tmp_path / "found.json"),
        modalwatch("report", log, "-o", tmp_path / "report.html"),
    ]
    assert "the same as live, to the last digit" in reported[4].out
    assert [done.code for done in reported] == [1, 0, 2, 0, reported[4].code, 0]
    found = {path.name for path, content in written(tmp_path) if MARK.encode() in content}
    found |= {path for path, content in served.items() if MARK.encode() in content}
    assert not found
    assert not [done for done in reported if MARK in done.out + done.err]
    assert not [path for path, _ in written(tmp_path / "log") if path.stat().st_mode & 0o007]
    assert not [path for path, _ in written(tmp_path / "state") if path.stat().st_mode & 0o007]


def test_report_of_an_older_log_contains_no_secrets(tmp_path: Path, modalwatch: Commands) -> None:
    text = 'structure = "a.toml"\n' + DEVICE + SECRETS % 1
    writer = McapWriter(tmp_path / "old.mcap", {"site.toml": text, "structure.toml": t_structure_toml()})
    for event in run_events():
        if event.topic.startswith("/result/"):
            writer.write(event)
    writer.close()
    assert modalwatch("report", tmp_path / "old.mcap", "-o", tmp_path / "report.html").code == 0
    assert MARK not in (tmp_path / "report.html").read_text(encoding="utf-8")


def test_invalid_argument_is_not_quoted_in_the_error(modalwatch: Commands, tmp_path: Path) -> None:
    done = modalwatch("check", tmp_path / "none.toml", "--set", f"notify[0].webhook=https://h/{MARK}")
    assert_refused(done, "expected KEY=VALUE")
    assert MARK not in done.err
