"""A diagnosis as its JSON schema has it: why causes are refused, and what to measure next, in sentences."""

from collections.abc import Iterable, Sequence

import numpy as np

from monitor.results.diagnosis import DiagnosisAnswer, RejectedCause
from monitor.text.quantities import MIN_P
from updater import Diagnosis
from updater.diagnosis import (
    ODD,
    Failed,
    Instrument,
    KnownMass,
    LongerRecord,
    Measurements,
    Misfit,
    NewSensor,
    NextMeasurement,
    ReferenceStep,
    Rejected,
    Situation,
)

_SITUATIONS: dict[Situation, str] = {
    "no_change": "None: the data agree with the reference.",
    "unsteady": "The frequencies drift between windows. Record again while the structure is stationary.",
    "scattered_mass": "Mass changed at several places that these modes cannot resolve. Inspect the structure, or "
    "measure with more sensors and up to higher modes.",
    "widespread_stiffness": "Stiffness has changed along most of several members: corrosion, another material or other "
    "sections, of which a loss of stiffness alone is a part. Measure the members' sections, and correct the structure "
    "file.",
}
_PARTS = {
    "further_modes": "modes that the reference lacks",
    "gain": "the gain",
    "next_measurement": "the next measurement",
    "pair_of_causes": "a pair of causes to first order",
    "recalibrated_file": "the file nearer to the logs",
    "removed_bodies": "removed bodies that the file lacks",
    "written_modes": "the modes of the written model",
}  # of a diagnosis, besides causes


def diagnosis_answer(found: Diagnosis, steps: tuple[ReferenceStep, ...] = ()) -> DiagnosisAnswer:
    """Return a diagnosis, and changes of the structure within the reference logs, as plain values and sentences."""
    return DiagnosisAnswer(
        verdict=found.verdict,
        causes=found.causes,
        rejected=tuple(
            RejectedCause(cause=r.cause, log_evidence=r.log_evidence, why=rejection_text(r)) for r in found.rejected
        ),
        modes=found.modes,
        gain=found.gain,
        calibration=found.calibration,
        next_measurement=next_text(found.next_measurement),
        failed=tuple(Failed(part=_PARTS.get(f.part, f.part), error=f.error) for f in found.failed),
        reference_steps=steps,
    )


def rejection_text(rejected: Rejected) -> str:
    """Return why a cause is refused."""
    match rejected.reason:
        case "poor_fit":
            p = f"p {rejected.p_value:.0e}" if rejected.p_value > MIN_P else f"p under {MIN_P:.0e}"
            return f"rejected: poor fit, {p}"
        case "uniform_shift":
            return "not distinguishable from a uniform frequency shift"
        case "no_change_fits_as_well":
            return "fits, but no change fits as well"
        case "worse_model_only":
            return "fits only if the model is assumed to be worse"
        case "less_probable":
            return f"fits, {_ratio_text(-rejected.log_evidence)} times less probable"


def _ratio_text(log_ratio: float) -> str:
    if log_ratio > -np.log(MIN_P):
        return f"more than {1 / MIN_P:.0e}".replace("+", "")
    return f"{np.exp(log_ratio):.2g}" if log_ratio < np.log(1e4) else f"1e{log_ratio / np.log(10):.0f}"


def next_text(found: NextMeasurement) -> str:
    """Return in sentences what to measure next."""
    match found:
        case Measurements():
            return _measurements_text(found)
        case Misfit():
            return f"Repeat the measurement. The best hypothesis ({_joint(found.causes)}) leaves {_misfit_text(found)}."
        case str():
            return _SITUATIONS[found]
        case _:
            return " ".join(found)


def _misfit_text(found: Misfit) -> str:
    odd = []
    if at := found.frequency:
        odd.append(f"the frequency of the mode at {at.frequency:.4g} Hz {at.deviations:.0f} standard deviations off")
    if shape := found.shape:
        odd.append(f"the shape at {shape.frequency:.4g} Hz at a MAC of {shape.mac:.3f}, most at {shape.channel}")
    each = f"no frequency {ODD:.0f} standard deviations off by itself, but all modes together more than noise"
    return ", ".join(odd) or each


def _measurements_text(found: Measurements) -> str:
    names = _distinctive(found.hypotheses)
    sentences = [
        f"{_measurement_text(m.what)}: expected to separate {_pairs_text(names, m.pairs)} by {m.deviations:.1f} "
        "standard deviations."
        for m in found.measurements
    ]
    if found.inseparable:
        sentences.append(f"None of the measurements considered separates {_pairs_text(names, found.inseparable)}.")
    return " ".join(sentences)


def _measurement_text(what: NewSensor | KnownMass | LongerRecord | Instrument) -> str:
    match what:
        case NewSensor():
            return "A sensor at ({:.2f}, {:.2f}, {:.2f}) m along {}".format(*what.position, what.axis)
        case KnownMass():
            return "A known mass of {:.3g} kg at ({:.2f}, {:.2f}, {:.2f}) m".format(what.mass, *what.position)
        case LongerRecord():
            return f"{what.times} times the record"
        case Instrument():
            return what.name


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
    return "; ".join(texts + [f"the alternative places of the {name}" for name in places])


def _distinctive(hypotheses: Sequence[Sequence[str]]) -> list[str]:
    """Return the names of the causes by which each hypothesis differs from the others."""
    common = set[str].intersection(*map(set, hypotheses))
    own = [[name for name in each if name not in common] for each in hypotheses]
    return [_joint(dict.fromkeys(each)) for each in (own if all(own) else hypotheses)]


def _joint(causes: Iterable[str]) -> str:
    return " and ".join(causes).replace("_", " ")
