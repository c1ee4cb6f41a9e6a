"""Residuals of channels that are each predicted from the others, block by block, by a learned spectral matrix.

At a line of the spectrum the best linear prediction of channel c by all others follows from the inverse P of the
spectral matrix: x_c - (P x)_c / P_cc, with a residual of variance 1 / P_cc. Squared residuals times P_cc, averaged over
the lines, are a block's residual relative to the learned one. The prediction is one in space: the residual grows where
motion is no combination of learned shapes, as after a change of shapes, or of the signals of a sensor.

The clocks of devices wander: the delays of a block's devices are fitted to x^H P x, summed over the lines, and removed.

References
----------
Rasmussen & Williams, Gaussian Processes for Machine Learning (2006), eq. 5.12; Bendat & Piersol, Random Data (2010),
s. 7.3 on conditioned spectra; Mardia, Kent & Bibby, Multivariate Analysis (1979), s. 3.4 on the Wishart distribution.
"""

import math

import numpy as np

from daq import FloatArray, IndexArray
from oma.types import ComplexArray

_TOP = 0.4  # of the rate: anti-aliasing filters pass up to there
_FIRST_LINE = 3  # below it are offset and drift
_LEAST_BLOCKS = 3  # per channel, before delays are fitted
_ACCURATE_BLOCKS = 10  # per channel, before a residual is computed: it varies less from block to block then
_STEPS = 2  # of the fit of the delays: phases turn by less than a radian
_LEAST_POWER = 1e-30  # at a line, (m/s2)^2: far below the rounding of any sensor
_HALF_OVERLAP = 36 / 38  # independent blocks per block of half-overlapping Hann windows (Welch 1967)


class ChannelPrediction:
    """Spectral matrix of blocks of one length, and the residuals of blocks by it.

    Parameters
    ----------
    n_samples : of a block
    devices : (n_channels,) number of each channel's device, from 0 on; at least two channels
    memory : number of blocks over which older ones are forgotten
    """

    def __init__(self, n_samples: int, devices: IndexArray, memory: float) -> None:
        self._taper = np.hanning(n_samples)[:, None]
        self._lines = slice(_FIRST_LINE, math.ceil(_TOP * n_samples))
        self._member = (np.arange(devices.max() + 1)[:, None] == devices).astype(float)  # (n_devices, n_channels)
        angle: FloatArray = 2 * np.pi * np.arange(n_samples)[self._lines] / n_samples
        self._turn = 1j * angle[:, None]  # of the phase, by a delay of one sample
        #: sums of blocks (n_lines, n_channels, n_channels): learned ones, those of the next `learn`, newer ones
        self._sum, self._held, self._pending = np.zeros((3, len(angle), len(devices), len(devices)), complex)
        self._n_held = self._n_pending = 0
        self._memory = memory
        self._weight = self._weight_squares = 0.0
        self._inverse: ComplexArray | None = None

    def spectrum(self, block: FloatArray) -> ComplexArray:
        """Return the spectrum (n_lines, n_channels) of a block (n_samples, n_channels) without gaps."""
        return np.asarray(np.fft.rfft(self._taper * (block - block.mean(0)), axis=0)[self._lines])

    def add(self, spectrum: ComplexArray) -> None:
        """Add the spectrum of a block (n_lines, n_channels); the first ones, not predicted yet, are learned at once."""
        spectrum = self._without_delays(spectrum)
        product = spectrum[:, :, None] * spectrum[:, None, :].conj()
        if self._known:
            self._pending += product
            self._n_pending += 1
        else:
            self._sum += product
            self._weight += 1
            self._weight_squares += 1

    def learn(self) -> None:
        """Learn the blocks added before the last call of `learn`; the next call learns those added since."""
        if self._n_held:
            kept = (1 - 1 / self._memory) ** self._n_held
            self._sum *= kept
            self._sum += self._held
            self._weight = kept * self._weight + self._n_held
            self._weight_squares = kept**2 * self._weight_squares + self._n_held
            self._inverse = None
        self._held, self._pending = self._pending, self._held
        self._n_held, self._n_pending = self._n_pending, 0
        self._pending[:] = 0

    def discard(self) -> None:
        """Discard the blocks that are not learned yet."""
        self._held[:] = 0
        self._pending[:] = 0
        self._n_held = self._n_pending = 0

    @property
    def n_blocks(self) -> float:
        """Number of independent blocks of which the mean is as accurate."""
        return _HALF_OVERLAP * self._weight**2 / self._weight_squares if self._weight else 0.0

    def residuals(self, spectrum: ComplexArray) -> FloatArray | None:
        """Return the mean squared residual (n_channels,) over the learned one [-], None before enough is learned.

        For blocks of the learned distribution its expectation is 1, whatever the number of blocks.
        """
        if self.n_blocks < _ACCURATE_BLOCKS * spectrum.shape[1]:
            return None
        n_channels, n, inverse = spectrum.shape[1], self.n_blocks, self._precision()
        diagonal = np.einsum("lcc->lc", inverse).real
        error = np.einsum("lcd,ld->lc", inverse, self._without_delays(spectrum)) / diagonal
        # 1 / P_cc is too small by (n - p + 1) / n, its inverse too large by n / (n - p); the error of the weights
        # makes the residual of another block too large by n / (n - p + 1)
        expected = n**2 / ((n - n_channels) * (n - n_channels + 1))
        return np.asarray((np.abs(error) ** 2 * diagonal).mean(0) / expected)

    @property
    def _known(self) -> bool:
        return bool(self.n_blocks >= _LEAST_BLOCKS * self._sum.shape[1])

    def _precision(self) -> ComplexArray:
        """Return the inverse (n_lines, n_channels, n_channels) of the spectral matrix."""
        if self._inverse is None:
            self._inverse = np.asarray(np.linalg.inv(self._sum / self._weight + self._floor))
        return self._inverse

    def _without_delays(self, spectrum: ComplexArray) -> ComplexArray:
        """Return a spectrum without the delays of its devices, by Gauss-Newton; unchanged before enough is learned.

        A delay common to all devices changes nothing, and is kept.
        """
        if len(self._member) == 1 or not self._known:
            return spectrum
        inverse = self._precision()
        for _ in range(_STEPS):
            slope = self._turn * spectrum
            pull = (slope.conj() * np.einsum("lcd,ld->lc", inverse, spectrum)).sum(0).real
            curvature = np.einsum("lc,lcd,ld->cd", slope.conj(), inverse, slope, optimize=True).real
            normal = self._member @ curvature @ self._member.T
            step = np.linalg.lstsq(normal, self._member @ pull)[0]  # 0 for a device without a signal
            spectrum = spectrum * np.exp(-self._turn * (step @ self._member))
        return spectrum

    @property
    def _floor(self) -> ComplexArray:
        """Least power: channels that are copies of each other, or constant, leave no residual."""
        power = np.einsum("lcc->lc", self._sum).real / self._weight
        unit = np.eye(power.shape[1])
        return np.asarray(unit * np.maximum(1e-12 * power.sum(1), _LEAST_POWER)[:, None, None], complex)
