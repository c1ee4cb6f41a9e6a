"""Report and rerun recording of a log or a running monitor."""

import os
import shutil
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from urllib.parse import urlsplit

from daq import AnyLog, LogExcerpt
from daq.errors import writing
from daq.log import files_of
from monitor.analysis.time_range import TimeRange
from monitor.cli.options import DONE
from monitor.cli.output import check_outputs
from monitor.cli.terminal import Work, echo, files_of_logs, progress
from monitor.errors import ArgumentError, ResultsError
from monitor.views.report import load_diagnosis, run_report
from monitor.views.run import Run, find_log, load_run

_CONNECT_SECONDS = 2.0


def write_report(
    path: Path, out: Path | None, diagnosis: Path | None, within: TimeRange, pdf: Path | None = None, *, force: bool
) -> int:
    """Write the report of a log, or of the newest one in a folder; by default next to it, one page per range."""
    found = load_diagnosis(diagnosis) if diagnosis else None
    with _loaded(path, within) as (run, work):
        page = out or _default_page(path, run.log)
        _spare(run.log, page)
        if pdf:
            _spare(run.log, pdf, "--pdf")
            if pdf.resolve() == page.resolve():
                raise ArgumentError("--pdf", f"{pdf} is the page itself")
        check_outputs({"--out": page, "--pdf": pdf}, force=force)
        work.stage("drawing")
        try:
            run_report(run, page, found, pdf=pdf)
        except ImportError as error:
            raise ArgumentError("--pdf", str(error)) from error
    echo(f"report: {page}{f', {pdf}' if pdf else ''}")
    return DONE


@contextmanager
def _loaded(path: Path, within: TimeRange) -> Iterator[tuple[Run, Work]]:
    """Read a run, and show the progress until it is used."""
    with progress("reading", files_of_logs([find_log(path)])) as work:
        yield load_run(path, within, echo), work


def _default_page(path: Path, log: AnyLog) -> Path:
    """Return the page next to a log or in a folder, such as `run.html`; `run_60-150s.html` of a range."""
    whole = path / "report.html" if path.is_dir() else path.with_suffix(".html")
    if not isinstance(log, LogExcerpt):
        return whole
    return whole.with_stem(f"{whole.stem}_{log.text.replace(' to ', '-').replace(' ', '')}")


def open_view(target: str, out: Path | None, *, show: bool, within: TimeRange, force: bool) -> int:
    """Open the viewer on a log's new recording or on a live server; print instructions if impossible."""
    if "://" in target:
        if not within.whole:
            raise ArgumentError(", ".join(within.options), f"expected a log, found the address of a monitor: {target}")
        sources = _live_sources(target)
    else:
        file = out or _cache(Path(target))
        _write(Path(target), file, within, in_cache=out is None, force=force)
        echo(f"recording: {file}")
        sources = [str(file)]
    if show:
        _open(sources)
    return DONE


def _write(path: Path, file: Path, within: TimeRange, *, in_cache: bool, force: bool) -> None:
    with _loaded(path, within) as (run, work):
        _spare(run.log, file)
        check_outputs({"--out": file}, force=force or in_cache)
        work.stage("drawing", [file])
        from monitor.views.viewer import write_recording  # loads rerun: not before the log is known to be good

        with writing(file, ResultsError):
            if in_cache:
                file.parent.mkdir(parents=True, exist_ok=True)
            write_recording(file, run.results)


def _spare(log: AnyLog, out: Path, option: str = "--out") -> None:
    """Refuse to write over the log."""
    if out.exists() and any(out.samefile(path) for path in files_of(log)):
        raise ArgumentError(option, f"{out} is the log itself")


def _cache(path: Path) -> Path:
    """Return where the recording of a log is kept."""
    root = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return root / "modalwatch" / f"{path.resolve().name.removesuffix('.mcap')}.rrd"


def _live_sources(url: str) -> list[str]:
    """Return the address of a live server, and the one of its signals if that responds too."""
    parts = urlsplit(url)
    try:
        host, port = parts.hostname, parts.port
    except ValueError as error:
        raise ArgumentError(url, str(error)) from error
    if host is None or port is None:
        raise ArgumentError(url, "expected an address like rerun+http://127.0.0.1:9876/proxy")
    if not _answers(host, port):
        raise ArgumentError(url, "nothing answers there: is the monitor running, with [viewer] in its settings?")
    second = url.replace(f":{port}", f":{port + 1}")
    return [url, second] if _answers(host, port + 1) else [url]


def _answers(host: str, port: int) -> bool:
    try:
        socket.create_connection((host, port), _CONNECT_SECONDS).close()
    except OSError:
        return False
    return True


def _open(sources: list[str]) -> None:
    """Open the viewer and leave it open; without a display print instructions."""
    viewer = shutil.which("rerun", path=f"{Path(sys.executable).parent}{os.pathsep}{os.environ.get('PATH', '')}")
    command = [viewer or "rerun", *sources]
    if viewer is None or not _has_display():
        why = "rerun is not installed" if viewer is None else "there is no display here"
        hint = f"{why}; in a browser: rerun --serve-web --bind 127.0.0.1 {' '.join(sources)}"
        echo(hint)
        return
    quiet = subprocess.DEVNULL
    subprocess.Popen(command, stdin=quiet, stdout=quiet, stderr=quiet, start_new_session=True)
    echo(f"viewer: {' '.join(command)}")


def _has_display() -> bool:
    return sys.platform in ("win32", "darwin") or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
