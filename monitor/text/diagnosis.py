"""A diagnosis as its JSON schema has it: why causes are refused, and what to measure next, in sentences."""

import math
from collections.abc import Iterable, Sequence

import numpy as np

from daq.notebook import number_text
from monitor.results.comparison import ChangeRate, DiagnosisAnswer, FollowUp, WithinRecord
from monitor.text.cause_list import listed_causes
from monitor.text.causes import cause_text, change_texts
from monitor.text.quantities import MIN_P, counted, mass_words, share_text, two_digits, utc
from updater import Body, Cause, DiagnosisResult
from updater.diagnosis import (
    CalibrationSummary,
    MassTestFit,
    Measurement,
    Misfit,
    NextMeasurement,
    ReferenceStep,
    Rejected,
    Separation,
    SmallestChange,
)
from updater.quantities import JOINT_ZONE, SIGNIFICANT, ExchangedSections, ParameterChange, plain

_REASONS = {
    "uniform_shift": "not distinguishable from a uniform frequency shift",
    "no_change_fits_as_well": "fits, but no change fits as well",
    "worse_model_only": "fits only if the model is assumed to be worse",
}
_SITUATIONS = {
    "no_change": "None: the data agree with the reference.",
    "unsteady": "The frequencies drift between windows. Record again while the structure is stationary.",
    "scattered_mass": "Mass changed at several places that these modes cannot resolve. Inspect the structure, or "
    "measure with more sensors and up to higher modes.",
    "widespread_stiffness": "Stiffness has changed along most of several members: corrosion, another material or other "
    "sections, of which a loss of stiffness alone is a part. Measure the members' sections, and correct the structure "
    "file.",
    "insignificant": "The causes that fit best do not each differ from zero by two standard deviations. Record "
    "longer, or measure with more sensors.",
    "unfit_model": "Correct the structure file: dimensions, supports and joints, width and height of each section and "
    "its orientation, positions of sensors, missing bodies. `identify --structure` compares its modes with the "
    "measured ones.",
    "worse_model": "The best causes explain the compared modes, but double the frequency error of the model over all "
    "measured modes. Measure with more sensors, so that close modes are distinguished, or describe the structure in "
    "more detail.",
    "other_model": "The frequencies of the model with the best causes differ from those that the search predicts, so "
    "that these causes are not established. Describe the structure with fewer members.",
}
_RATE_UNITS = {"kg": (1000.0, "g"), "-": (100.0, "%")}  # spoken: scale and unit
_SMALLEST = {
    "local_stiffness": "loss of stiffness",
    "sensor_gain": "gain error",
    "sensor_position": "shift of a sensor",
}
_BEYOND_TOLERANCE = 0.06  # of a section's factor: three deviations of rolled and cold-formed sections
_RIGID_JOINT = (
    "Members of the model meet at a point; a factor above 1 represents a solid block, gussets or overlapping members."
)
_FLEXIBLE_JOINT = (
    "Members of the model are joined without local deformation; the spring represents walls that bend at the joint, "
    "or for its bolts or weld."
)
_DEFORMED_SECTION = (
    "Sections of the model keep their shape; the factor represents shear lag, a section that deforms, or other "
    "dimensions."
)
_DIFFERENT = 1e-3  # p value under which predicted and measured shifts by a known mass differ
_SPOKEN_UNITS = _RATE_UNITS | {"m": (1000.0, "mm")}


def diagnosis_answer(found: DiagnosisResult, steps: tuple[ReferenceStep, ...] = ()) -> DiagnosisAnswer:
    """Return a diagnosis, and changes of the structure within the reference logs, with their sentences."""
    rejected = [r.model_dump(include={"cause", "log_evidence"}) | {"why": rejection_text(r)} for r in found.rejected]
    own: dict[str, object] = {"rejected": rejected, "reference_steps": steps}
    own["next_measurement"] = next_text(found.next_measurement)
    own["separation"] = found.next_measurement if isinstance(found.next_measurement, Separation) else None
    return DiagnosisAnswer.model_validate(dict(found.diagnosis) | own)


