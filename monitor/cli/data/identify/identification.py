"""Modes of logs, averaged over windows, or merged over set-ups."""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from daq import AnyLog, LogError, Recording, read_attachments
from daq.errors import writing
from daq.log import as_logs
from monitor.analysis.logs import log_channels, log_recordings
from monitor.analysis.time_range import TimeRange
from monitor.cli.terminal import echo, progress
from monitor.errors import ArgumentError, drawing
from monitor.optional import run_optional
from monitor.service.processes import keep_freed_memory, trim_memory
from oma import (
    AmplitudeDependence,
    Identification,
    IdentificationError,
    Method,
    ModalEstimate,
    OmaError,
    dependence_on_amplitude,
    identify_all,
    mpc,
)
from oma.preparation import ALIAS_FREE
from oma.windows import Windows, identify_windows
from updater import StructureError, UpdaterError
from updater.modal_data import LOW_MPC, Asynchrony, FusedModes, asynchrony, fuse, merge_setups

if TYPE_CHECKING:
    from monitor.results.sensor_geometry import SensorGeometry
    from monitor.settings import Settings
    from updater import Structure
    from updater.quantities import ExchangedSections
    from updater.validation import ModelModes

FOLDER_FILES = (
    *("modes.json", "modes.unv", "responses.unv", "synthesis.unv", "stabilization.png", "singular_values.png"),
    *("responses.png", "mac.png", "shapes.png", "complexity.png", "tracks.png"),
)  #: that `--out` may write
_KEPT_BYTES = 40 << 20  # of a window: 400 s of 12 channels at 1 kHz
_FEWEST_CALIBRATED = 3  # modes that a model can be calibrated to


def logs_within(paths: Sequence[Path], within: TimeRange, *, setups: bool) -> Sequence[AnyLog]:
    """Return the logs to read, or their parts within a range."""
    logs = as_logs(paths)
    if not setups:
        return within.of_logs(logs, echo)
    if len(logs) < 2:
        raise ArgumentError("--reference-sensor", f"expected the logs of two set-ups or more, found {len(logs)}")
    return [within.of_log(log, echo) for log in logs]


class LogWindows:
    """Windows of logs; the first one is kept unless it is large, because notes and pictures are made from it."""

    def __init__(self, logs: Sequence[AnyLog], window: float | None) -> None:
        self._logs, self._window = logs, window
        self._first: Recording | None = None

    def __iter__(self) -> Iterator[Recording]:
        """Yield all windows; later ones than the first are read again at each iteration."""
        keep_freed_memory()
        windows = _sparing(recordings_of(self._logs, self._window))
        start = None
        if self._first is None:
            first = next(windows, None)
            if first and first.data.nbytes <= _KEPT_BYTES:
                first.data.flags.writeable = False
                self._first = first
            if first:
                start = first.start
                yield first
                del first  # while the next one is made
        else:
            start = self._first.start
            yield self._first
        yield from filter(lambda recording: recording.start != start, windows)


def _sparing(windows: Iterator[Recording]) -> Iterator[Recording]:
    """Yield windows; before and after a large one, memory that was freed in pieces is given back."""
    while recording := next(windows, None):
        is_large = recording.data.nbytes > _KEPT_BYTES
        if is_large:
            trim_memory()  # of the blocks that it is made of
        yield recording
        del recording  # while the next one is made
        if is_large:
            trim_memory()  # of its analysis


def channel_delays(recordings: Iterable[Recording], windows: Windows, estimate: ModalEstimate) -> Asynchrony | None:
    """Return the delays between channels if shapes are far from real; from the first window that gave modes."""
    if (mpc(estimate.shape) >= LOW_MPC).all():
        return None
    first = next(r for r in recordings if r.start == windows.estimates[0].start)
    return asynchrony(first, estimate)


