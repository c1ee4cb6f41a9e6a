"""Common part of all drawings: the file, the two timelines, series, and a drawing with axes of its own."""

import errno
import os
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt
import rerun as rr
import rerun.blueprint as rrb

from daq import FloatArray
from monitor.results.windows import WindowResult
from monitor.views.member_axis import label_rows
from monitor.views.palette import FAINT, GREY, Colour

APPLICATION = "modalwatch"
_logged: WeakKeyDictionary[rr.RecordingStream, set[tuple[str, type]]] = WeakKeyDictionary()
TIME, PHASE = "time", "phase"
LEGEND_STEPS = (110.0, 32.0)  #: between two names of a legend, to the right and down
LEGEND_COLUMNS = 6  #: of names
_BAR_LINES = 8  # thin lines that fill a bar


@contextmanager
def recording_file(path: Path, recording_id: str, blueprint: rrb.Blueprint) -> Iterator[rr.RecordingStream]:
    """Open an .rrd file; it takes its name only when it is whole.

    Raises
    ------
    OSError
        If the folder does not exist or cannot be written to, or is itself `path`.
    """
    if path.is_dir():
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
    os.environ.setdefault("RERUN_ANALYTICS", "0")
    part = path.with_name(path.name + ".part")
    part.touch()
    recording = rr.RecordingStream(APPLICATION, recording_id=recording_id)
    try:
        recording.save(part, default_blueprint=blueprint)
        rr.set_log_time_enabled(False, recording=recording)
        rr.set_log_tick_enabled(False, recording=recording)
        yield recording
        recording.flush()
        recording.disconnect()
        part.replace(path)
    finally:
        recording.disconnect()
        part.unlink(missing_ok=True)


def at(recording: rr.RecordingStream, time: int) -> None:
    """Set the time of the following data [ns UTC]."""
    recording.reset_time()
    recording.set_time(TIME, timestamp=np.datetime64(time, "ns"))


def clock(time: int) -> str:
    """Return the time of day of a time [ns UTC]."""
    return str(np.datetime64(time, "ns"))[11:19]


def ends(windows: Sequence[WindowResult]) -> rr.TimeColumn:
    """Return the windows' ends as the column of times."""
    return times([w.end for w in windows])


def times(values: Sequence[int] | npt.NDArray[np.int64]) -> rr.TimeColumn:
    """Return times [ns UTC] as a column."""
    return rr.TimeColumn(TIME, timestamp=np.asarray(values, np.int64).astype("datetime64[ns]"))


def once(recording: rr.RecordingStream, path: str, archetype: rr.AsComponents) -> None:
    """Log static data, only the first time: a server keeps each repetition, before all data with a time."""
    logged = _logged.setdefault(recording, set())
    if (path, type(archetype)) not in logged:
        logged.add((path, type(archetype)))
        recording.log(path, archetype, static=True)


def line(
    recording: rr.RecordingStream, path: str, name: str, colour: Colour, column: rr.TimeColumn, values: Sequence[float]
) -> None:
    """Draw a line with its points over time; it breaks where a value is not a number."""
    once(recording, path, rr.SeriesLines(colors=[colour], names=[name], widths=[1.6]))
    once(recording, path, rr.SeriesPoints(colors=[colour], names=[name], marker_sizes=[2.5]))
    recording.send_columns(path, [column], rr.Scalars.columns(scalars=values))


def rule(
    recording: rr.RecordingStream, path: str, name: str, colour: Colour, span: tuple[int, int], value: float
) -> None:
    """Draw a level line over a stretch of time [ns UTC]."""
    once(recording, path, rr.SeriesLines(colors=[colour], names=[name], widths=[1.0]))
    recording.send_columns(path, [times(span)], rr.Scalars.columns(scalars=[value, value]))


def band(
    recording: rr.RecordingStream,
    path: str,
    name: str,
    colour: Colour,
    column: rr.TimeColumn,
    values: FloatArray,
    half_width: FloatArray,
) -> None:
    """Draw values (n,) with a band of +-half_width (n,) over time."""
    n = len(values)
    red, green, blue = colour
    columns = rr.Measurements.columns(
        values=values,
        variances=half_width**2,
        colors=np.full(n, (red << 24) | (green << 16) | (blue << 8) | 0xFF, np.uint32),
        names=[name] * n,
        widths=[1.6] * n,
    )
    recording.send_columns(path, [column], columns)


