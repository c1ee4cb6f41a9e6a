"""Content of the report, section by section: plain values and pictures for the template."""

import platform
from importlib.metadata import version
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from daq import LogExcerpt
from daq.log import files_of
from daq.notebook import number_text, rounded_text
from monitor.results.comparison import DiagnosisAnswer, DiscrepancyResult
from monitor.results.run_results import RunResults, find_mode
from monitor.results.state_comparison import StateComparison
from monitor.results.windows import MassAnswer, MassIncrements, ModeChange, ReferenceResult, WindowResult
from monitor.text.cause_list import listed_causes
from monitor.text.causes import (
    breathing_text,
    failed_text,
    fit_text,
    further_changes,
    further_changes_text,
    gain_text,
    increment_text,
    lost_modes_text,
    mass_text,
    member_share_text,
    other_texts,
    parameter_texts,
    predicted_text,
    probability_text,
    remainder_text,
    where_text,
)
from monitor.text.detection import last_detectable, standing_trend, unsure_ever, unsure_now
from monitor.text.diagnosis import (
    follow_text,
    mass_test_text,
    note_texts,
    plan_rows,
    record_change_texts,
    smallest_changes_text,
    within_record_text,
)
from monitor.text.modal_change import modal_change_text
from monitor.text.quantities import optional, utc
from monitor.text.sensors import health_rows
from monitor.text.verdicts import accepted_text, headline, is_one_mass, last_state, verdict_text
from monitor.views.report import fit_figures as fits
from monitor.views.report import place_figures as places
from monitor.views.report import time_figures as trends
from monitor.views.report.comparison_content import measured_content
from monitor.views.report.structure_figure import shapes_figure
from monitor.views.report.svg import Picture, picture
from monitor.views.run import Run
from oma import mac_matrix
from updater import Cause, Gain
from updater.diagnosis import FittedCause, ModeFit, evidence_figure, fits_figure
from updater.quantities import plain

_VERSIONS = ("modalwatch", "numpy", "scipy", "rerun-sdk")


def run_content(run: Run, diagnosis: DiagnosisAnswer | None) -> dict[str, Any]:
    """Return the template's values for a run."""
    run_results = run.results
    found = None if diagnosis else last_discrepancy(run_results)
    diagnosis = diagnosis or last_diagnosis(run_results)
    return {
        "title": run_results.name,
        "state": "watch"
        if last_state(run_results) == "normal" and unsure_now(run_results)
        else last_state(run_results),
        "headline": headline(run_results, diagnosis),
        "facts": _facts(run),
        "located": last_answer(run_results) is not None,
        "pictures": _pictures(run_results, diagnosis),
        "increments": _increments(run_results),
        "modes": _modes(run_results),
        "has_model": run_results.structure is not None,
        "change": _change(run_results),
        "sensors": _sensors(run_results),
        "diagnosis": _diagnosis(diagnosis, run_results.structure, found) if diagnosis else None,
        "quality": _quality(run),
        "settings": run.site_text,
        "versions": versions(),
    }


def versions() -> dict[str, str]:
    """Return the versions of the programs that made the page."""
    return {"python": platform.python_version()} | {name: version(name) for name in _VERSIONS}


def _sensors(run_results: RunResults) -> list[dict[str, str]]:
    """Return how the sensors fared when they were last looked at."""
    looked = [w.sensors for w in run_results.windows if w.sensors]
    return health_rows(looked[-1]) if looked else []


def last_diagnosis(run_results: RunResults) -> DiagnosisAnswer | None:
    """Return the diagnosis of the last window that has one, if the alarm is still active."""
    found = [w.diagnosis for w in run_results.windows if w.diagnosis]
    return found[-1] if found and last_state(run_results) == "alarm" else None


def last_discrepancy(run_results: RunResults) -> DiscrepancyResult | None:
    """Return the basis of the last diagnosis, if the alarm is still active."""
    found = [w.discrepancy for w in run_results.windows if w.diagnosis]
    return found[-1] if found and last_state(run_results) == "alarm" else None


def last_answer(run_results: RunResults) -> MassAnswer | None:
    """Return the newest located mass while the alarm is active, unless a later diagnosis excludes a mass."""
    diagnosis = last_diagnosis(run_results)
    if not run_results.answers or last_state(run_results) != "alarm" or (diagnosis and not is_one_mass(diagnosis)):
        return None
    return run_results.answers[-1][1]


