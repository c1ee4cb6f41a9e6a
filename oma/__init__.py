"""Recordings in, modes with uncertainty out: operational modal analysis without a user."""

from typing import TYPE_CHECKING

from daq.lazy_names import lazy_names
from oma.mac import comac as comac
from oma.mac import mac as mac
from oma.mac import mac_matrix as mac_matrix
from oma.mac import mpc as mpc
from oma.mac import mpd as mpd
from oma.mac import normalise as normalise

if TYPE_CHECKING:
    from oma.errors import IdentificationError as IdentificationError
    from oma.errors import NoCommonModes as NoCommonModes
    from oma.errors import OmaError as OmaError
    from oma.errors import TooShort as TooShort
    from oma.identification import METHODS as METHODS
    from oma.identification import Identification as Identification
    from oma.identification import IdentificationStream as IdentificationStream
    from oma.identification import identify as identify
    from oma.identification import identify_all as identify_all
    from oma.identification import least_frequency as least_frequency
    from oma.identification import shortest_duration as shortest_duration
    from oma.methods import EFDD as EFDD
    from oma.methods import FDD as FDD
    from oma.methods import FSDD as FSDD
    from oma.methods import PLSCF as PLSCF
    from oma.methods import CovarianceSSI as CovarianceSSI
    from oma.methods import DataSSI as DataSSI
    from oma.methods import Method as Method
    from oma.preparation import ChannelFault as ChannelFault
    from oma.preparation import WindowQuality as WindowQuality
    from oma.preparation import channel_faults as channel_faults
    from oma.responses import ResponseIdentification as ResponseIdentification
    from oma.responses import identify_responses as identify_responses
    from oma.responses import identify_responses_all as identify_responses_all
    from oma.spectral import AmplitudeDependence as AmplitudeDependence
    from oma.spectral import Resonance as Resonance
    from oma.spectral import aligned as aligned
    from oma.spectral import dependence_on_amplitude as dependence_on_amplitude
    from oma.spectral import device_delays as device_delays
    from oma.spectral import fit_resonance as fit_resonance
    from oma.spectral import plot_spectrum as plot_spectrum
    from oma.spectral import singular_values as singular_values
    from oma.tracking import FollowedModes as FollowedModes
    from oma.tracking import LongTermTracker as LongTermTracker
    from oma.tracking import Tracker as Tracker
    from oma.tracking import Tracks as Tracks
    from oma.tracking import match_setups as match_setups
    from oma.tracking import merge as merge
    from oma.tracking import pair_modes as pair_modes
    from oma.tracking import plot_tracks as plot_tracks
    from oma.types import ComplexArray as ComplexArray
    from oma.types import ModalEstimate as ModalEstimate
    from oma.types import Stabilization as Stabilization
    from oma.uff import Place as Place
    from oma.uff import node_motion as node_motion
    from oma.uff import places_by_name as places_by_name
    from oma.uff import write_universal as write_universal
else:
    __getattr__, __dir__, __all__ = lazy_names(__name__, __file__)
