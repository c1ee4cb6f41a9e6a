"""Over time: novelty against its limit, shifts with their standard deviations, the spectrum of the last window."""

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.dates import AutoDateLocator, ConciseDateFormatter
from matplotlib.figure import Figure
from matplotlib.ticker import FormatStrFormatter, LogLocator, NullFormatter

from daq import FloatArray
from monitor.results.run_results import RunResults, find_mode
from monitor.results.windows import Novelty, Spectrum, WindowResult
from monitor.views.member_axis import side_by_side
from monitor.views.report.svg import mode_colour
from oma.plots import ALARM, INK, OK, SOFT, WIDTH, new_figure

_COLUMNS = 3
_MIN_RATIO = 1e-2  # novelty over limit that is drawn at the least
_ROOM = 0.4  # under the lowest novelty or the limit, for its name
_SIGMAS = 3.0  # of the band of usual shifts
_LINE_SHARE = 0.075  # of the axis: least distance of two names
_ABOVE = 1.12  # of the highest mode: end of the frequency axis


def shifts_figure(run_results: RunResults) -> Figure | None:
    """Return one small plot a mode: its shift with +-1 sigma bars, window by window; None while learning."""
    shown = [n for n in run_results.tracks if any(_has_shift(w, n) for w in run_results.watched)]
    if not shown:
        return None
    rows = math.ceil(len(shown) / _COLUMNS)
    figure = new_figure(10.0, 0.6 + 1.55 * rows)
    grid = np.atleast_1d(figure.subplots(rows, _COLUMNS, sharex=True, squeeze=False)).ravel()
    for axes, number in zip(grid, shown, strict=False):
        _shift(axes, run_results, number)
    for axes in grid[len(shown) :]:
        axes.set_visible(False)
    figure.supylabel("shift from the baseline [%]", fontsize=8.5)
    return figure


def _has_shift(window: WindowResult, number: int) -> bool:
    mode = find_mode(window, number)
    return mode is not None and mode.shift_percent is not None


def _shift(axes: Axes, run_results: RunResults, number: int) -> None:
    seen = [(w, m) for w in run_results.watched if (m := find_mode(w, number)) and m.shift_percent is not None]
    reference = [m.frequency for m in run_results.reference.modes if m.id == number] if run_results.reference else []
    shift, std = [m.shift_percent or 0.0 for _, m in seen], [m.shift_std_percent or 0.0 for _, m in seen]
    axes.axhline(0.0, color=SOFT, linewidth=0.8)
    dates = _dates([w.end for w, _ in seen])
    axes.errorbar(dates, shift, std, fmt="o", markersize=3, linewidth=1.0, color=mode_colour(number), capsize=0)
    _mark_changes(axes, run_results)
    axes.set_title(f"Mode {number}" + (f", {reference[0]:.2f} Hz" if reference else ""), fontsize=8.5)
    _time_axis(axes)


def overview_figure(run_results: RunResults) -> Figure | None:
    """Return novelty and shifts of all windows, one above the other; None if no window was judged."""
    judged = [(w, w.novelty) for w in run_results.watched if w.novelty]
    if not judged:
        return None
    figure = new_figure(WIDTH, 4.4)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=[1.0, 1.3])
    _novelty(upper, judged)
    _standardised_shifts(lower, run_results)
    for axes in (upper, lower):
        _mark_changes(axes, run_results)
        _mark_learning(axes, run_results)
    _time_axis(lower)
    return figure


def _novelty(axes: Axes, judged: list[tuple[WindowResult, Novelty]]) -> None:
    ratio = np.maximum([n.t2 / n.limit for _, n in judged], _MIN_RATIO)
    dates = _dates([w.end for w, _ in judged])
    axes.semilogy(dates, ratio, color=INK, linewidth=0.8, zorder=2)
    axes.scatter(dates, ratio, c=[ALARM if r > 1 else OK for r in ratio], s=18, zorder=3)
    axes.axhline(1.0, color=ALARM, linewidth=1.2, linestyle="--")
    axes.annotate("alarm limit", (0.0, 1.0), (3, 2), ("axes fraction", "data"), "offset points", color=ALARM)
    axes.set_ylim(bottom=_ROOM * min(1.0, float(ratio.min())))
    axes.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axes.yaxis.set_major_formatter(FormatStrFormatter("%g"))
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.set_ylabel("novelty T² / limit")


