"""Slow trends as results and in sentences."""

import math
from typing import TYPE_CHECKING

from monitor.results.run_results import RunResults
from monitor.results.windows import ModeTrend, TrendResult

if TYPE_CHECKING:
    from monitor.detection import Trend

_WEEK = 7 * 86400.0  # s
_SIGNIFICANT = 3.0  # standard deviations from which a mode is named


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
    judged = [window.novelty for window in run_results.watched if window.novelty]
    return trend_text(judged[-1].trend) if judged and judged[-1].trend else ""


def _score(mode: ModeTrend) -> float:
    score = mode.percent_per_year / mode.std_percent_per_year
    return abs(score) if math.isfinite(score) else 0.0


def _rate(value: float, std: float) -> str:
    power = math.floor(math.log10(std))
    digits = max(0, -power + (std < 2.95 * 10.0**power))
    return f"{value:+.{digits}f} ± {std:.{digits}f}"
