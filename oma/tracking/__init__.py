"""Identities of modes over time and over set-ups."""

from oma.tracking.long_term import FollowedModes as FollowedModes
from oma.tracking.long_term import LongTermTracker as LongTermTracker
from oma.tracking.merging import match_setups as match_setups
from oma.tracking.merging import merge as merge
from oma.tracking.pairing import mac_of_moving as mac_of_moving
from oma.tracking.pairing import pair_modes as pair_modes
from oma.tracking.track_state import Tracks as Tracks
from oma.tracking.tracker import Tracker as Tracker
from oma.tracking.tracks_plot import plot_tracks as plot_tracks
