"""Modes of measured frequency responses: identified, compared with a structure, printed and written."""

from collections.abc import Collection, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.markup import escape
from rich.table import Table

from daq import DataError, LogError
from daq.errors import writing
from daq.files import read_geometry
from monitor.analysis.modal_table.responses import IdentifiedFile, identify_file
from monitor.cli.data.identify.identification import animate_modes, load_structure_file, paired_modes
from monitor.cli.data.identify.identification_output import LOW_MAC, mode_json
from monitor.cli.options import DONE
from monitor.cli.output import write_json
from monitor.cli.terminal import console, echo, new_table, progress
from monitor.errors import ArgumentError, drawing
from monitor.text.quantities import aligned_numbers, counted
from oma import ResponseIdentification, mpc, mpd
from updater.modal_data import LOW_MPC

if TYPE_CHECKING:
    from updater.validation import ModelModes, ModelPartner

_LEFT = 0.01  # amplitude at the end of a record from which modal masses are in doubt [-]


@dataclass(frozen=True, kw_only=True)
class ResponseRequest:
    """Arguments of the command for a file of frequency responses."""

    paths: Sequence[Path]
    of_logs: Collection[str]  #: options that were given, and are for logs
    band: tuple[float, float] | None
    window: float | None  #: time constant of the exponential window [s]
    structure: Path | None
    json: Path | None
    picture: Path | None
    animate: Path | None
    out: Path | None

    def check(self) -> Path:
        """Return the file, after a check of all arguments."""
        if len(self.paths) > 1:
            raise ArgumentError("LOG", f"expected one file of frequency responses, found {len(self.paths)} files")
        for name in self.of_logs:
            raise ArgumentError(name, f"expected a log, found frequency responses ({self.paths[0]})")
        if self.window is not None and not self.window > 0:
            raise ArgumentError("--exponential-window", f"expected a positive time in s, found {self.window:g}")
        return self.paths[0]


def identify_response_file(request: ResponseRequest) -> int:
    """Identify the modes of a file of frequency responses, and write what is requested."""
    path = request.check()
    structure = load_structure_file(request.structure) if request.structure else None
    with progress("identifying"):
        identified = identify_file(path, structure.channels if structure else None, request.band, request.window)
    found = identified.modes
    model = paired_modes(found.estimate, structure, request.structure)
    _say(path, identified, model)
    content = _as_json(path, identified, model, request.window)
    if request.json:
        write_json(request.json, content)
    with progress("drawing"):
        if request.animate:
            animate_modes(request.animate, found.estimate, model)
        if request.picture:
            from monitor.views.plots.response_modes import (
                draw_response_modes,  # matplotlib is loaded only for a picture
            )

            with drawing(request.picture, "--picture"):
                draw_response_modes(request.picture, found)
        if request.out:
            _fill(request.out, path, identified, model, content)
    return DONE


def _as_json(
    path: Path, identified: IdentifiedFile, model: "ModelModes | None", window: float | None
) -> dict[str, Any]:
    """Return the output for other programs."""
    found, header = identified.modes, identified.header
    return {
        "modes": [
            mode_json(found.estimate, i, _partner(model, i), {}) | {"modal_mass": _mass_json(found, i)}
            for i in range(found.estimate.n_modes)
        ],
        "channels": dict.fromkeys(found.estimate.channels, "ok") | dict.fromkeys(found.silent, "zero in all lines"),
        "agreement": {
            channel: {force: x if np.isfinite(x) else None for force, x in zip(found.forces, values, strict=True)}
            for channel, values in zip(found.estimate.channels, found.agreement.tolist(), strict=True)
        },
        "method": {
            "name": "responses",
            "file": path.name,
            "band": found.band,
            "lines": len(found.frequency),
            "exponential_window": window,
            "weighted_by_coherence": found.weighted,
            "header": asdict(header) if header else None,
        },
    }


def _mass_json(found: ResponseIdentification, i: int) -> dict[str, float] | None:
    mass = float(found.modal_mass[i])
    return {"value": mass, "std": float(found.modal_mass_std[i])} if np.isfinite(mass) else None


def _partner(model: "ModelModes | None", i: int) -> "ModelPartner | None":
    return model.partner(i) if model else None


