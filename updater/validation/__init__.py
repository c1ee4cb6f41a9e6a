"""Test-analysis correlation: modes, residual forces, virtual sensors, sensor health."""

from typing import TYPE_CHECKING

from daq.lazy_names import lazy_names

if TYPE_CHECKING:
    from updater.validation.breathing_crack import breathing as breathing
    from updater.validation.breathing_crack import with_cracks as with_cracks
    from updater.validation.channel_health import SensorHealth as SensorHealth
    from updater.validation.channel_health import sensor_health as sensor_health
    from updater.validation.channel_health import with_acting as with_acting
    from updater.validation.modal_correlation import ModalCorrelation as ModalCorrelation
    from updater.validation.modal_correlation import as_written as as_written
    from updater.validation.modal_correlation import correlate_modes as correlate_modes
    from updater.validation.modal_correlation import modes_before as modes_before
    from updater.validation.modal_correlation import modes_with_causes as modes_with_causes
    from updater.validation.residual_forces import ForceBalance as ForceBalance
    from updater.validation.residual_forces import force_balance as force_balance
    from updater.validation.response.fatigue import StressCycles as StressCycles
    from updater.validation.response.fatigue import count_cycles as count_cycles
    from updater.validation.response.fatigue import damage_rate as damage_rate
    from updater.validation.response.kalman_filter import ModalKalmanFilter as ModalKalmanFilter
    from updater.validation.response.live_filter import LiveFilter as LiveFilter
    from updater.validation.response.modal_system import MotionQuantity as MotionQuantity
    from updater.validation.response.response_model import Place as Place
    from updater.validation.response.response_model import Point as Point
    from updater.validation.response.response_model import ResponseEstimate as ResponseEstimate
    from updater.validation.response.response_model import ResponseModel as ResponseModel
    from updater.validation.response.response_model import SensorSignal as SensorSignal
    from updater.validation.response.section_stress import Fibre as Fibre
    from updater.validation.response.section_stress import edge_fibres as edge_fibres
    from updater.validation.response.sensor_prediction import PredictedSensors as PredictedSensors
    from updater.validation.response.sensor_prediction import SensorPredictor as SensorPredictor
    from updater.validation.response.sensor_prediction import learn_predictors as learn_predictors
    from updater.validation.shape_expansion import ModelModes as ModelModes
    from updater.validation.shape_expansion import ModelPartner as ModelPartner
    from updater.validation.shape_expansion import expand_measured as expand_measured
    from updater.validation.shape_expansion import model_modes as model_modes
    from updater.validation.signal_evidence import opening_evidence as opening_evidence
    from updater.validation.signal_evidence import opens_significantly as opens_significantly
    from updater.validation.virtual_sensors import VirtualSensing as VirtualSensing
    from updater.validation.virtual_sensors import gapless_part as gapless_part
    from updater.validation.virtual_sensors import virtual_sensing as virtual_sensing
else:
    __getattr__, __dir__, __all__ = lazy_names(__name__, __file__)
