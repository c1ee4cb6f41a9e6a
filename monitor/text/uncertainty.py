"""Texts on conditions under which the temperature law is uncertain."""

import math
from collections.abc import Sequence
from itertools import takewhile

from monitor.results.run_results import RunResults
from monitor.results.windows import Novelty, SingleMode, Unsure


def unsure_text(found: Sequence[Unsure]) -> str:
    """Return as a part of a sentence the detectable change of the least certain window."""
    worst = max(found, key=lambda one: one.least_percent)
    known = [one.temperature for one in found if math.isfinite(one.temperature)]
    where = f"at {_between(min(known), max(known))} degC" if known else ""
    if worst.outside:
        where += f", outside the range of the baseline ({_between(worst.coldest, worst.warmest)} degC),"
    silent = max((one.silent_hours for one in found if one.silent_hours is not None), default=None)
    if silent is not None:
        where += f"{' and ' if where else ''}without a temperature reading for up to {silent:.1f} h,"
    detectable = f"only changes of all frequencies alike by more than {worst.least_percent:.2g} % are detectable"
    return f"{where} {detectable}".lstrip()


def single_mode_text(single: SingleMode) -> str:
    """Return as part of a sentence that one mode alone is inconsistent, and for how long that is waited."""
    return (
        f"mode {single.mode} alone has been inconsistent for {single.windows} window{'s' * (single.windows != 1)} "
        f"(wrong pole?), which is taken for a change after {single.needed}"
    )


def _between(lowest: float, highest: float) -> str:
    low, high = f"{lowest:.1f}", f"{highest:.1f}"
    return low if low == high else f"{low} to {high}"


def unsure_now(run_results: RunResults) -> str:
    """Return the detectable change in the last windows; empty if the law was certain in the newest one."""
    judged = _judged(run_results)
    last = list(takewhile(lambda unsure: unsure is not None, (novelty.unsure for novelty in reversed(judged))))
    unsure = _of([unsure for unsure in last if unsure], f"the last {len(last)} of {len(judged)} windows")
    single = judged[-1].single_mode if judged else None
    return "; ".join(part for part in (unsure, single_mode_text(single) if single else "") if part)


def unsure_ever(run_results: RunResults) -> str:
    """Return the detectable change in all windows with an uncertain law; empty if there are none."""
    judged = _judged(run_results)
    found = [novelty.unsure for novelty in judged if novelty.unsure]
    return _of(found, f"{len(found)} of {len(judged)} windows")


def _judged(run_results: RunResults) -> list[Novelty]:
    return [window.novelty for window in run_results.watched if window.novelty]


def _of(found: list[Unsure], windows: str) -> str:
    return f"in {windows}, {unsure_text(found)}" if found else ""