def modulus_texts(summary: CalibrationSummary | None) -> list[str]:
    """Return for each modulus that was fitted unusually far from the file what may be wrong, and what depends on it."""
    return [
        f"{change.quantity} of {change.of} was fitted as {change_texts(change)[1]}: unusual for a metal. Check the "
        "section (wall thickness, corner radius), the density and the masses of sensors. Masses, props and "
        "forces are found relative to the mass of the structure: their deviations contain this error."
        for change in (summary.unusual_moduli if summary else ())
    ]


def exchanged_text(found: ExchangedSections) -> str:
    """Return which sections fit with width and height exchanged, and how well both describe the frequencies."""
    *first, last = found.members
    members = f"{', '.join(first)} and {last}" if first else last
    after = f"{found.error_percent_exchanged:.2g} % rms, {counted(found.paired_exchanged, 'mode')}"
    before = f"{found.error_percent:.2g} %, {counted(found.paired, 'mode')}" if found.error_percent else "too few modes"
    return (
        f"The frequencies fit with width and height of the section of {members} exchanged ({after}; as in the file: "
        f"{before}). Check the orientation of the section: width is along the local y axis of a member."
    )


def effective_texts(causes: Sequence[Cause]) -> list[str]:
    """Return which fitted parameters of the file stand for a deformation that a frame of beams does not have."""
    found: dict[str, list[str]] = {}
    for change in (change for cause in causes for change in cause.changes if cause.where is None and change.written):
        if meaning := _effective_meaning(change):
            found.setdefault(meaning, []).append(change.name)
    return [
        f"Effective: {', '.join(dict.fromkeys(names))}. {meaning} The values hold for the frequency range of the "
        "measured modes."
        for meaning, names in found.items()
    ]


def _effective_meaning(change: ParameterChange) -> str:
    """Return what an effective parameter stands for; empty for one that a frame of beams has."""
    if change.quantity.startswith(JOINT_ZONE):
        return _RIGID_JOINT
    if change.of.startswith("the joint of"):
        return _FLEXIBLE_JOINT
    of_section = change.of.startswith("section") and not change.quantity.endswith("area")
    return _DEFORMED_SECTION if of_section and abs(change.after - 1) > _BEYOND_TOLERANCE else ""


def note_texts(diagnosis: DiagnosisAnswer) -> list[str]:
    """Return what may be wrong in the structure file, and which of its fitted parameters are effective."""
    exchanged = diagnosis.exchanged_sections
    notes = [exchanged_text(exchanged)] if exchanged else []
    return [*notes, *modulus_texts(diagnosis.calibration), *effective_texts(diagnosis.causes)]


def mass_test_text(found: MassTestFit) -> str:
    """Return whether the shifts by a known mass are those that the causes predict."""
    x, y, z = found.position
    head = f"Known mass of {found.mass:.3g} kg at ({x:.2f}, {y:.2f}, {z:.2f}) m: "
    if not found.modes:
        return head + "none of the compared modes was measured with it"
    shifts = sorted(mode.measured_percent for mode in found.modes)
    p = f"p = {found.p_value:.2g}" if found.p_value > MIN_P else f"p < {MIN_P:.0e}"
    if found.p_value >= _DIFFERENT:
        between = f"{shifts[0]:.2g} to {shifts[-1]:.2g} %"
        return f"{head}shifts of {len(shifts)} modes by {between}, as predicted ({p})"
    odd = max(found.modes, key=lambda mode: abs(mode.measured_percent - mode.predicted_percent) / mode.std_percent)
    left_out = "; no cause explains both records, this one is left out" if found.left_out else ""
    return (
        f"{head}shifts are not as predicted ({p}), most at {odd.frequency:.4g} Hz: "
        f"{odd.measured_percent:.3g} instead of {odd.predicted_percent:.3g} ± {odd.std_percent:.1g} %{left_out}"
    )


def rejection_text(rejected: Rejected) -> str:
    """Return why a cause is refused."""
    if rejected.reason == "poor_fit":
        p = f"p = {rejected.p_value:.0e}" if rejected.p_value > MIN_P else f"p < {MIN_P:.0e}"
        return f"rejected: poor fit ({p})"
    if rejected.reason == "less_probable":
        return f"fits the data, but is {_ratio_text(-rejected.log_evidence)} times less probable"
    return _REASONS[rejected.reason]


