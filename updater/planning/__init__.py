"""Pre-test planning: expected errors, detectability, record length, sensor placement."""

from typing import TYPE_CHECKING

from daq.lazy_names import lazy_names

if TYPE_CHECKING:
    from updater.planning.detectability import DetectabilityStudy as DetectabilityStudy
    from updater.planning.detectability import Stretches as Stretches
    from updater.planning.detectability import blind as blind
    from updater.planning.detectability import heaviest as heaviest
    from updater.planning.detectability import study_detectability as study_detectability
    from updater.planning.expected_reference import motion as motion
    from updater.planning.expected_reference import seen_by as seen_by
    from updater.planning.mode_visibility import ALIKE as ALIKE
    from updater.planning.mode_visibility import ModeVisibility as ModeVisibility
    from updater.planning.mode_visibility import clearer as clearer
    from updater.planning.mode_visibility import look as look
    from updater.planning.record_length import LocalizationSimulation as LocalizationSimulation
    from updater.planning.record_length import Target as Target
    from updater.planning.record_noise import Record as Record
    from updater.planning.sensor_placement import Choice as Choice
    from updater.planning.sensor_placement import backward_elimination as backward_elimination
    from updater.planning.sensor_placement import best_additional_sensor as best_additional_sensor
    from updater.planning.sensor_placement import mean_position_std as mean_position_std
    from updater.planning.target_mass import Plan as Plan
    from updater.planning.target_mass import SensorSet as SensorSet
    from updater.planning.target_mass import plan as plan
else:
    __getattr__, __dir__, __all__ = lazy_names(__name__, __file__)
