"""Change detection that holds a false alarm rate: a law of temperature, the scatter about it, limits by run length."""

from typing import TYPE_CHECKING

from daq.lazy_names import lazy_names

if TYPE_CHECKING:
    from monitor.detection.alarm import DetectorName
    from monitor.detection.baseline_shift import Shift, shift_of, shifted
    from monitor.detection.correlated_noise import effective_number
    from monitor.detection.detectors import (
        DETECTORS,
        GUARD,
        LawState,
        ScoredWindows,
        accept,
        judge,
        start,
    )
    from monitor.detection.run_length import DetectionSettings
    from monitor.detection.sensitivity import detectable_change, least_unsure
    from monitor.detection.temperature_law import CHUNK
    from monitor.detection.trend import NO_TREND, Trend, TrendWatch, follow_trend
else:
    __getattr__, __dir__ = lazy_names(__name__, __file__)

__all__ = [
    "CHUNK",
    "DETECTORS",
    "GUARD",
    "NO_TREND",
    "DetectionSettings",
    "DetectorName",
    "LawState",
    "ScoredWindows",
    "Shift",
    "Trend",
    "TrendWatch",
    "accept",
    "detectable_change",
    "effective_number",
    "follow_trend",
    "judge",
    "least_unsure",
    "shift_of",
    "shifted",
    "start",
]
