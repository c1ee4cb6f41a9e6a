"""Texts on the smallest detectable change, and on a missing thermometer."""

import numpy as np

from monitor.results.run_results import RunResults
from monitor.results.windows import DetectableChange

NO_THERMOMETER = (
    "no temperature is measured: season and frost, which change frequencies by up to several per cent, raise alarms or "
    "hide changes; a thermometer is needed ([temperature] in the settings, or a device that has one)"
)


def detectable_text(found: DetectableChange) -> str:
    """Return the smallest detectable change, and that a thermometer is needed where there is none."""
    each = np.array(found.modes_percent)
    known = np.flatnonzero(np.isfinite(each))
    text = f"a lasting change of all frequencies alike by {found.alike_percent:.2g} %"
    if known.size:
        least, most = known[each[known].argmin()], known[each[known].argmax()]
        text += (
            f", or of one mode alone by {each[least]:.2g} % (mode {least + 1}) to {each[most]:.2g} % (mode {most + 1})"
        )
    if hidden := [str(k + 1) for k in np.flatnonzero(~np.isfinite(each))]:
        text += f"; not detectable alone: mode{'s' * (len(hidden) > 1)} {', '.join(hidden)}"
    return text if found.thermometer else f"{text}; {NO_THERMOMETER}"


def last_detectable(run_results: RunResults) -> str:
    """Return the smallest detectable change at the last window that was judged; empty where that is not known."""
    judged = [window.novelty for window in run_results.watched if window.novelty]
    return detectable_text(judged[-1].detectable) if judged and judged[-1].detectable else ""
