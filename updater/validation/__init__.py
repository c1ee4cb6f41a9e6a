"""Test-analysis correlation: modes, residual forces, virtual sensors, sensor health."""

from updater.validation.acting_causes import with_acting
from updater.validation.channel_health import SensorHealth, sensor_health
from updater.validation.modal_correlation import Discrepancy, as_before, as_extended, as_written, set_beside
from updater.validation.model_pairing import ModelModes, ModelPartner, model_modes
from updater.validation.residual_forces import ForceBalance, force_balance
from updater.validation.virtual_sensors import VirtualSensing, virtual_sensing

__all__ = [
    "Discrepancy",
    "ForceBalance",
    "ModelModes",
    "ModelPartner",
    "SensorHealth",
    "VirtualSensing",
    "as_before",
    "as_extended",
    "as_written",
    "force_balance",
    "model_modes",
    "sensor_health",
    "set_beside",
    "virtual_sensing",
    "with_acting",
]
