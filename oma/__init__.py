"""Recordings in, modes with uncertainty out: operational modal analysis without a user."""

from oma.errors import IdentificationError, OmaError, TooFewChannels, TooFewModes, TooShort
from oma.estimate import ComplexArray, ModalEstimate
from oma.identification import Identification, identify, identify_all
from oma.mac import mac, mac_matrix, mpc, mpd, normalise
from oma.selection import Selection
from oma.ssi import CovarianceSSI
from oma.stabilization import Stabilization

__all__ = [
    "ComplexArray",
    "CovarianceSSI",
    "Identification",
    "IdentificationError",
    "ModalEstimate",
    "OmaError",
    "Selection",
    "Stabilization",
    "TooFewChannels",
    "TooFewModes",
    "TooShort",
    "identify",
    "identify_all",
    "mac",
    "mac_matrix",
    "mpc",
    "mpd",
    "normalise",
]
