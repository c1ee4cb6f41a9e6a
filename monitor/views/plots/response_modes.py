"""Modes of frequency responses drawn: measured and synthesised responses, poles, shapes; and the files of a folder."""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from daq import FloatArray
from daq.files import FrequencyResponses, Geometry, header_set, write_responses
from monitor.analysis.modal_table.responses import IdentifiedFile
from monitor.views.plots.identification_folder import structure_geometry
from oma import ComplexArray, ResponseIdentification, places_by_name, write_universal
from oma.plots import (
    LINE,
    MODE,
    Skeleton,
    complexity_figure,
    draw_damping,
    draw_poles,
    figure_of_modes,
    highest_shown,
    mac_with_model_figure,
    mark_modes,
)
from updater.quantities import Vector
from updater.validation import ModelModes

_DPI = 110
_PANELS = 4  # responses that are drawn, those of the largest motion
_TINY = 1e-30
_ROOM = 6.0  # dB above and below


@dataclass(frozen=True, eq=False, kw_only=True)
class ResponseResults:
    """Results to be drawn and written."""

    identified: IdentifiedFile
    model: ModelModes | None  #: model to compare with
    geometry: Geometry | None  #: of the file
    content: Mapping[str, Any]  #: content of modes.json


@dataclass(frozen=True, eq=False, kw_only=True)
class _FileGeometry:
    """Geometry of a file, to draw shapes on."""

    axis_lines: FloatArray  #: (n_lines, 2, 3) their ends [m]
    measuring_axes: Mapping[str, tuple[Vector, Vector]]  #: channel -> position [m], direction


def draw_response_modes(path: Path, found: ResponseIdentification) -> None:
    """Write a picture: singular values of the responses, poles, shapes."""
    figure, diagram = figure_of_modes(found.estimate)
    _draw_diagram(diagram, found)
    figure.savefig(path, dpi=_DPI)


