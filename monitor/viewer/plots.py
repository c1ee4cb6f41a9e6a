"""Trends, states, texts, and the drawings that need axes of their own."""

from collections.abc import Sequence

import numpy as np
import rerun as rr

from daq import FloatArray
from monitor.describe import mass_text
from monitor.results import AlarmResult, MassAnswer, ReferenceResult, Spectrum, WindowResult
from monitor.viewer.palette import ALARM, DIM, GREY, LEARN, OK, TEXT, WARN, Colour, mode_colour

WIDTH, HEIGHT = 200.0, 92.0  # of a drawing with axes
_SIGMAS = 3.0
_SINGULAR = ((226, 231, 240), (132, 140, 156), (92, 99, 114))


def _times(windows: Sequence[WindowResult]) -> rr.TimeColumn:
    return rr.TimeColumn("time", timestamp=np.array([w.end for w in windows], "datetime64[ns]"))


def _series(
    recording: rr.RecordingStream,
    path: str,
    name: str,
    colour: Colour,
    windows: Sequence[WindowResult],
    values: list[float],
) -> None:
    recording.log(path, rr.SeriesLines(colors=[colour], names=[name], widths=[1.6]), static=True)
    recording.log(path, rr.SeriesPoints(colors=[colour], names=[name], marker_sizes=[2.5]), static=True)
    recording.send_columns(path, [_times(windows)], rr.Scalars.columns(scalars=values))


def draw_trends(recording: rr.RecordingStream, windows: Sequence[WindowResult]) -> None:
    """Draw shift and frequency of each tracked mode, and the novelty."""
    watched = [w for w in windows if w.novelty]
    for number in sorted({m.id for w in watched for m in w.modes}):
        seen = [(w, m) for w in watched for m in w.modes if m.id == number]
        where, modes = [w for w, _ in seen], [m for _, m in seen]
        name, colour = f"mode {number}", mode_colour(number)
        shift = [m.shift_percent or 0.0 for m in modes]
        _series(recording, f"/trend/shift/mode_{number}", name, colour, where, shift)
        _series(recording, f"/trend/frequency/mode_{number}", name, colour, where, [m.frequency for m in modes])
    if not watched:
        return
    index = [float(np.log10(max(w.novelty.t2 / w.novelty.limit, 1e-3))) for w in watched if w.novelty]
    _series(recording, "/novelty/index", "log10(T² / limit)", TEXT, watched, index)
    _series(recording, "/novelty/limit", "alarm limit", ALARM, watched, [0.0] * len(watched))
    band = max((m.shift_std_percent or 0.0 for w in watched for m in w.modes), default=0.0) * _SIGMAS
    columns = rr.Measurements.columns(
        values=np.zeros(len(watched)),
        variances=np.full(len(watched), band**2),
        colors=np.full(len(watched), 0xE8484D60, np.uint32),
        names=["3 sigma of the least sure mode"] * len(watched),
        widths=[0.6] * len(watched),
    )
    recording.send_columns("/trend/shift/limit", [_times(watched)], columns)


def draw_answers(recording: rr.RecordingStream, windows: Sequence[WindowResult]) -> None:
    """Draw how the answer sharpens, and the last posterior along the members."""
    pairs = [(w, w.answer) for w in windows if w.answer]
    if not pairs:
        return
    where, answers = [w for w, _ in pairs], [a for _, a in pairs]
    for name, sign in (("mass", 0), ("mass + 2 sigma", 2), ("mass - 2 sigma", -2)):
        values = [1000 * (a.mass + sign * a.mass_std) for a in answers]
        path = f"/answer/mass/{name.replace(' ', '_').replace('+', 'plus').replace('-', 'minus')}"
        _series(recording, path, f"{name} [g]", TEXT if sign == 0 else ALARM, where, values)
    _series(
        recording,
        "/answer/place/std",
        "standard deviation of place [mm]",
        WARN,
        where,
        [1000 * a.position_std for a in answers],
    )
    _posterior(recording, answers[-1])


def _posterior(recording: rr.RecordingStream, answer: MassAnswer) -> None:
    offset = 0.0
    for number, member in enumerate(dict.fromkeys(p.member for p in answer.profile)):
        points = [p for p in answer.profile if p.member == member]
        along = np.linalg.norm(np.subtract([p.position for p in points], points[0].position), axis=1)
        density = np.array([p.density for p in points])
        bars = rr.BarChart(
            density,
            abscissa=offset + along,
            widths=np.full(len(along), along[1]),
            color=((232, 110, 60), (86, 156, 255))[number % 2],
        )
        recording.log(f"/answer/posterior/{member}", bars, static=True)
        offset += float(along[-1]) + 0.1


