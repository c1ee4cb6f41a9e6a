"""Device clocks and sampling times: from arrival times to one time grid."""

from daq.timing.clock_fit import ClockFit
from daq.timing.host_clock import HostClock, ScaledClock, SharedTime, SystemClock
from daq.timing.resampling import Assembler
from daq.timing.scan_clocks import ScanClock, ScanClocks

__all__ = [
    "Assembler",
    "ClockFit",
    "HostClock",
    "ScaledClock",
    "ScanClock",
    "ScanClocks",
    "SharedTime",
    "SystemClock",
]
