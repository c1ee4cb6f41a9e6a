"""The law follows a slow drift, so that it raises no alarm, and weekly means keep it."""

import numpy as np

from monitor.detection import CHUNK, DETECTORS, DetectionSettings, accept, judge, start
from monitor.detection.trend import trend_of

STEP, STD, P = 3 * 3600.0, 5e-4, 6
YEAR = 365.25 * 86400.0
DRIFT = -2e-3


def test_slow_drift_raises_no_alarm_and_its_rate_is_estimated() -> None:
    """A constant that were the mean over the year would be off by half of it, 1e-3."""
    random, n = np.random.default_rng(15), int(YEAR / STEP) // CHUNK * CHUNK
    time = STEP * np.arange(1, n + 1)
    temperature = 15 + 5 * np.sin(2 * np.pi * time / 86400)
    y = DRIFT * time[:, None] / YEAR - 2e-4 * temperature[:, None] + STD * random.standard_normal((n, P))
    std, seconds = np.full((CHUNK, P), STD), np.full(CHUNK, STEP)
    watching = DetectionSettings(rate=STEP / YEAR / len(DETECTORS), overlap=0.0, hold=2)
    watched = start(y[:CHUNK], std, temperature[:CHUNK], seconds, watching)
    over = 0
    for first in range(CHUNK, n, CHUNK):
        now = slice(first, first + CHUNK)
        judged, watched = judge(watched, y[now], temperature[now], seconds, std)
        over += int((judged.over[1:] & judged.over[:-1]).sum())
        watched = accept(watched, judged.terms, judged.teaching, judged.variance, judged.age)
        residual = watched.law.residual(judged.terms, judged.whitened) * watched.law.scale
    trend = trend_of(watched.weekly)
    assert trend is not None
    lag = abs(float(residual.mean()))
    print(
        f"seed 15: law lags by {lag:.1e}, rate {1e2 * trend.common_rate:.3f} ± {1e2 * trend.common_std:.3f} % per year"
    )
    assert over == 0
    assert lag < 3e-4
    assert abs(trend.common_rate - DRIFT) < 3 * trend.common_std < 5e-4
