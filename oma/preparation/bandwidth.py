"""Upper end of the usable band of a recording: its anti-alias filter, if the spectrum shows one.

A recording without visible filter slope is analysed up to 0.48 of its rate. A digital or analogue anti-alias filter
that cuts in earlier leaves a slope towards half the rate; poles fitted to a slope are no modes, and the band then ends
at 0.40 of the rate.
"""

import numpy as np
from scipy import fft

from daq import FloatArray
from oma.preparation.pyramid import PASS, TOP

_N_FFT = 256  # samples per segment: lines at 0.004 of the rate
_MAX_SEGMENTS = 128  # spread evenly over the recording, so that long recordings cost no more
_MIN_SEGMENTS = 6
_REFERENCES = ((0.28, 0.34), (0.34, PASS))  # bands that the end is compared with, as shares of the rate [-]
_END = (0.45, 0.485)  # end of the spectrum [-]
_SLOPE_DB = 6.0  # fall of the spectrum's floor from the reference to the end that is taken for a filter [dB]


def usable_share(data: FloatArray) -> float:
    """Return the upper end of the usable band as a share of the rate.

    The floor of the spectrum (lower quartile over the lines, so that modes and tones do not count) between 0.45 and
    0.485 of the rate is compared with the lower one of those from 0.28 to 0.34 and from 0.34 to 0.40 (the flanks of
    a strong mode raise one of them), channel by channel; the median channel decides. A spectrum that falls as an
    integrated signal's does, 12 dB per octave, is not taken for filtered.

    Parameters
    ----------
    data : (n_samples, n_channels) array
        NaN where a sample is missing; segments with missing samples are not used.

    Returns
    -------
    float
        `TOP` without a filter slope or if the recording is too short to show one, else `PASS`.
    """
    return PASS if _fall(data) > _SLOPE_DB else TOP


def _fall(data: FloatArray) -> float:
    """Return the drop of the floor at the end of the spectrum [dB], median of the channels."""
    power = _periodogram(data)
    if power is None:
        return 0.0
    lines = np.arange(len(power)) / _N_FFT
    *before, end = (
        10 * np.log10(np.quantile(power[(lines >= low) & (lines < high)], 0.25, axis=0) + np.finfo(float).tiny)
        for low, high in (*_REFERENCES, _END)
    )
    return float(np.median(np.min(before, axis=0) - end))


def _periodogram(data: FloatArray) -> FloatArray | None:
    """Return mean periodograms (n_lines, n_channels) of complete segments; None if there are too few."""
    n = len(data) // _N_FFT
    chosen = np.unique(np.linspace(0, n - 1, min(n, _MAX_SEGMENTS)).astype(int)) if n else np.empty(0, int)
    segments = data[: n * _N_FFT].T.reshape(-1, n, _N_FFT)[:, chosen]
    segments = segments[:, np.isfinite(segments).all(axis=(0, 2))]
    if segments.shape[1] < _MIN_SEGMENTS:
        return None
    segments -= segments.mean(axis=2, keepdims=True)
    segments *= _blackman_harris(_N_FFT)  # 92 dB down: low modes do not leak to the end
    lines = fft.rfft(segments, axis=2)
    return np.asarray(np.mean(lines.real**2 + lines.imag**2, axis=1).T)


def _blackman_harris(n: int) -> FloatArray:
    """Return the window of four terms (n,)."""
    turns = np.linspace(0, 2 * np.pi, n)
    return np.asarray(np.cos(np.arange(4)[:, None] * turns).T @ np.array([0.35875, -0.48829, 0.14128, -0.01168]))