def _ratio_text(log_ratio: float) -> str:
    if log_ratio > -np.log(MIN_P):
        return f"more than {1 / MIN_P:.0e}".replace("+", "")
    return two_digits(float(np.exp(log_ratio))) if log_ratio < np.log(1e4) else f"1e{log_ratio / np.log(10):.0f}"


def next_text(found: NextMeasurement) -> str:
    """Return in sentences what to measure next."""
    if isinstance(found, Misfit):
        of_mesh = _mesh_text(*found.mesh) if found.mesh else ""
        of_model = of_mesh + (_model_text(found.model, of_matrices=found.of_matrices) if found.model else "")
        return (
            f"{of_model}Check the sensors and the structure file, and measure again. "
            f"The best hypothesis ({_joint(found.causes)}) leaves {_misfit_text(found)}."
        )
    if isinstance(found, Separation):
        return _separation_text(found)
    return _SITUATIONS[found] if isinstance(found, str) else " ".join(found)


def _mesh_text(error: float, elements: int) -> str:
    """Return the advice for a coarse mesh."""
    return (
        f"The mesh of the matrices is coarse: its error of these frequencies is up to {100 * error:.1f} %, shapes are "
        f"wrong accordingly. Use elements 1/{elements} as long, and diagnose again. "
    )


def _model_text(error: float, *, of_matrices: bool) -> str:
    """Return the advice for a model that is wrong in the undisturbed state."""
    solids = "Solids need elements of second order, as those of first order are too stiff in bending. "
    return (
        f"The calibrated model's frequencies differ from the baseline's by up to {100 * error:.1f} %: changes of such "
        f"a model are not those of the structure. {solids if of_matrices else ''}"
    )


def _misfit_text(found: Misfit) -> str:
    odd = []
    if found.frequency:
        odd.append("the frequency of the mode at {:.4g} Hz {:.0f} standard deviations off".format(*found.frequency))
    if found.shape:
        odd.append("the shape at {:.4g} Hz at a MAC of {:.3f}, most at {}".format(*found.shape))
    none = f"no frequency {SIGNIFICANT:.0f} standard deviations off by itself, but all modes together more than noise"
    return ", ".join(odd) or none


def _separation_text(found: Separation) -> str:
    """Return a sentence for each measurement that separates hypotheses which those before it do not."""
    names = _distinctive(found.hypotheses)
    sentences, separated = [], set[tuple[int, int]]()
    for m in found.measurements:
        if pairs := [pair for pair in m.pairs if pair not in separated]:
            what = _pairs_text(names, pairs)
            sentences.append(
                f"{measurement_text(m)}: expected to separate {what} by {m.deviations:.1f} standard deviations."
            )
        separated.update(m.pairs)
    if found.inseparable:
        sentences.append(f"None of the measurements considered separates {_pairs_text(names, found.inseparable)}.")
    return " ".join(sentences)


def measurement_text(found: Measurement) -> str:
    """Return what is measured, and where."""
    at = "({:.2f}, {:.2f}, {:.2f}) m".format(*found.position) if found.position else ""
    return {
        "sensor": f"A sensor at {at} along {found.axis}",
        "known_mass": f"A known mass of {found.mass:.3g} kg at {at}",
        "longer_record": f"{found.length} times the record",
        "instrument": found.instrument,
    }[found.kind]


def plan_rows(found: Separation | None) -> list[tuple[str, str, str]]:
    """Return a row for each further measurement: what, causes that it is expected to leave open, and hours."""
    if found is None:
        return []
    of = f" of {found.open:.1f}"
    return [(measurement_text(m), f"{m.leaves:.1f}{of}", f"{m.hours:.1f} h") for m in found.measurements]


def follow_text(found: FollowUp) -> str:
    """Return how many causes an earlier diagnosis left open, and how many are left with the further measurement."""
    expected = f", {found.expected:.1f} were expected" if found.expected else ""
    return f"The earlier diagnosis left {found.before:.1f} causes open; {found.now:.1f} are left{expected}."


