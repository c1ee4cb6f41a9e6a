"""Texts of verdicts and headlines."""

from monitor.results.run_results import RunResults
from monitor.results.windows import AcceptedShift, WindowResult
from monitor.text.cause_list import listed_causes
from monitor.text.causes import brief_text, change_text, further_changes, mass_text, not_considered_text
from monitor.text.detection import standing_trend, unsure_now
from monitor.text.modal_change import modal_change_headline
from monitor.text.quantities import utc
from updater import Diagnosis

_DOUBTFUL = 0.01  # p value under which the fit speaks against a mass
_CLOCKS = frozenset({"sensor_delay"})  # taken out of all modes before a mass is located
_MASSES = frozenset({"added_mass", "distributed_mass"})

VERDICTS = {
    "nothing_to_explain": "Nothing to explain: the data agree with the model.",
    "explained": "Explained",
    "ambiguous": "Explained, but the data cannot distinguish some causes",
    "unexplained": "Unexplained: no known cause explains the difference between data and model.",
}

_FITTED = "Nothing significant to explain: the data agree with the model after small changes of its parameters"


def verdict_text(diagnosis: Diagnosis) -> str:
    """Return the verdict as a sentence that the causes follow, if there are any."""
    return f"{_verdict(diagnosis)}:" if diagnosis.causes else _verdict(diagnosis)


def has_only_fitted_parameters(diagnosis: Diagnosis) -> bool:
    """Return whether parameters of the model alone explain the data, none of them by two deviations or more."""
    return bool(diagnosis.causes) and all(
        cause.changes and further_changes(cause) == cause.changes for cause in diagnosis.causes
    )


def _verdict(diagnosis: Diagnosis) -> str:
    model = diagnosis.calibration
    if diagnosis.verdict == "unexplained" and model and not model.fits_reference:
        return (
            "Unexplained: the model does not fit the reference logs. Its calibrated frequencies are off by "
            f"{model.frequency_error_percent.after or 0.0:.2g} % rms, those of a good model by 0.2 %. Its changes are "
            "not those of the structure."
        )
    if diagnosis.verdict == "unexplained" and diagnosis.failed:
        return f"{VERDICTS['unexplained'].removesuffix('.')}{not_considered_text(diagnosis)}."
    return _FITTED if has_only_fitted_parameters(diagnosis) else VERDICTS[diagnosis.verdict]


def diagnosis_text(diagnosis: Diagnosis) -> str:
    """Return the diagnosis in one sentence."""
    if not diagnosis.causes:
        return _verdict(diagnosis)
    return f"{_verdict(diagnosis)}: {'; '.join(map(brief_text, listed_causes(diagnosis.causes)))}."


def changed_between(run_results: RunResults) -> tuple[int, int] | None:
    """Return start and end [ns UTC] of the window that first showed the last alarm's change; None if none did.

    Windows after the alarm was raised do not count: one of them may be within the limit while the change is there.
    """
    raised = [alarm.time for alarm in run_results.alarms if alarm.raised]
    if raised and raised[-1] <= run_results.start:
        return None  # the window is before the range that is reported
    first: WindowResult | None = None
    before: WindowResult | None = None
    for window in run_results.watched:
        if raised and window.end > raised[-1]:
            break
        over = window.novelty is not None and window.novelty.t2 > window.novelty.limit
        if over and (before is None or before.novelty is None or before.novelty.t2 <= before.novelty.limit):
            first = window
        before = window if window.novelty else before
    return (first.start, first.end) if first else None


def last_state(run_results: RunResults) -> str:
    """Return the alarm's state at the end: learning, normal, watch or alarm."""
    if not run_results.watched and not run_results.reference:
        return "learning"
    return run_results.alarms[-1].state if run_results.alarms else "normal"


def accepted_text(change: AcceptedShift, time: int) -> str:
    """Return the cause, person and time [ns UTC] of an acceptance."""
    by = f" by {change.by}" if change.by else ""
    return f"as {change.cause!r}{by}, {utc(time)}"


def headline(run_results: RunResults, diagnosis: Diagnosis | None) -> str:
    """Return the verdict of a run in one sentence."""
    state, n = last_state(run_results), len(run_results.watched)
    if state == "learning":
        return f"Still learning: {len(run_results.windows)} windows so far, no window has been evaluated yet."
    if state == "alarm":
        return f"The structure has changed: {_what(run_results, diagnosis)}.{_when(run_results)}"
    if state == "watch":
        return "One window is above the limit. The next windows decide whether the structure has changed."
    unsure = unsure_now(run_results)
    if change := run_results.closed_by:
        since = sum(window.end > run_results.accepted_at(change) for window in run_results.watched)
        then = f"nothing has changed in {since} windows since" if since else "no window has been evaluated since"
        return f"A change was accepted {accepted_text(change, run_results.accepted_at(change))}; {unsure or then}."
    if any(alarm.state == "alarm" for alarm in run_results.alarms):
        return f"Back to normal after an alarm, {n} windows watched{f'; {unsure}' if unsure else ''}."
    trend = standing_trend(run_results)
    if unsure:
        return f"No large change: {unsure}{f'; {trend}' if trend else ''}."
    if trend:
        return f"No sudden change in {n} windows; {trend}."
    return f"Nothing has changed in {n} windows." if n else "A baseline is learned; no window has been evaluated yet."


def _what(run_results: RunResults, diagnosis: Diagnosis | None) -> str:
    if diagnosis and not (run_results.answers and is_one_mass(diagnosis)):  # the located mass is the surer of the two
        return change_text(diagnosis)
    if not run_results.answers:
        change = run_results.last_change
        return modal_change_headline(change) if change else "location not yet known"
    answer = run_results.answers[-1][1]
    doubt = " (a mass alone fits poorly)" if answer.p_value < _DOUBTFUL else ""
    return mass_text(answer) + doubt


def is_one_mass(diagnosis: Diagnosis) -> bool:
    """Return whether one added or removed mass explains the change of the structure, and nothing else.

    A mass that may also be distributed over a stretch is one, and so is one with a delayed clock: position and mass are
    the same.
    """
    structural = [c for c in diagnosis.causes if c.cause not in _CLOCKS]
    kinds = {name for c in structural for name in (c.cause, *c.cannot_be_told_from)}
    alternatives = diagnosis.verdict == "ambiguous" and sum(c.probability for c in structural) <= 1.0
    one = len(structural) == 1 or alternatives
    return bool(diagnosis.causes) and one and "added_mass" in kinds and kinds <= _MASSES


def _when(run_results: RunResults) -> str:
    between = changed_between(run_results)
    if between is None:
        return ""
    return f" First detected between {utc(between[0])[:-4]} and {utc(between[1], date=False)} UTC."
