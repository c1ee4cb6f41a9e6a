"""Figures of measured and simulated modes, sensors, residual forces and virtual sensors."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from daq import FloatArray
from daq.notebook import number_text
from monitor.results.comparison import (
    BalanceResult,
    DiscrepancyResult,
    FrequencyTrend,
    SensorComparison,
    SignalComparison,
)
from monitor.results.windows import ReferenceResult
from monitor.text.causes import SIGNIFICANT, position_text
from monitor.views.geometry import Geometry
from monitor.views.report.structure_figure import Frame
from monitor.views.report.svg import LIGHT, SENSOR, mode_colour
from oma.plots import ALARM, FAINT, INK, OK, SOFT, WIDTH, new_figure

_WRITTEN = 10  # modes up to which each MAC is written into its cell
_MIN = 1e-5  # smallest value on a logarithmic scale


def mac_figure(found: DiscrepancyResult) -> Figure | None:
    """Return the MAC of every simulated with every measured mode; None without modes."""
    mac = _matrix(found.mac)
    if not mac.size:
        return None
    rows, columns = mac.shape
    figure = new_figure(WIDTH, _mac_height(found))
    axes = figure.subplots()
    axes.grid(visible=False)
    image = axes.imshow(mac, cmap="Blues", vmin=0, vmax=1, aspect="auto")
    axes.set_xticks(range(columns), [f"{f:.4g}" for f in found.columns], rotation=90, fontsize=7)
    axes.set_yticks(range(rows), [f"{f:.4g}" for f in found.rows], fontsize=7)
    first, second = ("before", "now") if found.measured_before else ("model", "measured")
    modes = "modes before with modes now" if found.measured_before else "simulated with measured modes"
    axes.set_title(f"MAC of {modes}")
    axes.set_xlabel(f"{second} [Hz]")
    axes.set_ylabel(f"{first} [Hz]")
    if max(rows, columns) <= _WRITTEN:
        for (i, k), value in np.ndenumerate(mac):
            if value >= 0.005:
                text = f"{value:.3f}" if value >= 0.5 else f"{value:.2f}"
                axes.text(k, i, text, ha="center", va="center", fontsize=6, color=LIGHT if value > 0.6 else "black")
    bar = figure.colorbar(image, ax=axes, shrink=0.8, aspect=25, pad=0.02)
    bar.set_label("MAC", fontsize=7)
    bar.outline.set_visible(False)
    return figure


def _mac_height(found: DiscrepancyResult) -> float:
    """Return the height of the picture of the MAC [inches], so that its cells are nearly square."""
    return 0.9 + min(4.0, WIDTH * 0.72 * len(found.rows) / max(len(found.columns), 1))


def _matrix(rows: tuple[tuple[float | None, ...], ...]) -> FloatArray:
    return np.array([[np.nan if v is None else v for v in row] for row in rows], float)


def offsets_figure(found: DiscrepancyResult) -> Figure | None:
    """Return each pair's frequency, measured against simulated, without and with the causes, in per cent."""
    pairs = [m for m in found.modes if m.off_percent is not None]
    if not pairs:
        return None
    figure = new_figure(WIDTH, max(_mac_height(found), 2.9))
    axes = figure.subplots()
    number = np.arange(len(pairs))
    off = np.array([m.off_percent for m in pairs], float)
    std = np.array([m.std_percent or np.nan for m in pairs], float)
    after = _column([m.off_percent_after for m in pairs])
    axes.axhline(0.0, color=SOFT, linewidth=0.8)
    axes.errorbar(number - 0.12, off, 2 * std, fmt="o", markersize=5, color=ALARM, capsize=3, label="without")
    if np.isfinite(after).any():
        axes.errorbar(
            number + 0.12, after, 2 * std, fmt="o", markersize=5, color=OK, capsize=3, label="with the causes"
        )
        figure.legend(fontsize=7, loc="outside lower center", ncols=2)
    axes.set_xticks(number, [f"{m.measured:.4g}" for m in pairs], rotation=90, fontsize=7)
    axes.set_xlabel("mode now [Hz]" if found.measured_before else "measured mode [Hz]")
    axes.set_title(f"Measured frequencies relative to {'those before' if found.measured_before else 'the model'}")
    axes.set_ylabel("difference [%]")
    return figure


