"""Automatic selection of modes among groups of stable poles.

References
----------
Magalhães, F., Cunha, Á., Caetano, E. (2009). Online automatic identification of the modal parameters of a long span
arch bridge. MSSP 23(2), 316-329.
Au, S.-K. (2014). Uncertainty law in ambient modal identification, part I: theory. MSSP 48, 15-33.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from daq import FloatArray
from oma.mac import mac_matrix
from oma.types import ComplexArray

MIN_MEMBERS = 3  #: poles of a group that may be a mode [-]
BAND = 4.0  #: half widths of a resonance on each side of it: 84 % of its power [-]


@dataclass(frozen=True, kw_only=True)
class Selection:
    """Limits of the automatic selection."""

    max_damping: float = 0.1  #: largest damping ratio of a pole [-]
    min_damping: float = 2e-4  #: smallest damping ratio of a mode; below it is a tone [-]
    min_damping_sigmas: float = 3.0  #: damping over its standard deviation, of a mode seen by a single channel [-]
    min_mpc: float = 0.5  #: modal phase collinearity of a peak of the spectra [-]
    max_shift: float = 0.02  #: relative frequency difference of neighbours in successive orders [-]
    max_mac_loss: float = 0.1  #: 1 - MAC of the same neighbours [-]
    min_agreement: float = 0.5  #: MAC above which no two orthogonal shapes can be exchanged [-]
    cut: float = 0.04  #: mean distance inside a group, relative frequency plus 1 - MAC [-]
    max_law_ratio: float = 8.0  #: standard deviation of frequency over the uncertainty law, if all orders agree [-]
    min_law_ratio: float = 0.5  #: the same, for a mode with a known tone in its band; below it is that tone again [-]


def groups(
    frequency: FloatArray, shape: ComplexArray, order: npt.NDArray[np.intp], cut: float
) -> list[npt.NDArray[np.intp]]:
    """Group poles by average linkage on relative frequency difference plus 1 - MAC.

    Two modes of nearly one frequency are distinguished by their shapes, two of nearly one shape by their frequencies,
    two of nearly one frequency and shape by occurring together in the same models.

    Parameters
    ----------
    frequency : (n_poles,) array
        [Hz].
    shape : (n_poles, n_channels) array
    order : (n_poles,) array
        Of the model that shows the pole [-].
    cut : float
        Largest mean distance of groups that are joined.

    Returns
    -------
    list of (n_members,) index arrays
    """
    if len(frequency) < 2:
        return [np.arange(len(frequency))] if len(frequency) else []
    difference = np.abs(frequency[:, None] - frequency) / np.maximum(frequency[:, None], frequency)
    distance = difference + np.clip(1 - mac_matrix(shape, shape), 0, None)
    orders: list[int] = order.tolist()
    found: dict[int, list[list[int]]] = {i: [[i]] for i in range(len(orders))}
    for left, right in _joined((distance + distance.T) / 2, cut):
        parts = found[left] + found.pop(right)
        if len(parts) == 2 and not _side_by_side(*({orders[k] for k in part} for part in parts)):
            parts = [parts[0] + parts[1]]  # poles that are separate in most orders stay apart, however near
        found[left] = parts
    return [np.array(sorted(part), np.intp) for parts in found.values() for part in parts]


def _joined(distance: FloatArray, cut: float) -> Iterator[tuple[int, int]]:
    """Yield the pairs that average linkage joins up to a mean distance, nearest first; the second joins the first.

    The nearest neighbour of each row is kept: a mean is no less than both distances, so that a join alters only the
    rows that had one of the two.
    """
    distance[~np.isfinite(distance)] = np.inf  # a shape that is not finite is like no other
    np.fill_diagonal(distance, np.inf)
    size, nearest, least = np.ones(len(distance)), distance.argmin(1), distance.min(1)
    while least[left := int(least.argmin())] < cut:
        right = int(nearest[left])
        yield left, right
        mean = (size[left] * distance[left] + size[right] * distance[right]) / (size[left] + size[right])
        mean[left] = np.inf
        distance[left] = distance[:, left] = mean
        distance[right] = distance[:, right] = np.inf
        size[left] += size[right]
        altered = (nearest == left) | (nearest == right)  # the first among them
        altered[right] = True
        rows = distance[altered]
        nearest[altered], least[altered] = rows.argmin(1), rows.min(1)


def _side_by_side(a: set[int], b: set[int]) -> bool:
    """Return whether most of the orders with the rarer of two groups have the other too: a mode has one pole."""
    rarer = min(len(a), len(b))
    return rarer >= MIN_MEMBERS and 2 * len(a & b) > rarer


def uncertainty_law(frequency: float, damping: float, duration: float) -> tuple[float, float]:
    """Return the smallest standard deviations of frequency and damping that any method can reach.

    ``sigma_f / f = sqrt(zeta / (2 pi N_c))`` and ``sigma_zeta / zeta = 1 / sqrt(2 pi zeta N_c)`` with ``N_c = f T``
    cycles (Au 2014): long, well excited records.

    Parameters
    ----------
    frequency : float
        [Hz].
    damping : float
        [-].
    duration : float
        [s].

    Returns
    -------
    frequency_std, damping_std : float
        [Hz], [-].
    """
    cycles = frequency * duration
    return frequency * np.sqrt(damping / (2 * np.pi * cycles)), damping / np.sqrt(2 * np.pi * damping * cycles)
