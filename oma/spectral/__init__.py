"""Spectra and correlations, and the resonances and tones in them."""

from oma.spectral.correlation import CorrelationAccumulator, CorrelationSums, covariance, hankel
from oma.spectral.decomposition import Decomposition, decompose
from oma.spectral.device_alignment import aligned, channel_delays, delays_of_clean, device_delays
from oma.spectral.frequency_response import Resonance, fit_resonance
from oma.spectral.harmonics import LineClasses, classify
from oma.spectral.resonance_search import SpectralResonance, residue_weight, resonances
from oma.spectral.spectra import SpectrumAccumulator, singular_values, spectral_matrix

__all__ = [
    "CorrelationAccumulator",
    "CorrelationSums",
    "Decomposition",
    "LineClasses",
    "Resonance",
    "SpectralResonance",
    "SpectrumAccumulator",
    "aligned",
    "channel_delays",
    "classify",
    "covariance",
    "decompose",
    "delays_of_clean",
    "device_delays",
    "fit_resonance",
    "hankel",
    "residue_weight",
    "resonances",
    "singular_values",
    "spectral_matrix",
]
