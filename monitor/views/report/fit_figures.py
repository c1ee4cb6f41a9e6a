"""Causes compared, and the effect of an explanation.

Evidence and possible places of each cause; errors of the model before and after, mode by mode, and places of its
causes.
"""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from monitor.results.comparison import PlaceDensity
from monitor.results.windows import Interval, ReferenceResult
from monitor.text.causes import at_place
from monitor.views.report.structure_figure import Frame
from oma.plots import WIDTH, new_figure
from updater import Cause
from updater.diagnosis import FittedCause
from updater.quantities import Vector, plain


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