def _standardised_shifts(axes: Axes, run_results: RunResults) -> None:
    """Draw the shift of each mode in its own standard deviations, with its number after the last window."""
    last: dict[int, float] = {}
    axes.axhspan(-_SIGMAS, _SIGMAS, color=OK, alpha=0.12, linewidth=0)
    for number in run_results.tracks:
        seen = [
            (w.end, m.shift_percent / m.shift_std_percent)
            for w in run_results.watched
            if (m := find_mode(w, number)) and m.shift_percent is not None and m.shift_std_percent
        ]
        if seen:
            times, shifts = zip(*seen, strict=True)
            colour = mode_colour(number)
            axes.plot(_dates(list(times)), shifts, "o-", markersize=2.5, linewidth=1.1, color=colour)
            last[number] = shifts[-1]
    low, high = axes.get_ylim()
    apart = _LINE_SHARE * (high - low)
    order = sorted(last, key=lambda number: last[number])
    level = side_by_side(np.array([last[number] for number in order]), apart, high)
    for number, y in zip(order, level.tolist(), strict=True):
        axes.annotate(
            f"mode {number}",
            (1.0, y),
            (4, 0),
            ("axes fraction", "data"),
            "offset points",
            va="center",
            color=mode_colour(number),
            fontsize=7.5,
        )
    axes.set_ylabel("frequency shift [σ]")


def _mark_learning(axes: Axes, run_results: RunResults) -> None:
    """Mark the windows from which the baseline was learned."""
    if run_results.learning:
        start, end = _dates([run_results.learning[0].start, run_results.learning[-1].end])
        axes.axvspan(start, end, color=SOFT, alpha=0.12, linewidth=0)
        axes.annotate(
            "learning", (start, 0.0), (3, 3), ("data", "axes fraction"), "offset points", color=SOFT, fontsize=7.5
        )


def spectrum_figure(window: WindowResult, spectrum: Spectrum) -> Figure:
    """Return singular values of a window with the poles of the stabilisation diagram and the identified modes."""
    figure = new_figure(10.0, 3.2)
    axes = figure.subplots()
    poles = axes.twinx()
    frequency, values = np.array(spectrum.frequency), np.array(spectrum.singular_values)
    for level, (colour, width) in zip(values, ((INK, 1.1), (SOFT, 0.8), ("#a9b1ba", 0.7)), strict=False):
        axes.plot(frequency[1:], level[1:], color=colour, linewidth=width)
    for mode in window.modes:
        axes.axvline(mode.frequency, color=mode_colour(mode.id), linewidth=1.0, alpha=0.8)
        axes.annotate(f"{mode.id}", (mode.frequency, 1.0), xycoords=("data", "axes fraction"), ha="center", va="bottom")
    _poles(poles, spectrum)
    if window.modes:
        end = min(frequency[-1], _ABOVE * max(m.frequency for m in window.modes))
        axes.set_xlim(0.0, end)
        inside = values[:, frequency <= end]
        axes.set_ylim(float(np.quantile(inside, 0.005)) - 3, float(inside.max()) + 3)
    axes.set_xlabel("frequency [Hz]")
    axes.set_ylabel("singular values [dB re (m/s²)²/Hz]")
    return figure


def _poles(axes: Axes, spectrum: Spectrum) -> None:
    stable = np.array(spectrum.pole_stable, bool)
    frequency, order = np.array(spectrum.pole_frequency, float), np.array(spectrum.pole_order, float)
    axes.plot(frequency[~stable], order[~stable], ".", markersize=2, color="#b9c0c8", label="pole")
    axes.plot(frequency[stable], order[stable], "o", markersize=2.6, color=OK, label="stable pole")
    axes.set_ylabel("model order")
    axes.spines["right"].set_visible(True)
    axes.grid(visible=False)
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, fontsize=7)


def _mark_changes(axes: Axes, run_results: RunResults) -> None:
    for alarm in run_results.alarms:
        if alarm.raised and alarm.time >= run_results.start:
            axes.axvline(_dates([alarm.time])[0], color=ALARM, linewidth=0.9, linestyle=":")
    for change in run_results.accepted:
        if run_results.start <= change.time <= run_results.end:
            axes.axvline(_dates([run_results.accepted_at(change)])[0], color=OK, linewidth=1.2)


def _dates(times: list[int]) -> FloatArray:
    """Return times [ns UTC] in matplotlib's days."""
    return np.array(times, np.int64) / 86_400e9


def _time_axis(axes: Axes) -> None:
    locator = AutoDateLocator(minticks=3, maxticks=7)  # type: ignore[no-untyped-call]
    axes.xaxis.set_major_locator(locator)
    axes.xaxis.set_major_formatter(ConciseDateFormatter(locator))  # type: ignore[no-untyped-call]
    axes.xaxis_date()
