"""Recordings in, modes with uncertainty out: operational modal analysis without a user."""

from oma.alignment import aligned, channel_delays, device_delays
from oma.conditioning import channel_faults
from oma.efdd import EFDD
from oma.errors import (
    IdentificationError,
    InputError,
    NoCommonModes,
    NumericalFault,
    OmaError,
    TooFewChannels,
    TooFewModes,
    TooShort,
)
from oma.estimate import ComplexArray, ModalEstimate
from oma.faults import SAME_AS, ChannelFault, FaultKind
from oma.fdd import FDD
from oma.following import Followed, Follower
from oma.frequency_response import Resonance, fit_resonance
from oma.fsdd import FSDD
from oma.identification import METHODS, Identification, IdentificationStream, identify, identify_all
from oma.mac import comac, mac, mac_matrix, mpc, mpd, normalise
from oma.merging import match_setups, merge
from oma.methods import Method
from oma.pairing import mac_of_moving, pair_modes
from oma.plscf import PLSCF
from oma.pyramid import ALIAS_FREE, PASS, TOP
from oma.quality import WindowQuality
from oma.selection import Selection, uncertainty_law
from oma.spectra import singular_values
from oma.ssi import CovarianceSSI, DataSSI
from oma.stabilization import Stabilization
from oma.tracking import Tracker
from oma.tracks import Tracks
from oma.universal import Place, places_by_name, write_universal

__all__ = [
    "ALIAS_FREE",
    "EFDD",
    "FDD",
    "FSDD",
    "METHODS",
    "PASS",
    "PLSCF",
    "SAME_AS",
    "TOP",
    "ChannelFault",
    "ComplexArray",
    "CovarianceSSI",
    "DataSSI",
    "FaultKind",
    "Followed",
    "Follower",
    "Identification",
    "IdentificationError",
    "IdentificationStream",
    "InputError",
    "Method",
    "ModalEstimate",
    "NoCommonModes",
    "NumericalFault",
    "OmaError",
    "Place",
    "Resonance",
    "Selection",
    "Stabilization",
    "TooFewChannels",
    "TooFewModes",
    "TooShort",
    "Tracker",
    "Tracks",
    "WindowQuality",
    "aligned",
    "channel_delays",
    "channel_faults",
    "comac",
    "device_delays",
    "fit_resonance",
    "identify",
    "identify_all",
    "mac",
    "mac_matrix",
    "mac_of_moving",
    "match_setups",
    "merge",
    "mpc",
    "mpd",
    "normalise",
    "pair_modes",
    "places_by_name",
    "singular_values",
    "uncertainty_law",
    "write_universal",
]
