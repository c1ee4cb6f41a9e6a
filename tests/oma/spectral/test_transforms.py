"""Lengths of transforms."""

import numpy as np
import pytest
import scipy

from oma.spectral import fast_length


def test_fast_lengths_are_those_of_scipy() -> None:
    random = np.random.default_rng(0)
    for n in [*range(1, 600), *random.integers(600, 1_000_000, 100).tolist()]:
        assert fast_length(n) == scipy.fft.next_fast_len(n)
        assert fast_length(n, real=True) == scipy.fft.next_fast_len(n, real=True)


@pytest.mark.parametrize("n", [0, -4])
def test_length_that_is_not_positive_is_an_error(n: int) -> None:
    with pytest.raises(ValueError, match=f"expected at least 1, found {n}"):
        fast_length(n)
