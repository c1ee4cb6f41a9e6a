"""The reference: calibrated model, expansion of measured modes, pairing with model modes."""

from updater.reference.calibration import (
    UNLIKE,
    Calibration,
    Parameter,
    best_model,
    calibrate,
    channel_rows,
    share_within,
    spring_of,
)
from updater.reference.expansion import (
    LARGEST_CLUSTER,
    ExpandedChange,
    expand_change,
    expand_shape,
    orthonormal,
    orthonormal_slope,
    well_posed_cluster,
)
from updater.reference.model_fit import ModelFit, fit_of_model, own_modes
from updater.reference.new_modes import matched_and_new, matched_surely
from updater.reference.parameter_sensitivity import ParameterSensitivity, parameter_sensitivities
from updater.reference.reference import (
    NEAR,
    SAME_SHAPE,
    NominalModel,
    Reference,
    first_stage,
    match_nominal_modes,
    pair_baseline,
)
from updater.reference.sensitivity_method import Convergence, Prior, SensitivityFit, fit_parameters

__all__ = [
    "LARGEST_CLUSTER",
    "NEAR",
    "SAME_SHAPE",
    "UNLIKE",
    "Calibration",
    "Convergence",
    "ExpandedChange",
    "ModelFit",
    "NominalModel",
    "Parameter",
    "ParameterSensitivity",
    "Prior",
    "Reference",
    "SensitivityFit",
    "best_model",
    "calibrate",
    "channel_rows",
    "expand_change",
    "expand_shape",
    "first_stage",
    "fit_of_model",
    "fit_parameters",
    "match_nominal_modes",
    "matched_and_new",
    "matched_surely",
    "orthonormal",
    "orthonormal_slope",
    "own_modes",
    "pair_baseline",
    "parameter_sensitivities",
    "share_within",
    "spring_of",
    "well_posed_cluster",
]