def sensors_figure(found: DiscrepancyResult) -> Figure | None:
    """Return residual, prediction error, and 1 - COMAC of each sensor, without and with the causes."""
    if not found.sensors:
        return None
    has_prediction = any(s.missed is not None for s in found.sensors)
    figure = new_figure(WIDTH, 1.2 + 0.26 * len(found.sensors))
    panels = np.atleast_1d(figure.subplots(1, 3 if has_prediction else 2, sharey=True))
    names = [s.channel for s in found.sensors]
    level: FloatArray = np.arange(float(len(names)))
    _dots(panels[0], level, found.sensors, "residual", "noise", "residual [%]")
    if has_prediction:
        _dots(panels[1], level, found.sensors, "missed", "missed_least", "prediction error [%]")
    last = panels[-1]
    for colour, values, shift in (
        (ALARM, _column([1 - s.comac for s in found.sensors]), -0.12),
        (OK, _column([None if s.comac_after is None else 1 - s.comac_after for s in found.sensors]), 0.12),
    ):
        last.plot(np.maximum(values, _MIN), level + shift, "o", markersize=4.5, color=colour)
    last.set_xscale("log")
    last.set_xlabel("1 - COMAC [-]")
    titles = ("Shape residual", "Prediction error", "COMAC") if has_prediction else ("Shape residual", "COMAC")
    for panel, title in zip(panels, titles, strict=True):
        panel.set_title(title, fontsize=8)
    panels[0].set_ylabel("sensor")
    panels[0].set_yticks(level, names, fontsize=7)
    panels[0].invert_yaxis()
    return figure


def _dots(
    axes: Axes, level: FloatArray, sensors: tuple[SensorComparison, ...], name: str, least: str, label: str
) -> None:
    """Draw one figure per sensor in per cent, red without and green with the causes; a bar: the unavoidable part."""
    floor = 100 * _column([getattr(s, least) for s in sensors])
    axes.barh(level, floor, height=0.55, color=FAINT)
    axes.plot(100 * _column([getattr(s, name) for s in sensors]), level - 0.12, "o", markersize=4.5, color=ALARM)
    axes.plot(
        100 * _column([getattr(s, name + "_after") for s in sensors]), level + 0.12, "o", markersize=4.5, color=OK
    )
    axes.set_xlim(left=0.0)
    axes.set_xlabel(label)


def _column(values: list[float | None] | tuple[float | None, ...]) -> FloatArray:
    return np.array([np.nan if v is None else v for v in values], float)


def balance_figure(reference: ReferenceResult, balance: BalanceResult, reading: str) -> Figure:
    """Return one reading of the residual forces, drawn on the structure.

    Parameters
    ----------
    reference : with the nodes
    balance : of the same nodes, known at one of them at least
    reading : loss or added
    """
    values, peak = _peak(balance, reading)
    figure = new_figure(WIDTH, 4.4)
    axes, frame = figure.subplots(), Frame(reference)
    what = "missing stiffness [%]" if reading == "loss" else "excess mass [%]"
    axes.set_title(f"Residual forces as {what.partition(' [')[0]}")
    frame.draw_values(axes, 100 * values, what)
    if peak is not None:
        frame.draw_note(axes, reference.nodes[peak[0]], peak[1])
    return figure


def balance_text(reference: ReferenceResult, balance: BalanceResult, reading: str) -> str:
    """Return the strongest place of one reading in words; empty where nothing is known. Arguments as for the figure."""
    values, peak = _peak(balance, reading)
    if not np.isfinite(values).any():
        return ""
    if peak is None:
        return f"nowhere beyond {SIGNIFICANT:g} standard deviations"
    at = reference.nodes[peak[0]]
    return f"largest {peak[1]} {position_text(at, Geometry(reference).names.name(at), 3)}"


def _peak(balance: BalanceResult, reading: str) -> tuple[FloatArray, tuple[int, str] | None]:
    """Return the values (n_nodes,), and the strongest node with its value in words if that is significant."""
    values, std = _column(getattr(balance, reading)), _column(getattr(balance, reading + "_std"))
    if not np.isfinite(values).any():
        return values, None
    peak = int(np.nanargmax(np.abs(values)))
    if abs(values[peak]) <= SIGNIFICANT * std[peak]:
        return values, None
    return values, (peak, f"{100 * values[peak]:+.1f} ± {100 * std[peak]:.1f} %")


