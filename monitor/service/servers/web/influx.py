"""Status in the line protocol of InfluxDB, for `/influx`.

References
----------
InfluxData: Line protocol reference, https://docs.influxdata.com/influxdb/v2/reference/syntax/line-protocol/
"""

import math
import re
import time
from collections.abc import Iterator, Mapping

from monitor.results.site_status import SiteStatus, WindowStatus
from monitor.service.servers.web.source import problems

Field = float | int | bool | str | None
_NOT_IN_TAGS = re.compile(r"[\x00-\x1f\x7f\\]")  # line breaks end a point; a backslash may escape what follows the tag


def influx_lines(status: SiteStatus | None, site: str) -> str:
    """Return one line per device, mode and window, and one of the monitor.

    Points of the monitor and its devices have the time of the status; those of the window and its modes have the end
    of the window, so that repeated reading stores them once.

    Parameters
    ----------
    status : of the monitor; None where no monitor of this version has ever run
    site : name of the site
    """
    tags = {"site": site}
    if status is None:
        return _line("modalwatch", tags, {"healthy": False}, time.time_ns())
    window = _window(status.window, tags) if status.window else ()
    return "".join([*_monitor(status, tags), *window])


def _monitor(status: SiteStatus, tags: dict[str, str]) -> Iterator[str]:
    at, counters = round(status.time * 1e9), status.counters
    found = problems(status)
    monitor: dict[str, Field] = {
        "healthy": not found,
        "problems": len(found),
        "state": status.state,
        "alarm": status.state == "alarm",
        "temperature": status.temperature,
        "window_age": status.window_age,
        "windows_left_out": status.windows_left_out,
        "disk_free": counters.disk_free,
        "dropped": counters.dropped,
    }
    latency: dict[str, Field] = {f"latency_{name}": seconds for name, seconds in status.latency.items()}
    yield _line("modalwatch", tags, monitor | latency, at)
    for name, device in status.devices.items():
        fields: dict[str, Field] = {
            "scan_rate": device.rate,
            "scans": device.scans,
            "gaps": device.gaps,
            "bad_bytes": counters.bad_bytes.get(name),
            "lost": device.lost,
            "silent": device.silent,
            "temperature": device.temperature,
        }
        yield _line("modalwatch_device", tags | {"device": name}, fields, at)


def _window(window: WindowStatus, tags: dict[str, str]) -> Iterator[str]:
    if window.end is None:
        return
    fields: dict[str, Field] = {"phase": window.phase, "modes": window.n_modes}
    if window.novelty:
        fields |= {"novelty": window.novelty.t2, "novelty_limit": window.novelty.limit}
    yield _line("modalwatch_window", tags, fields, window.end)
    for identity, mode in window.tracked.items():
        yield _line("modalwatch_mode", tags | {"mode": str(identity)}, mode.model_dump(), window.end)


def _line(measurement: str, tags: Mapping[str, str], fields: Mapping[str, Field], at: int) -> str:
    """Return a point; values that are absent or not finite are left out.

    Parameters
    ----------
    measurement, tags, fields : of the point; keys without special characters
    at : time [ns UTC]
    """
    key = ",".join([measurement, *(f"{name}={_tag(tags[name])}" for name in sorted(tags))])
    given = [f"{name}={text}" for name, value in fields.items() if (text := _value(value))]
    return f"{key} {','.join(given)} {at}\n" if given else ""


def _tag(value: str) -> str:
    """Escape a tag value; characters that no escape can represent become underscores."""
    return re.sub(r"([,= ])", r"\\\1", _NOT_IN_TAGS.sub("_", value))


def _value(value: Field) -> str:
    """Return a field value with the mark of its type; empty for an absent one."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int):
        return f"{value}i"
    if isinstance(value, float):
        return repr(value) if math.isfinite(value) else ""
    if value is None:
        return ""
    text = value.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{text}"'
