"""`identify`: the modes of logs."""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from daq import LogError, Recording, read_attachments
from monitor.cli.files import write_json
from monitor.errors import ArgumentError
from monitor.fusion import FusedModes, Windows, fuse, identify_windows
from monitor.model_modes import ModelModes, ModelPartner, model_modes
from monitor.recordings import log_channels, log_recordings
from monitor.settings import Settings, parse_settings
from oma import METHODS, Identification, IdentificationError, Method, ModalEstimate, identify_all, mpc, mpd
from updater import Structure, StructureError, UpdaterError, load_structure, parse_structure

console = Console(highlight=False)


@dataclass(frozen=True, kw_only=True)
class Options:
    """What the command line asks for."""

    method: str = "ssi-data"
    window: float | None = None  #: [s]; the log's settings', else the whole log
    band: tuple[float, float] | None = None  #: [Hz]; the log's settings', else chosen
    structure: Path | None = None  #: to compare with; the one attached to the log, if any


def identify_command(
    logs: Sequence[Path], options: Options, json_path: Path | None, picture: Path | None, out: Path | None = None
) -> int:
    """Print the modes; write them as JSON, draw them and fill a folder where asked."""
    if options.method not in METHODS:
        raise ArgumentError("--method", f"expected one of {', '.join(METHODS)}, found {options.method!r}")
    if options.band is not None and not 0 < options.band[0] < options.band[1]:
        raise ArgumentError("--band", f"expected 0 < low < high, found {options.band[0]:g} {options.band[1]:g}")
    settings = _settings(logs[0])
    window = options.window or (settings.analysis.window_seconds if settings else None)
    band = options.band or (settings.analysis.band if settings else None)
    method = METHODS[options.method]()
    windows, fused = _identify(logs, window, method, band)
    model = _model(fused.estimate, logs[0], options.structure)
    partners = [model.partner(i) if model else None for i in range(fused.estimate.n_modes)]
    _say(logs, windows, fused, partners)
    about = {"name": options.method, "windows": len(windows.estimates), "window_seconds": window, "band": band}
    content = as_json(windows, fused, partners) | {"method": about | {"options": asdict(method)}}
    if json_path:
        write_json(json_path, content)
    if picture or out:
        recording, found = _first(_recordings(logs, window), method, band)
        if picture:
            _draw(picture, recording, found, fused.estimate)
        if out:
            _fill(out, windows, fused.estimate, recording, found, model, content)
    return 0


def _first(
    recordings: Iterable[Recording], method: Method, band: tuple[float, float] | None
) -> tuple[Recording, Identification]:
    """Return the first window that gives modes, and all that was found in it."""
    for recording in recordings:
        with suppress(IdentificationError):
            return recording, identify_all(recording, method, band)
    raise AssertionError("a window that gave modes gives none")


def _draw(path: Path, recording: Recording, found: Identification, estimate: ModalEstimate) -> None:
    """Draw one window, with the modes of all."""
    from monitor.modes_picture import draw_modes  # matplotlib: only where a picture is asked for

    try:
        draw_modes(path, recording, found, estimate)
    except (OSError, ValueError) as error:  # matplotlib: ValueError for an ending it does not know
        raise ArgumentError("--picture", f"{path}: cannot be written: {error}".splitlines()[0]) from error


def _fill(
    folder: Path,
    windows: Windows,
    estimate: ModalEstimate,
    recording: Recording,
    found: Identification,
    model: ModelModes | None,
    content: dict[str, Any],
) -> None:
    """Write everything into a folder, and say what."""
    from monitor.modes_folder import Results, write_folder  # matplotlib: only where pictures are asked for

    if model:
        agreement = zip(estimate.channels, model.comac.tolist(), strict=True)
        content = content | {"comac": {channel: c if np.isfinite(c) else None for channel, c in agreement}}
    results = Results(
        estimate=estimate, windows=windows.estimates, recording=recording, found=found, model=model, content=content
    )
    try:
        written = write_folder(folder, results)
    except OSError as error:
        raise ArgumentError("--out", f"{folder}: cannot be written: {error.strerror or error}") from error
    console.print(f"{escape(str(folder))}: {', '.join(path.name for path in written)}", soft_wrap=True)


def _settings(log: Path) -> Settings | None:
    """Return the settings attached to a log."""
    text = read_attachments(log).get("site.toml")
    return None if text is None else parse_settings(text, f"{log}: site.toml")


def _attached_structure(log: Path) -> Structure | None:
    text = read_attachments(log).get("structure.toml")
    return None if text is None else parse_structure(text, f"{log}: structure.toml")


def _identify(
    logs: Sequence[Path], window: float | None, method: Method, band: tuple[float, float] | None
) -> tuple[Windows, FusedModes]:
    named = ", ".join(map(str, logs))
    try:
        with console.status("reading ...") as status:
            number = iter(range(1, 1 << 30))
            windows = identify_windows(
                _recordings(logs, window), method, band, lambda _: status.update(f"window {next(number)} ...")
            )
        if not windows.estimates:
            raise LogError(named, windows.problems[0])
        return windows, fuse(windows.estimates)
    except (IdentificationError, ValueError) as error:
        raise LogError(named, str(error)) from error


