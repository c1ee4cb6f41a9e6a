"""Total mass from mass-normalised modes, without a model.

Modes B of a mass matrix satisfy B^T M B = I. Measured at as many channels as there are modes they can be inverted,
M = (B B^T)^-1: eq. 7 of the one-step update with every mode replaced. It is the mass as the channels feel it, exact
where nothing else moves; modes that were not measured are missing from B B^T, so that a frame with many comes out too
heavy.

References
----------
Berman, A. & Nagy, E. J. (1983). Improvement of a large analytical model using test data. AIAA Journal 21(8), 1168-1173.
"""

from dataclasses import dataclass

import numpy as np

from daq import FloatArray
from updater.errors import ModalDataError

_SINGULAR = 1e6  # condition of the modes: two of them are one at the channels


@dataclass(frozen=True, eq=False, kw_only=True)
class ModalMass:
    """A mass matrix at channels."""

    value: FloatArray  #: (n_channels, n_channels) [kg]
    std: FloatArray  #: (n_channels, n_channels) [kg]


def mass_of_modes(shape: FloatArray, covariance: FloatArray) -> ModalMass:
    """Return the mass that makes modes orthonormal, with first-order deviations.

    Parameters
    ----------
    shape : (n, n) mass-normalised, a row a mode, a column a channel [kg^-1/2]
    covariance : (n, n, n) of each mode's components [1/kg]

    Raises
    ------
    ValueError
        If there are not as many modes as channels, or the covariances are of another size.
    ModalDataError
        If two modes are the same at the channels.
    """
    n = len(shape)
    if shape.shape != (n, n) or covariance.shape != (n, n, n):
        raise ValueError(
            f"modes: expected as many as channels, each with its covariance; found {shape.shape}, {covariance.shape}"
        )
    if np.linalg.cond(shape) > _SINGULAR:
        raise ModalDataError("two of the modes have the same shape at the channels: they do not determine the mass")
    inverse = np.linalg.inv(shape)  # B^-T: columns are modes
    value = inverse @ inverse.T
    # dM = -(M dB B^-1 + its transpose); by one component c of one mode m: M[:, c] (B^-1)[m, :]
    one = np.einsum("ac,bm->mcab", value, inverse)
    slope = one + one.transpose(0, 1, 3, 2)
    variance = np.einsum("mcab,mcd,mdab->ab", slope, covariance, slope)
    return ModalMass(value=value, std=np.sqrt(variance))
