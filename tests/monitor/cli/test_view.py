"""`report` and `view` as a user types them."""

import shutil
import socket
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import Writer

from daq import Channel, Recording, write_recording
from monitor.views.run import load_run
from tests.support.monitor.cli import Commands, assert_refused
from tests.support.monitor.rrd_reader import Rrd

LOG = Path(__file__).parents[3] / "replay_data" / "t_frame_added_mass.mcap"


@pytest.fixture(autouse=True)
def _no_display(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))


@pytest.mark.usefixtures("undrawn")
def test_report_is_written_from_the_log_alone(modalwatch: Commands, tmp_path: Path) -> None:
    done = modalwatch("report", LOG, "-o", tmp_path / "page.html")
    assert done.code == 0, done
    assert done.out == f"report: {tmp_path / 'page.html'}\n"
    assert "The structure has changed" in (tmp_path / "page.html").read_text(encoding="utf-8")


def test_outputs_replace_files_only_by_force(modalwatch: Commands, tmp_path: Path) -> None:
    """Each command that writes a file: refused before it reads its input, with the option, the file and --force."""
    kept = tmp_path / "kept.json"
    kept.write_text("mine", encoding="utf-8")
    for name in ("modes.unv", "structure_extended.toml", "scenario.toml"):
        (tmp_path / name).write_text("mine", encoding="utf-8")
    (tmp_path / "found_structure.toml").write_text("mine", encoding="utf-8")
    none = tmp_path / "none.toml"
    commands: list[tuple[str, tuple[object, ...]]] = [
        *((f"--{option}", ("identify", none, f"--{option}", kept)) for option in ("json", "picture")),
        ("--out", ("identify", none, "--out", tmp_path)),
        ("--out", ("diagnose", none, none, "--out", tmp_path)),
        ("--json", ("diagnose", none, none, "--json", tmp_path / "found.json")),
        *((f"--{option}", ("diagnose", none, none, f"--{option}", kept)) for option in ("json", "pdf")),
        ("--json", ("response", none, none, "--reference", none, "--at", "a:1:x", "--json", kept)),
        ("--out", ("structure", none, "--out", kept)),
        ("--json", ("structure", none, "--json", kept)),
        ("--json", ("bodies", none, "--json", kept)),
        ("--json", ("log", "info", none, "--json", kept)),
        ("--json", ("replay", none, "--json", kept)),
        *((f"--{option}", ("history", none, f"--{option}", kept)) for option in ("json", "csv", "plot")),
        ("--json", ("devices", "--json", kept)),
        ("--json", ("prove", none, "--mass", "1", "--position", "0,0", "--json", kept)),
        *((f"--{option}", ("rig", "quiet", f"--{option}", kept)) for option in ("ports", "report", "new-site")),
        ("--out", ("demo", "--out", tmp_path)),
        ("--new-site", ("import", none, "-o", tmp_path / "new.mcap", "--new-site", kept)),
    ]
    for option, words in commands:
        assert_refused(modalwatch(*words), f"error: {option}: {tmp_path}", "exists: give another name, or --force")
    assert kept.read_text(encoding="utf-8") == "mine"
    assert_refused(modalwatch("report", LOG, "-o", kept), "--out", f"{kept} exists", "--force")
    assert_refused(modalwatch("view", LOG, "--no-open", "-o", kept), "--out", f"{kept} exists", "--force")
    assert modalwatch("report", LOG, "-o", kept, "--force").code == 0
    assert kept.read_text(encoding="utf-8").startswith("<!")
    assert_refused(modalwatch("log", "info", LOG, "--json", tmp_path / ("x" * 300)), "--json", "File name too long")
    assert modalwatch("log", "info", LOG, "--json", "/dev/null").code == 0


def test_view_writes_recording_to_cache_and_prints_viewer_command(modalwatch: Commands, tmp_path: Path) -> None:
    done = modalwatch("view", LOG)
    assert done.code == 0, done
    path = tmp_path / "cache" / "modalwatch" / "t_frame_added_mass.rrd"
    assert f"recording: {path}" in done.out
    assert f"rerun --serve-web --bind 127.0.0.1 {path}" in done.out
    rrd, run_results = Rrd(path), load_run(LOG).results
    assert rrd.scalars("/trend/shift/mode_2")[0].tolist() == [w.end for w in run_results.watched]
    assert len(rrd.entities("/signal")) == len(run_results.windows[0].channels)


def _nothing(path: Path) -> None:
    """Leave the path as it is: nothing is there."""


def _text(path: Path) -> None:
    path.write_text("t,a\n0,1\n", encoding="utf-8")


def _foreign(path: Path) -> None:
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start(profile="ros2")
        writer.finish()  # type: ignore[no-untyped-call]


