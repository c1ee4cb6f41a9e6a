"""Comparison of the causes: evidence of each, and its possible places on the structure."""

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, SymmetricalLogLocator

from monitor.results.comparison import DiagnosisAnswer, PlaceDensity
from monitor.results.windows import ReferenceResult
from monitor.text.quantities import plain
from monitor.views.report.structure_figure import Frame
from monitor.views.report.svg import ALARM, INK, OK, SOFT, WIDTH, new_figure

_LINEAR = 5.0  # log evidence up to which the scale is linear: ratio of 150 to 1


def evidence_figure(diagnosis: DiagnosisAnswer) -> Figure | None:
    """Return the log evidence of every cause against the best explanation; None where none was tried."""
    accepted = " + ".join(dict.fromkeys(plain(c.cause) for c in diagnosis.causes))
    bars = [(accepted, 0.0)] if accepted else []
    bars += sorted(((plain(r.cause), r.log_evidence) for r in diagnosis.rejected), key=lambda bar: -bar[1])
    if not bars:
        return None
    figure = new_figure(WIDTH, 0.9 + 0.25 * len(bars))
    axes = figure.subplots()
    level, value = np.arange(len(bars)), np.array([v for _, v in bars])
    axes.set_xscale("symlog", linthresh=_LINEAR)
    left = min(-2 * _LINEAR, 1.6 * float(value.min()))
    axes.barh(level, value, height=0.6, color=[ALARM if v > 0 else "#aab3bd" for v in value])
    axes.axvline(0.0, color=OK if accepted else SOFT, linewidth=1.4)
    for y, (name, v) in zip(level.tolist(), bars, strict=True):
        text = name if v else f"{name}: accepted"
        axes.annotate(
            text, (0.0, y), (5, 0), textcoords="offset points", va="center", fontsize=7.5,
            color=OK if accepted and y == 0 else INK,
        )  # fmt: skip
    right = max(float(value.max()), 0.0)
    axes.set_xlim(left, right if right > 0 else 0.0)
    axes.set_yticks([])
    axes.invert_yaxis()
    axes.spines["left"].set_visible(False)
    axes.xaxis.set_major_locator(SymmetricalLogLocator(base=10.0, linthresh=_LINEAR))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda v, _: f"{v:g}"))
    axes.set_title("Evidence relative to the best explanation")
    axes.set_xlabel("log evidence [-]")
    axes.set_box_aspect(None)
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
