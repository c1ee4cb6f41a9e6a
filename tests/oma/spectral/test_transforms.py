"""Lengths of transforms."""

import numpy as np
import scipy

from oma.spectral import fast_length


def test_fast_lengths_are_those_of_scipy() -> None:
    random = np.random.default_rng(0)
    for n in [*range(1, 600), *random.integers(600, 1_000_000, 100).tolist()]:
        assert fast_length(n) == scipy.fft.next_fast_len(n)
        assert fast_length(n, real=True) == scipy.fft.next_fast_len(n, real=True)
