"""Frequencies and bounds of parameters as given by options."""

from collections.abc import Sequence

from monitor.errors import ArgumentError


def frequencies_of(modes: Sequence[float]) -> tuple[float, ...]:
    """Return the frequencies of modes to leave out [Hz].

    Raises
    ------
    ArgumentError
        If one is not positive.
    """
    for hertz in modes:
        if not hertz > 0:
            raise ArgumentError("--without-mode", f"expected a positive frequency in Hz, found {hertz:g}")
    return tuple(modes)


def bounds_of(texts: Sequence[str]) -> dict[str, tuple[float, float]]:
    """Return bounds of parameters, each written as `steel.E=200e9:215e9`.

    Raises
    ------
    ArgumentError
        If one is not written like that.
    """
    return dict(map(_bound, texts))


def _bound(text: str) -> tuple[str, tuple[float, float]]:
    name, _, limits = text.rpartition("=")
    least, _, greatest = limits.partition(":")
    try:
        values = float(least), float(greatest)
    except ValueError:
        values = 1.0, 0.0
    if not name or not 0 < values[0] < values[1]:
        raise ArgumentError("--bound", f"expected NAME=MIN:MAX, such as steel.E=200e9:215e9, found {text!r}")
    return name, values