def _pairs_text(names: Sequence[str], pairs: Sequence[tuple[int, int]]) -> str:
    """Return the names of pairs of hypotheses, each once; names with the same partners are grouped."""
    order = list(dict.fromkeys(names))
    left, texts = {frozenset((names[i], names[j])) for i, j in pairs}, []
    places = [name for name in order if frozenset((name,)) in left]  # pairs of hypotheses with one name
    left -= {frozenset((name,)) for name in places}
    while left:
        partners = {a: [b for b in order if a != b and frozenset((a, b)) in left] for a in order}
        others = max(filter(None, partners.values()), key=lambda them: sum(p == them for p in partners.values()))
        own = [name for name in order if partners[name] == others]
        texts.append(f"{' or '.join(own)} from {' or '.join(others)}")
        left -= {frozenset((a, b)) for a in own for b in others}
    return ", and ".join(texts + [f"the alternative places of the {name}" for name in places])


def _distinctive(hypotheses: Sequence[Sequence[str]]) -> list[str]:
    """Return the names of the causes by which each hypothesis differs from the others."""
    common = set[str].intersection(*map(set, hypotheses))
    own = [[name for name in each if name not in common] for each in hypotheses]
    if not any(own):  # the same causes at other places
        own = [list(each) for each in hypotheses]
    if all(own):
        return [_joint(dict.fromkeys(each)) for each in own]
    others = dict.fromkeys(name for each in own for name in each)
    return [_joint(dict.fromkeys(each)) if each else f"no {_joint(others, ' or ')}" for each in own]


def _joint(causes: Iterable[str], word: str = " and ") -> str:
    return word.join(map(plain, causes))


def smallest_changes_text(found: Sequence[SmallestChange], *, unchanged: bool = False) -> str:
    """Return the smallest changes that differ from errors of a structure file; empty if unknown.

    Parameters
    ----------
    unchanged : whether the file agrees with the data as it is
    """
    if not found:
        return ""
    texts = "; ".join(map(_smallest_text, found))
    text = f"Smallest changes that differ from errors of the model, at half of all places (at nine tenths): {texts}."
    return text + " If the file was fitted to these logs, its parameters may contain larger ones." * unchanged


def _smallest_text(found: SmallestChange) -> str:
    scale, unit = _SPOKEN_UNITS[found.unit]
    values = (found.value, found.value_at_most_places)
    half, most = ("no size" if value is None else f"{two_digits(scale * value)} {unit}" for value in values)
    over = "" if found.extent is None else f" over {found.extent:.2g} m"
    return f"{_SMALLEST.get(found.cause, plain(found.cause))} {half} ({most}){over}"


def within_record_text(found: WithinRecord) -> str:
    """Return when the structure changed, and which state is diagnosed."""
    if found.step is not None:
        when = f"between {utc(found.step[0])} and {utc(found.step[1])}"
        state = "the state after this change"
    else:
        when = f"gradually; compared are the states at {utc(found.start)} and at {utc(found.end)}"
        state = f"the state at {utc(found.end)}"
    if found.of_all:
        state = "the mean of all windows"
    return f"The structure changed while the logs were recorded, {when}. The answer is for {state}."


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
    scale, unit = _RATE_UNITS.get(rate.unit, (1.0, rate.unit))
    return f"{plain(rate.parameter)} {number_text(scale * rate.per_hour, scale * rate.std)} {unit}/h"


def written_bodies_texts(causes: Sequence[Cause], bodies: Sequence[Body]) -> list[str]:
    """Return a sentence for each added body that the extended model has with other numbers than those reported.

    Reported are means of the posterior; the model has the best fit instead where the measured modes contradict them.

    Parameters
    ----------
    causes : of the diagnosis
    bodies : those added to the extended model
    """
    texts = []
    for cause in causes:
        mass, where = cause.parameters.get("mass"), cause.where
        if cause.cause != "added_mass" or mass is None or mass.value < 0 or where is None or where.position is None:
            continue
        at = where.position
        for body in sorted(bodies, key=lambda b: math.dist(b.at, at))[:1]:
            off = abs(body.mass - mass.value) > mass.std or math.dist(body.at, at) > (where.position_std or math.inf)
            if off:
                place = ", ".join(f"{x:.3f}" for x in body.at)
                texts.append(
                    f"its body has {mass_words(body.mass)} at ({place}) m: the best fit, because the measured modes "
                    "contradict the reported mean values"
                )
    return texts
