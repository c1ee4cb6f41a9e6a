"""Figures of a diagnosis: errors of the model mode by mode, and the evidence of all causes."""

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from daq import FloatArray
from oma.plots import ALARM, INK, OK, SOFT, WIDTH, new_figure, styled
from updater.diagnosis.schema.values import Cause, ModeFit
from updater.quantities import plain

_MIN = 1e-6  # of 1 - MAC that is drawn
_SHOWN = 20.0  # log evidence at which bars are cut off: ratio of 5e8 to 1
_SHORT = 3.0  # log evidence of a bar that is too short for its value
_WHOLE = 100.0  # log evidence from which on it is written without decimals
_FITS = (10.0, 2.7)  # width and height of the errors [in]


class Weighed(Protocol):
    """A cause that was not accepted."""

    @property
    def cause(self) -> str:
        """Its name."""

    @property
    def log_evidence(self) -> float:
        """Log evidence relative to the best explanation [-]."""


def diagnosis_figure(causes: Sequence[Cause], modes: Sequence[ModeFit], rejected: Sequence[Weighed]) -> Figure:
    """Draw the errors of the model without and with the causes, and below them the evidence of all causes.

    Raises
    ------
    ValueError
        If no mode was compared and no cause weighed.
    """
    bars, fitted = _bars(causes, rejected), _compared(modes)
    if not bars and not fitted:
        raise ValueError("diagnosis: expected compared modes or weighed causes, found none")
    heights = [*([_FITS[1]] if fitted else []), *([_height(bars)] if bars else [])]
    with styled():
        figure = new_figure(_FITS[0], sum(heights))
        parts = figure.subfigures(len(heights), 1, squeeze=False, height_ratios=heights)[:, 0]
        if fitted:
            left, right = parts[0].subplots(1, 2)
            _draw_fits((left, right), causes, modes)
        if bars:
            _draw_evidence(parts[-1].subplots(), bars, accepted=bool(causes))
        figure.draw_without_rendering()  # ticks take the style when they are first drawn
    return figure


def fits_figure(causes: Sequence[Cause], modes: Sequence[ModeFit]) -> Figure | None:
    """Return errors of frequency and of shape, mode by mode, without and with the causes; None without a mode."""
    if not _compared(modes):
        return None
    figure = new_figure(*_FITS)
    left, right = figure.subplots(1, 2)
    _draw_fits((left, right), causes, modes)
    return figure


def evidence_figure(causes: Sequence[Cause], rejected: Sequence[Weighed]) -> Figure | None:
    """Return the log evidence of every cause relative to the best explanation; None where none was tried."""
    bars = _bars(causes, rejected)
    if not bars:
        return None
    figure = new_figure(WIDTH, _height(bars))
    _draw_evidence(figure.subplots(), bars, accepted=bool(causes))
    return figure


def _compared(modes: Sequence[ModeFit]) -> bool:
    return any(m.frequency.measured and m.frequency.before is not None for m in modes)


def _draw_fits(panels: tuple[Axes, Axes], causes: Sequence[Cause], modes: Sequence[ModeFit]) -> None:
    left, right = panels
    number = np.arange(1.0, len(modes) + 1)
    std = [_share(m, m.frequency.std) for m in modes]
    left.axhline(0.0, color=SOFT, linewidth=0.8)
    left.errorbar(number, np.zeros(len(number)), 2 * np.array(std), fmt="none", ecolor=SOFT, capsize=4)
    _pairs(left, number, [_off(m, m.frequency.before) for m in modes], "without", ALARM)
    if causes:
        _pairs(left, number, [_off(m, m.frequency.after) for m in modes], "with the causes", OK)
        _pairs(right, number, [_far(m.mac.after) for m in modes], "with the causes", OK)
    left.set_title("Frequency error of the model")
    right.set_title("Shape error of the model")
    left.set_ylabel("model off by [%]")
    _pairs(right, number, [_far(m.mac.before) for m in modes], "without", ALARM)
    right.set_yscale("log")
    right.set_ylabel("1 - MAC")
    for axes in (left, right):
        axes.set_xticks(number, [f"{n:g}" for n in number])
        axes.set_xlabel("mode")
    if causes:
        left.figure.legend(*left.get_legend_handles_labels(), fontsize=7, loc="outside lower center", ncols=2)


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


def _bars(causes: Sequence[Cause], rejected: Sequence[Weighed]) -> list[tuple[str, float, bool]]:
    """Return name, log evidence, and whether it is open: accepted causes, alternatives, others."""
    accepted = " + ".join(dict.fromkeys(plain(c.cause) for c in causes))
    others = {a.cause: a.log_evidence for c in causes for a in c.alternatives}
    bars = [(f"{accepted}: accepted", 0.0, True)] if accepted else []
    bars += [(f"{plain(name)}: not distinguishable", v, True) for name, v in others.items()]
    return bars + sorted(((plain(r.cause), r.log_evidence, False) for r in rejected), key=lambda bar: -bar[1])


def _height(bars: Sequence[object]) -> float:
    """Return the height of the bars of the evidence [in]."""
    return 0.9 + 0.25 * len(bars)


def _draw_evidence(axes: Axes, bars: Sequence[tuple[str, float, bool]], *, accepted: bool) -> None:
    right = _SHOWN if max(v for _, v, _ in bars) > 0 else 0.0
    for y, (name, v, is_open) in enumerate(bars):
        text = OK if is_open and accepted else INK
        colour = OK if is_open and accepted else ALARM if v > 0 else SOFT
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
            color=text,
        )  # fmt: skip
    axes.axvline(0.0, color=OK if accepted else SOFT, linewidth=1.4)
    axes.set_xlim(-1.03 * _SHOWN, right)
    axes.set_yticks([])
    axes.invert_yaxis()
    axes.spines["left"].set_visible(False)
    axes.set_title("Evidence relative to the best explanation")
    axes.set_xlabel("log evidence [-]; an arrow: beyond the axis")
