"""State of a watch in the middle of a log: the part that a restart, which begins a new log, does without."""

from dataclasses import dataclass

from monitor.analysis.window import Window


@dataclass(frozen=True, eq=False, kw_only=True)
class MidLogState:
    """State of a watch between two windows of a log, beyond its `Memory`."""

    recent: tuple[Window, ...]  #: calm windows without a break, for the next self-test
    changing: bool  #: whether the change that raised the alarm continues
    added: str  #: message on a structure file that was added, not yet reported
    noted: tuple[str, ...]  #: faults of optional work that are reported once
    failed: tuple[str, ...]  #: faults of optional work, not yet reported
    unreported: bool = False  #: whether the continued reference is not yet reported
    readings: tuple[tuple[int, float], ...] = ()  #: times [ns UTC] and temperatures [degC] of the site's thermometer
