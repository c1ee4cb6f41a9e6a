"""What tests of the command line share."""

import pytest
from cli_helpers import Commands


@pytest.fixture
def modalwatch(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Commands:
    return Commands(monkeypatch, capsys)