def amplitude_dependences(
    recordings: Iterable[Recording], windows: Windows, estimate: ModalEstimate
) -> list[AmplitudeDependence | None]:
    """Return the dependence of each mode on its amplitude, pooled over the windows that gave modes."""
    starts = {window.start for window in windows.estimates}
    found = [dependence_on_amplitude(one, estimate) for one in recordings if one.start in starts]
    kept = [[one for one in of_mode if one] for of_mode in zip(*found, strict=True)]
    return [AmplitudeDependence.pooled(of_mode) if of_mode else None for of_mode in kept]


def first_window(
    recordings: Iterable[Recording], method: Method, band: tuple[float, float] | None
) -> tuple[Recording, Identification]:
    """Return the first window that gives modes, and all that was found in it."""
    for recording in recordings:
        with suppress(IdentificationError):
            return recording, identify_all(recording, method, band)
    raise AssertionError("a window that gave modes gives none")


def draw_window(path: Path, recording: Recording, found: Identification, estimate: ModalEstimate) -> None:
    """Draw one window, with the modes of all."""
    from monitor.views.plots.identification import draw_modes  # matplotlib is loaded only if a picture is requested

    with drawing(path, "--picture"):
        draw_modes(path, recording, found, estimate)
    echo(f"picture: {path}")


def animate_modes(
    path: Path, estimate: ModalEstimate, model: "ModelModes | None", geometry: "SensorGeometry | None" = None
) -> None:
    """Write the mode shapes in motion; they move on the model's structure, or at the positions of the sensors."""
    if (on := model or geometry) is None:
        raise ArgumentError("--animate", "expected a structure (--structure), or a site with [[sensor]] (--site)")
    from monitor.views.animation import write_animation  # matplotlib is loaded only if a picture is requested

    with writing(path, ArgumentError.of_file("--animate")):
        write_animation(path, estimate, on)
    echo(f"mode shapes: {path}")


def fill_folder(
    folder: Path,
    windows: Sequence[ModalEstimate],
    estimate: ModalEstimate,
    recording: Recording,
    found: Identification,
    model: "ModelModes | None",
    geometry: "SensorGeometry | None",
    content: dict[str, Any],
) -> None:
    """Write all files into a folder, and print their names."""
    from monitor.views.plots.identification_folder import (  # matplotlib is loaded only if pictures are requested
        Results,
        write_folder,
    )

    if model:
        agreement = zip(estimate.channels, model.comac.tolist(), strict=True)
        content = content | {"comac": {channel: c if np.isfinite(c) else None for channel, c in agreement}}
    results = Results(
        estimate=estimate,
        windows=windows,
        recording=recording,
        found=found,
        model=model,
        geometry=geometry,
        content=content,
    )
    with writing(folder, ArgumentError.of_file("--out")):
        written = write_folder(folder, results)
    echo(f"{folder}: {', '.join(path.name for path in written)}")


@dataclass(frozen=True, eq=False, kw_only=True)
class Attached:
    """Settings and structure of a site, or those attached to a log."""

    settings: "Settings | None"
    structure: "Structure | None"
    source: str  #: of the structure, named in errors


def attached(log: AnyLog, site: Path | None) -> Attached:
    """Return settings and structure of a site file, or else those attached to a log."""
    if site:
        from monitor.service.site import load_site  # slow to import, as the others inside functions

        texts, source = load_site(site).attachments, str(site)
    else:
        texts, source = dict(read_attachments(log)), str(log)
    if texts.keys().isdisjoint({"site.toml", "structure.toml"}):
        return Attached(settings=None, structure=None, source=source)
    from monitor.settings import attached_structure, parse_attached

    name = f"{source}: structure.toml"
    return Attached(
        settings=parse_attached(texts["site.toml"], f"{source}: site.toml") if "site.toml" in texts else None,
        structure=attached_structure(texts.get("structure.toml", ""), name),
        source=name,
    )


