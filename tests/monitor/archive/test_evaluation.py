"""Evaluation of logs in workers: chained per site, alike in any worker, and none stops another."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from distributed import Client

from daq import read_attachments
from monitor.archive import evaluation, reanalyse, steps_key
from monitor.archive.catalog import ArchiveLog, LogPiece
from monitor.archive.evaluation import EvaluatedLog, WatchState, evaluate_log
from monitor.archive.log_texts import LogTexts, site_name
from monitor.archive.reanalysis import AnalysedLog
from monitor.archive.steps import LogSteps, identify_log, write_steps
from monitor.results.windows import is_result
from monitor.settings import parse_attached
from monitor.watch.memory import parse_memory

RECORDED = Path(__file__).parents[3] / "replay_data" / "t_frame_added_mass.mcap"
SITE = "T-shaped steel frame"
SITES = {"a": SITE, "b": "other"}  # folders


def log_of(site: str, number: int) -> LogPiece:
    return LogPiece(log=Path(f"{site}{number}.mcap"), size=1, key=f"{site}{number}")


@pytest.fixture(scope="module")
def texts() -> LogTexts:
    attached = read_attachments(RECORDED)
    return LogTexts(site=attached["site.toml"], structure=attached["structure.toml"])


def first_steps(texts: LogTexts, folder: Path, n_bytes: int) -> LogSteps:
    """Return the steps of the first part of the recorded log."""
    path = folder / "cut.mcap"
    path.write_bytes(RECORDED.read_bytes()[:n_bytes])
    return identify_log(path, parse_attached(texts.site))


@pytest.fixture(autouse=True)
def _new_worker() -> Iterator[None]:
    forget()
    yield
    forget()


def forget() -> None:
    """Make this process like a worker that has evaluated nothing yet."""
    evaluation._pipelines = evaluation._Pipelines()


def chain(texts: LogTexts, steps: LogSteps, *, same_worker: bool) -> list[EvaluatedLog]:
    """Evaluate two logs, the second from the state at the end of the first."""
    first = evaluate_log(log_of("a", 1), texts, WatchState(), steps)
    if not same_worker:
        forget()
    return [first, evaluate_log(log_of("a", 2), texts, first.state, steps)]


@pytest.mark.parametrize(
    ("name", "folder"),
    [
        ("..", "unnamed-5ec1f7"),
        (".", "unnamed-cdb4ee"),
        ("../../etc", "_.._etc-74ccf3"),
        ("Brücke v1.2", "Brücke v1.2"),
        ("Brücke_v1.2", "Brücke_v1.2"),
    ],
)
def test_results_of_a_site_stay_in_a_folder_of_their_own(name: str, folder: str) -> None:
    """The name is part of an archived log, whoever wrote it."""
    settings = read_attachments(RECORDED)["site.toml"] + f'\n[history]\nsite = "{name}"\n'
    assert site_name(LogTexts(site=settings, structure="")) == folder


def test_next_log_is_evaluated_alike_by_any_worker(texts: LogTexts, tmp_path: Path) -> None:
    """To the last bit: from a pipeline that was kept, and from the saved state with its baseline."""
    site = texts.site.replace("baseline_windows = 8", "baseline_windows = 5")
    texts = LogTexts(site=site, structure=texts.structure)
    steps = first_steps(texts, tmp_path, 2_400_000)
    kept, restored = (chain(texts, steps, same_worker=same) for same in (True, False))
    assert kept == restored
    first, second = kept
    assert second.alarms[0].kind == "resumed"
    assert second.state != first.state
    assert sum(map(is_result, second.events)) > steps.n_windows
    assert any(not is_result(event) for event in second.events)


@pytest.mark.thorough
def test_alarm_continues_alike_in_any_worker(texts: LogTexts) -> None:
    whole = identify_log(RECORDED, parse_attached(texts.site))
    kept, restored = (chain(texts, whole, same_worker=same) for same in (True, False))
    assert kept == restored
    first, second = kept
    assert [alarm.state for alarm in first.alarms][-1] == "alarm"
    assert (second.alarms[0].kind, second.alarms[0].state) == ("resumed", "alarm")


def test_failed_evaluation_stops_no_other_log_or_site(
    texts: LogTexts, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its site continues from the state before; sites do not depend on one another."""
    other = LogTexts(site=texts.site, structure=texts.structure.replace(f'"{SITE}"', '"other"'))
    logs = [(log_of(site, k), own) for k in range(3) for site, own in (("a", texts), ("b", other))]
    steps = first_steps(texts, tmp_path, 1_200_000)
    (tmp_path / "steps").mkdir()
    for log, own in logs:
        write_steps(tmp_path / "steps" / steps_key(log, own), steps)

    def failing(log: LogPiece, own: LogTexts, state: WatchState, found: LogSteps, *, continued: bool) -> EvaluatedLog:
        if log.key == "a1":
            raise RuntimeError("out of order")
        return evaluate_log(log, own, state, found, continued=continued)

    monkeypatch.setattr(evaluation, "evaluate_log", failing)
    done: list[AnalysedLog] = []
    with Client(n_workers=2, threads_per_worker=1, processes=False, dashboard_address="127.0.0.1:0") as client:
        reanalyse(client, [(ArchiveLog((log,)), own) for log, own in logs], tmp_path, done.append)
    assert {(log.log.key, log.problem) for log in done} == {
        *((f"{site}{k}", None) for site in "ab" for k in range(3) if (site, k) != ("a", 1)),
        ("a1", "RuntimeError: out of order"),
    }
    assert [log.log.key for log in done if log.log.key[0] == "b"] == ["b0", "b1", "b2"]
    states = {site: (tmp_path / "sites" / name / "memory.json").read_text() for site, name in SITES.items()}
    assert states["a"] == chain(texts, steps, same_worker=False)[1].state.memory
    assert parse_memory(states["b"]).n_windows == 3 * steps.n_windows == 9
