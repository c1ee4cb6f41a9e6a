"""Signals of a log in files for other programs."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from daq import LogError, export_recording
from daq.files import expand_log
from monitor.analysis.logs import log_recordings
from monitor.analysis.time_range import TimeRange
from monitor.cli.logs.run_log import one_log
from monitor.cli.options import DONE
from monitor.cli.terminal import echo, files_of_logs, progress
from monitor.text.quantities import counted
from monitor.views.run import late_devices


def export_signals(paths: Sequence[Path], out: Path, within: TimeRange) -> int:
    """Write the signals of a log, or of a range of it, to a file of measurements."""
    whole = one_log(paths)
    log = within.of_log(whole, echo)
    late = late_devices(whole)
    with progress("reading", files_of_logs([log])) as work:
        recordings = list(log_recordings(log, late=late))
        if not recordings:
            raise LogError(str(log), "is shorter than the two seconds that the clocks need")
        work.stage("writing", [out])
        export_recording(out, recordings[0])
    found = recordings[0]
    echo(
        f"{out}: {counted(len(found.channels), 'channel')}, {found.duration:.6g} s at {found.rate:g} Hz, "
        f"{counted(len(found.gaps), 'gap')}; it starts at {found.start} ns UTC"
    )
    _say_late(late)
    return DONE


def expand_signals(paths: Sequence[Path], out: Path, within: TimeRange) -> int:
    """Write the signals of a log, or of a range of it, for stock viewers."""
    whole = one_log(paths)
    log = within.of_log(whole, echo)
    late = late_devices(whole)
    with progress("writing", files_of_logs([log])):
        written = expand_log(log, out, late)
    devices = ", ".join(f"/view/{device} {count}" for device, count in written.items())
    echo(f"{out}: {sum(written.values())} messages; {devices}")
    _say_late(late)
    return DONE


def _say_late(late: Mapping[str, float]) -> None:
    """Print the delays that were removed."""
    if late:
        text = ", ".join(f"{device} {1e3 * seconds:+.3f} ms" for device, seconds in late.items())
        echo(f"device delays of the baseline, removed: {text}")