def draw_states(recording: rr.RecordingStream, windows: Sequence[WindowResult], alarms: Sequence[AlarmResult]) -> None:
    """Draw the lanes: what the daemon does, what the structure is."""
    daemon = {
        "learning": ("learning the baseline", LEARN),
        "watching": ("watching", OK),
        "alarm": ("watching, in alarm", ALARM),
    }
    structure = {"normal": ("normal", OK), "watch": ("watch", WARN), "alarm": ("ALARM", ALARM)}
    for path, states in (("/state/daemon", daemon), ("/state/structure", structure)):
        labels, colours = [text for text, _ in states.values()], [colour for _, colour in states.values()]
        recording.log(path, rr.StateConfiguration(values=list(states), labels=labels, colors=colours), static=True)
    before = None
    for window in windows:
        if window.phase != before:
            _at(recording, window.start)
            recording.log("/state/daemon", rr.StateChange(state=window.phase))
            before = window.phase
    for alarm in alarms:
        _at(recording, alarm.time)
        recording.log("/state/structure", rr.StateChange(state=alarm.state))
        level = {"normal": "INFO", "watch": "WARN", "alarm": "ERROR"}[alarm.state]
        clock = str(np.datetime64(alarm.time, "ns"))[11:19]
        recording.log("/events", rr.TextLog(f"{clock}  {alarm.text}", level=level))


def _at(recording: rr.RecordingStream, time: int) -> None:
    recording.set_time("time", timestamp=np.datetime64(time, "ns"))


def write_cards(recording: rr.RecordingStream, windows: Sequence[WindowResult]) -> None:
    """Write the card that says what is known now, verdict first."""
    for window in windows:
        _at(recording, window.end)
        recording.log("/now", rr.TextDocument(card(window), media_type="text/markdown"))


def card(window: WindowResult) -> str:
    """Return the card of one window as Markdown."""
    title = {"learning": "Learning the baseline", "watching": "Normal", "alarm": "ALARM"}[window.phase]
    lines = [f"# {title}"]
    if window.problem:
        lines.append(f"No modes in this window: {window.problem}")
    if window.answer:
        lines.append(f"**{mass_text(window.answer)}**, from {window.answer.n_windows} windows.")
    if window.novelty:
        lines.append(f"Novelty {window.novelty.t2:.1f}, limit {window.novelty.limit:.1f}.")
    lines += ["", "| mode | Hz | ± | ζ % | shift % | ± |", "|---:|---:|---:|---:|---:|---:|"]
    for m in window.modes:
        shift = "" if m.shift_percent is None else f"{m.shift_percent:+.2f} | {m.shift_std_percent:.2f}"
        lines.append(
            f"| **{m.id}** | {m.frequency:.3f} | {m.frequency_std:.3f} | {100 * m.damping:.2f} | {shift or ' | '} |"
        )
    return "\n".join(lines)


class Axes:
    """A drawing of 200 x 92 with its own axes; y grows downwards on the screen."""

    def __init__(self, x_range: tuple[float, float], y_range: tuple[float, float]) -> None:
        self.x_range, self.y_range = x_range, y_range

    def x(self, value: FloatArray | float) -> FloatArray:
        """Return horizontal positions of values."""
        low, high = self.x_range
        return np.asarray((np.asarray(value) - low) / (high - low) * WIDTH)

    def y(self, value: FloatArray | float) -> FloatArray:
        """Return vertical positions of values."""
        low, high = self.y_range
        return np.asarray(HEIGHT * (1 - (np.asarray(value) - low) / (high - low)))


def draw_spectra(recording: rr.RecordingStream, windows: Sequence[WindowResult]) -> None:
    """Draw singular values, poles and identified modes, window by window."""
    drawn = [(w, w.spectrum) for w in windows if w.spectrum]
    if not drawn:
        return
    highest = max(m.frequency for w, _ in drawn for m in w.modes) * 1.12
    inside = np.array(drawn[0][1].frequency) <= highest
    levels = np.concatenate([np.array(s.singular_values)[:, 3 : inside.sum()] for _, s in drawn], axis=1)
    axes = Axes((0.0, highest), (10 * np.floor(levels.min() / 10), 10 * np.ceil(levels.max() / 10)))
    _grid(recording, axes)
    for window, spectrum in drawn:
        _at(recording, window.end)
        _spectrum(recording, axes, spectrum)
        _identified(recording, axes, window)