def _facts(run: Run) -> list[tuple[str, str]]:
    run_results = run.results
    facts = [("Monitored", f"{utc(run_results.start)} to {utc(run_results.end)}")]
    if isinstance(run.log, LogExcerpt):
        facts.append(("Range", f"{run.log.text} of the log"))
    facts.append(("Windows", _windows(run)))
    answer = last_answer(run_results)
    if answer:
        facts.append(("Position and size", mass_text(answer)))
        facts.append(("Probability", f"{member_share_text(answer)}; {fit_text(answer)}"))
        if answer.outlook:
            facts.append(("Forecast", answer.outlook))
    judged = [w.novelty for w in run_results.watched if w.novelty]
    if judged:
        facts.append(("Novelty, last window", f"{judged[-1].t2:.1f}, limit {judged[-1].limit:.1f}"))
    if detectable := last_detectable(run_results):
        facts.append(("Smallest detectable change", detectable))
    if unsure := unsure_ever(run_results):
        facts.append(("Detectable change", unsure))
    if trend := standing_trend(run_results):
        facts.append(("Slow trend", trend))
    alarms = [a for a in run_results.alarms if a.raised]
    facts.append(("Alarms", ", ".join(utc(a.time) for a in alarms) or "none"))
    for change in run_results.accepted:
        text = accepted_text(change, run_results.accepted_at(change))
        facts.append(("Accepted", f"{text}; diagnosis: {change.found}"))
    return facts


def _windows(run: Run) -> str:
    """Return the number of reported windows; of a range, without those of the baseline."""
    learning, watched = len(run.results.learning), len(run.results.watched)
    if not isinstance(run.log, LogExcerpt):
        return f"{learning} baseline, {watched} monitored"
    reference = run.results.reference
    baseline = f"; the baseline has {reference.n_windows} windows of the log" if reference else ""
    return f"{learning + watched} in the range, {learning} of them before the end of the baseline{baseline}"


def _pictures(run_results: RunResults, diagnosis: DiagnosisAnswer | None) -> dict[str, Picture | None]:
    reference, answer = run_results.geometry, last_answer(run_results)
    causes = listed_causes(diagnosis.causes) if diagnosis else ()
    spectra = run_results.spectra
    return {
        "structure": picture(
            lambda: _structure(reference, answer, causes) if reference else None,
            "The structure with its sensors" + (f": {mass_text(answer)}" if answer else ""),
        ),
        "shapes": picture(lambda: shapes_figure(reference) if reference else None, "Mode shapes of the baseline"),
        "overview": picture(lambda: trends.overview_figure(run_results), "Novelty and frequency shifts over time"),
        "profile": picture(
            lambda: places.profile_figure(answer, reference, run_results.mass_unit) if answer else None,
            "Misfit of every other place compared with the best one, in standard deviations",
        ),
        "shifts": picture(lambda: trends.shifts_figure(run_results), "Frequency shift of every mode over time, ± 1σ"),
        "spectrum": picture(
            lambda: trends.spectrum_figure(*spectra[-1]) if spectra else None,
            "Singular values of the spectral matrix and the stabilisation diagram",
        ),
    }


def _structure(reference: ReferenceResult, answer: MassAnswer | None, causes: tuple[Cause, ...]) -> Figure:
    """Return the structure with what is known: the located mass, else the places of the causes, else the sensors."""
    drawn = None if answer else fits.causes_figure(reference, causes)
    return drawn or places.structure_figure(reference, answer)


def _increments(run_results: RunResults) -> dict[str, Any] | None:
    found = [w.increments for w in run_results.windows if w.increments]
    if not found or run_results.structure is None:
        return None
    increments, reference = found[-1], run_results.structure
    return {
        "picture": picture(
            lambda: places.increments_figure(reference, increments),
            "Nodal mass increments of the one-step update by direction",
        ),
        "n_windows": increments.n_windows,
        "z_limit": f"{increments.z_limit:.1f}",
        "text": increment_text(increments),
        "flagged": _flagged(increments),
    }


def _flagged(increments: MassIncrements) -> list[dict[str, str]]:
    """Return one row per direction that has flagged nodes: their number and the largest z."""
    rows = []
    for direction in ("x", "y", "z"):
        z = [f.z for f in increments.flagged if f.direction == direction]
        if z:
            rows.append({"direction": direction, "n": str(len(z)), "z": f"{max(z, key=abs):+.1f}"})
    return rows


def _change(run_results: RunResults) -> dict[str, Any] | None:
    """Return the change of the measured modes while the alarm is active, at a site without a structure file."""
    change = run_results.last_change
    if change is None or last_state(run_results) != "alarm":
        return None
    return {
        "text": modal_change_text(change),
        "n_windows": change.n_windows,
        "modes": [_mode_change(mode) for mode in change.modes],
    }


