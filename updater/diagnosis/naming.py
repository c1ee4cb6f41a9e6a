"""A diagnosis put into the plain values of its contract."""

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.special import chdtrc, logsumexp

from daq import FloatArray
from updater.causes import (
    CONNECTIONS,
    CommonFactor,
    LocalStiffness,
    Parametric,
    Placed,
    SelectedCause,
    Springs,
    has_unobserved_mode,
    mac_of,
    other_springs,
    prediction,
)
from updater.diagnosis.places import by_place
from updater.diagnosis.schema import (
    Alternative,
    CalibrationSummary,
    Cause,
    FittedCause,
    FrequencyFit,
    MassShift,
    MassTestFit,
    Misfit,
    ModeFit,
    OtherStiffness,
    Pair,
    PairedModes,
    Reason,
    Rejected,
    SignalEvidence,
)
from updater.diagnosis.weighing import evidence_of_signals
from updater.inference import MODEL_ERROR, Comparison, beside, residual
from updater.modal_data import ModalMean
from updater.quantities import SIGNIFICANT, ParameterChange, Quantity, Vector, Where
from updater.reference import ModelFit, Reference, match_nominal_modes
from updater.structure import Joint, Structure, Support, place_name, size

if TYPE_CHECKING:
    from updater import causes
    from updater.diagnosis.weighing import Candidate
    from updater.inference import Fit

    _Part = tuple[Candidate, SelectedCause, Fit[causes.Cause]]

_SEPARATE = 6.0  # squared distance of two predictions, in standard deviations, above which the data distinguish them
MIN_P = 1e-3  #: p of chi-square below which a fit is refused
WORTH_NAMING = 0.05  #: share of the best one's posterior
#: chance that a certain answer is wrong by what is not modelled: of 763 sealed ones four were (rule of succession)
_UNMODELLED = 5 / 765
# of the error of a good model in the undisturbed state: a model with more is named as a reason why nothing fits; as
# much as an explanation may leave (`updater.diagnosis.search`)
_POOR_MODEL = 3.0
_COARSE_MESH = 2 * MODEL_ERROR  # of frequencies: a mesh with more is named as a reason why nothing fits
_SAME_SHAPE = 0.9995  # MAC that is printed as 1.000
_BESIDE = 0.04  # m, on a structure of 1.5 m, of a foot or joint: where a stretch is one with it
_WORTH_AN_ALIAS = 1e-3  # relative to it, if the data cannot distinguish the two: rarer places with the same effect


def named_causes(
    data: Comparison, found: "list[Candidate]", sure: float, log_nothing: float
) -> tuple[tuple[Cause, ...], bool, "list[Candidate]"]:
    """Return the causes with the posterior share `sure`, whether it is a single one, and all left open.

    Candidates that the data cannot separate are one set: its best member represents it with the probability of all. One
    cause at two places is two candidates. The stated probability leaves a chance that something that is not modelled
    imitates the causes.

    Parameters
    ----------
    data : compared
    found : candidates, the best first
    sure : probability from which on a cause is named
    log_nothing : log evidence for no change
    """
    decides = _decided_by_signals(found, log_nothing)
    found = by_place(found)
    probability = shares(found)
    left = [i for i in range(len(found)) if probability[i] >= _WORTH_AN_ALIAS * probability.max()]
    sets: list[tuple[float, list[int]]] = []
    while left:
        alike = [i for i in left if i == left[0] or _alike(data, found[left[0]], found[i])]
        if probability[left[0]] >= sure * probability[alike].sum() and any(_informed(found[i]) for i in alike):
            alike = alike[:1]  # distinguished by known circumstances
        sets.append((min(1.0, float(probability[alike].sum())), alike))
        left = [i for i in left if i not in alike]
    sets.sort(key=lambda one: -one[0])
    named: list[Cause] = []
    left_open: list[Candidate] = []
    held = 0.0
    for share, alike in sets:
        if held >= sure or share < WORTH_NAMING * sets[0][0]:
            break
        named += _causes([found[i] for i in alike], (1 - _UNMODELLED) * share, found, decides)
        left_open += [found[i] for i in alike]
        held += share
    alone = sets[0][0] >= sure and not any(c.cannot_be_told_from for c in named)
    return tuple(named), alone, left_open


