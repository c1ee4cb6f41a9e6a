"""Residuals between the prediction of a hypothesis and the measurement."""

from dataclasses import dataclass

import numpy as np

from daq import FloatArray
from updater.inference.comparison import Comparison, NewModes, Whitener
from updater.inference.shape_covariance import beside, inner, turned_back


@dataclass(frozen=True, eq=False)
class Prediction:
    """Measurement predicted by alternatives."""

    log_ratio: FloatArray  #: (n_alternatives, n) of frequency to the baseline's
    shape: FloatArray  #: (n_alternatives, n, n_channels) of any norm and sign
    imaginary: FloatArray  #: (n_alternatives, n, n_channels) imaginary part where the real one has unit norm
    log_damping: FloatArray  #: (n_alternatives, n) of damping to the baseline's
    new_frequency: FloatArray  #: (n_alternatives, n_new) of modes that came with something [Hz]
    new_shape: FloatArray  #: (n_alternatives, n_new, n_channels) of any norm and sign
    with_mass: tuple[FloatArray, ...] = ()  #: (n_alternatives, k) of each record with a known mass
    undone: FloatArray | None = None  #: (n_alternatives, n_channels, n_channels) exchanges and turns of channels undone


def residual(comparison: Comparison, predicted: Prediction, whitener: Whitener) -> FloatArray:
    """Return whitened residuals (n_alternatives, n_data) [-]: log frequencies, shapes, imaginary parts, log damping."""
    shape, n = predicted.shape, len(predicted.shape)
    frequency = (comparison.log_ratio - predicted.log_ratio) @ whitener.matrix.T
    rest = turned_back(_undone(predicted, beside(comparison.shape, shape)), _undone(predicted, shape), comparison.base)
    off = (rest.transpose(1, 0, 2) @ comparison.shape_whitener.transpose(0, 2, 1)).transpose(1, 0, 2).reshape(n, -1)
    off -= off @ comparison.common_to_modes @ comparison.common_to_modes.T
    blocks = [frequency, off]
    if comparison.phased.any():
        sign = np.where(inner(shape, comparison.shape) < 0, -1.0, 1.0)
        late = beside(comparison.imaginary - sign * predicted.imaginary, shape)  # a mode's own phase is no one's
        blocks.append(_undone(predicted, late).reshape(n, -1) @ comparison.imaginary_whitener.T)
    if comparison.damping_weight.any():
        blocks.append((comparison.log_damping - predicted.log_damping) * comparison.damping_weight)
    if comparison.new is not None:
        blocks.append(_off_new(comparison.new, predicted))
    for test, expected in zip(comparison.mass_tests, predicted.with_mass, strict=True):
        if test.is_evidence:
            blocks.append(test.whitened(test.log_ratio - expected, frequency, whitener))
    return np.concatenate(blocks, axis=1)


def _undone(predicted: Prediction, off: FloatArray) -> FloatArray:
    """Return residuals of shapes (p, n, n_channels) at the original channels, where common errors are known.

    Close modes rotate into each other by errors of a model. For two exchanged channels, each has the other's component.
    """
    return off if predicted.undone is None else np.asarray(off @ predicted.undone.transpose(0, 2, 1))


def _off_new(new: NewModes, predicted: Prediction) -> FloatArray:
    """Return whitened residuals (p, n_extra (1 + n_channels)) of new modes, each from the nearest that is predicted.

    A mode that no cause predicts has zero residuals. A cause that predicts it has the corresponding evidence.
    """
    n_alternatives, n_new = predicted.new_frequency.shape
    off = np.zeros((n_alternatives, len(new.shape), 1 + new.shape.shape[1]))
    every = np.arange(n_alternatives)
    for k in range(n_new):
        away = new.log_frequency - np.log(predicted.new_frequency[:, k, None])
        nearest = np.argmin(np.abs(away), axis=1)
        off[every, nearest, 0] = away[every, nearest] / new.log_frequency_std[nearest]
        shape = predicted.new_shape[:, k]
        moves = np.linalg.norm(shape, axis=1, keepdims=True) > 0  # not an oscillator at a foot
        beside_it = beside(new.shape[nearest], np.where(moves, shape, 1.0))
        off[every, nearest, 1:] = np.einsum("pij,pj->pi", new.whitener[nearest], beside_it)
    return off.reshape(n_alternatives, -1)
