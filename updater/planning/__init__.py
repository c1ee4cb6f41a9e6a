"""Pre-test planning: expected errors, detectability, record length, sensor placement."""

from typing import TYPE_CHECKING

from daq.lazy_names import lazy_names

if TYPE_CHECKING:
    from updater.planning.detectability import (
        DetectabilityStudy,
        Stretches,
        blind,
        heaviest,
        study_detectability,
    )
    from updater.planning.expected_reference import motion, seen_by
    from updater.planning.mode_visibility import ALIKE, ModeVisibility, clearer, look
    from updater.planning.record_length import LocalizationSimulation, Target
    from updater.planning.record_noise import Record
    from updater.planning.sensor_placement import (
        Choice,
        backward_elimination,
        best_additional_sensor,
        mean_position_std,
    )
    from updater.planning.target_mass import Plan, SensorSet, plan
else:
    __getattr__, __dir__ = lazy_names(__name__, __file__)

__all__ = [
    "ALIKE",
    "Choice",
    "DetectabilityStudy",
    "LocalizationSimulation",
    "ModeVisibility",
    "Plan",
    "Record",
    "SensorSet",
    "Stretches",
    "Target",
    "backward_elimination",
    "best_additional_sensor",
    "blind",
    "clearer",
    "heaviest",
    "look",
    "mean_position_std",
    "motion",
    "plan",
    "seen_by",
    "study_detectability",
]
