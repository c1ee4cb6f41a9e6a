"""Band-limited signals between their scans: a windowed sinc.

Its weights are a smooth function of the position between two scans. Samples are computed in blocks: the weights of all
samples of a block are polynomials of their deviations from the spacing of the grid, and a block is a product of
matrices. Where a scan is missing, or clocks differ by more than 200 ppm, each sample is computed by itself, with
weights from a table that is linear between its phases. The two ways differ by 3e-7 of the signal, the error of the
table.
"""

import itertools
from functools import lru_cache

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from daq.types import BoolArray, FloatArray, IndexArray

_HALF = 16  # taps on each side of the kernel, at the rate of the grid
_BETA = 8.75  # of its Kaiser window: errors under -80 dB for signals below 0.4 of the rate
_PHASES = 2048  # of the kernel's table; linear between them, error 1/8 (pi / 2048)^2 = -130 dB
_CHUNK = 1 << 11  # samples at a time: their weights stay in the processor's cache
_BLOCK = 16  # samples
_CELLS = 16  # of the position of a block's first sample between two scans, each with polynomials of its own ...
_TERMS = 5  # ... with so many terms: error (pi reach)^5 / 1920 = 6e-9, -164 dB
_MAX_DRIFT = 200e-6  # largest deviation of the spacing [scans per sample]
_REACH = 0.5 / _CELLS + _MAX_DRIFT * _BLOCK / 2  # largest deviation of a sample [scans]
_BLOCKS = 256  # at a time: they stay in the processor's cache


def half_taps(ratio: float) -> int:
    """Return how many scans on each side of a sample it is made of."""
    return int(np.ceil(_HALF / ratio))


def interpolate(
    scans: FloatArray, first: float, step: float, n: int, ratio: float = 1.0, out: FloatArray | None = None
) -> FloatArray:
    """Return a band-limited signal (n, n_axes) at even spacing in its scans; NaN where one that it needs is missing.

    Windowed sinc (Kaiser, beta 8.75) of 32 taps at the grid's rate, -80 dB below 0.4 of it.

    Parameters
    ----------
    scans : (n_scans, n_axes); at least `half_taps` on each side of every position
    first, step, n : position of the first sample and distance of the others [scans], and their number
    ratio : samples of the grid a scan, at most 1
    out : (n, n_axes) array for the result. Default: a new one
    """
    columns = np.ascontiguousarray(scans.T)
    rows = np.empty((len(columns), n)) if out is None else out.T
    done = _in_blocks(columns, first, step, ratio, rows)
    if n % _BLOCK or not done.all():
        rest = np.flatnonzero(np.append(np.repeat(~done, _BLOCK), np.ones(n % _BLOCK, np.bool_)))
        position = np.asarray(first + step * rest, np.float64)
        rows[:, rest] = _one_by_one(columns, position, ratio)
    return rows.T


