"""Files of measurements as a log."""

from collections.abc import Collection, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from daq import DataError, DataOptions, Recording, write_recordings
from daq.bounded_text import meant
from daq.files import (
    ACCELERATIONS,
    Measured,
    parse_sensitivity,
    parse_unit,
    read_calibration,
    read_in_order,
    with_channels,
)
from monitor.analysis.time_range import instant
from monitor.cli.data.importing.new_site import learning_notes, new_site
from monitor.cli.options import DONE
from monitor.cli.terminal import echo, progress, warn
from monitor.errors import ArgumentError
from monitor.service.site import Site, load_site
from monitor.text.quantities import counted
from updater import parse_structure
from updater.structure import no_sensor_text, portable_text

_STRONGEST = 100.0  # m/s2, rms: ten times gravity, far above the vibration of structures in service
_DEAD = 1e-3  # of the median rms of all channels
_RATE_TOLERANCE = 1e-3  # of the data's rate against the site's: more than any clock drifts


def import_measurements(
    data: Sequence[Path],
    out: Path,
    options: DataOptions,
    *,
    structure: Path | None = None,
    site: Path | None = None,
    new: Path | None = None,
    force: bool = False,
) -> int:
    """Write the log and print a summary.

    Parameters
    ----------
    structure, site : files to attach
    new : site to write, with the channels of the data
    force : an existing site is replaced
    """
    if new is not None and site is not None:
        raise ArgumentError("--new-site", "expected no --site with it")
    with ExitStack() as undone:
        work = undone.enter_context(progress("reading", data))
        try:
            found = read_in_order(data, options)
        except ValueError as error:  # invalid name or record too short: the other arguments were checked before
            raise ArgumentError("--velocity", f"{data[0]}: {error}") from error
        known = _sensors(structure, site)
        parts, left = _of_sensors(found, known)
        work.stage("writing", [out])
        if new is not None:
            undone.enter_context(new_site(new, structure, out, [part.recording for part in parts], force=force))
        recordings, notes = _write(data[0], out, parts, structure, new or site, learns=new is not None)
    _say(out, recordings, parts, new)
    if left:
        others = _without_column(recordings[0], known or ())
        names = "; ".join(name + meant(name, others) for name in left)
        notes.insert(0, f"columns of no sensor of {structure or site}, left out: {names}")
    for note in [*notes, *dead_channels(recordings), *implausible_level(recordings)]:
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
        attachments = site.attachments | attachments
        if site.settings.temperature is not None and any(np.isfinite(one.temperature) for one in recordings):
            notes.append(f"[temperature] of {path} overrides the log's temperatures; remove it there")
        if learns:
            notes += learning_notes(site.settings, sum(recording.duration for recording in recordings), path)
    write_recordings(out, recordings, attachments, [part.temperature for part in parts])
    return recordings, notes


def _say(out: Path, recordings: Sequence[Recording], parts: Sequence[Measured], new_site: Path | None) -> None:
    """Print the result and its interpretation."""
    gaps = [gap for recording in recordings for gap in recording.gaps]
    missing = sum(gap.stop - gap.start for gap in gaps)
    seconds, rate = sum(recording.duration for recording in recordings), recordings[0].rate
    echo(
        f"{out}: {counted(len(recordings[0].channels), 'channel')}, {seconds:.6g} s at {rate:.6g} Hz, "
        f"{counted(len(gaps), 'gap')} ({counted(missing, 'sample')}){level(recordings)}",
        divide=True,
    )
    if len(recordings) > 1:
        echo(_sequence(recordings), divide=True)
    if new_site is not None:
        echo(f"written: {new_site}, to be edited: `modalwatch replay {out} --site {new_site}` monitors the log")
    for remark in parts[0].remarks:
        echo(f"{'first file: ' if len(parts) > 1 else ''}{remark}", divide=True)


def _sequence(recordings: Sequence[Recording]) -> str:
    """Print the pauses between successive recordings."""
    pauses = [(after.start - before.end) * 1e-9 for before, after in pairwise(recordings)]
    real = [pause for pause in pauses if pause > 0.5 / recordings[0].rate]
    longest = f", the longest {max(real):.6g} s" if real else ""
    warm = [recording.temperature for recording in recordings if np.isfinite(recording.temperature)]
    means = f"; their mean temperatures: {min(warm):.4g} to {max(warm):.4g} degC" if warm else ""
    return f"{len(recordings)} files by their dates, {len(real)} pauses between them{longest}{means}"


