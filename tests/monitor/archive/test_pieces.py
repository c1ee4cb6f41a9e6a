"""A long run, divided into pieces of whole files: identified in parallel, continued when it grows, evaluated as one."""

import asyncio
import hashlib
import json
import pickletools
import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
import zstandard
from distributed import Client, get_worker

from daq import Block, Event, Flag, Item, Recording, read_attachments, read_log
from daq.events import DeviceFailed
from daq.log import PartedLog, as_logs
from monitor.analysis.window import IdentifiedWindow, RecordedWindow
from monitor.archive import (
    AnalysedLog,
    LogTexts,
    catalog,
    evaluation,
    find_logs,
    reanalyse,
    steps,
    steps_key,
    tasks,
    texts_of,
)
from monitor.archive.evaluation import WatchState, evaluate_log
from monitor.archive.run_state import PieceStart, RunState, TimeLimit, advance, code_files, read_start, write_start
from monitor.archive.steps import Packer, Step, identify_log, unpacked
from monitor.results.windows import AlarmResult, event_result
from monitor.service.replay import replay
from monitor.settings import Settings, parse_attached
from monitor.watch.pipeline import assembler_of
from tests.support.monitor.recorded_runs import write_items, write_run
from tests.support.thorough import few_of

RECORDED = Path(__file__).parents[3] / "replay_data" / "t_frame_added_mass.mcap"
SECOND = 10**9  # ns
_SHORT = 700  # items: 51 s
_SHORTEST = 200  # items: 15 s
LOST = "beam_left"  # device


@pytest.fixture(scope="module")
def attached() -> dict[str, str]:
    found = read_attachments(RECORDED)
    return found | {"site.toml": found["site.toml"].replace("baseline_windows = 8", "baseline_windows = 5")}


@pytest.fixture(scope="module")
def settings(attached: dict[str, str]) -> Settings:
    return parse_attached(attached["site.toml"])


@pytest.fixture(scope="module")
def items() -> list[Item]:
    """Return the recorded log with a gap of one device, another one lost and started again, and a pause of all."""
    recorded = [item for item in read_log(RECORDED) if not (isinstance(item, Event) and event_result(item))]
    start = min(item.arrival_time for item in recorded if isinstance(item, Block))
    return list(_disturbed(recorded, start))


def _disturbed(recorded: Sequence[Item], start: int) -> Iterator[Item]:
    origin = None
    for item in recorded:
        if isinstance(item, Event):
            yield item
            continue
        time = (item.arrival_time - start) / SECOND
        if (item.device == "col_037" and 31 < time < 38) or 100 < time < 104:
            continue
        if item.device == LOST and time > 60:
            if time < 85:
                if origin is None:
                    yield DeviceFailed(device=LOST).event(item.arrival_time)
                    origin = item.end_index
                continue
            flags = item.flags | (Flag.RESTARTED if origin is not None and origin >= 0 else Flag.NONE)
            shift, origin = 20_000, -1
            yield replace(
                item, first_index=item.first_index - shift, arrival_index=item.arrival_index - shift, flags=flags
            )
            continue
        yield item


def hashed(recording: Recording, band: tuple[float, float] | None) -> IdentifiedWindow:
    """Return a window with the hash of all its samples in place of modes."""
    content = recording.data.tobytes() + repr((recording.gaps, recording.rate, band)).encode()
    problem = hashlib.sha256(content).hexdigest()
    return IdentifiedWindow(recorded=RecordedWindow.of(recording), modes=None, problem=problem)


def plain(found: Sequence[Step]) -> list[str]:
    return [repr((step.recorded, step.problem) if isinstance(step, IdentifiedWindow) else step) for step in found]


