"""How a monitor is that is well."""

from typing import Any

from monitor.service.status import Pace

PACE = Pace(step=600.0, window=600.0)
WELL: dict[str, Any] = dict.fromkeys(("disk", "history", "notices", "viewer", "analysis"))
WELL |= {"dropped": 0, "disk_free": 5e9, "not_in_history": 0}
WELL |= {"waiting": {"log": 3, "analysis": 40}, "bad_bytes": {"left": 21, "right": 0}}