def signal_figure(signal: SignalComparison) -> Figure:
    """Return a sensor's signal in time, measured and predicted."""
    figure = new_figure(WIDTH, 2.5)
    axes = figure.subplots()
    t = 1000 * signal.step * np.arange(len(signal.measured))
    unit, name = (1000.0, "mm/s²") if np.abs(signal.measured).max() < 0.1 else (1.0, "m/s²")
    axes.plot(t, unit * np.array(signal.measured), color=INK, linewidth=1.3, label="measured")
    axes.plot(t, unit * np.array(signal.predicted), color=SENSOR, linewidth=1.0, label="predicted from the others")
    figure.legend(fontsize=7, loc="outside lower center", ncols=2)
    axes.set_title(f"{signal.channel}: signal", fontsize=8.5)
    axes.set_xlabel(f"time from {signal.start:.1f} s [ms]")
    axes.set_ylabel(f"acceleration [{name}]")
    return figure


def spectrum_figure(signal: SignalComparison) -> Figure:
    """Return amplitude densities about the resonances, side by side, with equal widths."""
    figure = new_figure(WIDTH, 2.5)
    axes = figure.subplots()
    frequency = _column(signal.frequency)
    place, ticks = _side_by_side(frequency)
    curves = [("measured", signal.spectrum, INK, 1.2), ("prediction error", signal.missed, ALARM, 0.9)]
    if signal.missed_after != signal.missed:
        curves.append(("prediction error with the causes", signal.missed_after, OK, 0.9))
    for name, values, colour, width in curves:
        axes.semilogy(place, np.sqrt(_column(values)), color=colour, linewidth=width, label=name)
    figure.legend(fontsize=7, loc="outside lower center", ncols=3)
    axes.set_xticks(list(ticks), list(ticks.values()), fontsize=7)
    axes.set_title(f"{signal.channel}: spectrum", fontsize=8.5)
    axes.set_xlabel("frequency near each resonance [Hz]")
    axes.set_ylabel("spectral density [m/s²/√Hz]")
    return figure


def _side_by_side(frequency: FloatArray) -> tuple[FloatArray, dict[float, str]]:
    """Return places (n,) of lines in stretches that NaN divides, each stretch one wide, and the stretches' names."""
    stretch = np.cumsum(np.isnan(frequency))
    place, ticks = np.full(len(frequency), np.nan), {}
    for number in range(int(stretch[-1]) + 1):
        mine = np.flatnonzero((stretch == number) & np.isfinite(frequency))
        low, high = frequency[mine[0]], frequency[mine[-1]]
        place[mine] = 1.2 * number + (frequency[mine] - low) / max(high - low, 1e-12)
        ticks[1.2 * number + 0.5] = f"{(low + high) / 2:.3g}"
    return place, ticks


def trends_figure(trends: tuple[FrequencyTrend, ...], over: str) -> Figure | None:
    """Return each mode's frequency over temperature or amplitude, with its straight line; None if unknown."""
    mine = [t for t in trends if t.over == over]
    if not mine:
        return None
    figure = new_figure(WIDTH, 3.2)
    axes = figure.subplots()
    for number, trend in enumerate(mine, 1):
        at, change = np.array(trend.at), np.array(trend.change_percent)
        colour = mode_colour(number)
        axes.errorbar(at, change, np.array(trend.std_percent), fmt="o", markersize=3, linewidth=0.7, color=colour)
        ends, weight = np.array([at.min(), at.max()]), np.array(trend.std_percent) ** -2.0
        middle = float(weight @ at / weight.sum())  # the line goes through the weighted means
        label = f"{trend.mode:.4g} Hz: {number_text(trend.slope, trend.slope_std)} %/{trend.unit}"
        axes.plot(ends, trend.slope * (ends - middle), color=colour, linewidth=1.1, label=label)
    axes.set_xlabel(f"{over} [{'°C' if mine[0].unit == 'K' else mine[0].unit}]")
    axes.set_title(f"Frequencies over {over}")
    axes.set_ylabel("difference from the mean [%]")
    axes.legend(fontsize=6.5, loc="upper center", bbox_to_anchor=(0.5, -0.2), ncols=2)
    return figure
