"""The picture of a history: novelty against its limit, and every mode's shift, with the alarms behind them."""

from collections.abc import Sequence
from pathlib import Path
from textwrap import shorten

import numpy as np
from matplotlib.axes import Axes
from matplotlib.dates import AutoDateLocator, ConciseDateFormatter
from matplotlib.figure import Figure
from matplotlib.ticker import FormatStrFormatter, LogLocator, NullFormatter

from daq import FloatArray
from monitor.errors import drawing
from monitor.outputs.history import TrendPoint
from monitor.outputs.history.summary import Found
from monitor.text.verdicts import accepted_text
from monitor.views.report.svg import mode_colour
from oma.plots import ALARM, INK, OK, SOFT, new_figure, styled

_STEPS_TO_JOIN = 3.0  # points further apart than this many median steps are not joined by a line
_LONGEST = 90  # characters of a text above a line


def draw_history(path: Path, found: Found) -> None:
    """Draw the content of a span.

    Raises
    ------
    ArgumentError
        If the picture cannot be written, or is of an unknown kind.
    """
    with styled():
        figure = _figure(found)
        with drawing(path, "--plot"):
            figure.savefig(path, dpi=150)


def _figure(found: Found) -> Figure:
    shown = {mode: points for mode, points in found.trends.items() if any(p.shift_percent is not None for p in points)}
    figure = new_figure(11.0, 2.2 + 1.25 * len(shown))
    rows = figure.subplots(1 + len(shown), 1, sharex=True, squeeze=False, height_ratios=[1.6, *(len(shown) * [1.0])])
    axes: Sequence[Axes] = list(rows[:, 0])
    _draw_levels(axes[0], found)
    for part, (mode, points) in zip(axes[1:], shown.items(), strict=True):
        _draw_shift(part, mode, points)
    for part in axes:
        for alarm in found.alarms:
            start, end = _dates([max(alarm.raised, found.span.start), alarm.cleared or found.span.end])
            part.axvspan(start, end, color=ALARM, alpha=0.13, linewidth=0)
        for change in found.accepted:
            part.axvline(_dates([found.accepted_at(change)])[0], color=OK, linewidth=1.4)
    _name_accepted(axes[0], found)
    locator = AutoDateLocator(minticks=4, maxticks=9)  # type: ignore[no-untyped-call]
    axes[-1].xaxis.set_major_locator(locator)
    axes[-1].xaxis.set_major_formatter(ConciseDateFormatter(locator))  # type: ignore[no-untyped-call]
    return figure


def _draw_levels(axes: Axes, found: Found) -> None:
    if levels := found.windows.levels:
        dates, level = _dates([t for t, _ in levels]), np.maximum([v for _, v in levels], 1e-2)
        axes.semilogy(*_broken(dates, level), color=INK, linewidth=0.7)
        axes.plot(dates[level > 1], level[level > 1], ".", color=ALARM, markersize=4)
    axes.axhline(1.0, color=ALARM, linewidth=1.0, linestyle="--")
    axes.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axes.yaxis.set_major_formatter(FormatStrFormatter("%g"))
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.set_ylabel("novelty / limit,\nhighest of the day" if found.span.every == "day" else "novelty / limit")


def _draw_shift(axes: Axes, mode: int, points: list[TrendPoint]) -> None:
    seen = [(p.time, p.shift_percent) for p in points if p.shift_percent is not None]
    dates, shift = _dates([time for time, _ in seen]), np.array([value for _, value in seen])
    axes.axhline(0.0, color=SOFT, linewidth=0.7)
    axes.plot(*_broken(dates, shift), color=mode_colour(mode), linewidth=0.9, marker=".", markersize=2.5)
    axes.set_ylabel(f"mode {mode}\n{points[0].frequency:.4g} Hz\nshift [%]", fontsize=7.5)


def _name_accepted(axes: Axes, found: Found) -> None:
    """Write accepted changes above the lines, towards the middle of the picture."""
    middle = (found.span.start + found.span.end) / 2
    for change in found.accepted:
        axes.annotate(
            f"accepted {shorten(accepted_text(change, found.accepted_at(change)), _LONGEST)}",
            (_dates([found.accepted_at(change)])[0], 1.0),
            (0, 2),
            ("data", "axes fraction"),
            "offset points",
            ha="right" if change.time > middle else "left",
            va="bottom",
            color=OK,
            fontsize=7.5,
        )


def _broken(x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Break the line where nothing was measured."""
    if len(x) < 3:
        return x, y
    step = np.diff(x)
    gaps = np.flatnonzero(step > _STEPS_TO_JOIN * np.median(step)) + 1
    return np.insert(x, gaps, np.nan), np.insert(y, gaps, np.nan)


def _dates(times: list[int]) -> FloatArray:
    """Return times [ns UTC] in matplotlib's days."""
    return np.array(times, np.int64) / 86_400e9