@dataclass(frozen=True, eq=False, kw_only=True)
class Axes:
    """A rectangle of a drawing with its own axes; on the screen y grows downwards, here upwards."""

    left: float
    top: float
    width: float
    height: float
    x_range: tuple[float, float]
    y_range: tuple[float, float]

    def x(self, value: FloatArray | float) -> FloatArray:
        """Return horizontal places of values."""
        low, high = self.x_range
        return np.asarray(self.left + (np.asarray(value, float) - low) / (high - low) * self.width)

    def y(self, value: FloatArray | float) -> FloatArray:
        """Return vertical places of values."""
        low, high = self.y_range
        return np.asarray(self.top + self.height * (1 - (np.asarray(value, float) - low) / (high - low)))

    def curve(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Return the points (n, 2) of a curve."""
        return np.column_stack([self.x(x), self.y(y)])

    def runs(self, x: FloatArray, y: FloatArray) -> list[FloatArray]:
        """Return the stretches of a curve that are inside the rectangle, each (n, 2) with at least two points."""
        low, high = min(self.y_range), max(self.y_range)
        inside = (low <= y) & (y <= high)
        edge = np.flatnonzero(inside[1:] != inside[:-1])
        outer = np.where(inside[edge], y[edge + 1], y[edge])
        level = np.clip(outer, low, high)  # where the curve crosses the frame
        share = (level - y[edge]) / (y[edge + 1] - y[edge])
        x = np.insert(x, edge + 1, x[edge] + share * (x[edge + 1] - x[edge]))
        y, inside = np.insert(y, edge + 1, level), np.insert(inside, edge + 1, True)
        stretches = np.split(np.arange(len(x)), np.flatnonzero(inside[1:] != inside[:-1]) + 1)
        return [self.curve(x[s], y[s]) for s in stretches if len(s) > 1 and inside[s[0]]]

    def grid(
        self,
        recording: rr.RecordingStream,
        path: str,
        x: dict[float, str],
        y: dict[float, str],
        room: float,
        *,
        static: bool = True,
    ) -> None:
        """Draw the frame, grid lines at the keys of x and y, and their texts below and `room` to the left."""
        right, bottom = self.left + self.width, self.top + self.height
        across = [[[a, self.top], [a, bottom]] for a in self.x(np.array(list(x)))]
        level = [[[self.left, b], [right, b]] for b in self.y(np.array(list(y)))]
        frame = [
            [[self.left, self.top], [right, self.top], [right, bottom], [self.left, bottom], [self.left, self.top]]
        ]
        thin = rr.Radius.ui_points(0.5)
        lines = rr.LineStrips2D([*across, *level, *frame], colors=[FAINT], radii=thin, draw_order=0.0)
        recording.log(f"{path}/grid", lines, static=static)
        below = [[a[0][0], bottom + 1] for a in across]
        beside = [[self.left - room, b[0][1] - 4] for b in level]
        text(recording, f"{path}/ticks", [*below, *beside], [*x.values(), *y.values()], [GREY], static=static)


def readable_ticks(axes: Axes, x: Iterable[tuple[float, str]], character: float) -> dict[float, str]:
    """Return ticks with empty texts where a text would overlap the one before.

    Parameters
    ----------
    axes : that have the ticks
    x : ascending values with their texts
    character : width of a character in the drawing
    """
    values, texts = zip(*x, strict=True)
    rows = label_rows(axes.x(np.array(values)), texts, character, 1)
    return {value: text if row == 0 else "" for value, text, row in zip(values, texts, rows, strict=True)}


def bars(
    recording: rr.RecordingStream,
    path: str,
    ends: Sequence[tuple[float, float, float]],
    half: float,
    colours: Sequence[Colour],
) -> None:
    """Draw horizontal bars from x to x at y, with square ends: lines have round ones, which are longer than the value.

    Parameters
    ----------
    ends : (n, 3) both x and y of each bar
    half : of a bar's height
    colours : (n,) of the bars
    """
    radius = half / _BAR_LINES
    offsets = np.linspace(radius - half, half - radius, _BAR_LINES).tolist()
    strips = [[[a, y + shift], [b, y + shift]] for a, b, y in ends for shift in offsets]
    every = [colour for colour in colours for _ in offsets]
    recording.log(path, rr.LineStrips2D(strips, colors=every, radii=1.6 * radius, draw_order=10.0), static=True)


def text(
    recording: rr.RecordingStream,
    path: str,
    places: Sequence[Sequence[float]],
    labels: Sequence[str],
    colours: Sequence[Colour],
    *,
    static: bool = True,
) -> None:
    """Write labels at places (n, 2) of a drawing."""
    points = rr.Points2D(places, radii=0.0, colors=list(colours), labels=list(labels), show_labels=True)
    if static:
        once(recording, path, points)
    else:
        recording.log(path, points)


def legend(
    recording: rr.RecordingStream, path: str, names: Sequence[str], colours: Sequence[Colour], *, static: bool = True
) -> None:
    """Write names in their colours, in rows, next to plots of series."""
    right, down = LEGEND_STEPS
    places = [[right * (i % LEGEND_COLUMNS), down * (i // LEGEND_COLUMNS)] for i in range(len(names))]
    text(recording, path, places, names, colours, static=static)
