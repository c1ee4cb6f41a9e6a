"""Spectral lines and responses that are analysed."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from daq import FloatArray, IndexArray
from oma.types import ComplexArray


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