def data_options(
    base: DataOptions, unit: str | None, sensitivity: str | None, names: str | None, calibration: Path | None
) -> DataOptions:
    """Return options with the texts and files of the command line.

    Parameters
    ----------
    base : other options
    unit : unit of all columns
    sensitivity : of all sensors
    names : names of all columns, between commas
    calibration : file of `read_calibration`

    Raises
    ------
    ArgumentError
        Naming the option.
    """
    if unit is not None and parse_unit(unit) is None:
        known = f"{', '.join(ACCELERATIONS)}, another unit of acceleration, velocity or displacement, V, mV or counts"
        raise ArgumentError("--unit", f"expected one of {known}, found {unit!r}")
    columns = None if names is None else tuple(name.strip() for name in names.split(","))
    if columns is not None and len({name for name in columns if name}) < max(1, len([n for n in columns if n])):
        raise ArgumentError("--columns", f"expected different names, found {names}")
    try:
        sensed = None if sensitivity is None else parse_sensitivity(sensitivity)
    except ValueError as error:
        raise ArgumentError("--sensitivity", str(error)) from error
    calibrated = {} if calibration is None else read_calibration(calibration)
    return replace(base, unit=unit, sensitivity=sensed, names=columns, calibration=calibrated)


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
                data, f"has {recording.rate:.6g} samples per second, device {device.name} of {path} {device.rate:g}"
            )
    try:
        return with_channels(recording, site.settings.channels)
    except ValueError as error:
        raise DataError(data, f"{error} of {path}") from error


def level(recordings: Sequence[Recording]) -> str:
    """Print the RMS of the channels about their means, which reveals a wrong unit."""
    rms = _rms(recordings)
    return f", rms {min(rms):.2g} to {max(rms):.2g} m/s2" if rms else ""


def implausible_level(recordings: Sequence[Recording]) -> Iterator[str]:
    """Yield a note on the unit if vibration is stronger than that of any structure in service."""
    rms = _rms(recordings)
    median = float(np.median(rms)) if rms else 0.0
    if median > _STRONGEST:
        yield f"an rms of {median:.2g} m/s2 exceeds that of structures in service: check the unit, such as --unit mm/s2"


def _rms(recordings: Sequence[Recording]) -> list[float]:
    """Return the RMS of each channel with samples, about its mean [m/s2]."""
    columns = (np.concatenate([one.data[:, k] for one in recordings]) for k in range(len(recordings[0].channels)))
    return [float(np.nanstd(column)) for column in columns if np.isfinite(column).any()]


def dead_channels(recordings: Sequence[Recording]) -> Iterator[str]:
    """Yield a note on each channel without a signal, or with one that is far smaller than the others."""
    names = [channel.name for channel in recordings[0].channels]
    columns = [np.concatenate([one.data[:, k] for one in recordings]) for k in range(len(names))]
    known = [column[np.isfinite(column)] for column in columns]
    rms = [float(np.std(column)) if len(column) else float("nan") for column in known]
    median = float(np.nanmedian(rms)) if np.isfinite(rms).any() else float("nan")
    for name, column, own in zip(names, known, rms, strict=True):
        if not len(column):
            yield f"{name} has no sample"
        elif column.min() == column.max():
            yield f"{name} is constant ({column[0]:.3g} m/s2): the sensor is dead or not connected"
        elif own < _DEAD * median:
            yield f"{name} has an rms of {own:.2g} m/s2, less than {_DEAD:g} of the median of all channels"


def _sensors(structure: Path | None, site: Path | None) -> Collection[str] | None:
    """Return the names of the sensors of a structure file, or of a site."""
    if structure is not None:
        return parse_structure(portable_text(structure), structure).channels
    return None if site is None else [channel.name for channel in load_site(site).settings.channels]


def _of_sensors(parts: Sequence[Measured], known: Collection[str] | None) -> tuple[Sequence[Measured], list[str]]:
    """Return the content without channels that are no sensors, and their names; all, if none is a sensor."""
    channels = parts[0].recording.channels
    keep = [k for k, channel in enumerate(channels) if known is None or channel.name in known]
    if not keep or len(keep) == len(channels):
        return parts, []
    return tuple(part.only(keep) for part in parts), [c.name for k, c in enumerate(channels) if k not in keep]


def _without_column(recording: Recording, known: Collection[str]) -> list[str]:
    """Return the sensors without a column."""
    there = {channel.name for channel in recording.channels}
    return [name for name in known if name not in there]


def _structure_text(data: Path, recording: Recording, path: Path) -> tuple[str, list[str]]:
    """Return the text of a structure file, once all columns are sensors of it, and its sensors without a column."""
    text = portable_text(path)
    known = parse_structure(text, path).channels
    for channel in recording.channels:
        if channel.name not in known:
            raise DataError(data, f"column {no_sensor_text(channel.name, known, path)}")
    return text, _without_column(recording, known)
