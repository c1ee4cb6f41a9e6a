"""Results as text and tables (Markdown)."""

import rerun as rr

from daq.notebook import number_text, rounded_text
from monitor.results.comparison import DiagnosisAnswer
from monitor.results.run_results import RunResults, find_mode, standing_answer
from monitor.results.windows import AlarmResult, MassAnswer, ModeResult, ReferenceResult, WindowResult
from monitor.text.cause_list import listed_causes
from monitor.text.causes import (
    alternative_texts,
    breathing_text,
    cause_text,
    failed_text,
    fit_text,
    mass_text,
    member_share_text,
    probability_text,
)
from monitor.text.modal_change import modal_change_text
from monitor.text.verdicts import diagnosis_text, is_one_mass
from monitor.views.viewer.primitives import at, clock
from updater.quantities import plain

_MAX_REFUSED = 6  # causes whose refusal is listed individually
_DOUBTFUL = 0.01  # p value under which the fit speaks against a mass
_MARKDOWN = "text/markdown"
_OF_CALIBRATION = (
    "Model parameters by the calibration. Stiffness: factor on the value of the file. Flexibility: times L / (E I) of"
    " the members there, L the longest length; along an axis times L³ / (E I). Weld: share of the flexibility of the"
    " joint's zone."
)


def write_cards(recording: rr.RecordingStream, run_results: RunResults, answered: WindowResult | None = None) -> None:
    """Write the card of each window; `answered` is the window whose answer held before the first of them."""
    for window in run_results.windows:
        at(recording, window.end)
        answered = standing_answer(window, answered)
        recording.log("/now", rr.TextDocument(window_card(window, run_results, answered), media_type=_MARKDOWN))
        if window.diagnosis:
            recording.log("/diagnosis", rr.TextDocument(diagnosis_card(window.diagnosis), media_type=_MARKDOWN))


def write_reference(recording: rr.RecordingStream, reference: ReferenceResult) -> None:
    """Write the reference's tables: modes, and with a structure its calibration."""
    cards = {"/reference/modes": modes_card(reference) if reference.has_model else baseline_card(reference)}
    if reference.has_model:
        cards["/reference/model"] = model_card(reference)
    for path, words in cards.items():
        recording.log(path, rr.TextDocument(words, media_type=_MARKDOWN), static=True)


def window_card(window: WindowResult, run_results: RunResults, answered: WindowResult | None = None) -> str:
    """Return the card of one window: the verdict first, then its basis.

    Parameters
    ----------
    answered : window whose answer holds; None if no answer was found
    """
    parts = [f"# {verdict(window, run_results.alarms)}"]
    if window.phase == "learning":
        parts.append(f"{window.index + 1} window{'s' * (window.index > 0)} so far. No window is evaluated yet.")
    if window.answer:
        parts.append(_answer(window.answer))
    elif answered and answered.answer:
        parts += [_answer(answered.answer), f"*By window {answered.index + 1}.*"]
    elif window.change:
        parts.append(f"**The structure has changed**: {modal_change_text(window.change)}.")
    elif window.phase == "alarm" and not (window.diagnosis and window.diagnosis.causes):
        parts.append("**The structure has changed.** Location not yet known.")
    if window.diagnosis and not (window.answer and is_one_mass(window.diagnosis)):  # else the same in other numbers
        parts.append(diagnosis_text(window.diagnosis))
    if window.problem:
        parts.append(f"**No modes in this window**: {window.problem}.")
    if window.novelty:
        parts.append(f"Novelty **{window.novelty.t2:.1f}**, limit {window.novelty.limit:.1f}.")
    if window.modes or (window.phase != "learning" and not window.problem):
        parts.append(_table(window, run_results))
    parts.append(f"*Window {window.index + 1}: {clock(window.start)} to {clock(window.end)} UTC*")
    return "\n\n".join(parts)


def verdict(window: WindowResult, alarms: tuple[AlarmResult, ...]) -> str:
    """Return the state in a few words."""
    if window.phase == "learning":
        return "Learning the baseline"
    since = [a for a in alarms if a.time <= window.end]
    state = since[-1].state if since else "normal"
    if window.phase == "alarm":
        raised = [a for a in since if a.raised]
        return f"ALARM since {clock(raised[-1].time)}" if raised else "ALARM"
    return "Watch: over the limit" if state == "watch" else "Normal"


def _answer(answer: MassAnswer) -> str:
    doubt = ". **A mass alone explains it badly.**" if answer.p_value < _DOUBTFUL else ""
    return f"**{mass_text(answer)}**\n\n{member_share_text(answer)}; {fit_text(answer)}{doubt}"


