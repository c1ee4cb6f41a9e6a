"""Comparison of an event with the baseline, and the fit of hypotheses to it."""

from updater.inference.comparison import Comparison, NewModes, Whitener
from updater.inference.event_comparison import MODEL_ERROR, compare
from updater.inference.laplace_fit import (
    BoolArray,
    Fit,
    Hypotheses,
    LinearInCompliance,
    evaluate,
    fit,
    freedom_of_frequencies,
    refined_fit,
    slopes,
)
from updater.inference.linearization import (
    first_order,
    foreseen,
    linear_in_mass,
    linearised,
    most_likely,
    pulls,
    size_deviations,
)
from updater.inference.new_shapes import shaken
from updater.inference.phases_and_damping import without_mode
from updater.inference.posterior import Place, PositionPosterior, credible, likeliest_place
from updater.inference.priors import Magnitude, common_magnitude, log_uniform
from updater.inference.reanalysis import Changed, Effect, Tangent, in_modes, no_effect, picked, predict, reanalyse
from updater.inference.residuals import Prediction, residual
from updater.inference.shape_covariance import SHAPE_BIAS, beside

__all__ = [
    "MODEL_ERROR",
    "SHAPE_BIAS",
    "BoolArray",
    "Changed",
    "Comparison",
    "Effect",
    "Fit",
    "Hypotheses",
    "LinearInCompliance",
    "Magnitude",
    "NewModes",
    "Place",
    "PositionPosterior",
    "Prediction",
    "Tangent",
    "Whitener",
    "beside",
    "common_magnitude",
    "compare",
    "credible",
    "evaluate",
    "first_order",
    "fit",
    "foreseen",
    "freedom_of_frequencies",
    "in_modes",
    "likeliest_place",
    "linear_in_mass",
    "linearised",
    "log_uniform",
    "most_likely",
    "no_effect",
    "picked",
    "predict",
    "pulls",
    "reanalyse",
    "refined_fit",
    "residual",
    "shaken",
    "size_deviations",
    "slopes",
    "without_mode",
]
