"""Shared fixtures of the tests of the command line, and the order in which files are run."""

import gc
from pathlib import Path

import pytest

from tests.support.monitor.cli import Commands

_LONG = (
    "test_hidden_mass.py",
    "diagnosis/test_diagnosis.py",
    "examined/test_modes.py",
    "test_csv_diagnosis.py",
    "examined/test_records.py",
    "test_report.py",
    "oma/test_identification.py",
    "test_replay_data.py",
    "test_no_mass_claimed.py",
    "test_one_mass.py",
    "test_restart.py",
)


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin long files first, else in random order: none of them is waited for at the end, with processors idle."""
    items.sort(key=lambda item: not item.path.as_posix().endswith(_LONG))


def pytest_configure() -> None:
    """Collect no garbage while tests are imported: nearly all of it stays."""
    gc.disable()


def pytest_collection_finish() -> None:
    """Leave what was imported out of the collection of garbage, which was a seventh of the time of the tests."""
    gc.freeze()
    gc.enable()
    gc.set_threshold(50_000, 20, 20)


_EMPTY_PICTURE = '<svg xmlns="http://www.w3.org/2000/svg" width="9" height="9"><defs></defs></svg>'


@pytest.fixture
def modalwatch(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Commands:
    return Commands(monkeypatch, capsys)


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave pictures empty, each of which takes a tenth of a second: for tests of other outputs."""
    monkeypatch.setattr("monitor.views.report.svg.svg", lambda _: _EMPTY_PICTURE)
    monkeypatch.setattr("matplotlib.figure.Figure.savefig", lambda _, path, **__: Path(path).touch())
