"""Joint prediction of selected causes, and its agreement with the measured shapes."""

from collections.abc import Sequence

import numpy as np

from daq import FloatArray
from updater.causes.composite import JointHypothesis, SelectedCause
from updater.inference import Comparison, Effect, Prediction, picked, predict, reanalyse


def prediction(data: Comparison, chosen: Sequence[SelectedCause] | None) -> Prediction:
    """Return the prediction of one alternative, chosen causes together; without causes, the modes before."""
    if not chosen:
        nothing = np.zeros((1, len(data.log_ratio)))
        nobody = np.empty((1, 0, data.base.shape[1]))
        ratio, shape = (data.nominal.log_ratio[None], data.nominal.shape) if data.nominal else (nothing, data.base)
        return Prediction(ratio, shape[None], data.baseline_imaginary[None], nothing, nobody[:, :, 0], nobody)
    effect = effect_of(chosen)
    return predict(data, *picked(reanalyse(data, effect)), effect)


def effect_of(chosen: Sequence[SelectedCause]) -> Effect:
    """Return the joint effect of chosen causes, as one alternative."""
    together = JointHypothesis(chosen[0].cause, tuple(chosen[1:]))
    return together.effect(np.concatenate([c.theta for c in chosen])[None], np.array([chosen[0].row]))


def mac_of(data: Comparison, shape: FloatArray) -> FloatArray:
    """Return the modal assurance criterion (n,) of measured shapes with others, one by one; NaN if not measured."""
    mac = (data.shape * shape).sum(1) ** 2 / (shape**2).sum(1)
    return np.where(data.shaped, mac, np.nan)
