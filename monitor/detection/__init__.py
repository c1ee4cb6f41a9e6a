"""Change detection that holds a false alarm rate: a law of temperature, the scatter about it, limits by run length."""

from monitor.detection.detector import DETECTORS, GUARD, DetectorName, Judged, Watched, accept, judge, start
from monitor.detection.law import CHUNK
from monitor.detection.run_length import Watching

__all__ = ["CHUNK", "DETECTORS", "GUARD", "DetectorName", "Judged", "Watched", "Watching", "accept", "judge", "start"]