def _alike(data: Comparison, one: "Candidate", other: "Candidate") -> bool:
    """Return whether the data cannot separate two causes' best predictions."""
    if one.names == other.names:
        return False  # at another place
    if any(has_unobserved_mode(part.cause) for c in (one, other) for part in c.chosen):
        return False  # on a stiff spring it is a body: their priors decide
    if _at_one_connection(one, other):
        return True
    return separation(data, one, other) < _SEPARATE


def separation(data: Comparison, one: "Candidate", other: "Candidate") -> float:
    """Return the squared distance of two candidates' best predictions in standard deviations of the data [-].

    A drift that both allow is ignored. The distance is infinite where only one has a new mode as evidence.
    """
    predicted = [prediction(data, c.chosen) for c in (one, other)]
    if data.new is not None and len({p.new_frequency.shape[1] for p in predicted}) > 1:
        return np.inf
    both = all(any(part.cause.drifting for part in c.chosen) for c in (one, other))
    whitener = data.drifting if both else data.plain
    first, second = (residual(data, p, whitener) for p in predicted)
    return float(((first - second) ** 2).sum())


def _at_one_connection(one: "Candidate", other: "Candidate") -> bool:
    """Return whether two candidates differ only by a foot or joint and a stretch next to it.

    The stiffness of a real foot or joint is unknown: only its model distinguishes it from an adjacent stretch.
    """
    own, theirs = Counter(one.names) - Counter(other.names), Counter(other.names) - Counter(one.names)
    if own.total() != 1 or theirs.total() != 1:
        return False
    kinds = {*own, *theirs}
    stretches = {p.hypotheses.name for c in (one, other) for p in c.parts if isinstance(p.hypotheses, LocalStiffness)}
    if not kinds & stretches or not kinds & set(CONNECTIONS):
        return False
    (name,), (other_name,) = own, theirs
    first, second = _position(one, name), _position(other, other_name)
    placed = [c.cause for c in (*one.chosen, *other.chosen) if isinstance(c.cause, Placed)]
    if first is None or second is None or not placed:
        return False
    near = _BESIDE * size(placed[0].reference.structure)
    return float(np.linalg.norm(np.subtract(first, second))) < near


def _position(candidate: "Candidate", name: str) -> Vector | None:
    """Return the place [m] of a candidate's cause, the last of its name."""
    where = [part.hypotheses.where(part) for part in candidate.parts if part.hypotheses.name == name][-1]
    return where.position if where else None


def _informed(candidate: "Candidate") -> bool:
    """Return whether a thermometer or a tone is evidence for or against a cause."""
    return any(isinstance(c.cause, CommonFactor) and c.cause.informed for c in candidate.chosen)


def _causes(
    alike: "list[Candidate]", probability: float, every: "list[Candidate]", decides: Collection[tuple[str, ...]]
) -> list[Cause]:
    """Return the causes of the first candidate, each with its alternatives in the others.

    Parameters
    ----------
    alike : candidates that the data cannot separate
    probability : of all of them
    every : all candidates; less probable ones that differ by a connection and a stretch next to it are alternatives too
    decides : names of the causes of candidates that are decided by the signals
    """
    first, *others = alike
    fitted = [*others, *(c for c in every if c not in alike and _at_one_connection(first, c))]
    found = []
    for chosen, part, by_signals in zip(first.chosen, first.parts, evidence_of_signals(first), strict=True):
        name = chosen.cause.name
        in_its_place = [other.cause.name for _, other, _ in _in_its_place(name, first, others)]
        aliases = tuple(dict.fromkeys((*chosen.cause.cannot_be_told_from, *in_its_place, *_of_a_connection(part))))
        best = {other.cause.name: (c, other, fit) for c, other, fit in reversed(_in_its_place(name, first, fitted))}
        alternatives = tuple(
            Alternative(log_evidence=candidate.log_evidence - first.log_evidence, **_fitted(other, fit))
            for candidate, other, fit in (best[alias] for alias in aliases if alias in best)
        )
        own = _fitted(chosen, part)
        if by_signals:
            own["signals"] = SignalEvidence(log_evidence=by_signals, decides=first.names in decides)
        found.append(Cause(probability=probability, cannot_be_told_from=aliases, alternatives=alternatives, **own))
    return found


