"""Commands as a user types them: exit codes and one-line errors."""

import subprocess
import sys
from pathlib import Path

import pytest

MODALWATCH = [sys.executable, "-c", "from monitor.cli.main import main; main()"]


def modalwatch(*arguments: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run([*MODALWATCH, *map(str, arguments)], capture_output=True, text=True, timeout=60, check=False)


def test_help_lists_the_commands() -> None:
    done = modalwatch("--help")
    assert done.returncode == 0
    assert all(name in done.stdout for name in ("demo", "rig", "run", "replay"))


@pytest.mark.parametrize(
    "arguments", [("replay",), ("nonsense",), ("demo", "--speed", "1000")], ids=["missing", "unknown", "range"]
)
def test_wrong_arguments_exit_2(arguments: tuple[str, ...]) -> None:
    done = modalwatch(*arguments)
    assert done.returncode == 2
    assert "Traceback" not in done.stderr


def test_bad_input_exits_2_with_one_line_that_names_the_file(tmp_path: Path) -> None:
    (tmp_path / "log.mcap").write_bytes(b"not a log")
    (tmp_path / "site.toml").write_text("structure = 1\n", encoding="utf-8")
    for command, name in (("replay", "none.mcap"), ("replay", "log.mcap"), ("run", "site.toml"), ("rig", "none.toml")):
        done = modalwatch(command, tmp_path / name)
        assert done.returncode == 2, done.stderr
        assert done.stderr.startswith(f"error: {tmp_path / name}: ")
        assert done.stderr.count("\n") == 1


def test_a_device_that_does_not_answer_exits_3(tmp_path: Path) -> None:
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
    assert done.returncode == 3, done.stderr
    assert "beam_left" in done.stderr
    assert "no-such-port" in done.stderr
    assert "Traceback" not in done.stderr
