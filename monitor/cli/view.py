"""`report` and `view`: pictures of what stands in a log."""

from pathlib import Path

from rich.console import Console

from monitor.logged import load_run
from monitor.report import load_diagnosis, run_report

console = Console(highlight=False)


def report_command(path: Path, out: Path | None, diagnosis: Path | None) -> int:
    """Write the report of a log, or of the newest one in a folder, beside it unless told otherwise."""
    found = load_diagnosis(diagnosis) if diagnosis else None
    run = load_run(path)
    page = out or (path / "report.html" if path.is_dir() else path.with_suffix(".html"))
    run_report(run, page, found)
    console.print(f"report: {page}", soft_wrap=True, markup=False)
    return 0