def _decided_by_signals(found: "Sequence[Candidate]", log_nothing: float) -> list[tuple[str, ...]]:
    """Return the names of candidates than which another one, or no change, is more probable by the modes alone."""
    by_modes = [c.log_evidence - max(filter(None, evidence_of_signals(c)), default=0.0) for c in found]
    most = max(*by_modes, log_nothing)
    return [c.names for c, own in zip(found, by_modes, strict=True) if own < most]


def _fitted(chosen: SelectedCause, part: "Fit[causes.Cause]") -> dict[str, Any]:
    """Return the fields of a fitted cause."""
    return {
        "cause": chosen.cause.name,
        "where": part.hypotheses.where(part),
        "parameters": part.hypotheses.parameters(part),
        "changes": part.hypotheses.changes(part) if isinstance(part.hypotheses, Parametric) else (),
        "advice": chosen.cause.advice,
    }


def _of_a_connection(part: "Fit[causes.Cause]") -> list[str]:
    """Return the stiffness of a foot or joint next to a stretch, which the model may not represent."""
    cause = part.hypotheses
    where = cause.where(part)
    if not isinstance(cause, LocalStiffness) or not where or where.position is None:
        return []
    structure = cause.reference.structure
    near = _BESIDE * size(structure)
    ends = [(name, each.at) for name, of in CONNECTIONS.items() for each in of(structure)]
    return [name for name, at in ends if np.linalg.norm(np.subtract(where.position, at)) < near]


def _in_its_place(name: str, first: "Candidate", others: "list[Candidate]") -> "list[_Part]":
    """Return the causes that other candidates have in place of one of the first, each with its candidate and fit."""
    return [
        (other, chosen, part)
        for other in others
        if name not in other.names
        for chosen, part in zip(other.chosen, other.parts, strict=True)
        if chosen.cause.name not in first.names
    ]


def shares(found: "Sequence[Candidate]") -> FloatArray:
    """Return the posterior probabilities (n,) of candidates among themselves."""
    log = np.array([c.log_evidence for c in found])
    return np.asarray(np.exp(log - logsumexp(log)))


def rejected_causes(
    singles: "list[Candidate]",
    accepted: Collection[str],
    best: float,
    judged: "Sequence[Candidate]" = (),
    *,
    unchanged: bool = False,
) -> tuple[Rejected, ...]:
    """Return the single causes that were not accepted, with the reason.

    Parameters
    ----------
    best : log evidence of the best of the search
    judged : candidates among which the probabilities are shared, the best first: their evidence is that of the answer
    unchanged : whether that is no change at all
    """
    alone = {c.names[0]: (c, judged[0].log_evidence) for c in reversed(judged) if len(c.names) == 1}
    compared = [alone.get(c.names[0], (c, best)) for c in singles if c.names[0] not in accepted]
    return tuple(
        Rejected(
            cause=c.names[0],
            log_evidence=c.log_evidence - most,
            reason=_reason(c, c.log_evidence - most, unchanged),
            p_value=c.p_value,
        )
        for c, most in compared
    )


def _reason(candidate: "Candidate", evidence: float, unchanged: bool) -> Reason:
    if candidate.p_value < MIN_P:
        return "poor_fit"
    if not candidate.effective:
        return "uniform_shift"
    if evidence >= 0:
        return "no_change_fits_as_well" if unchanged else "worse_model_only"
    return "less_probable"


