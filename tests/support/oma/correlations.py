"""Correlations of one recording, block by block."""

from collections.abc import Sequence

import numpy as np

from daq import FloatArray
from oma.spectral.correlation import CorrelationAccumulator, CorrelationSums


def correlation_sums(
    data: FloatArray, n_lags: int, n_blocks: int, references: Sequence[int] | None = None
) -> CorrelationSums:
    """Sum lagged products of all channels (n_samples, n_channels) with the references, in blocks of equal length."""
    accumulator = CorrelationAccumulator(data.shape[1], n_lags, references)
    for block in np.array_split(data, n_blocks):
        accumulator.add(block)
    return accumulator.sums