def _unwatched(path: Path) -> None:
    time = np.arange(200) / 100
    recording = Recording(
        channels=(Channel(name="a", device="d", axis=0),), data=np.sin(time)[:, None], rate=100.0, start=0, gaps=()
    )
    write_recording(path, recording)


def _beginning(path: Path) -> None:
    path.write_bytes(LOG.read_bytes()[:300])


def _damaged(path: Path) -> None:
    data = bytearray(LOG.read_bytes())
    middle = len(data) // 2
    data[middle : middle + 2000] = bytes(2000)
    path.write_bytes(data)


BAD: dict[str, tuple[Callable[[Path], None], str]] = {
    "missing": (_nothing, "there is no such file or folder"),
    "empty folder": (Path.mkdir, "holds no log: expected *.mcap in it or in its folder log/"),
    "empty file": (Path.touch, "is not an MCAP log"),
    "text": (_text, "is not an MCAP log"),
    "somebody else's": (_foreign, "expected profile 'modalwatch', found 'ros2'"),
    "never watched": (_unwatched, "holds no results"),
    "cut before its first window": (_beginning, "holds no results"),
    "damaged amid": (_damaged, "is damaged before byte"),
}


@pytest.mark.parametrize("command", ["report", "view"])
@pytest.mark.parametrize("name", BAD)
def test_unusable_log_exits_2_and_error_names_it(command: str, name: str, modalwatch: Commands, tmp_path: Path) -> None:
    make, why = BAD[name]
    path = tmp_path / "run.mcap"
    make(path)
    assert_refused(modalwatch(command, path), f"error: {path}: ", why)
    assert not [p for p in tmp_path.rglob("*") if p.suffix in (".html", ".rrd", ".part")]


@pytest.mark.parametrize("command", ["report", "view"])
def test_truncated_log_is_shown_up_to_the_cut(command: str, modalwatch: Commands, tmp_path: Path) -> None:
    data = LOG.read_bytes()
    (tmp_path / "cut.mcap").write_bytes(data[: len(data) * 3 // 4])
    done = modalwatch(command, tmp_path / "cut.mcap", "--out", tmp_path / "shown")
    assert done.code == 0, done
    if command == "report":
        page = " ".join((tmp_path / "shown").read_text(encoding="utf-8").split())
        assert "The log has no end record" in page


@pytest.mark.parametrize("command", ["report", "view"])
def test_output_never_overwrites_the_log(command: str, modalwatch: Commands, tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    shutil.copy(LOG, path)
    assert_refused(modalwatch(command, path, "--out", path), "error: --out: ", f"{path} is the log itself")
    assert path.read_bytes() == LOG.read_bytes()


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (None, "cannot be read: No such file"),
        ("{", "is no diagnosis: Invalid JSON"),
        ('{"a": 1}', "is no diagnosis: verdict: Field required"),
    ],
)
def test_invalid_diagnosis_file_is_reported(text: str | None, why: str, modalwatch: Commands, tmp_path: Path) -> None:
    path = tmp_path / "diagnosis.json"
    if text is not None:
        path.write_text(text, encoding="utf-8")
    done = modalwatch("report", LOG, "-o", tmp_path / "page.html", "--diagnosis", path)
    assert_refused(done, f"error: {path}: {why}")
    assert not (tmp_path / "page.html").exists()


def test_unwritable_output_is_reported(modalwatch: Commands, tmp_path: Path) -> None:
    for path in (tmp_path / "none" / "run", tmp_path):
        for command in ("view", "report"):
            assert_refused(modalwatch(command, LOG, "--out", path), f"error: {path}: cannot be written: ")


@pytest.mark.parametrize("url", ["http://host", "rerun+http://:x/proxy", "rerun+http://h:99999/proxy"])
def test_an_address_without_host_or_port_is_refused(url: str, modalwatch: Commands) -> None:
    assert_refused(modalwatch("view", url), f"error: {url}: ")


def test_view_reports_an_unreachable_monitor(modalwatch: Commands) -> None:
    with socket.socket() as closed:
        closed.bind(("127.0.0.1", 0))  # bound, yet nobody listens
        url = f"rerun+http://127.0.0.1:{closed.getsockname()[1]}/proxy"
        assert_refused(modalwatch("view", url), f"error: {url}: nothing answers there")


def test_view_opens_the_address_of_a_running_server(modalwatch: Commands) -> None:
    with socket.socket() as first:
        first.bind(("127.0.0.1", 0))
        first.listen()
        url = f"rerun+http://127.0.0.1:{first.getsockname()[1]}/proxy"
        done = modalwatch("view", url)
    assert done.code == 0, done
    assert done.out.strip().endswith(url)
