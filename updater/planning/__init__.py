"""Pre-test planning: expected errors, detectability, record length, sensor placement."""

from updater.planning.detectability import Outlook, Stretches, blind, foresee, heaviest, with_sensors
from updater.planning.expected_reference import UNSEEN, largest_motion, motion, seen_by
from updater.planning.mode_visibility import ALIKE, Sight, clearer, look
from updater.planning.record_length import Foresight, Target
from updater.planning.record_noise import Record
from updater.planning.sensor_placement import Choice, ever_fewer, one_more, vagueness
from updater.planning.target_mass import Plan, SensorSet, plan

__all__ = [
    "ALIKE",
    "UNSEEN",
    "Choice",
    "Foresight",
    "Outlook",
    "Plan",
    "Record",
    "SensorSet",
    "Sight",
    "Stretches",
    "Target",
    "blind",
    "clearer",
    "ever_fewer",
    "foresee",
    "heaviest",
    "largest_motion",
    "look",
    "motion",
    "one_more",
    "plan",
    "seen_by",
    "vagueness",
    "with_sensors",
]
