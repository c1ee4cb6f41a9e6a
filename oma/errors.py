"""Errors of identification.

OmaError
├── IdentificationError     the recording does not allow an estimate
│   ├── TooFewChannels      fewer usable channels than needed
│   ├── TooShort            fewer samples than needed
│   ├── TooFewModes         nothing in the recording passed for a mode
│   └── NumericalFault      a decomposition failed: an internal fault, not the recording's
├── NoCommonModes           set-ups have no mode in common that could be merged
└── InputError              arguments that do not fit the recordings (a ValueError as well)
"""

from daq.errors import OneLineError


class OmaError(OneLineError):
    """Base class of the errors of operational modal analysis."""


class IdentificationError(OmaError):
    """The recording does not allow an estimate."""


class TooFewChannels(IdentificationError):  # noqa: N818
    """Too few channels carry a signal.

    Parameters
    ----------
    usable : tuple of str
        Channels that carry a signal.
    needed : int
        Smallest number that would do.
    dropped : dict
        The other channels and what is wrong with each.
    """

    def __init__(self, usable: tuple[str, ...], needed: int, dropped: dict[str, str]) -> None:
        alike: dict[str, list[str]] = {}
        for name, why in dropped.items():
            alike.setdefault(why, []).append(name)
        reasons = "; ".join(f"{', '.join(names)}: {why}" for why, names in alike.items())
        super().__init__(f"{len(usable)} usable channels, {needed} needed ({reasons or 'none dropped'})")
        self.usable = usable
        self.needed = needed
        self.dropped = dropped


class TooShort(IdentificationError):  # noqa: N818
    """The recording is too short.

    Parameters
    ----------
    found, needed : float
        Length of the recording and the smallest that would do [s].
    """

    def __init__(self, found: float, needed: float) -> None:
        super().__init__(f"recording of {found:.3g} s is too short: at least {needed:.3g} s are needed")
        self.found = found
        self.needed = needed


class TooFewModes(IdentificationError):  # noqa: N818
    """No pole passed for a mode.

    Parameters
    ----------
    n_poles : int
        Poles that were looked at.
    """

    def __init__(self, n_poles: int) -> None:
        super().__init__(f"none of {n_poles} poles is a mode: no resonance is visible in the recording")
        self.n_poles = n_poles


class NumericalFault(IdentificationError):  # noqa: N818
    """A matrix could not be decomposed."""

    def __init__(self, message: str) -> None:
        super().__init__(f"internal error in the identification: {message}")


class InputError(OmaError, ValueError):
    """Arguments that do not fit the recordings: a band, the channels of set-ups."""


class NoCommonModes(OmaError):  # noqa: N818
    """No mode is seen in all set-ups.

    Parameters
    ----------
    n_setups : int
    n_modes : list of int
        Number of modes identified in each set-up.
    """

    def __init__(self, n_setups: int, n_modes: list[int]) -> None:
        super().__init__(f"none of the modes ({', '.join(map(str, n_modes))}) is identified in all {n_setups} set-ups")
        self.n_setups = n_setups
        self.n_modes = n_modes
