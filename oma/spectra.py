"""Singular values of the spectral matrix: the picture engineers look at first.

References
----------
Brincker, R., Zhang, L., Andersen, P. (2001). Modal identification of output-only systems using frequency domain
decomposition. Smart Materials and Structures 10(3), 441-445.
Welch, P. D. (1967). The use of fast Fourier transform for the estimation of power spectra. IEEE Transactions on Audio
and Electroacoustics 15(2), 70-73.
"""

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy import fft, signal

from daq import FloatArray, Recording
from oma.conditioning import detrended, usable
from oma.errors import TooShort
from oma.estimate import ComplexArray


def singular_values(recording: Recording, n_fft: int = 4096) -> tuple[FloatArray, FloatArray]:
    """Return the singular values of the one-sided spectral density matrix.

    Welch's method, Hann windows, half overlap. Missing samples count as zero and each pair of channels is divided by
    the window power of the samples it has in common.

    Parameters
    ----------
    recording : Recording
    n_fft : int
        Samples a segment.

    Returns
    -------
    frequency : (n_fft // 2 + 1,) array
        [Hz].
    values : (n_fft // 2 + 1, n_channels) array
        Of the usable channels, falling at each frequency [(m/s2)^2/Hz].

    Raises
    ------
    TooShort
        If the recording has fewer than `n_fft` samples.
    TooFewChannels
        If fewer than two channels carry a signal.
    """
    data = usable(recording)[1]
    if len(data) < n_fft:
        raise TooShort(recording.duration, n_fft / recording.rate)
    spectrum = spectral_matrix(detrended(data), recording.rate, n_fft)
    values = np.linalg.svd(spectrum, compute_uv=False, hermitian=True)
    return fft.rfftfreq(n_fft, 1 / recording.rate), values.astype(np.float64)


def spectral_matrix(data: FloatArray, rate: float, n_fft: int) -> ComplexArray:
    """Return the one-sided spectral density matrix, (n_frequencies, n_channels, n_channels)."""
    window = signal.get_window("hann", n_fft)
    valid = np.isfinite(data)
    segments = sliding_window_view(np.where(valid, data, 0.0), n_fft, axis=0)[:: n_fft // 2]
    present = sliding_window_view(valid.astype(np.float64), n_fft, axis=0)[:: n_fft // 2]
    lines = fft.rfft(segments * window, axis=-1).transpose(2, 1, 0)
    power = np.einsum("sit,sjt,t->ij", present, present, window**2, optimize=True)
    density: ComplexArray = 2 * np.matmul(lines, lines.conj().transpose(0, 2, 1)) / np.maximum(power, 1e-300) / rate
    density[0] /= 2
    if n_fft % 2 == 0:
        density[-1] /= 2
    return density
