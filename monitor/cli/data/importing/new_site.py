"""SITE.toml for a file of measurements: its channels as devices, for `replay` and `run`."""

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import pairwise
from math import ceil, floor, log10
from pathlib import Path
from statistics import median

from daq import Recording
from daq.errors import writing
from monitor.analysis.logs import EDGE_SAMPLES
from monitor.cli.output import replacing
from monitor.errors import ArgumentError
from monitor.settings import AXES, AnalysisSettings, DeviceSettings, Settings, annotated

_NAME = "logger"


@contextmanager
def new_site(
    path: Path, structure: Path | None, log: Path, recordings: Sequence[Recording], *, force: bool
) -> Iterator[None]:
    """Write a site with the channels of recordings and all settings with their meaning; none if a later step fails.

    Parameters
    ----------
    path : of the site
    structure : its structure file; None for none
    log : that will hold the recordings
    force : an existing file is replaced

    Raises
    ------
    ArgumentError
        If there is such a file, without `force`, or it cannot be written.
    """
    analysis = AnalysisSettings(window_seconds=window_of(recordings))
    devices = tuple(_devices(path, log, recordings[0]))
    settings = Settings(
        structure=None if structure is None else _from(path, structure), device=devices, analysis=analysis
    )
    with replacing(path, force=force, option="--new-site"):
        with writing(path, ArgumentError.of_file("--new-site")):
            path.write_text(annotated(settings), encoding="utf-8")
        try:
            yield
        except BaseException:
            path.unlink(missing_ok=True)
            raise


def _devices(path: Path, log: Path, recording: Recording) -> Iterator[DeviceSettings]:
    """Yield devices of up to three channels; channels with other missing samples are on another device."""
    together: dict[str, list[str]] = {}
    for channel in recording.channels:
        together.setdefault(channel.device, []).append(channel.name)
    threes = [own[k : k + len(AXES)] for own in together.values() for k in range(0, len(own), len(AXES))]
    for number, names in enumerate(threes, 1):
        name = f"{_NAME}-{number}"
        yield DeviceSettings.model_validate(
            {
                "name": name,
                "driver": "replay",
                "log": {"file": _from(path, log), "device": name},
                "rate": recording.rate,
                "channels": dict(zip(AXES, names, strict=False)),
            }
        )


def _from(site: Path, file: Path) -> str:
    """Return a path as written in the site's file."""
    return Path(os.path.relpath(file.resolve(), site.resolve().parent)).as_posix()


def window_of(recordings: Sequence[Recording]) -> float:
    """Return the length of windows [s]: the usual one, or an equal part of the usual record where a logger pauses."""
    usual = AnalysisSettings().window_seconds
    records = [recordings[0].duration]
    for before, after in pairwise(recordings):
        if after.start - before.end > 1e9 / before.rate:
            records.append(0.0)
        records[-1] += after.duration
    if len(records) == 1:
        return usual
    usable = max(median(records) - EDGE_SAMPLES / recordings[0].rate, 1.0)
    longest = usable / ceil(usable / usual)
    digit = 10.0 ** (floor(log10(longest)) - 2)
    return max(round(floor(longest / digit + 1e-6) * digit, 2), 1.0)


def learning_notes(settings: Settings, seconds: float, site: Path) -> Iterator[str]:
    """Return notes on suitable windows for a logger that pauses, and on too short a record [s]."""
    window = settings.analysis.window_seconds
    if window != AnalysisSettings().window_seconds:
        yield f"the logger pauses: window_seconds = {window:g} in {site}, so that its records contain whole windows"
    if seconds >= settings.learning_seconds:
        return
    analysis = settings.analysis
    yield (
        f"with {site} the baseline takes {settings.learning_seconds:g} s ({analysis.first_windows} windows of "
        f"{analysis.window_seconds:g} s), but the log has {seconds:.6g} s: reduce window_seconds or baseline_windows"
    )
