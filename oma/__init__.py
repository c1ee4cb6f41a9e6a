"""Recordings in, modes with uncertainty out: operational modal analysis without a user."""

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
from oma.identification import METHODS, Identification, IdentificationStream, identify, identify_all
from oma.mac import comac, mac, mac_matrix, mpc, mpd, normalise
from oma.methods.base import Method
from oma.methods.efdd import EFDD
from oma.methods.fdd import FDD
from oma.methods.fsdd import FSDD
from oma.methods.plscf import PLSCF
from oma.methods.ssi import CovarianceSSI, DataSSI
from oma.preparation.conditioning import channel_faults
from oma.preparation.faults import SAME_AS, ChannelFault, FaultKind
from oma.preparation.pyramid import ALIAS_FREE, PASS, TOP
from oma.preparation.quality import WindowQuality
from oma.selection.selection import Selection, uncertainty_law
from oma.selection.stabilization import Stabilization
from oma.spectral.device_alignment import aligned, channel_delays, device_delays
from oma.spectral.frequency_response import Resonance, fit_resonance
from oma.spectral.spectra import singular_values
from oma.tracking.long_term import Followed, Follower
from oma.tracking.merging import match_setups, merge
from oma.tracking.pairing import mac_of_moving, pair_modes
from oma.tracking.track_state import Tracks
from oma.tracking.tracker import Tracker
from oma.types import ComplexArray, ModalEstimate
from oma.uff import Place, places_by_name, write_universal

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
