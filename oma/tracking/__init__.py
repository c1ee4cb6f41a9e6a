"""Identities of modes over time and over set-ups."""

from oma.tracking.long_term import FollowedModes, LongTermTracker
from oma.tracking.merging import match_setups, merge
from oma.tracking.pairing import mac_of_moving, pair_modes
from oma.tracking.track_state import Tracks
from oma.tracking.tracker import Tracker

__all__ = [
    "FollowedModes",
    "LongTermTracker",
    "Tracker",
    "Tracks",
    "mac_of_moving",
    "match_setups",
    "merge",
    "pair_modes",
]
