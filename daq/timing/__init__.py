"""Device clocks and sampling times: from arrival times to one time grid."""

from daq.timing.clock_fit import ClockFit
from daq.timing.host_clock import SharedTime
from daq.timing.scan_clocks import ScanClock, ScanClocks

__all__ = [
    "ClockFit",
    "ScanClock",
    "ScanClocks",
    "SharedTime",
]
