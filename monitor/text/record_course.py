"""Texts of a change of the structure within the logs that are diagnosed."""

from daq.notebook import number_text
from monitor.results.comparison import ChangeRate, WithinRecord
from monitor.text.cause_list import listed_causes
from monitor.text.causes import cause_text
from monitor.text.quantities import plain, share_text, utc

_SPOKEN = {"kg": (1000.0, "g"), "-": (100.0, "%")}


def within_record_text(found: WithinRecord) -> str:
    """Return when the structure changed, and which state is diagnosed."""
    if found.step is not None:
        when = f"between {utc(found.step[0])} and {utc(found.step[1])}"
        state = "after this change"
    else:
        when = f"gradually; compared are the states at {utc(found.start)} and at {utc(found.end)}"
        state = f"at {utc(found.end)}"
    return f"The structure changed while the logs were recorded, {when}. The answer is for the state {state}."


def record_change_texts(found: WithinRecord) -> list[str]:
    """Return the causes of the change within the logs, then its rates."""
    if not found.causes:
        nothing = "no known cause explains it" if found.verdict == "unexplained" else "too small to be named"
        return [f"cause of the change within the logs: {nothing}"]
    causes = [
        f"change within the logs: {cause_text(cause)} (probability {share_text(cause.probability)})"
        for cause in listed_causes(found.causes)
    ]
    return causes + [f"mean rate: {rate_text(rate)}" for rate in found.rates]


def rate_text(rate: ChangeRate) -> str:
    """Return a rate with its parameter and standard deviation."""
    scale, unit = _SPOKEN.get(rate.unit, (1.0, rate.unit))
    return f"{plain(rate.parameter)} {number_text(scale * rate.per_hour, scale * rate.std)} {unit}/h"