def _mode_change(mode: ModeChange) -> dict[str, str]:
    return {
        "id": str(mode.id),
        "frequency": rounded_text(mode.frequency, 0.01 * mode.shift_std_percent * mode.frequency),
        "shift": _number(mode.shift_percent, mode.shift_std_percent),
        "damping": rounded_text(100 * mode.damping, 100 * mode.damping_shift_std),
        "damping_shift": _number(100 * mode.damping_shift, 100 * mode.damping_shift_std),
        "mac": f"{mode.mac:.4f}" if np.isfinite(mode.mac) else "",
        "changed": ", ".join(mode.changed),
    }


def _number(value: float, std: float) -> str:
    return number_text(value, std) if np.isfinite(value) and np.isfinite(std) else "not identified"


def _modes(run_results: RunResults) -> list[dict[str, str]]:
    if run_results.reference is None or not run_results.watched:
        return []
    last = next((w for w in reversed(run_results.watched) if w.modes), None)
    first = next((w for w in run_results.watched if w.modes), None)
    first = first if run_results.reference.has_shapes else None
    return [_mode(m.id, m.frequency, m.frequency_std, m.mac, first, last) for m in run_results.reference.modes]


def _mode(
    number: int, frequency: float, std: float, model_mac: float, first: WindowResult | None, last: WindowResult | None
) -> dict[str, str]:
    row = dict.fromkeys(("now", "shift", "sigmas", "damping", "mac"), "")
    row |= {"id": str(number), "reference": number_text(frequency, std), "model_mac": f"{model_mac:.4f}"}
    mode = find_mode(last, number) if last else None
    if mode is None or last is None:
        return row | {"now": "not identified"}
    row |= {"now": number_text(mode.frequency, mode.frequency_std)}
    row |= {"damping": number_text(100 * mode.damping, 100 * mode.damping_std)}
    if mode.shift_percent is not None and mode.shift_std_percent is not None:
        row["shift"] = number_text(mode.shift_percent, mode.shift_std_percent)
        row["sigmas"] = f"{mode.shift_percent / mode.shift_std_percent:+.1f}" if mode.shift_std_percent else ""
    earlier = find_mode(first, number) if first else None
    if earlier and first and first.channels == last.channels:
        row["mac"] = f"{float(mac_matrix(np.array([earlier.shape]), np.array([mode.shape]))[0, 0]):.4f}"
    return row


def _quality(run: Run) -> dict[str, Any]:
    run_results = run.results
    devices = [
        {
            "device": d.device,
            "rate": f"{d.rate:g}",
            "scans": f"{d.scans:,}".replace(",", "\u00a0"),
            "gaps": str(d.gaps),
            "missing": f"{'' if d.exact else 'about '}{d.missing}",
            "damaged": str(d.damaged),
            "lost": str(d.lost),
        }
        for d in run.devices
    ]
    return {
        "log": run.log.name,
        "size": f"{sum(path.stat().st_size for path in files_of(run.log)) / 1e6:.1f} MB",
        "ended": run.ended,
        "dropped": run.dropped,
        "devices": devices,
        "problems": [(w.index + 1, utc(w.end), w.problem) for w in run_results.windows if w.problem],
    }


def diagnosis_content(
    diagnosis: DiagnosisAnswer,
    reference: ReferenceResult | None,
    found: DiscrepancyResult | None = None,
    states: StateComparison | None = None,
) -> dict[str, Any]:
    """Return the template's values for a diagnosis; its places are drawn if there is a structure to draw."""
    drawn = picture(
        lambda: fits.causes_figure(reference, listed_causes(diagnosis.causes)) if reference else None,
        "The structure with the causes where they are",
    )
    return _diagnosis(diagnosis, reference, found, states) | {"places": drawn}


