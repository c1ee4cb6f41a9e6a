"""Measured modes of many windows: tracked, averaged, checked, matched, freed from device delays."""

from typing import TYPE_CHECKING

from daq.lazy_names import lazy_names

if TYPE_CHECKING:
    from updater.modal_data.averaging import MIN_PRESENCE as MIN_PRESENCE
    from updater.modal_data.averaging import FusedModes as FusedModes
    from updater.modal_data.averaging import choose_tracks as choose_tracks
    from updater.modal_data.averaging import fuse as fuse
    from updater.modal_data.averaging import merge_setups as merge_setups
    from updater.modal_data.conditions import NOTHING_KNOWN as NOTHING_KNOWN
    from updater.modal_data.conditions import Circumstances as Circumstances
    from updater.modal_data.conditions import Effort as Effort
    from updater.modal_data.conditions import KnownMass as KnownMass
    from updater.modal_data.conditions import Mixing as Mixing
    from updater.modal_data.conditions import OpeningEvidence as OpeningEvidence
    from updater.modal_data.conditions import Signals as Signals
    from updater.modal_data.conditions import Sites as Sites
    from updater.modal_data.conditions import Trend as Trend
    from updater.modal_data.conditions import tone_ratios as tone_ratios
    from updater.modal_data.conditions import trend_of as trend_of
    from updater.modal_data.delay_removal import LOW_MPC as LOW_MPC
    from updater.modal_data.delay_removal import NOTHING_REMOVED as NOTHING_REMOVED
    from updater.modal_data.delay_removal import Asynchrony as Asynchrony
    from updater.modal_data.delay_removal import SynchronizedWindows as SynchronizedWindows
    from updater.modal_data.delay_removal import asynchrony as asynchrony
    from updater.modal_data.delay_removal import remove_device_delays as remove_device_delays
    from updater.modal_data.delay_removal import without_known as without_known
    from updater.modal_data.device_delays import NO_DELAYS as NO_DELAYS
    from updater.modal_data.device_delays import DeviceDelays as DeviceDelays
    from updater.modal_data.device_delays import estimate_delays as estimate_delays
    from updater.modal_data.device_delays import learn_delays as learn_delays
    from updater.modal_data.device_delays import real_shape as real_shape
    from updater.modal_data.device_delays import remove_delays as remove_delays
    from updater.modal_data.mass_from_modes import ModalMass as ModalMass
    from updater.modal_data.mass_from_modes import mass_of_modes as mass_of_modes
    from updater.modal_data.matching import FREQUENCY_WEIGHT as FREQUENCY_WEIGHT
    from updater.modal_data.matching import match_modes as match_modes
    from updater.modal_data.matching import matched as matched
    from updater.modal_data.matching import may_answer as may_answer
    from updater.modal_data.matching import without_fault as without_fault
    from updater.modal_data.plausibility import check_baseline as check_baseline
    from updater.modal_data.plausibility import check_event as check_event
    from updater.modal_data.plausibility import check_unit as check_unit
    from updater.modal_data.plausibility import doubles as doubles
    from updater.modal_data.plausibility import doubles_since as doubles_since
    from updater.modal_data.scatter import USUAL_OVERDISPERSION as USUAL_OVERDISPERSION
    from updater.modal_data.scatter import BaselineModes as BaselineModes
    from updater.modal_data.scatter import Scatter as Scatter
    from updater.modal_data.scatter import learn_baseline_modes as learn_baseline_modes
    from updater.modal_data.scatter import learn_scatter as learn_scatter
    from updater.modal_data.scatter import stated_scatter as stated_scatter
    from updater.modal_data.states.change_point import ChangePoint as ChangePoint
    from updater.modal_data.states.change_point import find_change as find_change
    from updater.modal_data.states.change_point import windows_of_one_state as windows_of_one_state
    from updater.modal_data.states.course import Course as Course
    from updater.modal_data.states.course import find_course as find_course
    from updater.modal_data.states.stationarity import is_steady as is_steady
    from updater.modal_data.tracked import COMMON_STD as COMMON_STD
    from updater.modal_data.tracked import ModalMean as ModalMean
    from updater.modal_data.tracked import TrackedModes as TrackedModes
    from updater.modal_data.tracked import mean_modes as mean_modes
    from updater.modal_data.tracked import stack_tracks as stack_tracks
else:
    __getattr__, __dir__, __all__ = lazy_names(__name__, __file__)
