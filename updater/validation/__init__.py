"""Test-analysis correlation: modes, residual forces, virtual sensors, sensor health."""

from typing import TYPE_CHECKING

from daq.lazy_names import lazy_names

if TYPE_CHECKING:
    from updater.validation.channel_health import SensorHealth, sensor_health, with_acting
    from updater.validation.modal_correlation import (
        ModalCorrelation,
        as_written,
        correlate_modes,
        modes_before,
        modes_with_causes,
    )
    from updater.validation.residual_forces import ForceBalance, force_balance
    from updater.validation.response.fatigue import StressCycles, count_cycles, damage_rate
    from updater.validation.response.kalman_filter import ModalKalmanFilter
    from updater.validation.response.modal_system import MotionQuantity
    from updater.validation.response.response_model import Point, ResponseEstimate, ResponseModel
    from updater.validation.response.section_stress import Fibre, edge_fibres
    from updater.validation.shape_expansion import (
        ModelModes,
        ModelPartner,
        expand_measured,
        model_modes,
    )
    from updater.validation.virtual_sensors import VirtualSensing, virtual_sensing
else:
    __getattr__, __dir__ = lazy_names(__name__, __file__)

__all__ = [
    "Fibre",
    "ForceBalance",
    "ModalCorrelation",
    "ModalKalmanFilter",
    "ModelModes",
    "ModelPartner",
    "MotionQuantity",
    "Point",
    "ResponseEstimate",
    "ResponseModel",
    "SensorHealth",
    "StressCycles",
    "VirtualSensing",
    "as_written",
    "correlate_modes",
    "count_cycles",
    "damage_rate",
    "edge_fibres",
    "expand_measured",
    "force_balance",
    "model_modes",
    "modes_before",
    "modes_with_causes",
    "sensor_health",
    "virtual_sensing",
    "with_acting",
]
