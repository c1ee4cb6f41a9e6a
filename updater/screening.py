"""First-order screening of very many positions of a mass, so that the exact fit examines hundreds of them only.

A small mass m at a point where mode i moves by u_i changes ln omega_i by -m |u_i|^2 / 2 and turns the mode by
m (u_i . u_k) omega_i^2 / (omega_k^2 - omega_i^2) towards mode k (Brincker et al., MSSP 45 (2014) 91-104). Whitened as
the data are, residuals are linear in m; the best m and what it gains in chi-square have a closed form. A gain is
compared with others only: what first order gets wrong about a large mass it gets wrong alike nearby.
"""

from dataclasses import dataclass

import numpy as np

from daq import FloatArray, IndexArray
from updater.comparison import Comparison
from updater.shape_errors import beside

_CHUNK = 4096  # positions at a time
_LEAST_SEEN = 1e-6  # of a mode at the channels [1/sqrt(kg)]
_MOST_TURNED = 50.0  # omega_i^2 / |omega_k^2 - omega_i^2|: closer modes are no longer first order


def most_likely(comparison: Comparison, translation: FloatArray, mass_std: float, most: int) -> IndexArray:
    """Return the `most` positions, ascending, where a mass lowers chi-square the most.

    Parameters
    ----------
    comparison : what is measured now and before
    translation : (n, 3, n_modes) of the reference's modes at the positions
    mass_std : prior of the mass [kg]
    most : positions to keep
    """
    linear = linear_in_mass(comparison)
    chunks = [slice(i, i + _CHUNK) for i in range(0, len(translation), _CHUNK)]
    gain = np.concatenate([_gain(translation[c], comparison.paired, linear, mass_std) for c in chunks])
    if len(gain) <= most:
        return np.arange(len(gain))
    return np.sort(np.argpartition(-gain, most)[:most])


@dataclass(frozen=True, eq=False)
class Linear:
    """Whitened residuals without a mass, and what is predicted for m = 1 kg."""

    log_ratio: FloatArray  #: (n,)
    by_shift: FloatArray  #: (n, n) by |u_i|^2
    shape: FloatArray  #: (n, n_channels)
    by_coupling: FloatArray  #: (n, n_modes, n_channels) of shape i by u_i . u_k


def linear_in_mass(comparison: Comparison) -> Linear:
    """Return what a comparison leaves, and what a small mass would change of it."""
    square, paired = comparison.frequency**2, comparison.paired
    gap = square / square[paired, None] - 1
    gap[np.arange(len(paired)), paired] = np.inf
    turned = np.clip(1 / np.where(gap == 0, np.inf, gap), -_MOST_TURNED, _MOST_TURNED)
    along = (comparison.at_channels[:, paired].T * comparison.model_base).sum(1)
    along = np.where(np.abs(along) < _LEAST_SEEN, _LEAST_SEEN, along)
    moved = beside((turned / along[:, None])[:, :, None] * comparison.at_channels.T, comparison.base[:, None])
    off = beside(comparison.shape, comparison.base)
    white = comparison.drifting.matrix
    return Linear(
        log_ratio=white @ comparison.log_ratio,
        by_shift=-0.5 * white,
        shape=np.einsum("icd,id->ic", comparison.shape_whitener, off),
        by_coupling=np.einsum("icd,ikd->ikc", comparison.shape_whitener, moved),
    )


def _gain(translation: FloatArray, paired: IndexArray, linear: Linear, mass_std: float) -> FloatArray:
    """Return what the best mass at each position (n,) gains in chi-square."""
    shift = (translation[:, :, paired] ** 2).sum(1) @ linear.by_shift.T
    slope_rest, slope_slope = shift @ linear.log_ratio, (shift**2).sum(1)
    for mode, rest, by_coupling in zip(paired, linear.shape, linear.by_coupling, strict=True):
        slope = np.einsum("pa,pak->pk", translation[:, :, mode], translation) @ by_coupling
        slope_rest += slope @ rest
        slope_slope += (slope**2).sum(1)
    return np.asarray(slope_rest**2 / (slope_slope + mass_std**-2))
