"""Response where there is no sensor: modal forces, Kalman filter of modes, standard deviations."""

from typing import TYPE_CHECKING

from daq.lazy_names import lazy_names

if TYPE_CHECKING:
    from updater.response_estimation.excitation import Excitation, estimate_excitation, spectral_matrices
    from updater.response_estimation.kalman_filter import ModalKalmanFilter, Outputs
    from updater.response_estimation.modal_system import ModalSystem, Quantity
    from updater.response_estimation.response_model import Point, ResponseEstimate, ResponseModel
    from updater.response_estimation.shape_error import shape_error
else:
    __getattr__, __dir__ = lazy_names(__name__, __file__)

__all__ = [
    "Excitation",
    "ModalKalmanFilter",
    "ModalSystem",
    "Outputs",
    "Point",
    "Quantity",
    "ResponseEstimate",
    "ResponseModel",
    "estimate_excitation",
    "shape_error",
    "spectral_matrices",
]
