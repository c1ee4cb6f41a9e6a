"""Texts on change detection: smallest detectable change, missing thermometer, uncertain law, slow trends."""

import math
from collections.abc import Sequence
from itertools import takewhile
from typing import TYPE_CHECKING

import numpy as np

from monitor.results.run_results import RunResults
from monitor.results.windows import DetectableChange, ModeTrend, Novelty, SingleMode, TrendResult, Unsure

if TYPE_CHECKING:
    from monitor.detection import Trend

NO_THERMOMETER = (
    "no temperature is measured: season and frost, which change frequencies by up to several per cent, raise alarms or "
    "hide changes; a thermometer is needed ([temperature] in the settings, or a device that has one)"
)
_WEEK = 7 * 86400.0  # s
_SIGNIFICANT = 3.0  # standard deviations from which a mode is named


def detectable_text(found: DetectableChange) -> str:
    """Return the smallest detectable change, and that a thermometer is needed where there is none."""
    each = np.array(found.modes_percent)
    known = np.flatnonzero(np.isfinite(each))
    text = f"a lasting change of all frequencies alike by {found.alike_percent:.2g} %"
    if known.size:
        least, most = known[each[known].argmin()], known[each[known].argmax()]
        text += (
            f", or of one mode alone by {each[least]:.2g} % (mode {least + 1}) to {each[most]:.2g} % (mode {most + 1})"
        )
    if hidden := [str(k + 1) for k in np.flatnonzero(~np.isfinite(each))]:
        text += f"; not detectable alone: mode{'s' * (len(hidden) > 1)} {', '.join(hidden)}"
    return text if found.thermometer else f"{text}; {NO_THERMOMETER}"


def last_detectable(run_results: RunResults) -> str:
    """Return the smallest detectable change at the last window that was judged; empty where that is not known."""
    judged = _judged(run_results)
    return detectable_text(judged[-1].detectable) if judged and judged[-1].detectable else ""


def trend_result(trend: "Trend") -> TrendResult:
    """Return a trend in per cent per year, modes by their identities."""
    return TrendResult(
        weeks=trend.seconds / _WEEK,
        percent_per_year=100 * trend.common_rate,
        std_percent_per_year=100 * trend.common_std,
        modes=[
            ModeTrend(mode=k + 1, percent_per_year=100 * rate, std_percent_per_year=100 * std)
            for k, (rate, std) in enumerate(zip(trend.rate.tolist(), trend.std.tolist(), strict=True))
        ],
    )


def trend_text(trend: TrendResult | None) -> str:
    """Return a sentence on the trend; None: on its end."""
    if trend is None:
        return "the slow trend of the frequencies is no longer significant"
    named = [m for m in trend.modes if _score(m) > _SIGNIFICANT]
    mean = _rate(trend.percent_per_year, trend.std_percent_per_year)
    each = ", ".join(f"mode {m.mode} {_rate(m.percent_per_year, m.std_percent_per_year)}" for m in named)
    return (
        f"slow trend of the frequencies over {trend.weeks:.0f} weeks, the effects of temperature and season removed: "
        f"{mean} % per year on average over all modes{f' ({each})' if each else ''}; the temperature "
        "model adapts to it; it raises no alarm"
    )


def standing_trend(run_results: RunResults) -> str:
    """Return the trend of the last window that was judged; empty where there is none."""
    judged = _judged(run_results)
    return trend_text(judged[-1].trend) if judged and judged[-1].trend else ""


def _score(mode: ModeTrend) -> float:
    score = mode.percent_per_year / mode.std_percent_per_year
    return abs(score) if math.isfinite(score) else 0.0


def _rate(value: float, std: float) -> str:
    power = math.floor(math.log10(std))
    digits = max(0, -power + (std < 2.95 * 10.0**power))
    return f"{value:+.{digits}f} ± {std:.{digits}f}"


def unsure_text(found: Sequence[Unsure]) -> str:
    """Return as a part of a sentence the detectable change of the least certain window."""
    worst = max(found, key=lambda one: one.least_percent)
    known = [one.temperature for one in found if math.isfinite(one.temperature)]
    where = f"at {_between(min(known), max(known))} degC" if known else ""
    if worst.outside:
        where += f", outside the range of the baseline ({_between(worst.coldest, worst.warmest)} degC),"
    silent = max((one.silent_hours for one in found if one.silent_hours is not None), default=None)
    if silent is not None:
        where += f"{' and ' if where else ''}without a temperature reading for up to {silent:.1f} h,"
    detectable = f"only changes of all frequencies alike by more than {worst.least_percent:.2g} % are detectable"
    return f"{where} {detectable}".lstrip()


def single_mode_text(single: SingleMode) -> str:
    """Return as part of a sentence that one mode alone is inconsistent, and for how long that is waited."""
    return (
        f"mode {single.mode} alone has been inconsistent for {single.windows} window{'s' * (single.windows != 1)} "
        f"(wrong pole?), which is taken for a change after {single.needed}"
    )


def _between(lowest: float, highest: float) -> str:
    low, high = f"{lowest:.1f}", f"{highest:.1f}"
    return low if low == high else f"{low} to {high}"


def unsure_now(run_results: RunResults) -> str:
    """Return the detectable change in the last windows; empty if the law was certain in the newest one."""
    judged = _judged(run_results)
    last = list(takewhile(lambda unsure: unsure is not None, (novelty.unsure for novelty in reversed(judged))))
    unsure = _of([unsure for unsure in last if unsure], f"the last {len(last)} of {len(judged)} windows")
    single = judged[-1].single_mode if judged else None
    return "; ".join(part for part in (unsure, single_mode_text(single) if single else "") if part)


def unsure_ever(run_results: RunResults) -> str:
    """Return the detectable change in all windows with an uncertain law; empty if there are none."""
    judged = _judged(run_results)
    found = [novelty.unsure for novelty in judged if novelty.unsure]
    return _of(found, f"{len(found)} of {len(judged)} windows")


def _judged(run_results: RunResults) -> list[Novelty]:
    return [window.novelty for window in run_results.watched if window.novelty]


def _of(found: list[Unsure], windows: str) -> str:
    return f"in {windows}, {unsure_text(found)}" if found else ""
