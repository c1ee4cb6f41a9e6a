"""Lengths of fast Fourier transforms."""

from collections.abc import Sequence
from functools import lru_cache
from itertools import count

_OF_REAL, _OF_COMPLEX = (2, 3, 5), (2, 3, 5, 7, 11)  # factors that numpy's transforms have code for


@lru_cache(maxsize=256)
def fast_length(n: int, *, real: bool = False) -> int:
    """Return the smallest length from n on that is a product of small primes; fewer of them for real signals.

    Raises
    ------
    ValueError
        If n is not positive.
    """
    if n < 1:
        raise ValueError(f"length of a transform: expected at least 1, found {n}")
    primes = _OF_REAL if real else _OF_COMPLEX
    return next(length for length in count(n) if _without(length, primes) == 1)


def _without(n: int, primes: Sequence[int]) -> int:
    """Return a number without these prime factors."""
    for prime in primes:
        while n % prime == 0:
            n //= prime
    return n
