"""Checks of a sampling rate, common to drivers."""

from collections.abc import Collection

from daq.drivers.addresses import CanPlace


def known_rate(rate: float, known: Collection[int], place: str | CanPlace) -> int:
    """Return a rate that a device at a place has [Hz].

    Raises
    ------
    ValueError
        If it has no such rate.
    """
    if rate not in known:
        raise ValueError(f"rate of {place}: expected one of {sorted(known)} Hz, found {rate:g}")
    return int(rate)


def positive_rate(rate: float, place: str | CanPlace) -> float:
    """Return a rate of a device at a place that has any [Hz].

    Raises
    ------
    ValueError
        If it is not positive.
    """
    if not rate > 0:
        raise ValueError(f"rate of {place}: expected a positive number of Hz, found {rate:g}")
    return rate
