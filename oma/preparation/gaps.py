"""Filling of short gaps by the most probable samples, from the signals around them and the other channels.

If samples are lost on each channel independently, few rows are complete: with eight channels that lack a fifth each,
one row in six. A vector autoregression estimates a lost sample, up to its noise: for Gaussian signals, the values with
the smallest innovations are the conditional mean.

References
----------
Janssen, A. J. E. M., Veldhuis, R. N. J., Vries, L. B. (1986). Adaptive interpolation of discrete-time signals that can
be modeled as autoregressive processes. IEEE Transactions on Acoustics, Speech, and Signal Processing 34(2), 317-330.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import scipy  # its parts at their first use

from daq import FloatArray

BoolArray = npt.NDArray[np.bool_]

ORDER = 8  #: order of the autoregression, and longest gap that is filled [samples]
_PASSES = 3  # of filling and fitting in turn
_ROWS = 150  # per regressor that the fit takes, at most: the prediction error grows by 1/300
_BLOCK = 1024  # consecutive samples that it takes, in a long record
_ITERATIONS = 30  # of conjugate gradients a pass
_RIDGE = 1e-6  # of the mean variance: keeps the fit of nearly predictable signals solvable


@dataclass(frozen=True, eq=False)
class Autoregression:
    """Sample minus its prediction from the previous ones, in units of its standard deviation."""

    filters: FloatArray  #: (ORDER + 1, n_channels, n_channels): innovation = sum of filters[k] x(t - k)

    def innovations(self, data: FloatArray) -> FloatArray:
        """Return the innovations from sample ORDER on."""
        n = len(data) - ORDER
        return np.asarray(sum(data[ORDER - k : ORDER - k + n] @ f.T for k, f in enumerate(self.filters)))

    def adjoint(self, innovations: FloatArray) -> FloatArray:
        """Return the transpose of `innovations` applied."""
        n = len(innovations)
        result = np.zeros((n + ORDER, self.filters.shape[1]))
        for k, f in enumerate(self.filters):
            result[ORDER - k : ORDER - k + n] += innovations @ f
        return result


def gapless_stretches(data: FloatArray) -> list[tuple[int, int]]:
    """Return first sample and end of the stretches of data (n_samples, n_channels) without a gap in any channel."""
    edges = np.flatnonzero(np.diff(np.r_[False, np.isfinite(data).all(1), False].astype(np.int8)))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def short_gaps(missing: BoolArray) -> BoolArray:
    """Return which missing samples, (n_samples, n_channels), are in gaps of no more than ORDER."""
    within = np.zeros((missing.shape[1], len(missing) + 1), np.bool_)  # channel by channel, with an end to each
    within[:, :-1] = missing.T
    edges = np.flatnonzero(within.ravel()[1:] != within.ravel()[:-1]) + 1
    if within[0, 0]:
        edges = np.concatenate([[0], edges])
    for start, end in edges.reshape(-1, 2)[np.diff(edges.reshape(-1, 2), axis=1)[:, 0] > ORDER].tolist():
        within.ravel()[start:end] = False
    return np.asarray(within[:, :-1].T)


def filled(data: FloatArray, *, in_place: bool = False) -> FloatArray:
    """Fill short gaps; long ones stay.

    Of a long record, the autoregression is fitted to blocks that are spread evenly over it.

    Parameters
    ----------
    data : (n_samples, n_channels) array
        NaN where a sample is missing.
    in_place : bool
        Write into `data`, instead of a copy.

    Returns
    -------
    (n_samples, n_channels) array
    """
    missing = np.isnan(data)
    lost = short_gaps(missing)
    if not lost.any() or len(data) < 10 * ORDER * data.shape[1]:
        return data
    n = len(data)
    every = max(n // max(_ROWS * ORDER * data.shape[1], _BLOCK), 1)  # of blocks, spread evenly over the samples
    learnt = np.asarray(np.arange(n) // _BLOCK % every == 0)
    beside = np.convolve(lost.any(axis=1), np.ones(2 * ORDER + 1), mode="same") > 0
    rows = np.flatnonzero(learnt | beside)
    part, gap, short = data[rows], missing[rows], lost[rows]
    mean, size = np.nanmean(part, axis=0), np.nanstd(part, axis=0)
    size[size == 0] = 1.0
    values = (bridged(part, gap) - mean) / size
    used = ~np.convolve((gap & ~short).any(axis=1), np.ones(ORDER + 1), mode="valid").astype(np.bool_)
    used &= rows[ORDER:] - rows[:-ORDER] == ORDER  # their past is there
    for _ in range(_PASSES):
        model = _fit(values, used & learnt[rows[ORDER:]])
        values[short] += _most_likely(model, values, short, used)
    result = data if in_place else data.copy()
    result[lost] = (values * size + mean)[short]
    return result


def bridged(data: FloatArray, missing: BoolArray) -> FloatArray:
    """Fill gaps with straight lines between the samples before and after them.

    Parameters
    ----------
    data : (n_samples, n_channels) [any unit]
    missing : (n_samples, n_channels) true where a sample is missing
    """
    result = data.copy()
    time = np.arange(len(data))
    for column, gap in zip(result.T, missing.T, strict=True):
        if gap.any():
            column[gap] = np.interp(time[gap], time[~gap], column[~gap]) if not gap.all() else 0.0
    return result


def _fit(values: FloatArray, used: BoolArray) -> Autoregression:
    """Fit by least squares to the rows without a long gap in their past."""
    n = values.shape[1]
    past = np.concatenate([values[ORDER - k : len(values) - k][used] for k in range(1, ORDER + 1)], axis=1)
    now = values[ORDER:][used]
    gram = past.T @ past
    gram += _RIDGE * np.trace(gram) / len(gram) * np.eye(len(gram))
    weights = scipy.linalg.solve(gram, past.T @ now, assume_a="pos").T
    rest = now - past @ weights.T
    scatter = rest.T @ rest / len(rest)
    root = scipy.linalg.cholesky(scatter + _RIDGE * np.trace(scatter) / n * np.eye(n), lower=True)
    filters = np.concatenate([np.eye(n)[None], -weights.reshape(n, ORDER, n).transpose(1, 0, 2)])
    return Autoregression(np.stack([scipy.linalg.solve_triangular(root, f, lower=True) for f in filters]))


def _most_likely(model: Autoregression, values: FloatArray, lost: BoolArray, used: BoolArray) -> FloatArray:
    """Return the correction of the lost samples with the smallest squared innovations: conjugate gradients."""
    rows = used[:, None]

    def applied(change: FloatArray) -> FloatArray:
        whole = np.zeros_like(values)
        whole[lost] = change
        return model.adjoint(model.innovations(whole) * rows)[lost]

    residual = -model.adjoint(model.innovations(values) * rows)[lost]
    change, direction, power = np.zeros_like(residual), residual.copy(), float(residual @ residual)
    first = power
    for _ in range(_ITERATIONS):
        if power <= 1e-12 * first:
            break
        moved = applied(direction)
        step = power / float(direction @ moved)
        change += step * direction
        residual -= step * moved
        power, before = float(residual @ residual), power
        direction = residual + power / before * direction
    return change
