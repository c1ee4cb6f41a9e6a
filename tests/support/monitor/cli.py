"""Commands run inside the test's own process: as a user types them, without the half second of a new one."""

import sys
from dataclasses import dataclass

import pytest

from monitor.cli.main import main
from monitor.cli.terminal import console


@dataclass(frozen=True)
class Done:
    code: int
    out: str  # without line breaks that a narrow terminal would put in
    err: str


class Commands:
    """Runs `modalwatch` commands."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
        self._monkeypatch, self._capsys = monkeypatch, capsys
        monkeypatch.setenv("COLUMNS", "200")
        monkeypatch.setattr(console, "width", 200)  # it may have been made before

    def __call__(self, *arguments: object) -> Done:
        self._monkeypatch.setattr(console, "stderr", False)
        self._monkeypatch.setattr(sys, "argv", ["modalwatch", *map(str, arguments)])
        with pytest.raises(SystemExit) as end:
            main()
        reported = self._capsys.readouterr()
        return Done(int(end.value.code or 0), reported.out, reported.err)


def assert_refused(done: Done, *reported: object) -> None:
    """Assert exit code 2 and one line of error with all these texts."""
    assert done.code == 2, done
    assert done.err.startswith("error: "), done
    assert done.err.count("\n") == 1, done
    for text in reported:
        assert str(text) in done.err, done