def modes_of(
    reference: Reference, event: ModalMean, data: Comparison, written: ModelFit | None = None
) -> tuple[ModeFit, ...]:
    """Return each mode without and with the causes, lowest first; those without a partner have a null.

    Parameters
    ----------
    reference, event, data : compared
    written : (n + n_extra,) fit of the written model to the modes compared, then to those that the baseline has not
    """
    measured = [*_paired(data), *_extra(data.circumstances.extra)]
    if written is not None:
        measured = [_with_causes(mode, written, i) for i, mode in enumerate(measured)]
    modes = (*measured, *_missing(reference, event))
    return tuple(sorted(modes, key=lambda mode: mode.frequency.measured or mode.frequency.before or 0.0))


def mass_tests_of(data: Comparison, chosen: Sequence[SelectedCause]) -> tuple[MassTestFit, ...]:
    """Return each record with a known mass, compared with the prediction of causes, or of no change."""
    if not data.mass_tests:
        return ()
    whitener = data.drifting if any(c.cause.drifting for c in chosen) else data.plain
    predicted = prediction(data, chosen)
    before = (data.log_ratio - predicted.log_ratio) @ whitener.matrix.T
    frequency = data.frequency[data.paired] * np.exp(data.log_ratio)
    found = []
    for test, expected in zip(data.mass_tests, predicted.with_mass, strict=True):
        off = test.whitened(test.log_ratio - expected, before, whitener)[0]
        std = np.sqrt(np.diag(test.covariance))
        shifts = [
            MassShift(
                frequency=float(frequency[row]),
                measured_percent=100 * float(np.expm1(test.log_ratio[k])),
                std_percent=100 * float(std[k]),
                predicted_percent=100 * float(np.expm1(expected[0, k])),
            )
            for k, row in enumerate(test.rows.tolist())
        ]
        p_value = float(chdtrc(len(off), off @ off)) if len(off) else 1.0
        found.append(
            MassTestFit(
                mass=test.mass,
                position=test.position,
                modes=tuple(shifts),
                p_value=p_value,
                left_out=not test.is_evidence,
            )
        )
    return tuple(found)


def _with_causes(mode: ModeFit, written: ModelFit, row: int) -> ModeFit:
    frequency, mac = (_finite_or_none(values[row : row + 1])[0] for values in (written.frequency, written.mac))
    shaped = mode.mac.before is not None or mode.frequency.before is None
    return ModeFit(
        frequency=mode.frequency.model_copy(update={"after": frequency}),
        mac=mode.mac.model_copy(update={"after": mac if shaped else None}),
    )


def _mode(
    *, measured: float | None = None, std: float | None = None, before: float | None = None, mac: float | None = None
) -> ModeFit:
    """Return a mode without the causes."""
    frequency = FrequencyFit(measured=measured, std=std, before=before, after=None)
    return ModeFit(frequency=frequency, mac=Pair(before=mac, after=None))


def _paired(data: Comparison) -> list[ModeFit]:
    base = np.log(data.frequency[data.paired])
    measured, before = np.exp(base + data.log_ratio), prediction(data, None)
    std, simulated = measured * data.log_frequency_std, np.exp(base + before.log_ratio[0])
    mac = _finite_or_none(mac_of(data, before.shape[0]))
    return [
        _mode(measured=float(measured[i]), std=float(std[i]), before=float(simulated[i]), mac=mac[i])
        for i in range(len(base))
    ]


def _missing(reference: Reference, event: ModalMean) -> list[ModeFit]:
    """Return the modes that were there before and were not measured since."""
    gone = np.flatnonzero(~np.isfinite(event.log_frequency))
    frequency = reference.frequency
    if reference.nominal is not None:
        answer = match_nominal_modes(reference, reference.nominal, reference.baseline.channels)
        frequency = reference.file.frequency[answer]
    return [_mode(before=float(frequency[m])) for m in reference.paired[gone]]


