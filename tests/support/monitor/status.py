"""Status of the other parts of a healthy monitor."""

from monitor.results.site_status import Counters, PartProblems
from monitor.service.status import Pace

PACE = Pace(step=600.0, window=600.0)
WELL = (
    PartProblems(),
    Counters(disk_free=5 * 10**9, waiting={"log": 3, "analysis": 40}, bad_bytes={"left": 21, "right": 0}),
)
