"""Device clocks and sampling times: from arrival times to one time grid."""

from daq.timing.clock_fit import ClockFit as ClockFit
from daq.timing.host_clock import SharedTime as SharedTime
from daq.timing.scan_clocks import ScanClock as ScanClock
from daq.timing.scan_clocks import ScanClocks as ScanClocks
