"""Choice of the next measurement: each one is tried on the predictions of the remaining hypotheses.

A further sensor, a longer record, a known mass, a thermometer, a tone of known frequency: the hypotheses predict the
result of each measurement. The distance of the predictions in standard deviations gives the expected information, and
this per hour of work the order. Where nothing is to be decided, the smallest changes that the data would have shown.
"""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from daq import FloatArray, IndexArray
from updater.causes import (
    AddedMass,
    Cause,
    CommonFactor,
    JointHypothesis,
    LocalStiffness,
    SelectedCause,
    SensorGain,
    SensorPosition,
    effect_of,
    prediction,
)
from updater.diagnosis.schema import Measurement, Separation, SmallestChange
from updater.inference import (
    DRIFT,
    MODEL_ERROR,
    Changed,
    Comparison,
    Effect,
    compare,
    entropy,
    expected_information,
    picked,
    reanalyse,
    residual,
    size_deviations,
)
from updater.modal_data import Effort, ModalMean
from updater.quantities import vector
from updater.reference import Reference
from updater.structure import size

_DECIDES = 3.0  # standard deviations
_NEAR = 0.03  # m, on a structure of 1.5 m, within which one sensor is as good as another
_SPACING = 0.1  # of a member's length, between places that are tried
_SHARES = (0.01, 0.02, 0.04)  # known masses relative to the structure's
_ENOUGH = 0.9  # of the information of the heaviest mass: the lightest one that gives it is proposed
_LONGER = (2, 4, 8, 16)  # times the record
_DEVIATIONS = ("log_frequency_std", "shape_std", "damping_std")  # that a longer record lowers
_WORTHLESS = 1.0  # standard deviations under which a measurement is not named


Hypothesis = tuple[SelectedCause, ...]
#: a measurement, and by how many standard deviations it separates each two hypotheses (n, n)
_Trial = tuple[Measurement, FloatArray]


def next_measurement(
    reference: Reference,
    event: ModalMean,
    data: Comparison,
    bodies: AddedMass | None,
    open_ones: Sequence[Hypothesis],
    probability: FloatArray,
) -> Separation:
    """Return the measurements that would decide between hypotheses, by expected information per hour of work.

    Parameters
    ----------
    bodies : positions where a known mass may be clamped on
    open_ones : (n,) two or more hypotheses that the data do not separate
    probability : (n,) of these, their sum is 1
    """
    trials = [
        *_sensors(reference, event, data, open_ones),
        *(_known_masses(data, bodies, open_ones, probability) if bodies is not None else []),
        *_longer(reference, event, data, open_ones),
        *_known_beside(data, open_ones),
    ]
    effort = data.circumstances.effort
    weighed = [_weighed(trial, probability, effort) for trial in trials if trial[1].max() >= _WORTHLESS]
    planned: dict[str, Measurement] = {}  # the best of each kind
    for one in sorted(weighed, key=lambda one: -one.information_per_hour):
        planned.setdefault(one.kind + one.instrument, one)
    never = np.argwhere(np.triu(np.max([distance for _, distance in trials], axis=0) < _WORTHLESS, 1))
    return Separation(
        hypotheses=tuple(tuple(part.cause.name for part in chosen) for chosen in open_ones),
        measurements=tuple(planned.values()),
        inseparable=tuple((int(i), int(j)) for i, j in never),
        open=2 ** float(entropy(probability)),
    )


def _weighed(trial: _Trial, probability: FloatArray, effort: Effort) -> Measurement:
    """Return a measurement with the hypotheses that it separates, its information and its effort."""
    measurement, distance = trial
    apart = np.argwhere(np.triu(distance >= min(_DECIDES, 0.99 * distance.max()), 1))
    information = expected_information(probability, distance)
    work = 0.0 if measurement.kind == "longer_record" else float(getattr(effort, measurement.kind))
    own = {
        "pairs": tuple((int(i), int(j)) for i, j in apart),
        "deviations": min(float(distance[i, j]) for i, j in apart),
        "information": information,
        "leaves": 2 ** max(0.0, float(entropy(probability)) - information),
        "hours": work + measurement.length * effort.record,
    }
    return measurement.model_copy(update=own)


def _apart(values: FloatArray, std: FloatArray) -> FloatArray:
    """Return the distances (n, n) of readings (n, n_readings) with standard deviations (n_readings,)."""
    scaled = values / std
    return np.asarray(np.linalg.norm(scaled[:, None] - scaled[None], axis=2))


def _solved(data: Comparison, chosen: Hypothesis, more: Effect | None = None) -> Changed:
    """Return the modes that a hypothesis expects, alone or with one more effect."""
    effect = effect_of(chosen)
    if more is None:
        return reanalyse(data, effect)
    added = {name: getattr(more, name) + getattr(effect, name) for name in ("mass", "compliance")}
    hung = {name: np.repeat(getattr(effect, name), len(more.mass), axis=0) for name in ("coupling", "own")}
    return reanalyse(data, replace(more, **added, **hung))


