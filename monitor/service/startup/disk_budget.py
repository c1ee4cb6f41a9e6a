"""Forecast of the time until the disk is full, before anything is recorded."""

from monitor.settings import Settings

BYTES_A_SCAN = 4.4, 9.2  # of three axes in a log: a sensor at rest, and 10 mg rms (`make bench-log-crash`)


def disk_plan(settings: Settings, free: float) -> str:
    """Return a text on disk use per day, days until the disk is full, and the consequence.

    Parameters
    ----------
    settings : of the site
    free : room on the disk of the logs [bytes]
    """
    recorder = settings.recorder
    least, most = (sum(device.rate for device in settings.device) * 86400 * b * 1e-9 for b in BYTES_A_SCAN)
    takes = f"{_span(least, most)} GB per day"
    room = free * 1e-9 - recorder.min_free_gb
    if room <= 0:
        return f"{takes}; less than recorder.min_free_gb = {recorder.min_free_gb:g} is free now"
    allowed = min(room, recorder.keep_gb or room)
    days = allowed / most, allowed / least
    if recorder.keep_days and recorder.keep_days <= days[0]:
        return f"{takes}; the last {recorder.keep_days:g} days are kept"
    spared = recorder.min_free_gb > 0 or allowed < room
    then = "the oldest files are deleted" if spared else "the disk is full"
    return f"{takes}; room for {_span(*days)} days, then {then}"


def _span(low: float, high: float) -> str:
    """Return two figures as one where they print the same."""
    texts = f"{low:.2g}" if low < 100 else f"{low:.0f}", f"{high:.2g}" if high < 100 else f"{high:.0f}"
    return texts[0] if texts[0] == texts[1] else f"{texts[0]} to {texts[1]}"