def _extra(modes: ModalMean | None) -> list[ModeFit]:
    """Return the modes that were not there before."""
    if modes is None:
        return []
    frequency = np.exp(modes.log_frequency)
    return [
        _mode(measured=float(f), std=float(f * std)) for f, std in zip(frequency, modes.log_frequency_std, strict=True)
    ]


def _finite_or_none(values: FloatArray) -> list[float | None]:
    return [float(v) if np.isfinite(v) else None for v in values]


def calibration_summary(reference: Reference) -> CalibrationSummary | None:
    """Return the modes paired and the frequency error before and after calibration; None without one."""
    calibration, nominal = reference.calibration, reference.nominal
    if nominal is not None:
        measured = reference.scatter.mean(reference.windows)
        n_measured, n_nominal = len(measured.n), nominal.reference.calibration.n_nominal
        log_measured = measured.log_frequency[calibration.tracks]
        of_file = match_nominal_modes(reference, nominal, reference.baseline.channels)[calibration.paired]
        uncalibrated = nominal.reference.frequency[of_file]
    elif calibration.fitted:
        n_measured, n_nominal = len(reference.known.n), calibration.n_nominal
        log_measured, uncalibrated = reference.baseline.log_frequency, calibration.nominal_frequency
    else:
        return None
    off = (np.log(f) - log_measured for f in (uncalibrated, calibration.modes.frequency[calibration.paired]))
    before, after = (100 * float(np.sqrt(np.mean(one**2))) for one in off)
    return CalibrationSummary(
        modes_measured=n_measured,
        modes_paired=PairedModes(before=n_nominal, after=len(calibration.paired)),
        frequency_error_percent=Pair(before=before, after=after),
        unusual_moduli=calibration.unusual_moduli,
        fits_reference=reference.of_file or reference.fits_baseline,
    )


def misfit(reference: Reference, data: Comparison, chosen: Sequence[SelectedCause]) -> Misfit:
    """Return the significant residuals of the best explanation, and errors of the model as their reason."""
    predicted = prediction(data, chosen)
    std = np.linalg.norm(np.linalg.inv(data.plain.matrix), axis=1)
    score = np.abs(data.log_ratio - predicted.log_ratio[0]) / std
    worst, hertz = int(np.argmax(score)), data.frequency[data.paired]
    shape = None
    if data.shaped.any():
        mac = mac_of(data, predicted.shape[0])
        least = int(np.nanargmin(mac))
        off = np.abs(beside(data.shape[least], predicted.shape[0, least]))
        if mac[least] < _SAME_SHAPE:
            shape = float(hertz[least]), float(mac[least]), data.channels[int(np.argmax(off))]
    far = (float(hertz[worst]), float(score[worst])) if score[worst] >= SIGNIFICANT else None
    error = float(data.mesh_error.max())
    mesh = (error, int(np.ceil(np.sqrt(error / MODEL_ERROR)))) if error > _COARSE_MESH else None
    model = reference.frequency_error if reference.model_error_factor > _POOR_MODEL else None
    return Misfit(
        causes=tuple(c.cause.name for c in chosen),
        frequency=far,
        shape=shape,
        mesh=mesh,
        model=model,
        of_matrices=reference.structure.external is not None,
    )


