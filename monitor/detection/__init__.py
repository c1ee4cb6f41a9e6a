"""Change detection that holds a false alarm rate: a law of temperature, the scatter about it, limits by run length."""

from typing import TYPE_CHECKING

from daq.lazy_names import lazy_names

if TYPE_CHECKING:
    from monitor.detection.alarm import DetectorName as DetectorName
    from monitor.detection.baseline_shift import Shift as Shift
    from monitor.detection.baseline_shift import shift_of as shift_of
    from monitor.detection.baseline_shift import shifted as shifted
    from monitor.detection.correlated_noise import effective_number as effective_number
    from monitor.detection.detectors import DETECTORS as DETECTORS
    from monitor.detection.detectors import GUARD as GUARD
    from monitor.detection.detectors import LawState as LawState
    from monitor.detection.detectors import ScoredWindows as ScoredWindows
    from monitor.detection.detectors import accept as accept
    from monitor.detection.detectors import judge as judge
    from monitor.detection.detectors import start as start
    from monitor.detection.run_length import DetectionSettings as DetectionSettings
    from monitor.detection.sensitivity import detectable_change as detectable_change
    from monitor.detection.sensitivity import least_unsure as least_unsure
    from monitor.detection.temperature_law import CHUNK as CHUNK
    from monitor.detection.trend import NO_TREND as NO_TREND
    from monitor.detection.trend import Trend as Trend
    from monitor.detection.trend import TrendWatch as TrendWatch
    from monitor.detection.trend import follow_trend as follow_trend
else:
    __getattr__, __dir__, __all__ = lazy_names(__name__, __file__)