def _recordings(logs: Sequence[Path], window: float | None) -> Iterator[Recording]:
    """Yield the windows of logs that have the same channels."""
    names = {channel.name for channel in log_channels(logs[0])}
    for log in logs:
        found = {channel.name for channel in log_channels(log)}
        if found != names:
            other = ", ".join(sorted(found ^ names))
            raise LogError(log, f"expected the channels of {logs[0]}; only one of the two has {other}")
        yield from log_recordings(log, window)


def _model(estimate: ModalEstimate, log: Path, path: Path | None) -> ModelModes | None:
    """Return the modes of the given or attached structure beside the measured ones; None if there is no structure."""
    structure = load_structure(path) if path else _attached_structure(log)
    if structure is None:
        return None
    try:
        return model_modes(estimate, structure)
    except UpdaterError as error:
        raise StructureError(path or f"{log}: structure.toml", str(error)) from error


def as_json(windows: Windows, fused: FusedModes, partners: Sequence[ModelPartner | None]) -> dict[str, Any]:
    """Return what other programs read, but for the method."""
    return {
        "modes": [_mode_json(fused, i, partner) for i, partner in enumerate(partners)],
        "harmonics": windows.harmonics.tolist(),
        "channels": windows.channels,
        "window": {"start": windows.start, "end": windows.end, "rate": windows.rate},
    }


def _mode_json(fused: FusedModes, i: int, partner: ModelPartner | None) -> dict[str, Any]:
    estimate = fused.estimate
    shape = dict(zip(estimate.channels, ([z.real, z.imag] for z in estimate.shape[i].tolist()), strict=True))
    quality: dict[str, Any] = {
        "support": float(estimate.support[i]),
        "law_ratio": float(estimate.law_ratio[i]),
        "mpc": float(mpc(estimate.shape[i])),
        "mpd": float(mpd(estimate.shape[i])),
        "windows": int(fused.n[i]),
    }
    if partner:
        quality["model"] = {"frequency": partner.frequency, "mac": partner.mac}
    return {
        "id": i + 1,
        "frequency": {"value": float(estimate.frequency[i]), "std": float(estimate.frequency_std[i])},
        "damping": {"value": float(estimate.damping[i]), "std": float(estimate.damping_std[i])},
        "shape": shape,
        "shape_std": dict(zip(estimate.channels, estimate.shape_std[i].tolist(), strict=True)),
        "quality": quality,
    }


def _say(logs: Sequence[Path], windows: Windows, fused: FusedModes, partners: Sequence[ModelPartner | None]) -> None:
    """Print the table and what else there is to know."""
    console.print(_table(logs, windows, fused, partners))
    if len(windows.harmonics):
        console.print("tones, no modes: " + ", ".join(f"{tone:.3f}" for tone in windows.harmonics) + " Hz")
    for channel, state in windows.channels.items():
        if state != "ok":
            console.print(f"channel {escape(channel)}: {state}")
    if windows.problems:
        console.print(f"{len(windows.problems)} windows gave no modes: {escape(windows.problems[0])}")
    if fused.scatter is not None:
        console.print(f"frequencies scatter {fused.scatter:.2f} times what the windows state")


def _table(logs: Sequence[Path], windows: Windows, fused: FusedModes, partners: Sequence[ModelPartner | None]) -> Table:
    estimate, first = fused.estimate, windows.estimates[0]
    compared = any(partners)
    n, seconds = len(windows.estimates), (first.end - first.start) * 1e-9
    what = f"{n} windows of {seconds:.6g} s" if n > 1 else f"one window of {seconds:.6g} s"
    table = Table(box=SIMPLE_HEAD, title=f"{escape(', '.join(log.name for log in logs))}: {what}")
    for name in (
        "mode",
        "frequency [Hz]",
        "damping [%]",
        "MPC",
        *(() if compared else ("MPD [°]",)),
        "seen",
        *(("model", "MAC") * compared),
    ):
        table.add_column(name, justify="right", no_wrap=True)
    for i, partner in enumerate(partners):
        cells = [
            str(i + 1),
            f"{estimate.frequency[i]:.4f} ± {estimate.frequency_std[i]:.4f}",
            f"{100 * estimate.damping[i]:.3f} ± {100 * estimate.damping_std[i]:.3f}",
            f"{float(mpc(estimate.shape[i])):.3f}",
            *([] if compared else [f"{np.degrees(float(mpd(estimate.shape[i]))):.1f}"]),
            str(int(fused.n[i])),
        ]
        if compared:
            cells += [f"{partner.frequency:.3f}", f"{partner.mac:.3f}"] if partner else ["-", "-"]
        table.add_row(*cells)
    return table
