"""Expected errors of the modes of a planned record: laws of frequencies and of shapes.

Frequencies follow the uncertainty law (Au 2014). A shape errs along the other modes: at the frequency of mode i mode k
still answers with r = 2 zeta / sqrt((omega_k^2 / omega_i^2 - 1)^2 + (2 zeta)^2) of mode i's amplitude if both are
forced alike, at random phase, and 2 pi zeta f T independent glimpses average that out, as they do the channels' own
noise. So shapes of well separated modes are sure to a part in a thousand, those of close modes are mixed by several
per cent.

References
----------
Au, S.-K. (2014). Uncertainty law in ambient modal identification, part I: theory. MSSP 48, 15-33.
"""

from dataclasses import dataclass

import numpy as np

from daq import FloatArray, IndexArray
from oma.selection import uncertainty_law

_OVER_THE_LAW = 1.1  # ratio reached by identification, as measured: docs/validation/identification
_YEAR = 365.25 * 86400  # s


@dataclass(frozen=True, kw_only=True)
class Record:
    """Length of the records before and after a change, and the permitted rate of false alarms."""

    seconds: float = 600.0  #: length of each of the two records [s]
    damping: float = 0.005  #: damping of all modes, which a structure file does not have [-]
    highest: float = 400.0  #: frequency up to which modes are identified [Hz]
    channel_noise: float = (
        0.005  #: amplitude of each channel's own noise in the band of a resonance over that's own [-]
    )
    false_alarms_per_year: float = 1.0

    def __post_init__(self) -> None:
        """Refuse invalid records."""
        for name in ("seconds", "damping", "highest", "channel_noise", "false_alarms_per_year"):
            if not 0 < getattr(self, name) < np.inf:
                raise ValueError(f"{name}: expected a positive number, found {getattr(self, name)!r}")

    @property
    def false_alarm_probability(self) -> float:
        """Probability of a false alarm per record [-] at the stated rate, for records without a pause in between."""
        return min(0.5, self.false_alarms_per_year * self.seconds / _YEAR)

    def log_frequency_std(self, frequency: FloatArray) -> FloatArray:
        """Return the standard deviations (n,) of log frequencies from one record of modes at frequencies (n,) [Hz]."""
        return np.array([_OVER_THE_LAW * uncertainty_law(f, self.damping, self.seconds)[0] / f for f in frequency])

    def leaks(self, frequency: FloatArray, measured: IndexArray) -> FloatArray:
        """Return how much of every mode is mixed into measured ones by chance.

        Parameters
        ----------
        frequency : (n_modes,) of all modes [Hz]
        measured : (n,) modes whose shapes are evaluated

        Returns
        -------
        (n, n_modes)
            Standard deviations of modal amplitudes, the measured mode's own being 1; zero for itself.
        """
        leak = self._loudness(frequency, measured) * self._glimpse_std(frequency[measured])[:, None]
        return np.asarray(np.where(np.arange(len(frequency)) == measured[:, None], 0.0, leak))

    def blur(self, measured: FloatArray) -> FloatArray:
        """Return the standard deviations (n,) of each component of unit shapes by the channels' own noise.

        Parameters
        ----------
        measured : (n,) frequencies of the modes [Hz]
        """
        return self.channel_noise * self._glimpse_std(measured)

    def _glimpse_std(self, frequency: FloatArray) -> FloatArray:
        """Return one over the root of the number of independent glimpses of modes (n,)."""
        return np.asarray(1 / np.sqrt(np.maximum(2 * np.pi * self.damping * frequency * self.seconds, 1.0)))

    def _loudness(self, frequency: FloatArray, measured: IndexArray) -> FloatArray:
        """Return how loud all modes are at the measured ones' frequencies (n, n_modes), these themselves being 1."""
        gap = (frequency / frequency[measured, None]) ** 2 - 1
        width = 2 * self.damping
        return np.asarray(width / np.hypot(gap, width))


def shape_errors(at_channels: FloatArray, leaks: FloatArray, measured: FloatArray) -> FloatArray:
    """Return the directions (n, n_modes, n_channels) in which unit shapes err, each by one standard deviation.

    Parameters
    ----------
    at_channels : (n_channels, n_modes) of all modes
    leaks : (n, n_modes)
    measured : (n, n_channels) shapes of the measured modes at the channels, not of unit norm
    """
    length = np.linalg.norm(measured, axis=1)
    unit = (measured / length[:, None])[:, None]
    error = leaks[:, :, None] * at_channels.T / length[:, None, None]
    return np.asarray(error - (error * unit).sum(-1, keepdims=True) * unit)