def as_written(cause: Cause, structure: Structure, file: Structure) -> Cause:
    """Return the stiffness of a foot or joint in a structure in which another cause changed it too.

    Flexibilities add, so that the deviation of a stiffness goes with its square; other causes are returned as they are.

    Parameters
    ----------
    structure : with the causes
    file : as it was, whose springs are those before
    """
    where, found, before = cause.where, cause.parameters, dict[str, float | None]()
    of = CONNECTIONS.get(cause.cause)
    for connection in of(structure) if of else ():
        if _is_at(connection, where):
            now = {f"stiffness_{axis}": stiffness for axis, stiffness in connection.stiffness.items()}
            found = {
                name: q.model_copy(update={"value": now[name], "std": q.std * (now[name] / q.value) ** 2})
                for name, q in found.items()
            }
            before = dict.fromkeys(found)
            for one in of(file) if of else ():
                if _is_at(one, where):
                    before |= {f"stiffness_{axis}": stiffness for axis, stiffness in one.stiffness.items()}
    changes = []
    for change, q in _with_quantities(cause.changes, found):
        own = {"before": before[f"stiffness_{change.name.rpartition('.')[2]}"]} if before else {}
        changes.append(change.model_copy(update={"after": q.value, "std": q.std, **own}))
    return cause.model_copy(update={"parameters": found, "changes": tuple(changes)})


def _is_at(connection: Support | Joint, where: Where | None) -> bool:
    """Return whether a foot or joint is at the place of a cause."""
    return where is not None and connection.at == where.position and getattr(connection, "member", None) == where.member


def each_once(named: tuple[Cause, ...]) -> tuple[Cause, ...]:
    """Return causes of which those without a place leave out the springs that others change too."""
    others = {change.name for cause in named if cause.where for change in cause.changes}
    return tuple(cause if cause.where else _without(cause, others) for cause in named)


def _without(cause: Cause, others: Collection[str]) -> Cause:
    parameters = {name: q for name, q in cause.parameters.items() if name not in others}
    changes = tuple(change for change in cause.changes if change.name not in others)
    return cause.model_copy(update={"parameters": parameters, "changes": changes})


def with_place_names(cause: Cause, structure: Structure) -> Cause:
    """Return a cause with the names of its places and its alternatives', and of the parameters that they change."""
    alternatives = tuple(other.model_copy(update=_place_names(other, structure)) for other in cause.alternatives)
    return cause.model_copy(update=_place_names(cause, structure) | {"alternatives": alternatives})


def with_other_connections(
    cause: Cause, data: Comparison, left_open: "Sequence[Candidate]", structure: Structure
) -> Cause:
    """Return a cause at a foot, bearing or joint with the changes of those like it, as far as the data determine them.

    Parameters
    ----------
    data : compared
    left_open : candidates of the answer, the best first
    structure : that was diagnosed
    """
    places = CONNECTIONS[cause.cause](structure) if cause.cause in CONNECTIONS else ()
    if cause.where is None or len(places) < 2:
        return cause
    with_it = (
        (candidate.chosen, one)
        for candidate in left_open
        for one in candidate.chosen
        if isinstance(one.cause, Springs) and _is_at(one.cause.connections[one.row], cause.where)
    )
    found = next(with_it, None)
    if found is None:
        return cause
    chosen, named = found
    return cause.model_copy(
        update={
            "others": tuple(
                OtherStiffness(
                    name=place_name(structure, one.connection.at),
                    position=one.connection.at,
                    member=getattr(one.connection, "member", None),
                    parameter=f"stiffness_{one.axis}",
                    change_percent=100 * one.change,
                    std_percent=100 * one.std,
                    deviations=one.deviations,
                )
                for one in other_springs(data, chosen, named)
            )
        }
    )


def _place_names(cause: FittedCause, structure: Structure) -> dict[str, object]:
    """Return the place of a cause, and the parameters that it changes, with the names of their places."""
    where = cause.where
    if where and where.position:
        where = where.model_copy(update={"name": place_name(structure, where.position)})
    changes = tuple(
        change.model_copy(update={"place": place_name(structure, change.position)}) if change.position else change
        for change in cause.changes
    )
    return {"where": where, "changes": changes}


def _with_quantities(
    changes: Sequence[ParameterChange], found: Mapping[str, Quantity]
) -> list[tuple[ParameterChange, Quantity]]:
    """Return each change of a spring with the parameter that it is, or of the model's own by its name."""
    return [(c, found[c.name] if c.name in found else found[f"stiffness_{c.name.rpartition('.')[2]}"]) for c in changes]