def _table(window: WindowResult, run_results: RunResults) -> str:
    if window.phase == "learning":
        head = ["| Hz | ± | ζ % |", "|---:|---:|---:|"]
        return "\n".join([*head, *(f"| {_frequency(m)} |" for m in window.modes)])
    head = ["| mode | Hz | ± | ζ % | shift % | ± | σ |", "|---:|---:|---:|---:|---:|---:|---:|"]
    return "\n".join([*head, *(_row(number, find_mode(window, number)) for number in run_results.tracks)])


def _row(number: int, mode: ModeResult | None) -> str:
    if mode is None:
        return f"| **{number}** | not identified | | | | | |"
    return f"| **{number}** | {_frequency(mode)} | {_shift(mode)} |"


def _frequency(mode: ModeResult) -> str:
    return _measured(mode.frequency, mode.frequency_std, mode.damping, mode.damping_std)


def _measured(frequency: float, std: float, damping: float, damping_std: float = 0.0) -> str:
    """Return the cells of a frequency [Hz], its deviation and a damping [%], with digits by their deviations."""
    shown = rounded_text(100 * damping, 100 * damping_std) if damping_std else f"{100 * damping:.3g}"
    return f"{_cells(frequency, std)} | {shown}"


def _cells(value: float, std: float, *, sign: bool = False) -> str:
    """Return the cells of a value and its deviation."""
    shown, _, deviation = number_text(value, std, sign=sign).partition(" ± ")
    return f"{shown} | {deviation}"


def _shift(mode: ModeResult) -> str:
    if mode.shift_percent is None or mode.shift_std_percent is None:
        return " | | "
    sigmas = f"{mode.shift_percent / mode.shift_std_percent:+.1f}" if mode.shift_std_percent else ""
    return f"{_cells(mode.shift_percent, mode.shift_std_percent, sign=True)} | {sigmas}"


def diagnosis_card(diagnosis: DiagnosisAnswer) -> str:
    """Return the verdict, the causes, the refused ones with reasons, and the gain."""
    parts = [f"# {diagnosis.verdict.replace('_', ' ').capitalize()}"]
    for cause in listed_causes(diagnosis.causes):
        others = "".join(f"\n\nor **{text}**" for text in alternative_texts(cause))
        parts.append(f"**{cause_text(cause)}** (probability {probability_text(cause)}){others}")
        parts += filter(None, [breathing_text(cause)])
    if diagnosis.gain:
        error = diagnosis.gain.frequency_error_percent
        where = "data not used" if diagnosis.gain.heldout else "the same data"
        if error.before is not None and error.after is not None:
            parts.append(
                f"Model error of frequencies on {where}: {error.before:.3f} % without, {error.after:.3f} % with."
            )
    if diagnosis.next_measurement:
        parts.append(f"*Next: {diagnosis.next_measurement}*")
    nearest = sorted(diagnosis.rejected, key=lambda r: -r.log_evidence)
    if nearest:
        lines = [f"- {plain(r.cause)}: {r.why}" for r in nearest[:_MAX_REFUSED]]
        rest = ", ".join(plain(r.cause) for r in nearest[_MAX_REFUSED:])
        parts.append("\n".join(["Refused:", "", *lines, *([f"- even less probable: {rest}"] if rest else [])]))
    parts += [failed_text(failed) for failed in diagnosis.failed]
    return "\n\n".join(parts)


def baseline_card(reference: ReferenceResult) -> str:
    """Return the measured modes of a site without a structure file."""
    lines = [f"Baseline of {reference.n_windows} windows; no structure file.", ""]
    lines += ["| mode | measured Hz | ± | ζ % |", "|---:|---:|---:|---:|"]
    for m in reference.modes:
        lines.append(f"| **{m.id}** | {_measured(m.frequency, m.frequency_std, m.damping)} |")
    return "\n".join(lines)


def modes_card(reference: ReferenceResult) -> str:
    """Return measured modes with those of the structure file."""
    lines = [f"Baseline of {reference.n_windows} windows; model: structure file before calibration.", ""]
    lines += ["| mode | measured Hz | ± | ζ % | model Hz | off % | MAC |", "|---:|---:|---:|---:|---:|---:|---:|"]
    for m in reference.modes:
        off = 100 * (m.model_frequency / m.frequency - 1)
        measured = _measured(m.frequency, m.frequency_std, m.damping)
        model = rounded_text(m.model_frequency, m.frequency_std)
        lines.append(f"| **{m.id}** | {measured} | {model} | {off:+.2f} | {m.mac:.4f} |")
    return "\n".join(lines)


def model_card(reference: ReferenceResult) -> str:
    """Return the result of the calibration."""
    if not reference.calibrated:
        return "Nothing was calibrated."
    lines = [_OF_CALIBRATION, "", "| parameter | value | ± |", "|:--|---:|---:|"]
    lines += [f"| {name} | {_cells(value, std)} |" for name, (value, std) in reference.calibrated.items()]
    return "\n".join(lines)
