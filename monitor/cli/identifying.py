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

from daq import FloatArray, LogError, Recording, read_attachments
from monitor.cli.files import write_json
from monitor.errors import ArgumentError
from monitor.fusion import FusedModes, Windows, fuse, identify_windows
from monitor.recordings import log_channels, log_recordings
from monitor.settings import Settings, parse_settings
from oma import METHODS, IdentificationError, Method, ModalEstimate, identify_all, mac_matrix, mpc, mpd, pair_modes
from updater import (
    Structure,
    StructureError,
    UpdaterError,
    build_model,
    channel_rows,
    load_structure,
    parse_structure,
    real_shape,
)

console = Console(highlight=False)


@dataclass(frozen=True, kw_only=True)
class Options:
    """What the command line asks for."""

    method: str = "ssi-data"
    window: float | None = None  #: [s]; the log's settings', else the whole log
    band: tuple[float, float] | None = None  #: [Hz]; the log's settings', else chosen
    structure: Path | None = None  #: to compare with; the one attached to the log, if any


@dataclass(frozen=True, eq=False)
class ModelPartner:
    """The model's mode that answers to a measured one."""

    frequency: float  #: [Hz]
    mac: float  #: [-]


def identify_command(logs: Sequence[Path], options: Options, json_path: Path | None, picture: Path | None) -> int:
    """Print the modes; write them as JSON and draw them where asked."""
    if options.method not in METHODS:
        raise ArgumentError("--method", f"expected one of {', '.join(METHODS)}, found {options.method!r}")
    if options.band is not None and not 0 < options.band[0] < options.band[1]:
        raise ArgumentError("--band", f"expected 0 < low < high, found {options.band[0]:g} {options.band[1]:g}")
    settings = _settings(logs[0])
    window = options.window or (settings.analysis.window_seconds if settings else None)
    band = options.band or (settings.analysis.band if settings else None)
    method = METHODS[options.method]()
    windows, fused = _identify(logs, window, method, band)
    partners = _partners(fused.estimate, logs[0], options.structure)
    _say(logs, windows, fused, partners)
    if json_path:
        about = {"name": options.method, "windows": len(windows.estimates), "window_seconds": window, "band": band}
        content = as_json(windows, fused, partners) | {"method": about | {"options": asdict(method)}}
        write_json(json_path, content)
    if picture:
        _draw(picture, _recordings(logs, window), method, band, fused.estimate)
    return 0


def _draw(
    path: Path,
    recordings: Iterable[Recording],
    method: Method,
    band: tuple[float, float] | None,
    estimate: ModalEstimate,
) -> None:
    """Draw the first window that gives modes, with the modes of all."""
    from monitor.modes_picture import draw_modes  # matplotlib: only where a picture is asked for

    for recording in recordings:
        with suppress(IdentificationError):
            found = identify_all(recording, method, band)
            break
    try:
        draw_modes(path, recording, found, estimate)
    except (OSError, ValueError) as error:  # matplotlib: ValueError for an ending it does not know
        raise ArgumentError("--picture", f"{path}: cannot be written: {error}".splitlines()[0]) from error


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


def _partners(estimate: ModalEstimate, log: Path, path: Path | None) -> list[ModelPartner | None]:
    """Return the mode of the given or attached structure for each measured one, None where there is none."""
    structure = load_structure(path) if path else _attached_structure(log)
    if structure is None:
        return [None] * estimate.n_modes
    try:
        return _model_partners(estimate, structure)
    except UpdaterError as error:
        raise StructureError(path or f"{log}: structure.toml", str(error)) from error


def _model_partners(estimate: ModalEstimate, structure: Structure) -> list[ModelPartner | None]:
    model = build_model(structure, shear_flexible=True, mass="consistent")
    modes = model.modes(min(estimate.n_modes + 10, model.n_dofs - 1))
    shapes: FloatArray = (channel_rows(model, estimate.channels) @ modes.shape).T
    seen = np.flatnonzero(np.linalg.norm(shapes, axis=1) > 0)
    pairs = pair_modes(estimate.frequency, real_shape(estimate.shape), modes.frequency[seen], shapes[seen])
    return [
        None
        if k < 0
        else ModelPartner(float(modes.frequency[seen[k]]), float(mac_matrix(shape[None], shapes[seen[k]][None])[0, 0]))
        for shape, k in zip(estimate.shape, pairs, strict=True)
    ]


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
    for name in ("mode", "frequency [Hz]", "damping [%]", "MPC", "seen", *(("model", "MAC") * compared)):
        table.add_column(name, justify="right", no_wrap=True)
    for i, partner in enumerate(partners):
        cells = [
            str(i + 1),
            f"{estimate.frequency[i]:.4f} ± {estimate.frequency_std[i]:.4f}",
            f"{100 * estimate.damping[i]:.3f} ± {100 * estimate.damping_std[i]:.3f}",
            f"{float(mpc(estimate.shape[i])):.3f}",
            str(int(fused.n[i])),
        ]
        if compared:
            cells += [f"{partner.frequency:.3f}", f"{partner.mac:.3f}"] if partner else ["-", "-"]
        table.add_row(*cells)
    return table