@pytest.mark.thorough
@pytest.mark.parametrize(("seconds", "n_bytes"), [(4.0, 1), (11.0, 1), (30.0, 1), (4.0, 600_000)])
def test_pieces_have_the_windows_of_the_whole_run(
    seconds: float,
    n_bytes: int,
    items: list[Item],
    attached: dict[str, str],
    settings: Settings,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """To the last bit of the samples; files shorter and longer than a window of 15 s."""
    monkeypatch.setattr(catalog, "PIECE_BYTES", n_bytes)
    monkeypatch.setattr(steps, "identify_window", hashed)
    write_run(tmp_path / "log", items, attached, seconds).close()
    [whole] = as_logs([tmp_path / "log"])
    expected = list(unpacked(identify_log(whole, settings).packed))
    assert sum(isinstance(step, IdentifiedWindow) for step in expected) == 13
    [log] = find_logs([str(tmp_path)])
    assert len(log.pieces) > 4
    found: list[Step] = []
    start, files = PieceStart(), list(log.files)
    for piece in log.pieces:
        before = files[: files.index(piece.files[0])]
        lead = before[len(before) - start.n_files :]
        found += unpacked(identify_log(piece.log, settings, start=start, lead=lead).packed)
        start = advance(piece.log, settings, start, TimeLimit())
        assert start.n_files * seconds < 60 + seconds  # a window that is open while a device is lost
    assert plain(found) == plain(expected)


@pytest.mark.thorough
@pytest.mark.timeout(600)
@pytest.mark.parametrize("same_worker", [False, True])
def test_evaluation_in_pieces_is_that_of_the_whole_log(
    same_worker: bool, attached: dict[str, str], settings: Settings, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With baseline, alarm and diagnoses; each piece has one window, and begins in a worker of its own or the same."""
    texts = LogTexts(site=attached["site.toml"], structure=attached["structure.toml"])
    whole = identify_log(RECORDED, settings)
    monkeypatch.setattr(evaluation, "_pipelines", evaluation._Pipelines())
    piece = catalog.LogPiece(log=RECORDED, size=1, key="whole")
    expected = evaluate_log(piece, texts, WatchState(), whole)
    state, events = WatchState(), list[Event]()
    alarms: list[AlarmResult] = []
    for k, part in enumerate(_parts(list(unpacked(whole.packed)))):
        if not same_worker:
            monkeypatch.setattr(evaluation, "_pipelines", evaluation._Pipelines())
        packer = Packer()
        for step in part:
            packer.add(steps._encoded(step))
        some = replace(whole, packed=packer.finish())
        found = evaluate_log(piece, texts, state, some, continued=k > 0)
        state = found.state
        events += list(found.events)
        alarms += found.alarms
    assert texts_of_events(events) == texts_of_events(expected.events)
    assert tuple(alarms) == expected.alarms
    assert state == expected.state
    assert [alarm.state for alarm in alarms][-1] == "alarm"


def texts_of_events(events: Iterable[Event]) -> list[str]:
    return [json.dumps([event.topic, event.time, event.payload]) for event in events]


def _parts(whole: list[Step]) -> Iterator[list[Step]]:
    part: list[Step] = []
    for step in whole:
        part.append(step)
        if isinstance(step, IdentifiedWindow):
            yield part
            part = []
    yield part


class Archive:
    """A folder of logs that is reanalysed on a cluster."""

    def __init__(self, client: Client, logs: Path, out: Path) -> None:
        self._client, self._logs, self._out = client, logs, out

    def reanalyse(self) -> list[AnalysedLog]:
        done: list[AnalysedLog] = []
        logs = find_logs([str(self._logs)])
        reanalyse(self._client, [(log, texts_of(log, None)) for log in logs], self._out, done.append)
        return done

    @property
    def windows(self) -> pd.DataFrame:
        """Rows of the table of windows, in order."""
        return pd.read_parquet(self._out / "windows").sort_values("window").drop(columns="log").reset_index(drop=True)

    @property
    def results(self) -> list[str]:
        """Events and results in the log of the site."""
        [path] = (self._out / "sites").glob("*/results.mcap")
        return texts_of_events(item for item in read_log(path) if isinstance(item, Event))

    @property
    def n_states(self) -> int:
        return len(list((self._out / "states").iterdir()))


@contextmanager
def workers() -> Iterator[Client]:
    """Yield a cluster of two threads."""
    with Client(n_workers=2, threads_per_worker=1, processes=False, dashboard_address="127.0.0.1:0") as found:
        yield found


@pytest.fixture(scope="module")
def client() -> Iterator[Client]:
    """Yield a cluster of two threads."""
    with workers() as found:
        yield found


@pytest.fixture
def one_file_each(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make each file a piece, and identification fast."""
    monkeypatch.setattr(catalog, "PIECE_BYTES", 1)
    monkeypatch.setattr(steps, "identify_window", hashed)


@pytest.mark.usefixtures("one_file_each")
def test_run_that_has_grown_is_continued(
    client: Client,
    items: list[Item],
    attached: dict[str, str],
    settings: Settings,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Only new files are identified; no old one is read beyond those with the scans of the open window."""
    monkeypatch.setattr(catalog, "PIECE_BYTES", 200_000)
    advanced: list[str] = []

    def counted(log: Any, settings: Settings, start: PieceStart, limit: TimeLimit) -> PieceStart:
        advanced.append(str(log))
        return advance(log, settings, start, limit)

    monkeypatch.setattr(tasks, "advance", counted)
    archive = Archive(client, tmp_path / "log", tmp_path / "out")
    items = items[:_SHORT]
    n = int(len(items) * 0.7)
    writer = write_run(tmp_path / "log", items[:n], attached, 7.0)
    writer.flush()
    first = archive.reanalyse()
    assert len(first) > 2
    assert not any(piece.kept for piece in first)
    assert 0 < archive.n_states <= 2
    write_items(writer, items[n:])
    writer.close()
    advanced.clear()
    second = archive.reanalyse()
    assert len(second) > len(first)
    assert [piece.kept for piece in second] == [k < len(first) - 1 for k in range(len(second))]
    assert len(advanced) <= len(second) - len(first) + 1
    assert 0 < archive.n_states <= 2
    [run] = as_logs([tmp_path / "log"])
    expected = [step for step in unpacked(identify_log(run, settings).packed) if isinstance(step, IdentifiedWindow)]
    found = archive.windows
    assert found.problem.tolist() == [step.problem for step in expected]
    assert found.start.astype("int64").tolist() == [step.recorded.start for step in expected]
    assert len(expected) == 3


@pytest.mark.usefixtures("one_file_each")
@pytest.mark.parametrize("task", few_of(["identify_window", "advance", "evaluate_log"]))
def test_worker_that_is_lost_in_a_piece_costs_nothing(
    task: str,
    client: Client,
    items: list[Item],
    attached: dict[str, str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """One of two workers ends in the middle of a task of each kind: windows and log of results are those without."""
    write_run(tmp_path / "log", items[: 2 * _SHORTEST], attached, 7.0).close()
    expected = Archive(client, tmp_path / "log", tmp_path / "whole")
    assert len(expected.reanalyse()) > 3
    lost: list[str] = []
    module = {"identify_window": steps, "advance": tasks, "evaluate_log": evaluation}[task]
    function = getattr(module, task)
    with workers() as disturbed:
        scheduler = disturbed.cluster.scheduler

        def losing(*given: Any, **more: Any) -> Any:
            if not lost:
                lost.append(get_worker().address)
                gone = scheduler.remove_worker(lost[0], stimulus_id="lost")
                asyncio.run_coroutine_threadsafe(gone, disturbed.loop.asyncio_loop).result(60)
            return function(*given, **more)

        monkeypatch.setattr(module, task, losing)
        found = Archive(disturbed, tmp_path / "log", tmp_path / "out")
        assert not any(piece.problem for piece in found.reanalyse())
        assert lost[0] not in disturbed.scheduler_info()["workers"]
    assert len(lost) == 1
    pd.testing.assert_frame_equal(found.windows, expected.windows)
    assert found.results == expected.results


@pytest.mark.usefixtures("one_file_each")
def test_state_behind_the_only_complete_piece_is_kept(
    client: Client, items: list[Item], attached: dict[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    writer = write_run(tmp_path / "log", items[:_SHORTEST], attached, 5.0)
    writer.close()
    monkeypatch.setattr(catalog, "PIECE_BYTES", sum(path.stat().st_size for path in writer.paths[:-1]))
    archive = Archive(client, tmp_path / "log", tmp_path / "out")
    assert len(archive.reanalyse()) == 2
    assert archive.n_states == 1


@pytest.mark.usefixtures("one_file_each")
def test_steps_of_deleted_files_are_removed(
    client: Client, items: list[Item], attached: dict[str, str], tmp_path: Path
) -> None:
    """When the oldest file of a run is deleted; those of other runs and of the same pieces with other settings stay."""
    writer = write_run(tmp_path / "log", items[:_SHORTEST], attached, 5.0)
    writer.close()
    out = tmp_path / "out"
    archive = Archive(client, tmp_path / "log", out)
    archive.reanalyse()
    before = names(out)
    writer.paths[0].unlink()
    [log] = find_logs([str(tmp_path / "log")])
    texts = texts_of(log, None)
    assert isinstance(texts, LogTexts)
    other_run = steps_key(log.pieces[0], replace(texts, run="0" * 16))
    shorter = replace(texts, site=texts.site.replace("window_seconds = 15.0", "window_seconds = 14.0"))
    other_settings = steps_key(log.pieces[0], shorter)
    assert other_settings != steps_key(log.pieces[0], texts)
    for name in (other_run, other_settings):
        (out / "steps" / name).touch()
    done = archive.reanalyse()
    assert not any(piece.kept for piece in done)
    after = names(out)
    assert not after & before
    assert {name for name in after if name.startswith("steps")} == {
        f"steps/{name}" for name in (other_run, other_settings, *(steps_key(each, texts) for each in log.pieces))
    }
    assert all(piece.kept for piece in archive.reanalyse())


def names(out: Path) -> set[str]:
    return {path.relative_to(out).as_posix() for name in ("steps", "states") for path in (out / name).iterdir()}


@pytest.mark.usefixtures("one_file_each")
def test_damage_before_a_piece_costs_no_window_of_it(
    items: list[Item], attached: dict[str, str], settings: Settings, tmp_path: Path
) -> None:
    """The file before it is damaged after the advance; if it cannot be read, the next run tries again."""
    writer = write_run(tmp_path / "log", items[: 2 * _SHORTEST], attached, 7.0)
    writer.close()
    lead, rest = writer.paths[0], writer.paths[1:]
    start = advance(lead, settings, PieceStart(), TimeLimit())
    assert start.n_files == 1
    damage(lead)
    piece = PartedLog(tuple(rest))
    found = identify_log(piece, settings, start=start, lead=[lead])
    assert (found.n_windows, found.problem) == (1, None)
    lead.unlink()
    found = identify_log(piece, settings, start=start, lead=[lead])
    assert (found.n_windows, found.retry) == (0, True)


def damage(path: Path) -> None:
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 255
    path.write_bytes(content)


@pytest.mark.usefixtures("one_file_each")
def test_limit_of_time_bounds_the_advance(
    items: list[Item], attached: dict[str, str], settings: Settings, tmp_path: Path
) -> None:
    """The reason is returned, and no state that begins anew as after damage."""
    writer = write_run(tmp_path / "log", items[:_SHORTEST], attached, 60.0)
    writer.close()
    [log] = find_logs([str(tmp_path)])
    found = tasks.advance_task(log.pieces[0], attached["site.toml"], 1e-9, PieceStart())
    assert found == f"{log.name}: was not analysed within 1e-09 s: the rest is left out"
    assert isinstance(tasks.advance_task(log.pieces[0], attached["site.toml"], 60.0, PieceStart()), PieceStart)


def test_state_that_cannot_be_unpacked_is_no_state(tmp_path: Path) -> None:
    """As after an update of a library: the file is whole, but its objects are not known."""
    path = tmp_path / "state"
    write_start(path, PieceStart(after_damage=True))
    assert read_start(path) == PieceStart(after_damage=True)
    write_start(path, PieceStart(state=zstandard.compress(b"cnumpy.absent\narray\n.")))
    assert read_start(path) is None
    write_start(path, PieceStart(state=b"not compressed"))
    assert read_start(path) is None


def test_state_belongs_to_the_code_of_all_its_classes(settings: Settings) -> None:
    """Modules of this program in a packed state: their content is part of the head of its file."""
    state = zstandard.decompress(RunState(assembler=assembler_of(settings)).pack())
    names = {arg.split(" ")[0] for _, arg, _ in pickletools.genops(state) if isinstance(arg, str)}
    modules = {sys.modules[name] for name in names if name.startswith(("daq.", "monitor.")) and name in sys.modules}
    assert {module.__name__ for module in modules} >= {"daq.types", "daq.timing.resampling"}
    assert {Path(str(module.__file__)) for module in modules} <= set(code_files())


@pytest.mark.thorough
@pytest.mark.usefixtures("one_file_each")
def test_damaged_file_costs_the_windows_up_to_the_next_piece(
    client: Client, items: list[Item], attached: dict[str, str], tmp_path: Path
) -> None:
    """The damage is stated; the next piece begins as a log does, while one device is absent."""
    archive = Archive(client, tmp_path / "log", tmp_path / "out")
    writer = write_run(tmp_path / "log", items, attached, 9.0)
    writer.close()
    intact = find_logs([str(tmp_path / "log")])[0]
    damaged = next(k for k, path in enumerate(writer.paths) if _holds(path, DeviceFailed.topic))
    damage(writer.paths[damaged])
    found = archive.reanalyse()
    problems = {k: piece.problem for k, piece in enumerate(found) if piece.problem}
    assert problems.keys() == {damaged}
    assert "is damaged before byte" in str(problems[damaged])
    assert len(found) == len(intact.pieces)
    begins = archive.windows.start.astype("int64")
    assert 10 <= len(begins) <= 13
    assert 15e9 < begins.diff().max() < 45e9
    assert archive.reanalyse()[-1].kept


def _holds(path: Path, topic: str) -> bool:
    return any(isinstance(item, Event) and item.topic == topic for item in read_log(path))


@pytest.mark.thorough
@pytest.mark.timeout(300)
def test_results_of_pieces_are_those_of_a_replay(
    client: Client, items: list[Item], attached: dict[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All results of a run with a baseline and an alarm, identified and evaluated piece by piece."""
    monkeypatch.setattr(catalog, "PIECE_BYTES", 1)
    write_run(tmp_path / "log", items, attached, 20.0).close()
    [log] = as_logs([tmp_path / "log"])
    report = replay(log, None, lambda _: None)
    done = Archive(client, tmp_path / "log", tmp_path / "out").reanalyse()
    assert len(done) > 5
    [results] = (tmp_path / "out" / "sites").glob("*/results.mcap")
    found = [result for item in read_log(results) if isinstance(item, Event) and (result := event_result(item))]
    assert [result.payload() for result in found] == [result.payload() for result in report.found]
    assert len(found) > 15
