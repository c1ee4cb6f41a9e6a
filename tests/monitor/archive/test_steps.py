"""Windows identified in advance give the same results as the blocks of their log."""

from pathlib import Path
from typing import Any

import pytest

from daq import Event, read_attachments, read_log
from monitor.archive.steps import Step, identify_log, unpacked
from monitor.results.windows import event_result
from monitor.settings import parse_attached
from monitor.watch.pipeline import Pipeline
from updater import parse_structure

RECORDED = Path(__file__).parents[3] / "replay_data" / "t_frame_added_mass.mcap"


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the first part of the recorded log: six windows and some more, cut amid a chunk."""
    path = tmp_path_factory.mktemp("archive") / "cut.mcap"
    path.write_bytes(RECORDED.read_bytes()[:2_400_000])
    return path


def sooner(site: str) -> str:
    """Return the settings with a baseline of five windows, not eight."""
    assert site.count("baseline_windows = 8") == 1
    return site.replace("baseline_windows = 8", "baseline_windows = 5")


def test_results_from_steps_equal_results_from_blocks(log: Path) -> None:
    """To the last digit, through the packed bytes; the baseline is learned, and windows are evaluated after it."""
    attached = read_attachments(log)
    structure, settings = parse_structure(attached["structure.toml"]), parse_attached(sooner(attached["site.toml"]))
    direct, later = Pipeline(structure, settings), Pipeline(structure, settings)
    expected = [
        result.payload()
        for item in read_log(log)
        if not (isinstance(item, Event) and event_result(item))
        for result in direct.push(item)
    ]
    steps = identify_log(log, settings)
    found = _results(later, list(unpacked(steps.packed)))
    assert found == expected
    assert steps.n_windows == len([payload for payload in found if "phase" in payload]) > 5
    assert {payload["phase"] for payload in found if "phase" in payload} == {"learning", "watching"}
    assert steps.problem is None


def test_log_beyond_the_time_limit_is_cut_and_not_kept(log: Path) -> None:
    settings = parse_attached(read_attachments(log)["site.toml"])
    steps = identify_log(log, settings, limit=0.02)
    assert steps.retry
    assert steps.n_windows < 8
    assert steps.problem is not None
    assert "was not analysed within 0.02 s: the rest is left out" in steps.problem
    assert len(list(unpacked(steps.packed))) >= steps.n_windows


def _results(pipeline: Pipeline, steps: list[Step]) -> list[dict[str, Any]]:
    return [
        result.payload()
        for step in steps
        for result in (pipeline.resume(step) if isinstance(step, int) else pipeline.push_identified(step))
    ]


def test_log_that_cannot_be_read_is_not_kept(log: Path, tmp_path: Path) -> None:
    """A storage may respond again later; a file that is damaged stays damaged."""
    settings = parse_attached(read_attachments(log)["site.toml"])
    (tmp_path / "damaged.mcap").write_bytes(b"not a log")
    gone, damaged = (identify_log(tmp_path / f"{name}.mcap", settings) for name in ("gone", "damaged"))
    assert gone.problem is not None
    assert damaged.problem is not None
    assert (gone.retry, damaged.retry) == (True, False)
