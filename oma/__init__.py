"""Recordings in, modes with uncertainty out: operational modal analysis without a user."""

from typing import TYPE_CHECKING

from daq.lazy_names import lazy_names
from oma.mac import comac, mac, mac_matrix, mpc, mpd, normalise  # not lazily: a function and its module have one name

if TYPE_CHECKING:
    from oma.errors import IdentificationError, NoCommonModes, OmaError, TooShort
    from oma.identification import METHODS, Identification, IdentificationStream, identify, identify_all
    from oma.methods import EFDD, FDD, FSDD, PLSCF, CovarianceSSI, DataSSI, Method
    from oma.preparation import ChannelFault, WindowQuality, channel_faults
    from oma.responses import ResponseIdentification, identify_responses, identify_responses_all
    from oma.spectral import Resonance, aligned, device_delays, fit_resonance, singular_values
    from oma.tracking import FollowedModes, LongTermTracker, Tracker, Tracks, match_setups, merge, pair_modes
    from oma.types import ComplexArray, ModalEstimate
    from oma.uff import Place, node_motion, places_by_name, write_universal
else:
    __getattr__, __dir__ = lazy_names(__name__, __file__)

__all__ = [
    "EFDD",
    "FDD",
    "FSDD",
    "METHODS",
    "PLSCF",
    "ChannelFault",
    "ComplexArray",
    "CovarianceSSI",
    "DataSSI",
    "FollowedModes",
    "Identification",
    "IdentificationError",
    "IdentificationStream",
    "LongTermTracker",
    "Method",
    "ModalEstimate",
    "NoCommonModes",
    "OmaError",
    "Place",
    "Resonance",
    "ResponseIdentification",
    "TooShort",
    "Tracker",
    "Tracks",
    "WindowQuality",
    "aligned",
    "channel_faults",
    "comac",
    "device_delays",
    "fit_resonance",
    "identify",
    "identify_all",
    "identify_responses",
    "identify_responses_all",
    "mac",
    "mac_matrix",
    "match_setups",
    "merge",
    "mpc",
    "mpd",
    "node_motion",
    "normalise",
    "pair_modes",
    "places_by_name",
    "singular_values",
    "write_universal",
]
