"""Files of measurements as a log."""

from collections.abc import Sequence
from contextlib import ExitStack
from itertools import pairwise
from pathlib import Path

import numpy as np

from daq import DataError, DataOptions, Recording, write_recordings
from daq.files import ACCELERATIONS, Measured, acceleration, read_in_order, with_channels
from monitor.analysis.time_range import instant
from monitor.cli.data.importing.new_site import learning_notes, new_site
from monitor.cli.exit_codes import DONE
from monitor.cli.terminal import echo, warn
from monitor.errors import ArgumentError
from monitor.service.site import Site, load_site
from updater import parse_structure
from updater.structure import portable_text

_RATE_TOLERANCE = 1e-3  # of the data's rate against the site's: more than any clock drifts


def import_measurements(
    data: Sequence[Path],
    out: Path,
    options: DataOptions,
    *,
    structure: Path | None = None,
    site: Path | None = None,
    new: Path | None = None,
) -> int:
    """Write the log and print a summary.

    Parameters
    ----------
    structure, site : files to attach
    new : site to write, with the channels of the data
    """
    try:
        parts = read_in_order(data, options)
    except ValueError as error:  # invalid name or record too short: the other arguments were checked before
        raise ArgumentError("--velocity", f"{data[0]}: {error}") from error
    with ExitStack() as undone:
        if new is not None:
            if structure is None or site is not None:
                raise ArgumentError("--new-site", "expected --structure with it, and no --site")
            undone.enter_context(new_site(new, structure, out, [part.recording for part in parts]))
        recordings, notes = _write(data[0], out, parts, structure, new or site, learns=new is not None)
    _say(out, recordings, parts, new)
    for note in notes:
        warn(f"note: {note}")
    return DONE


def _write(
    data: Path, out: Path, parts: Sequence[Measured], structure: Path | None, path: Path | None, *, learns: bool
) -> tuple[Sequence[Recording], list[str]]:
    """Write the log with a structure and the site of a path; return its content, and the notes."""
    recordings = [part.recording for part in parts]
    attachments: dict[str, str] = {}
    notes: list[str] = []
    if structure is not None:
        attachments["structure.toml"], lacking = _structure_text(data, recordings[0], structure)
        if lacking:
            notes.append(f"no column for {', '.join(lacking)} of {structure}")
    if path is not None:
        site = load_site(path)
        recordings = [_for_site(data, recording, site, path) for recording in recordings]
        attachments = {"structure.toml": site.structure_text} | attachments | {"site.toml": site.site_text}
        if site.settings.temperature is not None and any(np.isfinite(one.temperature) for one in recordings):
            notes.append(f"[temperature] of {path} overrides the log's temperatures; remove it there")
        if learns:
            notes += learning_notes(site.settings, sum(recording.duration for recording in recordings), path)
    write_recordings(out, recordings, attachments, [part.temperature for part in parts])
    return recordings, notes


def _say(out: Path, recordings: Sequence[Recording], parts: Sequence[Measured], new_site: Path | None) -> None:
    """Print the result and its interpretation."""
    gaps = [gap for recording in recordings for gap in recording.gaps]
    seconds, rate = sum(recording.duration for recording in recordings), recordings[0].rate
    echo(
        f"{out}: {len(recordings[0].channels)} channels, {seconds:.6g} s at {rate:.6g} Hz, "
        f"{len(gaps)} gaps ({sum(gap.stop - gap.start for gap in gaps)} samples){level(recordings)}"
    )
    if len(recordings) > 1:
        echo(_sequence(recordings))
    if new_site is not None:
        echo(f"written: {new_site}, to be edited: `modalwatch replay {out} --site {new_site}` watches the log")
    for remark in parts[0].remarks:
        echo(f"{'first file: ' if len(parts) > 1 else ''}{remark}")


def _sequence(recordings: Sequence[Recording]) -> str:
    """Print the pauses between successive recordings."""
    pauses = [(after.start - before.end) * 1e-9 for before, after in pairwise(recordings)]
    real = [pause for pause in pauses if pause > 0.5 / recordings[0].rate]
    longest = f", the longest {max(real):.6g} s" if real else ""
    warm = [recording.temperature for recording in recordings if np.isfinite(recording.temperature)]
    means = f"; their mean temperatures: {min(warm):.4g} to {max(warm):.4g} degC" if warm else ""
    return f"{len(recordings)} files by their dates, {len(real)} pauses between them{longest}{means}"


def factor_of(unit: str | None, scale: float | None) -> float | None:
    """Return the factor of a number [m/s2] if it was given explicitly."""
    if unit is None and scale is None:
        return None
    worth = acceleration(unit or "m/s2")
    if worth is None:
        raise ArgumentError("--unit", f"expected one of {', '.join(ACCELERATIONS)}, found {unit!r}")
    return worth * (scale or 1.0)


def columns_of(options: Sequence[str]) -> dict[str, str] | None:
    """Return column -> channel from NAME or NAME=SENSOR; None for all columns."""
    pairs = [(option.rpartition("=") if "=" in option else (option, "", option)) for option in options]
    columns = {column: channel for column, _, channel in pairs}
    if len(columns) < len(pairs) or len(set(columns.values())) < len(pairs):
        raise ArgumentError("--column", f"expected different names, found {', '.join(options)}")
    return columns or None


def start_of(text: str) -> int:
    """Return a time [ns UTC]; without a zone it is UTC."""
    try:
        return instant(text)
    except ValueError as error:
        raise ArgumentError("--start", str(error)) from error


def _for_site(data: Path, recording: Recording, site: Site, path: Path) -> Recording:
    """Return the recording on the devices of a site, so that it can be replayed."""
    names = {channel.name for channel in recording.channels}
    for channel in site.settings.channels:
        if channel.name not in names:
            raise DataError(data, f"has no column {channel.name!r}, which {path} requires")
    for device in site.settings.device:
        if abs(recording.rate / device.rate - 1) > _RATE_TOLERANCE:
            raise DataError(
                data, f"has {recording.rate:.6g} samples a second, device {device.name} of {path} {device.rate:g}"
            )
    try:
        return with_channels(recording, site.settings.channels)
    except ValueError as error:
        raise DataError(data, f"{error} of {path}") from error


def level(recordings: Sequence[Recording]) -> str:
    """Print the RMS of the channels about their means, which reveals a wrong unit."""
    columns = (np.concatenate([one.data[:, k] for one in recordings]) for k in range(len(recordings[0].channels)))
    rms = [np.nanstd(column) for column in columns if np.isfinite(column).any()]
    return f", rms {min(rms):.2g} to {max(rms):.2g} m/s2" if rms else ""


def _structure_text(data: Path, recording: Recording, path: Path) -> tuple[str, list[str]]:
    """Return the text of a structure file, once all columns are sensors of it, and its sensors without a column."""
    text = portable_text(path)
    known = parse_structure(text, path).channels
    for channel in recording.channels:
        if channel.name not in known:
            raise DataError(data, f"column {channel.name!r} is no sensor of {path}; there are {', '.join(known)}")
    there = {channel.name for channel in recording.channels}
    return text, [channel for channel in known if channel not in there]
