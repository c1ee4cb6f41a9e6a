"""Selection of causes, channels, modes and parameters from the options of a command."""

from collections.abc import Sequence

from monitor.analysis.selection import Selection
from monitor.errors import ArgumentError


def selection_of(
    only: Sequence[str] | None,
    without: Sequence[str] | None,
    channels: Sequence[str] | None,
    modes: Sequence[float] | None,
    fixed: Sequence[str] | None,
    bounds: Sequence[str] | None,
) -> Selection:
    """Return the selection by the options.

    Raises
    ------
    ArgumentError
        If a bound or a frequency is not written as it should be.
    """
    for hertz in modes or ():
        if not hertz > 0:
            raise ArgumentError("--without-mode", f"expected a positive frequency in Hz, found {hertz:g}")
    return Selection(
        only=tuple(only or ()),
        without=tuple(without or ()),
        without_channels=tuple(channels or ()),
        without_modes=tuple(modes or ()),
        fixed=tuple(fixed or ()),
        bounds=dict(map(_bound, bounds or ())),
    )


def _bound(text: str) -> tuple[str, tuple[float, float]]:
    """Read such as `steel.E=200e9:215e9`."""
    name, _, limits = text.rpartition("=")
    least, _, greatest = limits.partition(":")
    try:
        values = float(least), float(greatest)
    except ValueError:
        values = 1.0, 0.0
    if not name or not 0 < values[0] < values[1]:
        raise ArgumentError("--bound", f"expected NAME=MIN:MAX, such as steel.E=200e9:215e9, found {text!r}")
    return name, values
