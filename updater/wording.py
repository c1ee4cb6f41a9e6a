"""A diagnosis put into the plain values of its contract."""

from collections.abc import Collection, Sequence
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import logsumexp

from daq import FloatArray
from updater.causes.composite import Beside, Chosen
from updater.comparison import Comparison, Prediction, residual
from updater.reanalysis import picked, predict, reanalyse
from updater.verdict import Cause, FrequencyFit, Gain, ModeFit, Pair, Rejected

if TYPE_CHECKING:
    from updater.diagnosis import Candidate

_SEPARATE = 6.0  # squared distance of two predictions, in standard deviations, over which the data tell them apart
_LEAST_P = 1e-3  # under which a fit is none
_WORTH_NAMING = 0.05  # of the best one's posterior


def prediction(data: Comparison, chosen: Sequence[Chosen] | None) -> Prediction:
    """Return what one alternative, chosen causes together, predicts; of none, the baseline."""
    if not chosen:
        nothing = np.zeros((1, len(data.log_ratio)))
        return Prediction(nothing, data.base[None], data.base_lag[None], nothing)
    together = Beside(chosen[0].cause, tuple(chosen[1:]))
    theta = np.concatenate([c.theta for c in chosen])[None]
    effect = together.effect(theta, np.array([chosen[0].row]))
    return predict(data, *picked(reanalyse(data, effect)), effect)


def named_causes(data: Comparison, found: "list[Candidate]", sure: float) -> tuple[tuple[Cause, ...], bool]:
    """Return the causes that hold the posterior's share `sure`, and whether it is one that stands alone."""
    log = np.array([c.log_evidence for c in found])
    probability = np.exp(log - logsumexp(log))
    left = [i for i in range(len(found)) if probability[i] >= _WORTH_NAMING * probability[0]]
    named: list[Cause] = []
    held, alone = 0.0, probability[0] >= sure
    while left and held < sure:
        first = found[left[0]]
        alike = [i for i in left if _alike(data, first, found[i])] if not alone else left[:1]
        share = float(probability[alike].sum())
        others = tuple(name for i in alike[1:] for name in found[i].names if name not in first.names)
        named += _causes(first, share, others)
        held += share
        left = [i for i in left if i not in alike]
    unmistakable = not any(c.cause.cannot_be_told_from for c in found[0].chosen)
    return tuple(named), bool(alone and unmistakable)


def _alike(data: Comparison, one: "Candidate", other: "Candidate") -> bool:
    """Tell whether the data cannot separate two causes' best predictions."""
    first, second = (residual(data, prediction(data, c.chosen), data.plain) for c in (one, other))
    return bool(((first - second) ** 2).sum() < _SEPARATE)


def _causes(candidate: "Candidate", probability: float, others: tuple[str, ...]) -> list[Cause]:
    return [
        Cause(
            cause=chosen.cause.name,
            probability=probability,
            where=part.hypotheses.where(part),
            parameters=part.hypotheses.parameters(part),
            cannot_be_told_from=(*chosen.cause.cannot_be_told_from, *others),
        )
        for chosen, part in zip(candidate.chosen, candidate.parts, strict=True)
    ]


def rejected_causes(singles: "list[Candidate]", accepted: Collection[str], best: float) -> tuple[Rejected, ...]:
    """Return the single causes that were not accepted, with the reason."""
    return tuple(
        Rejected(cause=c.names[0], log_evidence=c.log_evidence - best, why=_why(c, c.log_evidence - best))
        for c in singles
        if c.names[0] not in accepted
    )


def _why(candidate: "Candidate", evidence: float) -> str:
    p = candidate.p_value
    if p < _LEAST_P:
        return f"does not fit: p {p:.0e}" if p > 0 else "does not fit: p under 1e-300"
    if evidence >= 0:
        return "fits, but so does nothing at all"
    return f"fits, but the odds against it are {_odds(-evidence)} to 1"


def _odds(log_odds: float) -> str:
    return f"{np.exp(log_odds):.2g}" if log_odds < np.log(1e4) else f"1e{log_odds / np.log(10):.0f}"


def modes_of(data: Comparison, chosen: Sequence[Chosen] | None) -> tuple[ModeFit, ...]:
    """Return each mode without and with the causes."""
    base = np.log(data.frequency[data.paired])
    measured = np.exp(base + data.log_ratio)
    before, after = prediction(data, None), prediction(data, chosen)
    macs = [_said(_mac(data, predicted.shape[0])) for predicted in (before, after)]
    return tuple(
        ModeFit(
            frequency=FrequencyFit(
                measured=float(measured[i]),
                std=float(measured[i] * data.log_frequency_std[i]),
                before=float(np.exp(base[i])),
                after=float(np.exp(base[i] + after.log_ratio[0, i])) if chosen else None,
            ),
            mac=Pair(before=macs[0][i], after=macs[1][i] if chosen else None),
        )
        for i in range(len(base))
    )


def _mac(data: Comparison, shape: FloatArray) -> FloatArray:
    """Return the modal assurance criterion (n,) of measured shapes with others, one by one; NaN if not measured."""
    mac = (data.shape * shape).sum(1) ** 2 / (shape**2).sum(1)
    return np.where(data.shaped, mac, np.nan)


def _said(values: FloatArray) -> list[float | None]:
    return [float(v) if np.isfinite(v) else None for v in values]


def gain_of(data: Comparison, chosen: Sequence[Chosen], *, heldout: bool) -> Gain:
    """Return what the causes gain on data."""
    figures = []
    for part, whitener in ((None, data.plain), (chosen, data.drifting)):
        predicted = prediction(data, part)
        drift = any(c.cause.drifting for c in part) if part else False
        used = whitener if drift else data.plain
        rest = residual(data, predicted, used)
        error = 100 * float(np.sqrt(np.mean((data.log_ratio - predicted.log_ratio[0]) ** 2)))
        apart = float(1 - _mac(data, predicted.shape[0])[data.shaped].mean()) if data.shaped.any() else None
        figures.append((error, apart, float(-0.5 * (rest**2).sum() + used.log_det)))
    before, after = figures
    names = ("frequency_error_percent", "one_minus_mac", "log_likelihood")
    pairs = {name: Pair(before=b, after=a) for name, b, a in zip(names, before, after, strict=True)}
    return Gain(heldout=heldout, **pairs)
