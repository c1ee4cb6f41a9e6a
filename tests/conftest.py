"""Shared fixtures of the tests of the command line, and the order in which files are run."""

import gc
from pathlib import Path

import pytest

from tests.support.monitor.cli import Commands

_LONG = (
    "contracts/test_fuzzed_readers.py",
    "test_breathing_crack.py",
    "test_rig_crack.py",
    "test_small_crack.py",
    "test_rigid_file.py",
    "live/test_innovations.py",
    "test_amplitude_dependence.py",
    "test_further_measurements.py",
    "reference/test_section_orientation.py",
    "data/test_structure.py",
    "test_report.py",
    "watch/test_acceptance.py",
    "watch/test_memory.py",
    "examples/test_notebooks.py",
    "oma/test_identification.py",
    "test_replay_data.py",
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
