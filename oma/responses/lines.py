"""Spectral lines and responses that are analysed, and their noise from coherences.

The variance of a response of n averages is ``(1 - c) / (2 n c) |H|^2`` in each of its parts, c the coherence. It is
written as a product of a factor per line and a factor per response. The number of averages is not needed: the size of
the noise comes from the residuals of the fit.

References
----------
Bendat, J. & Piersol, A. (2010). Random data. 4th edition, section 9.2: random errors of frequency response estimates.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import convolve1d

from daq import FloatArray, IndexArray
from oma.errors import InputError
from oma.types import ComplexArray

_MIN_INCOHERENCE = 1e-5  # of responses with five to six digits, and of one blow, which has a coherence of one
_MIN_COHERENCE = 1e-3
_NEAR = np.array([1, 2, 3, 2, 1]) / 9  # lines whose noise is averaged
_ROUNDING = 1e-6
_TINY = 1e-300


@dataclass(frozen=True, eq=False, kw_only=True)
class Lines:
    """Accelerances on evenly spaced lines.

    An exponential window of force and response shifts the responses along the real axis of the Laplace variable: a
    measured line is the response at ``s = 2 pi i f + decay``, whose poles are those of the structure.
    """

    frequency: FloatArray  #: (n_lines,) [Hz]
    response: ComplexArray  #: (n_lines, n_channels, n_inputs) [m/s2/N]
    spacing: float  #: [Hz]
    decay: float  #: decay rate of the exponential window, 0 without a window [1/s]
    line_noise: FloatArray  #: (n_lines,) relative noise of lines [-]
    response_noise: FloatArray  #: (n_channels, n_inputs) relative noise of responses [-]

    @property
    def laplace(self) -> ComplexArray:
        """Values of the Laplace variable, (n_lines,) [rad/s]."""
        return np.asarray(self.decay + 2j * np.pi * self.frequency)

    def correlated(self, values: ComplexArray) -> ComplexArray:
        """Return the correlation of the noise of lines times values (n_lines, n), of their shape.

        An exponential window makes neighbours alike, by noise that was stationary before it; without a window lines
        are independent.
        """
        if not self.decay:
            return values
        apart = self.frequency[:, None] - self.frequency
        return np.asarray(1 / (1 + 1j * np.pi * apart / self.decay) @ values)

    @property
    def flat(self) -> ComplexArray:
        """All responses of each line in one row, (n_lines, n_responses)."""
        return self.response.reshape(len(self.frequency), -1)

    @property
    def white(self) -> ComplexArray:
        """All responses in units of their noise, (n_lines, n_responses)."""
        return np.asarray(self.flat / self.line_noise[:, None] / self.response_noise.ravel())

    @property
    def moving(self) -> IndexArray:
        """Numbers of the channels with a response that is not zero."""
        return np.flatnonzero(self.response.any(axis=(0, 2)))

    def of_channels(self, chosen: IndexArray) -> "Lines":
        """Return the lines of some of the channels, by their numbers."""
        return replace(self, response=self.response[:, chosen], response_noise=self.response_noise[chosen])

    def __getitem__(self, chosen: IndexArray) -> "Lines":
        """Return some of the lines."""
        return replace(
            self,
            frequency=self.frequency[chosen],
            response=self.response[chosen],
            line_noise=self.line_noise[chosen],
        )

    def without(self, parts: Iterable[ComplexArray]) -> "Lines":
        """Return the lines less parts of the responses, each (n_lines, n_channels, n_inputs)."""
        return replace(self, response=self.response - sum(parts))


def noise_levels(response: ComplexArray, coherence: FloatArray) -> tuple[FloatArray, FloatArray] | None:
    """Return the noise of lines (n_lines,) and of responses (n_channels, n_inputs), as factors of mean square one.

    A line has its own variance or the geometric mean of those about it, if this is larger: an estimate of few averages
    that is small by chance gives the line no larger weight.

    Parameters
    ----------
    response : (n_lines, n_channels, n_inputs), not zero in all lines of a channel
    coherence : of the same shape [-]

    Returns
    -------
    tuple or None
        None if coherences are one in most lines, as those of a single blow.

    Raises
    ------
    InputError
        If coherences are not between 0 and 1.
    """
    if not ((coherence > -_ROUNDING) & (coherence < 1 + _ROUNDING)).all():
        raise InputError("coherence: expected numbers from 0 to 1")
    if np.median(1 - coherence) < _MIN_INCOHERENCE:
        return None
    known = np.clip(coherence, _MIN_COHERENCE, 1.0)
    variance = np.maximum(1 - known, _MIN_INCOHERENCE) / known * np.abs(response) ** 2
    variance = np.maximum(variance, 1e-9 * variance.mean(axis=0) + _TINY)
    of_response = np.exp(np.log(variance).mean(axis=0))
    own = (variance / of_response).mean(axis=(1, 2))
    of_line = np.maximum(own, np.exp(convolve1d(np.log(own), _NEAR, mode="nearest")))
    return np.sqrt(of_line / of_line.mean()), np.sqrt(of_response / of_response.mean())
