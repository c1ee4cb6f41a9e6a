"""One-to-one pairing of two sets of modes by frequency and shape."""

import numpy as np
import scipy  # its parts at their first use

from daq import FloatArray, IndexArray
from oma.mac import mac_matrix
from oma.preparation import BoolArray

_IMPOSSIBLE = 1e6  # larger than any cost
# relative to the longest shape of the model: a mode below it has only the motion of an adjacent mode at the sensors
_MIN_LENGTH = 1e-3
_MIN_MAC, _FARTHEST = 0.5, 0.3  # limits of a pair of a measured and a model mode; the latter of ln f


def assign(cost: FloatArray, possible: BoolArray) -> IndexArray:
    """Pair rows with columns one to one: as many possible pairs as there can be, and of these the cheapest.

    Parameters
    ----------
    cost : (n_rows, n_columns) array
        Far below 1e6 where a pair is possible.
    possible : (n_rows, n_columns) array of bool

    Returns
    -------
    (n_rows,) array of int
        The column of each row, -1 where it has none.
    """
    result = np.full(len(cost), -1, dtype=np.intp)
    if max(possible.sum(0).max(initial=0), possible.sum(1).max(initial=0)) <= 1:  # no choice
        rows, columns = np.nonzero(possible)
        result[rows] = columns
        return result
    rows, columns = scipy.optimize.linear_sum_assignment(np.where(possible, cost, _IMPOSSIBLE))
    taken = possible[rows, columns]
    result[rows[taken]] = columns[taken]
    return result


def assign_gains(gain: FloatArray) -> IndexArray:
    """Pair rows with columns one to one with the largest sum of gains; entries without gain remain unpaired.

    Parameters
    ----------
    gain : (n_rows, n_columns) array

    Returns
    -------
    (n_rows,) array of int
        The column of each row, -1 where it has none.
    """
    rows, columns = scipy.optimize.linear_sum_assignment(gain.clip(0), maximize=True)
    result = np.full(len(gain), -1, dtype=np.intp)
    taken = gain[rows, columns] > 0
    result[rows[taken]] = columns[taken]
    return result


def mac_of_moving(shape: FloatArray, model_shape: FloatArray) -> FloatArray:
    """Return the MAC (n, k) of measured shapes (n, n_channels) with a model's (k, n_channels).

    It is 0 with a mode that does not move the channels: its small motion is that of an adjacent mode.
    """
    length = np.linalg.norm(model_shape, axis=1)
    moving = length > _MIN_LENGTH * length.max()
    assurance = np.zeros((len(shape), len(model_shape)))
    assurance[:, moving] = mac_matrix(shape, model_shape[moving])
    return assurance


def pair_modes(
    frequency: FloatArray, shape: FloatArray, model_frequency: FloatArray, model_shape: FloatArray
) -> IndexArray:
    """Return for each measured mode the paired model mode, one to one; -1 if there is none.

    The assignment has the least sum of (1 - MAC) + |ln f / f_model|: MAC alone fails with few sensors. A MAC below 0.5
    or frequencies more than 30 % apart are no pair, and no mode is paired with one that no channel measures.

    Parameters
    ----------
    frequency, shape : (n,) [Hz] and (n, n_channels) measured; NaN for one that was never measured
    model_frequency, model_shape : (k,) [Hz] and (k, n_channels) of the model at the same channels

    Returns
    -------
    (n,) array of int
    """
    seen = np.flatnonzero(np.isfinite(frequency) & np.isfinite(shape).all(1))
    assurance = mac_of_moving(shape[seen], model_shape)
    distance = np.abs(np.log(frequency[seen, None] / model_frequency))
    row, column = scipy.optimize.linear_sum_assignment(1 - assurance + distance)
    near = (assurance[row, column] >= _MIN_MAC) & (distance[row, column] <= _FARTHEST)
    answers = np.full(len(frequency), -1, np.intp)
    answers[seen[row[near]]] = column[near]
    return answers
