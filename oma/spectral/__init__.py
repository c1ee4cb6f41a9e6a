"""Spectra and correlations, and the resonances and tones in them."""

from oma.spectral.amplitude_dependence import AmplitudeDependence as AmplitudeDependence
from oma.spectral.amplitude_dependence import dependence_on_amplitude as dependence_on_amplitude
from oma.spectral.channel_prediction import ChannelPrediction as ChannelPrediction
from oma.spectral.correlation import CorrelationAccumulator as CorrelationAccumulator
from oma.spectral.correlation import CorrelationSums as CorrelationSums
from oma.spectral.correlation import covariance as covariance
from oma.spectral.correlation import hankel as hankel
from oma.spectral.decomposition import Decomposition as Decomposition
from oma.spectral.decomposition import decompose as decompose
from oma.spectral.device_alignment import aligned as aligned
from oma.spectral.device_alignment import channel_delays as channel_delays
from oma.spectral.device_alignment import delays_of_clean as delays_of_clean
from oma.spectral.device_alignment import device_delays as device_delays
from oma.spectral.frequency_response import Resonance as Resonance
from oma.spectral.frequency_response import fit_resonance as fit_resonance
from oma.spectral.harmonics import LineClasses as LineClasses
from oma.spectral.harmonics import classify as classify
from oma.spectral.resonance_search import SpectralResonance as SpectralResonance
from oma.spectral.resonance_search import residue_weight as residue_weight
from oma.spectral.resonance_search import resonances as resonances
from oma.spectral.spectra import SpectrumAccumulator as SpectrumAccumulator
from oma.spectral.spectra import singular_values as singular_values
from oma.spectral.spectra import singular_values_of_clean as singular_values_of_clean
from oma.spectral.spectra import spectral_matrix as spectral_matrix
from oma.spectral.transforms import fast_length as fast_length
