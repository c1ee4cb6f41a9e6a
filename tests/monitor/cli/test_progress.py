"""Progress of long commands: shares by size of files and by time of windows, and nothing where no terminal is."""

import gzip
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from daq import Channel, DataOptions, LogExcerpt, Recording, export_recording, read_log, read_measured, write_recording
from daq.log import progress_reported_to
from monitor.cli import terminal as shown
from monitor.cli.terminal import Terminal, Work, progress

SECOND = 10**9


@pytest.fixture
def recording() -> Recording:
    channels = tuple(Channel(name=name, device="a", axis=axis) for axis, name in enumerate("xyz"))
    data = np.random.default_rng(3).standard_normal((3000, 3))
    return Recording(channels=channels, data=data, rate=100.0, start=1_000_000 * SECOND)


@pytest.fixture
def log(tmp_path: Path, recording: Recording) -> Path:
    write_recording(tmp_path / "log.mcap", recording)
    return tmp_path / "log.mcap"


class Bar(Progress):
    """Bar with a clock that a test sets."""

    def __init__(self) -> None:
        self.now = 0.0
        super().__init__(console=Console(file=StringIO(), force_terminal=True), get_time=lambda: self.now)

    @property
    def share(self) -> float | None:
        (task,) = self.tasks
        return None if task.total is None else task.completed / task.total

    @property
    def text(self) -> str:
        return self.tasks[0].description


def test_files_of_a_stage_count_by_their_sizes(tmp_path: Path) -> None:
    small, large = tmp_path / "small", tmp_path / "large"
    small.write_bytes(bytes(100))
    large.write_bytes(bytes(300))
    bar = Bar()
    work = Work(bar)
    work.stage("reading", [small, large])
    assert bar.share == 0.0
    work.file_progress(small, 1.0)
    work.file_progress(large, 0.5)
    work.file_progress(large, 0.1)  # the first chunk is read again
    work.file_progress(tmp_path / "other", 1.0)
    assert bar.share == pytest.approx((100 + 150) / 400)
    work.stage("drawing")
    assert bar.share is None
    assert bar.text == "drawing"


def test_windows_of_several_logs_count_by_their_times(log: Path) -> None:
    bar = Bar()
    work = Work(bar)
    start = 1_000_000 * SECOND
    work.windows_of("identifying", [LogExcerpt(log=log, stop=start + 10 * SECOND, text=""), log])
    work.window(start + 5 * SECOND)
    assert bar.share == pytest.approx(5 / 40)
    assert bar.text == "identifying: window 1"


def test_lengths_of_logs_are_not_read_for_a_hidden_bar(tmp_path: Path) -> None:
    work = Work(Progress(disable=True))
    work.windows_of("identifying", [tmp_path])  # a folder: reading it would be an error of the file system


def test_time_left_follows_from_what_is_done() -> None:
    bar = Bar()
    work = Work(bar)
    for bar.now, done in ((0.0, 0), (2.0, 1), (4.0, 2)):
        work.advance(done, 33)
    assert str(shown.TimeColumn().render(bar.tasks[0])) == "0:04 elapsed, 1:02 left"


def test_stage_of_unknown_length_shows_its_elapsed_time() -> None:
    bar = Bar()
    work = Work(bar)
    bar.now = 10.0
    work.stage("drawing")
    bar.now = 75.0
    assert str(shown.TimeColumn().render(bar.tasks[0])) == "1:05 elapsed"


@pytest.mark.parametrize("part", [False, True])
def test_reading_a_log_reports_up_to_its_end(log: Path, part: bool) -> None:
    shares: list[float] = []
    start = 1_000_000 * SECOND
    read = LogExcerpt(log=log, start=start + 5 * SECOND, stop=start + 20 * SECOND, text="") if part else log
    with progress_reported_to(lambda path, share: shares.append(share) if path == log else None):
        items = list(read_log(read))
    assert items
    assert shares == sorted(shares)
    assert shares[-1] == pytest.approx(1.0, abs=0.2)  # behind the last chunk of a whole log is its index
    n = len(shares)
    list(read_log(read))
    assert len(shares) == n  # nobody listens any more


@pytest.mark.parametrize("name", ["table.csv", "table.csv.gz"])
def test_tables_report_reading_and_writing(tmp_path: Path, recording: Recording, name: str) -> None:
    shares: dict[str, list[float]] = {}

    def listen(path: Path, share: float) -> None:
        shares.setdefault(path.name, []).append(share)

    path = tmp_path / name
    with progress_reported_to(listen):
        export_recording(tmp_path / "table.csv", recording)
        written = shares.pop("table.csv")
        if name.endswith(".gz"):
            path.write_bytes(gzip.compress((tmp_path / "table.csv").read_bytes()))
        read_measured(path, DataOptions())
        write_recording(tmp_path / "new.mcap", recording)
    assert written[-1] == shares[name][-1] == shares["new.mcap"][-1] == 1.0
    assert len(shares[name]) > 2
    assert shares["new.mcap"] == sorted(shares["new.mcap"])


@pytest.fixture
def at_terminal(monkeypatch: pytest.MonkeyPatch) -> StringIO:
    """Make the standard output a terminal."""
    file = StringIO()
    monkeypatch.setattr(shown, "console", Console(file=file, force_terminal=True, width=80))
    return file


def test_a_terminal_shows_stage_share_and_window(at_terminal: StringIO) -> None:
    with progress("reading") as work:
        work.note("window 3")
        work.advance(1, 4)
    assert "reading: window 3" in at_terminal.getvalue()
    assert "25%" in at_terminal.getvalue()


def test_files_and_pipes_get_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    with progress("reading") as work:
        work.advance(1, 4)
        print("a result")
    assert capsys.readouterr() == ("a result\n", "")


def test_lines_and_cells_for_files_are_whole(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delenv("COLUMNS", raising=False)
    terminal = Terminal()
    row = [f"cell number {k}" for k in range(20)]
    table = Table.grid(padding=1)
    table.add_row(*row)
    terminal.print(table)
    terminal.print("word " * 100)
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 2
    assert lines[0].rstrip() == " ".join(row)


def test_texts_are_printed_above_the_bar(monkeypatch: pytest.MonkeyPatch) -> None:
    """The bar is erased before a text, so that no text continues its line."""
    out = StringIO()
    seen = Console(file=out, force_terminal=True, width=60)
    monkeypatch.setattr(shown, "console", seen)
    with progress("reading"):
        shown.echo("picture: modes.png")
    before, printed, _ = out.getvalue().partition("picture: modes.png")
    assert printed
    assert before.rpartition("\n")[2].endswith("\x1b[2K")
