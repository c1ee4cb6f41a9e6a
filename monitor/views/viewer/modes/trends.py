"""Modes and novelty over time."""

import numpy as np
import rerun as rr

from monitor.results.run_results import RunResults, find_mode
from monitor.results.windows import ModeResult, WindowResult
from monitor.views.palette import ALARM, GREY, OK, TEXT, mode_colour
from monitor.views.viewer.primitives import band, ends, legend, line, once, rule

SIGMAS = 3.0  # of the control band
_NAN = float("nan")
_MIN = 1e-3  # novelty over its limit: lower is drawn here


def frequency_span(run_results: RunResults, number: int) -> tuple[float, float]:
    """Return lowest and highest value [Hz] of a mode's plot, +-2 sigma and the baseline included."""
    seen = [m for m in (find_mode(w, number) for w in run_results.watched) if m]
    seen += [m for _, m in run_results.learned_near(number)]
    ends = [m.frequency + sign * 2 * m.frequency_std for m in seen for sign in (-1, 1)]
    ends += [m.frequency for m in (run_results.reference.modes if run_results.reference else []) if m.id == number]
    return min(ends), max(ends)


def damping_span(run_results: RunResults, number: int) -> tuple[float, float]:
    """Return lowest and highest value [%] of the plot of a mode's damping, zero and +-2 sigma included."""
    seen = [m for m in (find_mode(w, number) for w in run_results.watched) if m]
    return 0.0, max((100 * (m.damping + 2 * m.damping_std) for m in seen if np.isfinite(m.damping_std)), default=1.0)


def shift_span(run_results: RunResults) -> tuple[float, float]:
    """Return lowest and highest value of the plot of shifts [standard deviations], the control band included."""
    shifts = [s for w in run_results.watched for m in w.modes if np.isfinite(s := _standardised(m))]
    shifts += [s for number in run_results.tracks for _, s in _learned_shifts(run_results, number)]
    return min([-SIGMAS, *shifts]), max([SIGMAS, *shifts])


def _standardised(mode: ModeResult | None) -> float:
    """Return the shift of a mode from its baseline in its own standard deviations; NaN if it has none."""
    if mode is None or mode.shift_percent is None or not mode.shift_std_percent:
        return _NAN
    return mode.shift_percent / mode.shift_std_percent


def _learned_shifts(run_results: RunResults, number: int) -> list[tuple[WindowResult, float]]:
    """Return the distances of the learning windows from a mode of the baseline, in their own standard deviations."""
    base = next((m for m in run_results.reference.modes if m.id == number), None) if run_results.reference else None
    if base is None:
        return []
    return [
        (window, (mode.frequency - base.frequency) / mode.frequency_std)
        for window, mode in run_results.learned_near(number)
        if mode.frequency_std > 0
    ]


def draw_trends(recording: rr.RecordingStream, run_results: RunResults) -> None:
    """Draw shift and frequency of each tracked mode, modes found during learning, and the novelty."""
    _learning(recording, run_results)
    for number in run_results.tracks:
        _frequency(recording, run_results, number)
        _damping(recording, run_results, number)
        _shift(recording, run_results, number)
    n = len(run_results.watched)
    if n:
        column, limit = ends(run_results.watched), np.full(n, SIGMAS)
        band(recording, "/trend/shift/band", f"± {SIGMAS:g}σ", OK, column, np.zeros(n), limit)
    _novelty(recording, run_results)


def _learning(recording: rr.RecordingStream, run_results: RunResults) -> None:
    """Draw all frequencies of the learning windows as points: they have no identity yet."""
    pairs = [(w, m.frequency) for w in run_results.learning for m in w.modes]
    if not pairs:
        return
    look = rr.SeriesPoints(colors=[GREY], names=["found while learning"], marker_sizes=[2.5])
    once(recording, "/trend/found", look)
    columns = rr.Scalars.columns(scalars=[f for _, f in pairs])
    recording.send_columns("/trend/found", [ends([w for w, _ in pairs])], columns)


