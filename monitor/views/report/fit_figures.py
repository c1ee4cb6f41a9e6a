"""Causes compared, and the effect of an explanation.

Evidence and possible places of each cause; errors of the model before and after, mode by mode, and places of its
causes.
"""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from daq import FloatArray
from monitor.results.comparison import DiagnosisAnswer, PlaceDensity
from monitor.results.windows import Interval, ReferenceResult
from monitor.text.cause_list import listed_causes
from monitor.text.causes import at_place
from monitor.text.quantities import plain
from monitor.views.report.structure_figure import Frame
from monitor.views.report.svg import ALARM, INK, OK, SOFT, WIDTH, new_figure, styled
from updater import Cause, Diagnosis
from updater.diagnosis import FittedCause, ModeFit
from updater.quantities import Vector

_MIN = 1e-6  # of 1 - MAC that is drawn
_SHOWN = 20.0  # log evidence at which bars are cut off: ratio of 5e8 to 1
_SHORT = 3.0  # log evidence of a bar that is too short for its value
_WHOLE = 100.0  # log evidence from which on it is written without decimals


def fits_figure(diagnosis: Diagnosis) -> Figure | None:
    """Return errors of frequency and of shape, mode by mode, without and with the causes; None without a mode."""
    if not any(m.frequency.measured and m.frequency.before is not None for m in diagnosis.modes):
        return None
    figure = new_figure(10.0, 2.7)
    left, right = figure.subplots(1, 2)
    number = np.arange(1.0, len(diagnosis.modes) + 1)
    std = [_share(m, m.frequency.std) for m in diagnosis.modes]
    left.axhline(0.0, color=SOFT, linewidth=0.8)
    left.errorbar(number, np.zeros(len(number)), 2 * np.array(std), fmt="none", ecolor=SOFT, capsize=4)
    _pairs(left, number, [_off(m, m.frequency.before) for m in diagnosis.modes], "without", ALARM)
    if diagnosis.causes:
        _pairs(left, number, [_off(m, m.frequency.after) for m in diagnosis.modes], "with the causes", OK)
        _pairs(right, number, [_far(m.mac.after) for m in diagnosis.modes], "with the causes", OK)
    left.set_title("Frequency error of the model")
    right.set_title("Shape error of the model")
    left.set_ylabel("model off by [%]")
    _pairs(right, number, [_far(m.mac.before) for m in diagnosis.modes], "without", ALARM)
    right.set_yscale("log")
    right.set_ylabel("1 - MAC")
    for axes in (left, right):
        axes.set_xticks(number, [f"{n:g}" for n in number])
        axes.set_xlabel("mode")
    if diagnosis.causes:
        figure.legend(*left.get_legend_handles_labels(), fontsize=7, loc="outside lower center", ncols=2)
    return figure


def _pairs(axes: Axes, number: FloatArray, values: list[float], name: str, colour: str) -> None:
    axes.plot(number, values, "o", markersize=5, color=colour, label=name)


def _off(mode: ModeFit, model: float | None) -> float:
    measured = mode.frequency.measured
    return np.nan if measured is None or model is None else 100 * (model / measured - 1)


def _share(mode: ModeFit, std: float | None) -> float:
    measured = mode.frequency.measured
    return np.nan if measured is None or std is None else 100 * std / measured


def _far(mac: float | None) -> float:
    return np.nan if mac is None else max(1 - mac, _MIN)


def causes_figure(reference: ReferenceResult, causes: tuple[Cause, ...]) -> Figure | None:
    """Return the structure with every cause that has a place or a channel with a sensor; None if none has."""
    placed = [c for c in causes if c.where and c.where.position]
    at_sensors = _at_sensors(reference, causes)
    if not placed and not at_sensors:
        return None
    figure = new_figure(4.6, 4.2)
    axes, frame = figure.subplots(), Frame(reference)
    axes.set_title("Places of the causes")
    frame.draw(axes, names=not at_sensors)
    places = [
        (
            one.where.position,
            [Interval(member=one.where.member or "", start=start, end=end) for start, end in one.where.region],
            _label(cause) if one is cause else _label_of_alternative(one, cause),
        )
        for cause in placed
        for one in (cause, *cause.alternatives)
        if one.where and one.where.position
    ]
    frame.draw_places(axes, places)
    frame.draw_places(axes, at_sensors, above=True)
    figure.legend(loc="outside lower center", ncols=3, fontsize=7)
    return figure