def _sensors(reference: Reference, event: ModalMean, data: Comparison, open_ones: Sequence[Hypothesis]) -> list[_Trial]:
    """Try a sensor along each axis at places of every member; return the best one."""
    structure, model = reference.structure, reference.model
    if not structure.member or not data.shaped.any():
        return []
    points = np.concatenate([m.point(np.arange(0, 1 + _SPACING / 2, _SPACING) * m.length) for m in structure.member])
    rows = (model.reader(points) @ reference.shape).reshape(len(points), 6, -1)[:, :3]
    readings = np.array([_readings(data, _solved(data, chosen), rows) for chosen in open_ones])
    typical = np.sqrt(np.mean(readings**2, axis=(0, 1, 2)))  # of each mode
    noise = np.nanmean(np.where(data.shaped[:, None], event.shape_std[data.tracks], np.nan), axis=1)
    std = np.hypot(np.where(np.isfinite(noise), noise, np.inf), MODEL_ERROR * typical)
    scaled = readings / std
    distance = np.linalg.norm(scaled[:, None] - scaled[None], axis=4)  # (n, n, n_points, 3)
    for i, axis in itertools.product(range(len(points)), range(3)):
        if _taken(reference, points[i], axis):
            distance[:, :, i, axis] = 0
    total = np.minimum(distance, 2 * _DECIDES).sum((0, 1))
    i, axis = divmod(int(np.argmax(total)), 3)
    return [(Measurement(kind="sensor", position=vector(points[i]), axis="xyz"[axis]), distance[:, :, i, axis])]


def _readings(data: Comparison, changed: Changed, rows: FloatArray) -> FloatArray:
    """Return the reading of new sensors (n_points, 3, n_modes) in the compared modes (n_points, 3, n)."""
    n, n_modes = len(data.paired), len(data.frequency)  # an oscillator has modes and motions of its own
    vector = picked(changed)[1][0, :n_modes, :n]
    at = data.at_channels @ vector
    scale = np.linalg.norm(at, axis=0) * np.where((at * data.shape.T).sum(0) < 0, -1, 1)
    return np.asarray(rows @ vector / scale)


def _taken(reference: Reference, point: FloatArray, axis: int) -> bool:
    """Return whether a sensor along an axis exists already, or is so near that it measures the same."""
    near = _NEAR * size(reference.structure)
    return any(
        np.linalg.norm(np.subtract(s.at, point)) < near and abs(s.direction[axis]) > 0.99 * np.linalg.norm(s.direction)
        for s in reference.structure.sensor
    )


