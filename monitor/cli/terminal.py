"""Output on the terminal, control characters shown as escapes, and progress of long work."""

import os
import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Literal

import typer
from rich.box import SIMPLE_HEAD
from rich.console import Console, ConsoleDimensions, ConsoleOptions, RenderResult
from rich.file_proxy import FileProxy
from rich.markup import escape
from rich.progress import BarColumn, Progress, ProgressColumn, Task, TaskProgressColumn, TextColumn
from rich.table import Table
from rich.text import Text

from daq import AnyLog, LogError, LogExcerpt
from daq.bounded_text import printable
from daq.log import files_of, log_span, progress_reported_to
from monitor.cli.lines import divided, echo_error
from monitor.errors import StartError

_FILE_COLUMNS = 1000  # of lines that no terminal shows


class Terminal(Console):
    """Console that escapes control characters in all strings it renders, cells of tables too."""

    def __init__(self) -> None:
        super().__init__(highlight=False)

    @property
    def size(self) -> ConsoleDimensions:
        """Size of the terminal; lines for files and other programs are whole."""
        found = super().size
        if self.is_terminal or self._width is not None or "COLUMNS" in os.environ:
            return found
        return ConsoleDimensions(_FILE_COLUMNS, found.height)

    @size.setter
    def size(self, new: tuple[int, int]) -> None:
        self._width, self._height = new

    def render_str(self, text: str, **options: Any) -> Text:  # noqa: ANN401 - as rich has them
        """Return the text of a string with markup."""
        return super().render_str(printable(text), **options)


console = Terminal()


def keep_stdout_free() -> None:
    """Print all texts to the standard error stream from now on."""
    console.stderr = True


def echo(text: str, *, nl: bool = True, divide: bool = False) -> None:
    """Print a text without markup, its control characters as escapes; above a progress bar that is shown.

    Parameters
    ----------
    text : for persons, or to be copied
    nl : ends the last line
    divide : a terminal gets lines that are divided between words: not for commands and settings, which are copied
    """
    text = printable(text)
    if divide:
        text = divided(text, sys.stderr if console.stderr else sys.stdout)
    stdout, is_bar_shown = sys.stdout, isinstance(sys.stdout, FileProxy)  # behind it is the stream that typer prints to
    typer.echo(text, file=stdout if is_bar_shown and not console.stderr else None, nl=nl, err=console.stderr)


def warn(text: str) -> None:
    """Print a text that needs attention, in yellow."""
    console.print(text, style="yellow", soft_wrap=not console.is_terminal, markup=False)


SPEED_SECONDS = 300.0  #: of the latest progress, from which the time left is estimated
_SECOND = 10**9  # ns by which a window may begin before the first scan
_REFRESHES = 4.0  # per second


class TimeColumn(ProgressColumn):
    """Elapsed time of a stage, and the estimated time left, once it is known."""

    def render(self, task: Task) -> Text:
        """Return the times of a task."""
        elapsed = f"{_clock(task.elapsed or 0.0)} elapsed"
        left = task.time_remaining
        return Text(elapsed if left is None or task.finished else f"{elapsed}, {_clock(left)} left")


def start_error(reasons: Sequence[str]) -> StartError:
    """Print all reasons but the last, one per line, and return the error with the last one."""
    for reason in reasons[:-1]:
        echo_error(f"error: {printable(reason)}")
    return StartError(reasons[-1])


