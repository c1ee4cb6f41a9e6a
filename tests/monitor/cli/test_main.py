"""Commands as a user types them: exit codes and one-line errors."""

import os
import pty
import subprocess
import sys
import tomllib
from contextlib import suppress
from pathlib import Path

import pytest

from monitor.cli.lines import echo_error
from tests.support.monitor.cli import Commands, assert_refused

MODALWATCH = [sys.executable, "-c", "from monitor.cli.main import main; main()"]


def as_process(*arguments: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run([*MODALWATCH, *map(str, arguments)], capture_output=True, text=True, timeout=60, check=False)


def test_help_lists_the_commands() -> None:
    done = as_process("--help")
    assert done.returncode == 0
    assert all(name in done.stdout for name in ("demo", "rig", "run", "replay"))


def test_version_equals_the_package_version(modalwatch: Commands) -> None:
    text = (Path(__file__).parents[3] / "pyproject.toml").read_text(encoding="utf-8")
    done = modalwatch("--version")
    assert (done.code, done.out.strip()) == (0, f"modalwatch {tomllib.loads(text)['project']['version']}")


@pytest.mark.parametrize(
    "arguments", [("replay",), ("nonsense",), ("demo", "--speed", "1000")], ids=["missing", "unknown", "range"]
)
def test_wrong_arguments_exit_2(modalwatch: Commands, arguments: tuple[str, ...]) -> None:
    assert modalwatch(*arguments).code == 2


@pytest.mark.parametrize(
    ("command", "name"), [("replay", "none.mcap"), ("replay", "log.mcap"), ("run", "site.toml"), ("rig", "none.toml")]
)
def test_bad_input_exits_2_and_error_names_the_file(
    tmp_path: Path, modalwatch: Commands, command: str, name: str
) -> None:
    (tmp_path / "log.mcap").write_bytes(b"not a log")
    (tmp_path / "site.toml").write_text("structure = 1\n", encoding="utf-8")
    assert_refused(modalwatch(command, tmp_path / name), f"error: {tmp_path / name}: ")


def test_error_is_divided_between_words_in_a_terminal_only(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    text = "error: logs/tower-2.mcap: expected a log, found a table of accelerations, see modalwatch import --help"
    echo_error(text)
    assert capsys.readouterr().err == f"{text}\n"
    master, slave = pty.openpty()
    with os.fdopen(master, "rb") as screen, os.fdopen(slave, "w") as terminal:
        monkeypatch.setattr(sys, "stderr", terminal)
        monkeypatch.setenv("COLUMNS", "40")
        echo_error(text)
        lines = screen.read1(1000).decode().splitlines()
    assert len(lines) > 1
    assert max(map(len, lines)) <= 40
    assert " ".join(lines) == text


def test_errors_and_settings_without_standard_streams() -> None:
    """A service may have none: the exit code is the same."""
    for arguments, code in (("log info /nonexistent.mcap 2>&-", 2), ("settings >&-", 0)):
        command = f"exec \"$0\" -c 'from monitor.cli.main import main; main()' {arguments}"
        done = subprocess.run(["sh", "-c", command, sys.executable], timeout=60, check=False, stdin=subprocess.DEVNULL)
        assert done.returncode == code, arguments


def test_settings_can_be_copied_from_a_terminal() -> None:
    pid, screen = pty.fork()
    if not pid:
        os.execvpe(MODALWATCH[0], [*MODALWATCH, "settings"], {**os.environ, "COLUMNS": "80"})
    shown = b""
    with suppress(OSError):  # the terminal ends with the process
        while part := os.read(screen, 65536):
            shown += part
    os.close(screen)
    assert os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) == 0
    assert "device" in tomllib.loads(shown.decode().replace("\r\n", "\n"))


def test_run_exits_3_if_a_device_does_not_respond(tmp_path: Path, modalwatch: Commands) -> None:
    from updater import t_structure_toml

    (tmp_path / "t_structure.toml").write_text(t_structure_toml(), encoding="utf-8")
    site = f"""structure = "t_structure.toml"
[[device]]
name = "beam_left"
driver = "epson-uart"
port = "{tmp_path}/no-such-port"
channels = {{y = "beam_left_y"}}
"""
    (tmp_path / "site.toml").write_text(site, encoding="utf-8")
    done = modalwatch("run", tmp_path / "site.toml")
    assert done.code == 3, done
    assert "beam_left" in done.err
    assert "no-such-port" in done.err