def _at_sensors(reference: ReferenceResult, causes: Sequence[Cause]) -> list[tuple[Vector, list[Interval], str]]:
    """Return the places of the channels that causes name, each with the cause and all its channels there."""
    found = []
    for cause in causes:
        channels: dict[Vector, list[str]] = {}
        for name in cause.where.channels if cause.where else ():
            if name in reference.sensors:
                channels.setdefault(reference.sensors[name][0], []).append(name)
        found += [(at, list[Interval](), f"{plain(cause.cause)}\n{', '.join(names)}") for at, names in channels.items()]
    return found


def _label(cause: Cause) -> str:
    """Return a cause, the alternatives at the same place, and the place in a line of its own where it has a name."""
    name = cause.where.name if cause.where else ""
    here = [f"or {plain(other.cause)}" for other in cause.alternatives if other.where and other.where.name == name]
    return "\n".join(filter(None, (plain(cause.cause), *here, at_place(name))))


def _label_of_alternative(other: FittedCause, cause: Cause) -> str:
    """Return an alternative with its place; nothing for one at the place of its cause."""
    name = other.where.name if other.where else ""
    if cause.where and name == cause.where.name:
        return ""
    return "\n".join(filter(None, (f"or {plain(other.cause)}", at_place(name))))


def evidence_figure(diagnosis: DiagnosisAnswer) -> Figure | None:
    """Return the log evidence of every cause against the best explanation; None where none was tried."""
    accepted = " + ".join(dict.fromkeys(plain(c.cause) for c in diagnosis.causes))
    others = {a.cause: a.log_evidence for c in listed_causes(diagnosis.causes) for a in c.alternatives}
    bars = [(f"{accepted}: accepted", 0.0)] if accepted else []
    bars += [(f"{plain(name)}: not distinguishable", v) for name, v in others.items()]
    n_open = len(bars)
    bars += sorted(((plain(r.cause), r.log_evidence) for r in diagnosis.rejected), key=lambda bar: -bar[1])
    if not bars:
        return None
    figure = new_figure(WIDTH, 0.9 + 0.25 * len(bars))
    axes = figure.subplots()
    right = _SHOWN if max(v for _, v in bars) > 0 else 0.0
    for y, (name, v) in enumerate(bars):
        colour = OK if y < n_open and accepted else ALARM if v > 0 else SOFT
        shown = float(np.clip(v, -_SHOWN, _SHOWN))
        axes.barh(y, shown, height=0.6, color=colour, alpha=0.55)
        if shown != v:  # cut off: the value is printed in the bar
            axes.plot(shown, y, marker="<" if v < 0 else ">", markersize=5, color=colour, clip_on=False)
        value = f"{v:+,.1f}".replace(",", "\u202f") if abs(v) < _WHOLE else f"{v:+,.0f}".replace(",", "\u202f")
        if v:
            outside = -_SHORT < shown < 0  # its name is at the other end of the bar
            axes.annotate(
                value, (shown, y), (-4 if outside else 6, 0), textcoords="offset points", va="center", fontsize=6.5,
                ha="right" if outside else "left", color=INK,
            )  # fmt: skip
        axes.annotate(
            name, (right, y), (6, 0), textcoords="offset points", va="center", fontsize=7.5, annotation_clip=False,
            color=OK if y < n_open and accepted else INK,
        )  # fmt: skip
    axes.axvline(0.0, color=OK if accepted else SOFT, linewidth=1.4)
    axes.set_xlim(-1.03 * _SHOWN, right)
    axes.set_yticks([])
    axes.invert_yaxis()
    axes.spines["left"].set_visible(False)
    axes.set_title("Evidence relative to the best explanation")
    axes.set_xlabel("log evidence [-]; an arrow: beyond the axis")
    return figure


def density_figure(reference: ReferenceResult, places: PlaceDensity) -> Figure:
    """Return where along the structure a cause may be."""
    figure = new_figure(WIDTH, 4.4)
    axes, frame = figure.subplots(), Frame(reference)
    frame.draw(axes, names=True)
    axes.set_title(f"Places of {plain(places.cause)}")
    frame.draw_density(axes, places)
    best = int(np.argmax(places.density))
    frame.draw_note(axes, places.position[best], plain(places.cause))
    return figure


def plot_evidence(diagnosis: DiagnosisAnswer) -> Figure:
    """Draw the log evidence of each cause relative to the best explanation.

    Raises
    ------
    ValueError
        If the diagnosis weighed no cause.
    """
    with styled():
        figure = evidence_figure(diagnosis)
        if figure is None:
            raise ValueError("diagnosis: expected weighed causes, found none")
        figure.draw_without_rendering()  # ticks take the style when they are first drawn
    return figure