def identified(
    logs: Sequence[AnyLog],
    recordings: LogWindows,
    method: Method,
    band: tuple[float, float] | None,
) -> tuple[Windows, FusedModes]:
    """Identify all windows of logs."""
    named = ", ".join(map(str, logs))
    try:
        with progress("identifying") as work:
            work.windows_of("identifying", logs)
            windows = identify_windows(
                recordings, method, band, lambda one: work.window(one.start), uncertain=True, overwrite=True
            )
        if not windows.estimates:
            raise LogError(named, windows.problems[0])
        return windows, fuse(windows.estimates)
    except OmaError as error:
        raise LogError(named, str(error)) from error


def merged(
    logs: Sequence[AnyLog],
    window: float | None,
    method: Method,
    band: tuple[float, float] | None,
    references: Sequence[str],
) -> tuple[Windows, FusedModes]:
    """Identify each log as a set-up of its own, and merge them by reference sensors."""
    parts = [identified([log], LogWindows([log], window), method, band) for log in logs]
    try:
        return merge_setups(parts, references)
    except OmaError as error:
        raise LogError(", ".join(map(str, logs)), str(error)) from error


def recordings_of(logs: Sequence[AnyLog], window: float | None) -> Iterator[Recording]:
    """Yield the windows of logs that have the same channels."""
    names = {channel.name for channel in log_channels(logs[0])}
    for log in logs:
        found = {channel.name for channel in log_channels(log)}
        if found != names:
            other = ", ".join(sorted(found ^ names))
            raise LogError(str(log), f"expected the channels of {logs[0]}; only one of the two has {other}")
        yield from log_recordings(log, window)


def load_structure_file(path: Path) -> "Structure":
    """Return the structure of a file."""
    from updater import load_structure

    return load_structure(path)


def modes_of_structure(estimate: ModalEstimate, given: Attached, path: Path | None) -> "ModelModes | None":
    """Return the modes of a structure paired with the measured ones; None without a structure.

    Parameters
    ----------
    estimate : measured modes
    given : structure if there is no path
    path : of a structure file
    """
    structure = load_structure_file(path) if path else given.structure
    return paired_modes(estimate, structure, path or given.source)


def paired_modes(
    estimate: ModalEstimate, structure: "Structure | None", source: Path | str | None
) -> "ModelModes | None":
    """Return the modes of a structure paired with the measured ones; its source is named in errors."""
    if structure is None:
        return None
    from updater.validation import model_modes  # slow to import

    try:
        return model_modes(estimate, structure)
    except UpdaterError as error:
        raise StructureError(source or "structure", str(error)) from error


def exchanged_in(model: "ModelModes | None", estimate: ModalEstimate, rate: float) -> "ExchangedSections | None":
    """Return sections of a structure file with exchanged dimensions, by measured modes.

    None without a structure, and for fewer modes than a model can be calibrated to.

    Parameters
    ----------
    model : of the structure file
    estimate : measured modes; those that may be aliases are not used
    rate : of the logs [Hz]
    """
    used = np.flatnonzero(estimate.frequency <= ALIAS_FREE * rate)
    if model is None or len(used) < _FEWEST_CALIBRATED:
        return None
    from updater import stack_tracks  # slow to import
    from updater.modal_data import mean_modes
    from updater.reference import exchanged_sections

    return run_optional(
        "the test of the sections' orientation",
        lambda: exchanged_sections(model.structure, mean_modes(stack_tracks([estimate], [used]))),
    )


def sensor_positions(estimate: ModalEstimate, given: Attached, site: Path | None) -> "SensorGeometry | None":
    """Return the positions of the sensors; None if there are none.

    Raises
    ------
    ArgumentError
        If a site file was given, and its positions are those of other channels.
    """
    geometry = given.settings.sensor_geometry if given.settings else None
    if geometry is None or set(geometry.sensors) & set(estimate.channels):
        return geometry
    if site:
        raise ArgumentError(
            "--site", f"{site}: sensor: expected a channel of the log, {', '.join(estimate.channels)}, found none"
        )
    return None
