"""Comparison of the causes: evidence of each, and its possible places on the structure."""

import numpy as np
from matplotlib.figure import Figure

from monitor.results.comparison import DiagnosisAnswer, PlaceDensity
from monitor.results.windows import ReferenceResult
from monitor.text.cause_list import listed_causes
from monitor.text.quantities import plain
from monitor.views.report.structure_figure import Frame
from monitor.views.report.svg import ALARM, INK, OK, SOFT, WIDTH, new_figure

_SHOWN = 20.0  # log evidence at which bars are cut off: ratio of 5e8 to 1
_WHOLE = 100.0  # log evidence from which on it is written without decimals


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
            axes.annotate(
                value,
                (max(shown, -_SHOWN), y),
                (6, 0),
                textcoords="offset points",
                va="center",
                fontsize=6.5,
                color=INK,
            )
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
