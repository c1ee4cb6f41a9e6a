"""Measured modes of many windows: tracked, averaged, checked, matched, freed from device delays."""

from typing import TYPE_CHECKING

from daq.lazy_names import lazy_names

if TYPE_CHECKING:
    from updater.modal_data.averaging import MIN_PRESENCE, FusedModes, choose_tracks, fuse, merge_setups
    from updater.modal_data.conditions import NOTHING_KNOWN, Circumstances, Trend, tone_ratios, trend_of
    from updater.modal_data.delay_removal import (
        NOTHING_REMOVED,
        SynchronizedWindows,
        remove_device_delays,
        without_known,
    )
    from updater.modal_data.device_delays import (
        NO_DELAYS,
        DeviceDelays,
        estimate_delays,
        learn_delays,
        real_shape,
        remove_delays,
    )
    from updater.modal_data.mass_from_modes import ModalMass, mass_of_modes
    from updater.modal_data.matching import match_modes, matched, may_answer, without_fault
    from updater.modal_data.plausibility import check_baseline, check_event, check_unit, doubles
    from updater.modal_data.scatter import (
        USUAL_OVERDISPERSION,
        BaselineModes,
        Scatter,
        learn_baseline_modes,
        learn_scatter,
        stated_scatter,
    )
    from updater.modal_data.states.change_point import ChangePoint, find_change, windows_of_one_state
    from updater.modal_data.states.course import Course, find_course
    from updater.modal_data.states.stationarity import is_steady
    from updater.modal_data.synchrony import LOW_MPC, Asynchrony, asynchrony
    from updater.modal_data.tracked import COMMON_STD, ModalMean, TrackedModes, mean_modes, stack_tracks
else:
    __getattr__, __dir__ = lazy_names(__name__, __file__)

__all__ = [
    "COMMON_STD",
    "LOW_MPC",
    "MIN_PRESENCE",
    "NOTHING_KNOWN",
    "NOTHING_REMOVED",
    "NO_DELAYS",
    "USUAL_OVERDISPERSION",
    "Asynchrony",
    "BaselineModes",
    "ChangePoint",
    "Circumstances",
    "Course",
    "DeviceDelays",
    "FusedModes",
    "ModalMass",
    "ModalMean",
    "Scatter",
    "SynchronizedWindows",
    "TrackedModes",
    "Trend",
    "asynchrony",
    "check_baseline",
    "check_event",
    "check_unit",
    "choose_tracks",
    "doubles",
    "estimate_delays",
    "find_change",
    "find_course",
    "fuse",
    "is_steady",
    "learn_baseline_modes",
    "learn_delays",
    "learn_scatter",
    "mass_of_modes",
    "match_modes",
    "matched",
    "may_answer",
    "mean_modes",
    "merge_setups",
    "real_shape",
    "remove_delays",
    "remove_device_delays",
    "stack_tracks",
    "stated_scatter",
    "tone_ratios",
    "trend_of",
    "windows_of_one_state",
    "without_fault",
    "without_known",
]