def _in_blocks(columns: FloatArray, first: float, step: float, ratio: float, out: FloatArray) -> BoolArray:
    """Write the blocks that lack no scan; return which these are (n_blocks,)."""
    n_blocks, drift = out.shape[1] // _BLOCK, step - 1 / ratio
    bank, half, middle = _bank(ratio), half_taps(ratio), _middle(ratio)
    span, n_scans = bank.shape[2], columns.shape[1]
    if abs(drift) > _MAX_DRIFT or not n_blocks or n_scans < span:
        return np.zeros(n_blocks, np.bool_)
    drifts = drift * (np.arange(_BLOCK) - _BLOCK // 2)  # from the spacing of the grid, which fits at the middle
    nominal = first + step * (_BLOCK * np.arange(n_blocks) + _BLOCK // 2) - _BLOCK // 2 / ratio
    base = np.floor(nominal)
    cell = np.minimum((_CELLS * (nominal - base)).astype(np.intp), _CELLS - 1)
    off = nominal - base - middle[cell, 0]
    fraction = middle - np.floor(middle) + drifts  # of samples whose block is in the middle of a cell
    begin = base.astype(np.intp) - half + 1
    done = (off >= -fraction.min(1)[cell]) & (off < 1 - fraction.max(1)[cell])  # samples between the same two scans
    done &= (begin >= 0) & (begin + span <= n_scans)
    if np.isnan(columns.sum()):
        before = np.append(0, np.cumsum(np.isnan(columns.sum(0))))
        done[done] = before[begin[done] + span] == before[begin[done]]
    windows = sliding_window_view(columns, span, axis=1)
    blocks = out[:, : n_blocks * _BLOCK].reshape(len(columns), n_blocks, _BLOCK)
    edges = np.flatnonzero(np.diff(np.where(done, cell, -1), prepend=-2, append=-2)).tolist()
    for start, end in itertools.pairwise(edges):
        for place in range(start, end if done[start] else start, _BLOCKS):
            some = slice(place, min(place + _BLOCKS, end))
            x = (off[some] + drifts[:, None, None]) / _REACH
            scans = windows[:, begin[some]]
            terms = (bank[cell[start]] @ scans.reshape(-1, span).T).reshape(_TERMS, _BLOCK, *scans.shape[:2])
            sums = terms[-1]
            for k in range(_TERMS - 2, -1, -1):  # Horner's scheme
                sums *= x
                sums += terms[k]
            blocks[:, some] = sums.transpose(1, 2, 0)
    return np.asarray(done)


@lru_cache
def _bank(ratio: float) -> FloatArray:
    """Return the weights of a block's scans for each term of each sample, (n_cells, _TERMS * _BLOCK, span).

    The span begins `half_taps` - 1 scans before the one at or before the block's first sample. The polynomials hold
    while each sample is between the same two scans as in the middle of the cell.
    """
    half = half_taps(ratio)
    node = _REACH * np.cos(np.pi * (np.arange(_TERMS) + 0.5) / _TERMS)  # Chebyshev's
    to_terms = np.linalg.inv(np.vander(node / _REACH, increasing=True))
    centre = _middle(ratio)
    lowest = np.floor(centre).astype(np.intp)
    fraction, same = np.unique(np.round(centre - lowest, 12), return_inverse=True)
    tap = np.arange(1 - half, half + 1)
    weight = _kernel(fraction[:, None, None] + node[:, None] - tap, ratio)  # (n_fractions, n_nodes, n_taps)
    weight = np.einsum("kn,fnt->fkt", to_terms, weight)[same.reshape(centre.shape)]
    bank = np.zeros((_CELLS, _TERMS, _BLOCK, int(lowest.max()) + len(tap)))
    for k in range(_BLOCK):
        for cell in range(_CELLS):
            begin = lowest[cell, k]
            bank[cell, :, k, begin : begin + len(tap)] = weight[cell, k]
    return bank.reshape(_CELLS, _TERMS * _BLOCK, -1)


def _middle(ratio: float) -> FloatArray:
    """Return the evenly spaced positions of a block in the middle of each cell (n_cells, _BLOCK) [scans]."""
    return np.asarray((np.arange(_CELLS)[:, None] + 0.5) / _CELLS + np.arange(_BLOCK) / ratio)


def _kernel(x: FloatArray, ratio: float) -> FloatArray:
    """Return the weights of scans at distances (..., n_taps) [scans], of sum 1; slightly beyond its ends as well."""
    z = _BETA**2 * (1 - (x / half_taps(ratio)) ** 2)
    window = np.i0(np.sqrt(np.maximum(z, 0)))
    beyond = np.minimum(z, 0)  # the series of the same function
    window += beyond / 4 * (1 + beyond / 16 * (1 + beyond / 36 * (1 + beyond / 64)))
    weight = np.sinc(ratio * x) * window
    return np.asarray(weight / weight.sum(-1, keepdims=True))


@lru_cache
def _table(ratio: float) -> tuple[FloatArray, FloatArray]:
    """Return the weights (phases + 1, taps) of a low-pass at the Nyquist frequency of a grid `ratio` times as fast.

    And their differences from phase to phase (phases, taps).
    """
    half = half_taps(ratio)
    table = _kernel(np.linspace(0, 1, _PHASES + 1)[:, None] - np.arange(1 - half, half + 1), ratio)
    return table, np.diff(table, axis=0)


def _one_by_one(columns: FloatArray, position: FloatArray, ratio: float) -> FloatArray:
    """Return samples (n_axes, n) at any positions."""
    (table, slopes), half = _table(ratio), half_taps(ratio)
    out = np.empty((len(columns), len(position)))
    windows = [sliding_window_view(column, 2 * half) for column in columns]
    for start in range(0, len(position), _CHUNK):
        part = position[start : start + _CHUNK]
        base: IndexArray = np.floor(part).astype(np.intp)
        phase = (part - base) * _PHASES
        row = np.minimum(phase.astype(np.intp), _PHASES - 1)
        weight = slopes[row]
        weight *= (phase - row)[:, None]
        weight += table[row]
        for window, row_out in zip(windows, out[:, start : start + len(part)], strict=True):
            np.einsum("nt,nt->n", window[base - half + 1], weight, out=row_out)
    return out