def _say(path: Path, identified: IdentifiedFile, model: "ModelModes | None") -> None:
    """Print the table and the notes."""
    found, estimate = identified.modes, identified.modes.estimate
    n_lines, n_channels, n_forces = found.response.shape
    title = f"{path.name}: {counted(n_channels, 'channel')}, {counted(n_forces, 'force')}, {n_lines} lines"
    console.print(_table(title, found, model))
    low, high = found.band
    console.print(f"band: {low:.4g} to {high:.4g} Hz; lines of {1 / found.record_seconds:.4g} Hz")
    console.print(f"measured responses and those of the modes: lowest FRAC {np.nanmin(found.agreement):.4f}")
    console.print(_coherence_line(identified))
    if identified.header and identified.header.text:
        console.print(f"header of the file: {escape(identified.header.text)}")
    notes = []
    if found.silent:
        notes.append(f"! left out, zero in all lines: {escape(', '.join(found.silent))}")
    if (mpc(estimate.shape) < LOW_MPC).any():
        notes.append(f"! MPC below {LOW_MPC:g}: the channels do not move in phase")
    if any(p and p.mac < LOW_MAC for p in (_partner(model, i) for i in range(estimate.n_modes))):
        notes.append(f"! MAC below {LOW_MAC:g}: not the shape of the model's mode")
    notes += _mass_notes(found)
    for note in notes:
        console.print(note)


def _coherence_line(identified: IdentifiedFile) -> str:
    """Return what of the coherence was used."""
    coherence = identified.responses.coherence
    if coherence is None:
        return "coherence: none in the file; all lines weighted equally"
    known = np.isfinite(coherence).all(axis=0)
    if not known.all():
        return f"coherence: of {known.sum()} of {counted(known.size, 'response')}, not used; all lines weighted equally"
    low, high = identified.modes.band
    inside = (identified.responses.frequency >= low) & (identified.responses.frequency <= high)
    median = np.median(coherence[inside], axis=0)
    if not identified.modes.weighted:
        return "coherence: one in most lines, as of a single blow, not used; all lines weighted equally"
    row, column = np.unravel_index(int(np.argmin(median)), median.shape)
    worst = f"{identified.responses.outputs[row]}, force {identified.responses.inputs[column]}"
    return escape(f"coherence: weight of lines and responses; lowest median {median.min():.3f} ({worst})")


def _mass_notes(found: ResponseIdentification) -> list[str]:
    """Return remarks on the modal masses."""
    if not np.isfinite(found.modal_mass).all():
        return ["no force is along a channel at its place: no modal masses"]
    notes = []
    if (found.modal_mass < 0).any():
        notes.append("negative modal mass: force and response at the driving point have opposite signs")
    worst = int(np.argmax(found.left_at_end))
    if found.left_at_end[worst] > _LEFT:
        notes.append(
            f"mode {worst + 1} has {100 * found.left_at_end[worst]:.2g} % of its motion left at the end of a record of "
            f"{found.record_seconds:.3g} s: after blows of a hammer, its modal mass may have an error of that size"
        )
    return notes


def _table(title: str, found: ResponseIdentification, model: "ModelModes | None") -> Table:
    estimate = found.estimate
    massive = bool(np.isfinite(found.modal_mass).all())
    names = ["mode", "frequency [Hz]", "damping [%]", "MPC", *([] if model else ["MPD [°]"])]
    names += ["modal mass [kg]"] * massive + ["model", "MAC"] * (model is not None)
    table = new_table(right=names, no_wrap=True, title=title)
    frequencies = aligned_numbers(zip(estimate.frequency, estimate.frequency_std, strict=True))
    dampings = aligned_numbers(zip(100 * estimate.damping, 100 * estimate.damping_std, strict=True))
    masses = aligned_numbers(zip(found.modal_mass, found.modal_mass_std, strict=True)) if massive else []
    for i in range(estimate.n_modes):
        phase, partner = float(mpc(estimate.shape[i])), _partner(model, i)
        cells = [str(i + 1), frequencies[i], dampings[i], f"{'! ' if phase < LOW_MPC else ''}{phase:.3f}"]
        cells += [] if model else [f"{np.degrees(float(mpd(estimate.shape[i]))):.1f}"]
        cells += masses[i : i + 1]
        if partner:
            cells += [f"{partner.frequency:.3f}", f"{'! ' if partner.mac < LOW_MAC else ''}{partner.mac:.3f}"]
        elif model:
            cells += ["-", "-"]
        table.add_row(*cells)
    return table


def _fill(
    folder: Path, path: Path, identified: IdentifiedFile, model: "ModelModes | None", content: dict[str, Any]
) -> None:
    """Write all files into a folder, and print their names."""
    from monitor.views.plots.response_modes import ResponseResults, write_response_folder  # loads matplotlib

    try:
        geometry = read_geometry(path)
    except DataError as error:
        raise LogError(path, str(error).removeprefix(f"{path}: ")) from error
    results = ResponseResults(identified=identified, model=model, geometry=geometry, content=content)
    with writing(folder, ArgumentError.of_file("--out")):
        written = write_response_folder(folder, results)
    echo(f"{folder}: {', '.join(one.name for one in written)}")