def _clock(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"


class Work:
    """Present stage of long work.

    Parameters
    ----------
    bar : that shows it
    """

    def __init__(self, bar: Progress) -> None:
        self._bar = bar
        self._task = bar.add_task("", total=None)
        self._text = ""
        self._shares: dict[Path, float] = {}  # of files that are read or written
        self._sizes: dict[Path, int] = {}
        self._spans: list[tuple[int, int]] = []  # of the logs whose windows follow [ns UTC]
        self._windows = 0

    def stage(self, text: str, files: Iterable[Path] = ()) -> None:
        """Begin a stage.

        Parameters
        ----------
        text : what is done
        files : whose reading or writing is the progress of the stage; without any, `advance` reports it
        """
        self._text, self._spans, self._windows = text, [], 0
        self._sizes = {path: path.stat().st_size if path.is_file() else 0 for path in files}
        if not any(self._sizes.values()):  # to be written, or missing, as an error will state
            self._sizes = dict.fromkeys(self._sizes, 1)
        self._shares = dict.fromkeys(self._sizes, 0.0)
        self._bar.remove_task(self._task)  # a reset keeps the total
        self._task = self._bar.add_task(escape(text), total=1.0 if self._sizes else None)

    def windows_of(self, text: str, logs: Sequence[AnyLog]) -> None:
        """Begin a stage that analyses windows of logs, one log after the other."""
        self.stage(text)
        if self._bar.disable:  # not shown: their length is not needed
            return
        with suppress(LogError):  # of a damaged log, which its reader reports
            self._spans = [span for log in logs if (span := _span(log))]

    def note(self, text: str) -> None:
        """Show a detail of the stage."""
        self._bar.update(self._task, description=escape(f"{self._text}: {text}"))

    def advance(self, done: float, total: float) -> None:
        """Show the progress of the stage, in any unit."""
        self._bar.update(self._task, completed=done, total=total)

    def window(self, time: int) -> None:
        """Begin the analysis of the next window of the logs; what is before its time [ns UTC] is done."""
        self._windows += 1
        self.note(f"window {self._windows}")
        place = next((k for k, (start, end) in enumerate(self._spans) if start - _SECOND <= time < end), None)
        if place is not None:
            lengths = [end - start for start, end in self._spans]
            self.advance(max(time - self._spans[place][0] + sum(lengths[:place]), 0), sum(lengths))

    def file_progress(self, path: Path, share: float) -> None:
        """Take the share of a file that is read or written; files of other stages are ignored."""
        if path in self._shares:
            self._shares[path] = max(self._shares[path], share)
            done = sum(self._sizes[file] * part for file, part in self._shares.items())
            self.advance(done, sum(self._sizes.values()))


def _span(log: AnyLog) -> tuple[int, int] | None:
    """Return first and last time of a log [ns UTC]; None if it is empty."""
    span = log_span(log)
    return (max(span[0], log.start), min(span[1], log.stop)) if span and isinstance(log, LogExcerpt) else span


class TitledTable(Table):
    """Table with a title that begins at the left and may be wider than the columns."""

    def __init__(self, *columns: str, title: str, **options: Any) -> None:  # noqa: ANN401 - as rich has them
        super().__init__(*columns, **options)
        self._title = title

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Render the title, then the table."""
        if self._title:
            yield Text(printable(self._title), style="table.title")
        yield from super().__rich_console__(console, options)


def new_table(
    left: Iterable[str] = (),
    right: Iterable[str] = (),
    *,
    no_wrap: bool = False,
    overflow: Literal["fold", "ellipsis"] = "ellipsis",
    title: str = "",
    **options: Any,  # noqa: ANN401 - as rich has them
) -> Table:
    """Return a table without rows: columns of texts, then columns of numbers, with options of `rich.table.Table`.

    Title and headings are plain text: a unit in brackets is no markup.
    """
    table = TitledTable(title=title, box=SIMPLE_HEAD, **options)
    for name in left:
        table.add_column(escape(name), no_wrap=no_wrap, overflow=overflow)
    for name in right:
        table.add_column(escape(name), justify="right", no_wrap=no_wrap, overflow=overflow)
    return table


@contextmanager
def progress(text: str, files: Iterable[Path] = ()) -> Iterator[Work]:
    """Show the progress of long work while it lasts, on standard error unless the standard output is the terminal.

    Without a terminal nothing is shown.

    Parameters
    ----------
    text, files : first stage, as for `Work.stage`
    """
    shown = console if console.is_terminal else Console(stderr=True)
    columns = (
        TextColumn("{task.description}"),
        BarColumn(bar_width=24),
        TaskProgressColumn(show_speed=False),
        TimeColumn(),
    )
    bar = Progress(
        *columns,
        console=shown,
        transient=True,
        refresh_per_second=_REFRESHES,
        speed_estimate_period=SPEED_SECONDS,
        redirect_stdout=shown is console,  # else it is no terminal, and takes lines as they are
        disable=not shown.is_terminal,
    )
    work = Work(bar)
    work.stage(text, files)
    with bar, progress_reported_to(work.file_progress):
        yield work


def files_of_logs(logs: Sequence[AnyLog]) -> list[Path]:
    """Return the files of logs."""
    return [path for log in logs for path in files_of(log)]
