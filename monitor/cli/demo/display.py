"""Terminal display of a running demo."""

import threading

from rich.console import Console, Group
from rich.live import Live
from rich.markup import escape
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from daq.notebook import rounded_text
from monitor.cli.site.console_log import line
from monitor.results.windows import AlarmResult, Result, WindowResult
from monitor.text.quantities import aligned_numbers


class Display:
    """Terminal display while the monitor runs."""

    def __init__(self, console: Console, n_windows: int, stop: threading.Event) -> None:
        self._planned, self._stop, self._console = n_windows, stop, console
        self._bar = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            TextColumn("window {task.completed} of {task.total}"),
            TimeElapsedColumn(),
        )
        self._task = self._bar.add_task("learning ", total=n_windows)
        self._live = Live(self._bar, console=console, refresh_per_second=4)
        self.found: list[Result] = []
        self.n_windows = 0

    def __enter__(self) -> None:
        self._live.start()

    def __exit__(self, *_: object) -> None:
        self._live.stop()

    def show(self, result: Result) -> None:
        """Take one result; ends the watch after the last planned window."""
        self.found.append(result)
        if not isinstance(result, WindowResult):
            style = "bold red" if isinstance(result, AlarmResult) and result.state == "alarm" else "cyan"
            self._console.print(f"[{style}]{escape(line(result))}[/]")
            return
        self.n_windows = result.index + 1
        total = max(self._planned, self.n_windows)  # one may be in progress at the end
        self._bar.update(self._task, completed=self.n_windows, total=total, description=result.phase.ljust(9))
        latest = Table.grid(padding=(0, 2))
        frequencies = aligned_numbers((mode.frequency, mode.frequency_std) for mode in result.modes)
        for mode, frequency in zip(result.modes, frequencies, strict=True):
            shift = mode.shift_percent
            latest.add_row(
                f"mode {mode.id}",
                f"{frequency} Hz",
                f"{rounded_text(100 * mode.damping, 100 * mode.damping_std)} %",
                "" if shift is None else f"{rounded_text(shift, mode.shift_std_percent or 0.0, sign=True)} %",
            )
        self._live.update(Group(latest, self._bar))
        if result.answer:
            self._console.print(escape(line(result)))
        if self.n_windows >= self._planned:
            self._stop.set()
