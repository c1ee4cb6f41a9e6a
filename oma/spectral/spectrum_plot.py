"""Spectrum of a recording as a figure."""

from typing import TYPE_CHECKING

import numpy as np

from daq import FloatArray, Recording
from oma.errors import IdentificationError
from oma.spectral.spectra import singular_values
from oma.types import ModalEstimate

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_SEGMENTS = 8  # of a spectrum, at least: fewer scatter too much
_LARGEST_FFT = 1 << 14


def drawn_spectrum(recording: Recording) -> tuple[FloatArray, FloatArray] | None:
    """Return frequencies (n,) [Hz] and singular values (n, n_channels) [(m/s2)^2/Hz] that figures show.

    None if the recording is too short for a spectrum, or has no signal.
    """
    n_fft = min(_LARGEST_FFT, 1 << max(6, int(np.log2(len(recording.data) / _SEGMENTS))))
    try:
        return singular_values(recording, n_fft)
    except IdentificationError:
        return None


def plot_spectrum(
    recording: Recording, estimate: ModalEstimate | None = None, tones: FloatArray | tuple[float, ...] = ()
) -> "Figure":
    """Draw the singular values of the spectral matrix of a recording.

    Parameters
    ----------
    recording : Recording
    estimate : modes to mark; the axis ends above the highest. Default: none, up to half the rate
    tones : (n_tones,) frequencies of tones to mark as well [Hz]
    """
    from oma.plots import highest_shown, spectrum_figure  # matplotlib is loaded only for a figure

    highest = recording.rate / 2 if estimate is None else highest_shown(estimate)
    return spectrum_figure(drawn_spectrum(recording), highest, estimate, np.asarray(tones, np.float64))
