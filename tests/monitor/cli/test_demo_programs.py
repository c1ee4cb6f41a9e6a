"""Commands that the demo prints at its end can be pasted, wherever the package is installed."""

import sys
from pathlib import Path

import pytest

from monitor.cli.demo.score import program_path


@pytest.fixture
def program(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a program in the folder of the interpreter, which is not on the path."""
    path = tmp_path / ".venv" / "bin" / "rerun"
    path.parent.mkdir(parents=True)
    path.touch(mode=0o755)
    monkeypatch.setattr(sys, "executable", str(path.parent / "python"))
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    return path


def test_program_below_the_working_folder_has_its_relative_path(program: Path) -> None:
    assert program_path(program.name) == ".venv/bin/rerun"


def test_program_elsewhere_has_its_whole_path(program: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir("/")
    assert Path("/", program_path(program.name)) == program


def test_program_on_the_path_has_its_name(program: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(program.parent))
    assert program_path(program.name) == "rerun"


@pytest.mark.usefixtures("program")
def test_program_that_is_not_installed_has_its_name() -> None:
    assert program_path("modalwatch") == "modalwatch"