def _grid(recording: rr.RecordingStream, axes: Axes) -> None:
    step = max(10 ** np.floor(np.log10(axes.x_range[1])) / 2, 1.0)
    frequencies = np.arange(0, axes.x_range[1], step)
    levels = np.arange(axes.y_range[0], axes.y_range[1] + 1, 20)
    x, y = axes.x(frequencies), axes.y(levels)
    lines = [[[a, 0], [a, HEIGHT]] for a in x] + [[[0, b], [WIDTH, b]] for b in y]
    grid = rr.LineStrips2D(lines, colors=[(48, 52, 60)], radii=rr.Radius.ui_points(0.5), draw_order=0)
    recording.log("/spectrum/grid", grid, static=True)
    places = [[a, HEIGHT + 1] for a in x] + [[-11, b - 4] for b in y]
    labels = [f"{f:g} Hz" for f in frequencies] + [f"{d:g} dB" for d in levels]
    ticks = rr.Points2D(places, labels=labels, radii=0.0, colors=[GREY], show_labels=True)
    recording.log("/spectrum/ticks", ticks, static=True)


def _spectrum(recording: rr.RecordingStream, axes: Axes, spectrum: Spectrum) -> None:
    frequency = np.array(spectrum.frequency)
    keep = (frequency <= axes.x_range[1]) & (frequency >= frequency[2])
    for number, values in enumerate(spectrum.singular_values):
        curve = np.column_stack([axes.x(frequency[keep]), axes.y(np.array(values)[keep])])
        radius = rr.Radius.ui_points((1.1, 0.8, 0.7)[number])
        strip = rr.LineStrips2D([curve], colors=[_SINGULAR[number]], radii=radius, draw_order=10 - number)
        recording.log(f"/spectrum/singular_value_{number + 1}", strip)
    pole, order = np.array(spectrum.pole_frequency), np.array(spectrum.pole_order)
    stable = np.array(spectrum.pole_stable, bool)
    shown = pole <= axes.x_range[1]
    places = np.column_stack([axes.x(pole), HEIGHT * (1 - order / max(order.max(initial=1), 1))])
    for name, chosen, colour, radius in (("stable", shown & stable, OK, 2.2), ("loose", shown & ~stable, DIM, 1.2)):
        points = rr.Points2D(places[chosen], colors=[colour], radii=rr.Radius.ui_points(radius), draw_order=20)
        recording.log(f"/spectrum/{name}_poles", points)


def _identified(recording: rr.RecordingStream, axes: Axes, window: WindowResult) -> None:
    at = axes.x(np.array([m.frequency for m in window.modes]))
    colours = [mode_colour(m.id) for m in window.modes]
    lines = rr.LineStrips2D(
        [[[x, -3], [x, HEIGHT]] for x in at], colors=colours, radii=rr.Radius.ui_points(0.7), draw_order=5
    )
    recording.log("/spectrum/identified", lines)
    apart = np.maximum.accumulate(at + 0.0)
    for i in range(1, len(apart)):  # labels of close modes side by side
        apart[i] = max(at[i], apart[i - 1] + 6)
    names = rr.Points2D(
        np.column_stack([apart, np.full(len(at), -9.0)]),
        radii=0.0,
        colors=colours,
        labels=[str(m.id) for m in window.modes],
        show_labels=True,
    )
    recording.log("/spectrum/names", names)


def reference_text(reference: ReferenceResult) -> str:
    """Return what the baseline taught, as Markdown."""
    lines = [
        f"## Reference, from {reference.n_windows} windows",
        "",
        "| mode | measured Hz | model Hz | off % | MAC | ζ % |",
    ]
    lines.append("|---:|---:|---:|---:|---:|---:|")
    for m in reference.modes:
        off = 100 * (m.model_frequency / m.frequency - 1)
        measured = f"{m.frequency:.3f} ± {m.frequency_std:.3f}"
        model = f"{m.model_frequency:.2f} | {off:+.2f} | {m.mac:.4f}"
        lines.append(f"| {m.id} | {measured} | {model} | {100 * m.damping:.2f} |")
    lines += [
        "",
        "Model: as the structure file says, before calibration. What calibration found:",
        "",
        "| parameter | value | ± |",
        "|:--|---:|---:|",
    ]
    lines += [f"| {name} | {value:.4f} | {std:.4f} |" for name, (value, std) in reference.calibrated.items()]
    return "\n".join(lines)
