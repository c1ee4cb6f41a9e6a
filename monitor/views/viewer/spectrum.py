"""Singular values of the spectral matrix with the stabilisation diagram's poles over them."""

import numpy as np
import rerun as rr

from monitor.results.run_results import RunResults
from monitor.results.windows import Spectrum, WindowResult
from monitor.views.member_axis import side_by_side, ticks
from monitor.views.palette import GREY, OK, Colour, mode_colour
from monitor.views.viewer.primitives import Axes, at, text

BOUNDS = ((-24.0, 218.0), (-20.0, 120.0))  # of the drawing, x and y
_WIDTH, _HEIGHT = 200.0, 108.0
_APART = 7.0  # between the labels of close modes
_ROOM_ABOVE = 1.12  # of the highest mode's frequency
_CURVES: tuple[tuple[Colour, float], ...] = (((226, 231, 240), 1.2), ((132, 140, 156), 0.8), ((92, 99, 114), 0.7))


def draw_spectra(recording: rr.RecordingStream, run_results: RunResults, *, static: bool = True) -> None:
    """Draw singular values, poles and identified modes, window by window; axes for ever, or for now if not `static`."""
    if not run_results.spectra:
        return
    axes = spectrum_axes(run_results)
    x = {float(f): f"{f:g}" for f in ticks(*axes.x_range, 9)}
    x[list(x)[-1]] += " Hz"
    y = {float(v): f"{v:g} dB" for v in ticks(*axes.y_range, 6)}
    axes.grid(recording, "/spectrum", x, y, room=11.0, static=static)
    highest = max((max(s.pole_order, default=1) for _, s in run_results.spectra), default=1)
    _orders(recording, highest, static=static)
    for window, spectrum in run_results.spectra:
        at(recording, window.end)
        _curves(recording, axes, spectrum)
        _poles(recording, axes, spectrum, highest)
        _identified(recording, axes, window)


def spectrum_axes(run_results: RunResults) -> Axes:
    """Return the axes that hold the spectra of all windows, up to a little above the highest mode."""
    spectra = [s for _, s in run_results.spectra]
    end = max(s.frequency[-1] for s in spectra)
    named = [m.frequency for w, _ in run_results.spectra for m in w.modes] + [
        m.frequency for m in (run_results.reference.modes if run_results.reference else [])
    ]
    highest = min(end, _ROOM_ABOVE * max(named)) if named else end
    low = min(_low(s, highest) for s in spectra)
    high = max(low + 10, *(max(s.singular_values[0]) for s in spectra))
    return Axes(
        left=0.0,
        top=0.0,
        width=_WIDTH,
        height=_HEIGHT,
        x_range=(0.0, highest),
        y_range=(10 * np.floor(low / 10), 10 * np.ceil(high / 10)),
    )


def _low(spectrum: Spectrum, highest: float) -> float:
    """Return a level under all but the lowest hundredth of a spectrum: the fall towards 0 Hz need not be seen."""
    inside = np.array(spectrum.frequency) <= highest
    return float(np.quantile(np.array(spectrum.singular_values)[:, inside], 0.01))


def _orders(recording: rr.RecordingStream, highest: int, *, static: bool) -> None:
    """Write the model orders of the poles at the right edge."""
    values = [v for v in ticks(0, highest, 4) if v > 0]
    places = [[_WIDTH + 8, _HEIGHT * (1 - v / highest) - 4] for v in values]
    labels = [f"{v:g}" for v in values]
    text(recording, "/spectrum/orders", [*places, [_WIDTH + 8, -9.0]], [*labels, "order"], [GREY], static=static)


def _curves(recording: rr.RecordingStream, axes: Axes, spectrum: Spectrum) -> None:
    frequency = np.array(spectrum.frequency)
    keep = (frequency <= axes.x_range[1]) & (frequency > 0)
    levels = np.maximum(np.array(spectrum.singular_values)[:, keep], axes.y_range[0])
    curves = [axes.curve(frequency[keep], values) for values in levels]
    styles = [_CURVES[min(i, len(_CURVES) - 1)] for i in range(len(curves))]
    strips = rr.LineStrips2D(
        curves[::-1],  # the first one on top
        colors=[colour for colour, _ in styles[::-1]],
        radii=[-radius for _, radius in styles[::-1]],  # below zero: in points of the screen
        draw_order=10.0,
    )
    recording.log("/spectrum/singular_values", strips)


def _poles(recording: rr.RecordingStream, axes: Axes, spectrum: Spectrum, highest: int) -> None:
    frequency, stable = np.array(spectrum.pole_frequency, float), np.array(spectrum.pole_stable, bool)
    height = _HEIGHT * (1 - np.array(spectrum.pole_order, float) / highest)
    places, shown = np.column_stack([axes.x(frequency), height]), frequency <= axes.x_range[1]
    for name, chosen, colour, radius in (("stable", shown & stable, OK, 2.2), ("other", shown & ~stable, GREY, 1.1)):
        points = rr.Points2D(places[chosen], colors=[colour], radii=rr.Radius.ui_points(radius), draw_order=20.0)
        recording.log(f"/spectrum/poles/{name}", points)


def _identified(recording: rr.RecordingStream, axes: Axes, window: WindowResult) -> None:
    """Draw a line a mode; a label above it where the mode is tracked, and so has an identity."""
    x = axes.x(np.array([m.frequency for m in window.modes], float))
    tracked = window.phase != "learning"
    colours = [mode_colour(m.id) if tracked else GREY for m in window.modes]
    names = side_by_side(x, _APART, axes.left + axes.width)
    lines = [[[b, -5.0], [a, -1.0], [a, _HEIGHT]] for a, b in zip(x, names if tracked else x, strict=True)]
    thin = rr.Radius.ui_points(0.7)
    recording.log("/spectrum/modes/lines", rr.LineStrips2D(lines, colors=colours, radii=thin, draw_order=5.0))
    places, labels = [[b, -12.0] for b in names], [str(m.id) for m in window.modes]
    if not tracked:
        places, labels = [], []
    text(recording, "/spectrum/modes/names", places, labels, colours[: len(labels)], static=False)