def _diagnosis(
    diagnosis: DiagnosisAnswer,
    reference: ReferenceResult | None,
    found: DiscrepancyResult | None,
    states: StateComparison | None = None,
) -> dict[str, Any]:
    """Return the values without the picture of the places."""
    within = diagnosis.within_record
    causes = listed_causes(diagnosis.causes)
    fitted = [one for cause in causes for one in (cause, *cause.alternatives)]
    return {
        "places": None,
        "has_region": any(one.where and one.where.region for one in fitted),
        "fits": picture(
            lambda: fits_figure(causes, diagnosis.modes),
            "Errors of the model mode by mode, without and with the causes",
        ),
        "evidence": picture(
            lambda: evidence_figure(causes, diagnosis.rejected), "Log evidence of every cause that was tried"
        ),
        "measured": measured_content(found, reference, states) if found else None,
        "verdict": diagnosis.verdict,
        "text": verdict_text(diagnosis),  # the headline has the causes, and so has the table
        "causes": [row for cause in causes for row in _cause_rows(cause, diagnosis)],
        "rejected": _refused(diagnosis),
        "n_rejected": len(diagnosis.rejected),
        "failed": [failed_text(failed) for failed in diagnosis.failed],
        "modes": [_fit(i, m) for i, m in enumerate(diagnosis.modes, 1)],
        "gain": _gain(diagnosis, found.gain_std if found else None),
        "extended_model": diagnosis.extended_model,
        "next_measurement": diagnosis.next_measurement,
        "notes": [*filter(None, [lost_modes_text(found) if found else ""]), *note_texts(diagnosis)],
        "plan": plan_rows(diagnosis.separation),
        "follows": follow_text(diagnosis.follows) if diagnosis.follows else "",
        "mass_tests": [mass_test_text(test) for test in diagnosis.mass_tests],
        "smallest": smallest_changes_text(
            diagnosis.smallest_changes, unchanged=diagnosis.verdict == "nothing_to_explain"
        ),
        "within": [within_record_text(within), *record_change_texts(within)] if within else [],
    }


def _refused(diagnosis: DiagnosisAnswer) -> list[tuple[str, str]]:
    """Return the reasons, each with the causes that were refused for it and their log evidence."""
    found: dict[str, list[str]] = {}
    for rejected in sorted(diagnosis.rejected, key=lambda r: -r.log_evidence):
        found.setdefault(rejected.why, []).append(f"{plain(rejected.cause)} ({rejected.log_evidence:+.1f})")
    return [(why, ", ".join(names)) for why, names in found.items()]


def _cause_rows(cause: Cause, diagnosis: DiagnosisAnswer) -> list[dict[str, Any]]:
    """Return the row of a cause, then those of its alternatives; each with its check where several are left open."""
    fitted: dict[str, FittedCause] = {other.cause: other for other in (cause, *cause.alternatives)}
    rows = []
    for name in (cause.cause, *cause.cannot_be_told_from):
        one = fitted.get(name) or FittedCause(cause=name, where=None, parameters={})
        check = one.advice if diagnosis.verdict == "ambiguous" else ""
        rows.append(
            {
                "name": plain(name),
                "or": name != cause.cause,
                "probability": probability_text(cause),
                "where": where_text(one.where) or ("–" if name in fitted else "not fitted"),
                "parameters": parameter_texts(one),
                "further": list(filter(None, _further(one))),
                "check": check if check not in diagnosis.next_measurement else "",
            }
        )
    return rows


def _further(cause: FittedCause) -> list[str]:
    """Return the lines below the parameters of a cause, some of them empty."""
    return [further_changes_text(further_changes(cause)), breathing_text(cause), *other_texts(cause)]


def _fit(number: int, mode: ModeFit) -> dict[str, str]:
    frequency, mac_pair = mode.frequency, mode.mac
    measured = "" if frequency.measured is None else number_text(frequency.measured, frequency.std or 0.0)
    return {
        "number": str(number),
        "measured": measured or "not identified",
        "before": _hertz(frequency.before, frequency.std),
        "after": _hertz(frequency.after, frequency.std),
        "mac_before": optional(mac_pair.before, ".4f"),
        "mac_after": optional(mac_pair.after, ".4f"),
    }


def _hertz(value: float | None, std: float | None) -> str:
    """Return a frequency of the model with the digits of the measured one; empty for none."""
    return "" if value is None else rounded_text(value, std or 0.0)


def _gain(diagnosis: DiagnosisAnswer, std: Gain | None) -> dict[str, Any] | None:
    gain = diagnosis.gain
    if gain is None:
        return None
    names = (
        ("frequency_error_percent", "frequency error, root mean square [%]", ".3f"),
        ("change_error_percent", f"{predicted_text(gain)} [%]", ".3f"),
        ("one_minus_mac", "1 - MAC, mean", ".5f"),
    )
    known = [(getattr(gain, n), n, label, form) for n, label, form in names]
    rows = [
        (label, *gain_text(pair, getattr(std, n, None), form)) for pair, n, label, form in known if pair is not None
    ]
    remainder = None if gain.noise_percent is None else remainder_text(gain)
    return {"heldout": gain.heldout, "rows": rows, "remainder": remainder}