def _known_masses(
    data: Comparison, bodies: AddedMass, open_ones: Sequence[Hypothesis], probability: FloatArray
) -> list[_Trial]:
    """Try a known mass at places of every member, then others at the best place; return the lightest that is enough."""
    step = max(1, len(bodies.position) // 40)
    rows = np.arange(0, len(bodies.position), step)
    members = bodies.reference.structure.member
    total = bodies.reference.model.total_mass()
    distance = _with_mass(data, bodies, open_ones, rows, np.full(len(rows), _SHARES[1] * total))
    row = rows[int(np.argmax(np.minimum(distance, 2 * _DECIDES).sum((1, 2))))]
    masses = np.array(_SHARES) * total
    there = _with_mass(data, bodies, open_ones, np.full(len(masses), row), masses)
    information = np.array([expected_information(probability, one) for one in there])
    k = int(np.argmax(information >= _ENOUGH * information[-1]))
    at = vector(members[bodies.member[row]].point(bodies.position[row]))
    return [(Measurement(kind="known_mass", mass=float(masses[k]), position=at), there[k])]


def _with_mass(
    data: Comparison, bodies: AddedMass, open_ones: Sequence[Hypothesis], rows: IndexArray, mass: FloatArray
) -> FloatArray:
    """Return the distances (n_rows, n, n) of hypotheses by the shifts that masses (n_rows,) at places cause."""
    theta = np.zeros((len(rows), len(bodies.prior_std)))
    theta[:, 0] = mass
    on = bodies.effect(theta, rows)
    n, shift = len(data.paired), []
    for chosen in open_ones:
        bare = picked(_solved(data, chosen))[0][:, :n]
        shift.append(-0.5 * np.log(picked(_solved(data, chosen, on))[0][:, :n] / bare))
    shifts = np.array(shift)  # (n, n_rows, n_modes)
    noise, found = 2 * data.log_frequency_std**2, []
    for here in shifts.transpose(1, 0, 2):
        covariance = np.diag(noise + (MODEL_ERROR * _typical(here)) ** 2) + DRIFT**2
        found.append(_apart(here @ np.linalg.inv(np.linalg.cholesky(covariance)).T, np.ones(n)))
    return np.stack(found)


def _typical(shift: FloatArray) -> FloatArray:
    """Return the size that a mode's shift is known to (n_modes,), a mode that hardly moves by the others' mean."""
    size = np.abs(shift).mean(0)
    return np.asarray(2 * np.sqrt(size * size.mean()))


def _longer(reference: Reference, event: ModalMean, data: Comparison, open_ones: Sequence[Hypothesis]) -> list[_Trial]:
    """Try longer records: less noise, the same errors of the baseline and of the model."""
    drifting = all(any(c.cause.drifting for c in h) for h in open_ones)
    found = []
    for factor in _LONGER:
        less = {name: getattr(event, name) / np.sqrt(factor) for name in _DEVIATIONS}
        longer = compare(reference, replace(event, **less), circumstances=data.circumstances)
        whitener = longer.drifting if drifting else longer.plain
        rest = np.array([residual(longer, prediction(longer, chosen), whitener)[0] for chosen in open_ones])
        found.append((Measurement(kind="longer_record", length=factor), _apart(rest, np.ones(rest.shape[1]))))
    return found


def _known_beside(data: Comparison, open_ones: Sequence[Hypothesis]) -> list[_Trial]:
    """Try a thermometer and a tone, where the factor on all frequencies may be a temperature's or a clock's."""
    factors = [
        [(part, part.cause) for part in chosen if isinstance(part.cause, CommonFactor) and not part.cause.informed]
        for chosen in open_ones
    ]
    found = []
    for instrument in sorted({cause.instrument for each in factors for _, cause in each} - {""}):
        reading = np.array(
            [[sum(c.reading(p.theta) for p, c in each if c.instrument == instrument)] for each in factors]
        )
        if reading.any():
            found.append((Measurement(kind="instrument", instrument=instrument), _apart(reading, np.ones(1))))
    return found


_NAMED = 4.5  # standard deviations: cause, place and size cost about 10 of log evidence
_HALF, _MOST = 0.5, 0.9  # shares of all places
_IMPOSSIBLE = 3.0  # prior standard deviations: a larger magnitude is not stated
_LARGEST_LOSS = 0.9  # a larger one is not stated: a stretch is then a hinge


def smallest_changes(data: Comparison, causes: Mapping[str, Cause], chosen: Hypothesis) -> tuple[SmallestChange, ...]:
    """Return the smallest changes that the data would have shown in addition to the chosen causes.

    To first order, with all parameters of these fitted too.

    Parameters
    ----------
    causes : that were considered, by name
    chosen : accepted
    """
    found = []
    for cause in causes.values():
        if isinstance(cause, AddedMass):
            found.append(_smallest(data, cause, chosen, "mass", "kg"))
        elif isinstance(cause, LocalStiffness):
            found += _smallest_loss(data, cause, chosen)
        elif isinstance(cause, SensorGain):
            found.append(_smallest(data, cause, chosen, "gain", "-"))
        elif isinstance(cause, SensorPosition):
            found.append(_smallest(data, cause, chosen, "shift", "m"))
    return tuple(found)


def _smallest(
    data: Comparison, cause: AddedMass | SensorGain | SensorPosition, chosen: Hypothesis, parameter: str, unit: str
) -> SmallestChange:
    least = _least(data, cause, chosen)
    least[least > _IMPOSSIBLE * cause.prior_std[0]] = np.inf
    half, most = _at_places(least, np.exp(cause.log_prior))
    return SmallestChange(cause=cause.name, parameter=parameter, value=half, value_at_most_places=most, unit=unit)


def _smallest_loss(data: Comparison, cause: LocalStiffness, chosen: Hypothesis) -> list[SmallestChange]:
    """Return the smallest loss of stiffness along stretches of the middle kind of length."""
    kind = sorted(cause.kinds.size)[len(cause.kinds.size) // 2]
    rows = cause.kind == kind
    if not rows.any():
        return []
    compliance, weight = _least(data, cause, chosen)[rows], np.exp(cause.log_prior[rows])
    loss = compliance / (1 + compliance)  # a softer stretch has 1 / (1 - loss) of the compliance
    half, most = _at_places(np.where(loss > _LARGEST_LOSS, np.inf, loss), weight)
    extent = float(np.median(cause.size[rows] * cause.cells.length[cause.member[rows]]))
    return [
        SmallestChange(
            cause=cause.name, parameter="loss", value=half, value_at_most_places=most, unit="-", extent=extent
        )
    ]


def _least(data: Comparison, cause: Cause, chosen: Hypothesis) -> FloatArray:
    """Return the smallest magnitude of each alternative (n,)."""
    n_own = len(cause.prior_std)
    theta = np.concatenate([np.zeros(n_own), *(c.theta for c in chosen)])
    beside: JointHypothesis[Cause] = JointHypothesis(cause, chosen)
    return _NAMED * size_deviations(data, beside, theta, n_own)


def _at_places(least: FloatArray, weight: FloatArray) -> tuple[float | None, float | None]:
    """Return the smallest magnitude (n,) at half of all places, and at nine of ten; None where it is infinite."""
    order = np.argsort(least)
    below = np.cumsum(weight[order]) / weight.sum()
    half, most = (float(least[order][np.searchsorted(below, share)]) for share in (_HALF, _MOST))
    return half if np.isfinite(half) else None, most if np.isfinite(most) else None