def write_response_folder(folder: Path, results: ResponseResults) -> list[Path]:
    """Write modes.json, modes.unv, responses and the pictures, over those of an earlier run; return the files.

    `responses.unv` has the accelerances that were analysed, with their coherences, `synthesis.unv` those of the modes.
    Lines that were left out are zero in it.

    Raises
    ------
    OSError
        If one cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    found, model = results.identified.modes, results.model
    written = [folder / name for name in ("modes.json", "modes.unv", "responses.unv", "synthesis.unv")]
    written[0].write_text(json.dumps(results.content, indent=1), encoding="utf-8")
    geometry: dict[str, Any] = {}
    if model:
        geometry = dict(
            zip(("places", "nodes", "lines"), structure_geometry(model.structure, found.estimate), strict=True)
        )
    elif results.geometry:
        geometry = {"nodes": results.geometry.nodes, "lines": results.geometry.lines}
    write_universal(written[1], found.estimate, **geometry, modal_mass=found.modal_mass)
    measured = results.identified.responses
    write_responses(written[2], measured, header_set("accelerances as analysed"))
    write_responses(written[3], _synthesis(measured, found), header_set("accelerances of the modes"))
    skeleton = model.structure if model else _skeleton(results)
    pictures: dict[str, Callable[[], Figure]] = {
        "stabilization.png": lambda: stabilization_figure(found),
        "responses.png": lambda: response_figure(found),
        "mac.png": lambda: mac_with_model_figure(
            found.estimate, model.near(found.estimate.frequency) if model else None
        ),
        "shapes.png": lambda: found.estimate.plot_shapes(skeleton),
        "complexity.png": lambda: complexity_figure(found.estimate),
    }
    for name, draw in pictures.items():
        draw().savefig(folder / name, dpi=_DPI)
        written.append(folder / name)
    return written


def _synthesis(measured: FrequencyResponses, found: ResponseIdentification) -> FrequencyResponses:
    """Return the accelerances of the modes on all lines of the file, zero outside of those that were analysed."""
    response = np.zeros((len(measured.frequency), *found.synthesis.shape[1:]), np.complex128)
    response[np.isin(measured.frequency, found.frequency)] = found.synthesis
    return FrequencyResponses(
        frequency=measured.frequency, response=response, outputs=found.estimate.channels, inputs=measured.inputs
    )


def stabilization_figure(found: ResponseIdentification) -> Figure:
    """Draw poles over frequency by model order with the singular values behind them, and the damping."""
    figure = Figure(figsize=(14, 9), layout="constrained")
    upper, lower = np.ravel(figure.subplots(2, 1, height_ratios=(2, 1), sharex=True))
    _draw_diagram(upper, found)
    upper.set_xlabel("")
    draw_damping(lower, found.poles, found.estimate)
    return figure


def response_figure(found: ResponseIdentification) -> Figure:
    """Draw the largest responses, measured and synthesised from the modes."""
    size = np.linalg.norm(found.response, axis=0)
    chosen = np.argsort(-size, axis=None, kind="stable")[:_PANELS]
    figure = Figure(figsize=(14, 3.0 * len(chosen) + 1), layout="constrained")
    panels = figure.subplots(len(chosen), 1, sharex=True, squeeze=False)[:, 0]
    for axes, place in zip(panels, chosen.tolist(), strict=True):
        channel, force = np.unravel_index(place, size.shape)
        pair = found.response[:, channel, force], found.synthesis[:, channel, force]
        for values, colour, width, label in zip(pair, (LINE, MODE), (1.2, 0.9), ("measured", "modes"), strict=True):
            axes.plot(found.frequency, _decibels(values), color=colour, linewidth=width, label=label)
        axes.set_title(
            f"{found.estimate.channels[channel]}, force {found.forces[force]}: "
            f"FRAC {found.agreement[channel, force]:.4f}",
            fontsize=9,
        )
        axes.set_ylabel("dB re 1 m/s²/N")
        axes.grid(alpha=0.3)
    panels[0].legend(loc="upper right", fontsize=8)
    panels[-1].set_xlabel("frequency [Hz]")
    return figure


def _draw_diagram(axes: Axes, found: ResponseIdentification) -> None:
    """Draw poles, modes, and the singular values of measured and synthesised responses behind them."""
    highest = min(highest_shown(found.estimate), float(found.frequency[-1]))
    draw_poles(axes, found.poles, highest)
    behind = axes.twinx()
    axes.set(zorder=behind.get_zorder() + 1, frame_on=False)
    shown = found.frequency <= highest
    level = _decibels(np.linalg.svd(found.response[shown], compute_uv=False).astype(np.float64))
    for k, line in enumerate(level.T[:3]):
        behind.plot(found.frequency[shown], line, color=LINE, linewidth=max(1.2 - 0.3 * k, 0.5), alpha=1 - 0.25 * k)
    behind.set_ylim(float(np.quantile(level, 0.01)) - _ROOM, float(level.max()) + _ROOM)
    behind.set_ylabel("singular values of the responses [dB re 1 m/s²/N]")
    mark_modes(axes, found.estimate, np.empty(0), highest)


def _decibels(values: ComplexArray | FloatArray) -> FloatArray:
    return np.asarray(20 * np.log10(np.maximum(np.abs(values), _TINY)))


def _skeleton(results: ResponseResults) -> Skeleton | None:
    """Return the geometry of the file if all channels are at its nodes, else None."""
    geometry, channels = results.geometry, results.identified.modes.estimate.channels
    if geometry is None:
        return None
    places = places_by_name(channels)
    if any(places[name].node not in geometry.nodes for name in channels):
        return None
    ends = [(a, b) for line in geometry.lines for a, b in pairwise(line)]
    return _FileGeometry(
        axis_lines=np.array([[geometry.nodes[a], geometry.nodes[b]] for a, b in ends]).reshape(-1, 2, 3),
        measuring_axes={name: (geometry.nodes[places[name].node], places[name].direction) for name in channels},
    )
