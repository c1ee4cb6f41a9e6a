"""Bounds of model parameters as given by an option."""

from monitor.errors import ArgumentError


def bound_of(text: str) -> tuple[str, tuple[float, float]]:
    """Return name and bounds of a parameter, written as `steel.E=200e9:215e9`.

    Raises
    ------
    ArgumentError
        If the text is not written like that.
    """
    name, _, limits = text.rpartition("=")
    least, _, greatest = limits.partition(":")
    try:
        values = float(least), float(greatest)
    except ValueError:
        values = 1.0, 0.0
    if not name or not 0 < values[0] < values[1]:
        raise ArgumentError("--bound", f"expected NAME=MIN:MAX, such as steel.E=200e9:215e9, found {text!r}")
    return name, values