def _frequency(recording: rr.RecordingStream, run_results: RunResults, number: int) -> None:
    """Draw a mode's natural frequency with +-2 sigma, and the baseline's; the band breaks where it was not seen."""
    path, seen = f"/trend/frequency/mode_{number}", [find_mode(w, number) for w in run_results.watched]
    if any(seen):
        values = np.array([m.frequency if m else _NAN for m in seen])
        spread = np.array([2 * m.frequency_std if m else _NAN for m in seen])
        column = ends(run_results.watched)
        band(recording, f"{path}/measured", f"mode {number} ± 2σ", mode_colour(number), column, values, spread)
        look = rr.SeriesPoints(colors=[mode_colour(number)], names=[f"mode {number}"], marker_sizes=[2.5])
        once(recording, f"{path}/seen", look)  # a window alone between two gaps makes no line
        recording.send_columns(f"{path}/seen", [column], rr.Scalars.columns(scalars=values))
    _learned_points(recording, f"{path}/learning", [(w, m.frequency) for w, m in run_results.learned_near(number)])
    for mode in run_results.reference.modes if run_results.reference else []:
        if mode.id == number:
            rule(recording, f"{path}/baseline", "baseline", GREY, (run_results.start, run_results.end), mode.frequency)


def _damping(recording: rr.RecordingStream, run_results: RunResults, number: int) -> None:
    """Draw a mode's damping with +-2 sigma, and the baseline's."""
    path, seen = f"/trend/damping/mode_{number}", [find_mode(w, number) for w in run_results.watched]
    values = np.array([100 * m.damping if m else _NAN for m in seen])
    spread = np.array([200 * m.damping_std if m else _NAN for m in seen])
    if np.isfinite(values).any():
        column, colour = ends(run_results.watched), mode_colour(number)
        band(recording, f"{path}/measured", f"mode {number} ± 2σ", colour, column, values, np.nan_to_num(spread))
        once(recording, f"{path}/seen", rr.SeriesPoints(colors=[colour], names=[f"mode {number}"], marker_sizes=[2.5]))
        recording.send_columns(f"{path}/seen", [column], rr.Scalars.columns(scalars=values))
    for mode in run_results.reference.modes if run_results.reference else []:
        if mode.id == number and np.isfinite(mode.damping):
            span = (run_results.start, run_results.end)
            rule(recording, f"{path}/baseline", "baseline", GREY, span, 100 * mode.damping)


def _learned_points(recording: rr.RecordingStream, path: str, pairs: list[tuple[WindowResult, float]]) -> None:
    """Draw values of learning windows as points."""
    if pairs:
        once(recording, path, rr.SeriesPoints(colors=[GREY], names=["learning"], marker_sizes=[2.0]))
        recording.send_columns(path, [ends([w for w, _ in pairs])], rr.Scalars.columns(scalars=[v for _, v in pairs]))


def draw_legend(recording: rr.RecordingStream, run_results: RunResults, *, static: bool = True) -> None:
    """Draw the names of the modes in their colours, for the plots of trends."""
    numbers = run_results.tracks
    names = [*(f"mode {number}" for number in numbers), f"usual, ± {SIGMAS:g}σ", "learning"]
    legend(recording, "/legend", names, [*map(mode_colour, numbers), OK, GREY], static=static)


def _shift(recording: rr.RecordingStream, run_results: RunResults, number: int) -> None:
    shift = [_standardised(find_mode(w, number)) for w in run_results.watched]
    if np.isfinite(shift).any():
        path = f"/trend/shift/mode_{number}"
        line(recording, path, f"mode {number}", mode_colour(number), ends(run_results.watched), shift)
    _learned_points(recording, f"/trend/shift/learning/mode_{number}", _learned_shifts(run_results, number))


def _novelty(recording: rr.RecordingStream, run_results: RunResults) -> None:
    if not any(w.novelty for w in run_results.watched):
        return
    ratio = [w.novelty.t2 / w.novelty.limit if w.novelty else _NAN for w in run_results.watched]
    index = np.log10(np.maximum(ratio, _MIN)).tolist()
    line(recording, "/novelty/index", "log10(T² / limit)", TEXT, ends(run_results.watched), index)
    rule(recording, "/novelty/limit", "alarm limit", ALARM, (run_results.start, run_results.end), 0.0)
