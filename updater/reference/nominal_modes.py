"""Map from the modes of the recalibrated model to the modes of the original structure file."""

import numpy as np
from scipy.optimize import linear_sum_assignment

from daq import IndexArray
from oma import mac_matrix
from updater.reference.reference import NominalModel, Reference


def match_nominal_modes(reference: Reference, nominal: NominalModel, channels: tuple[str, ...]) -> IndexArray:
    """Return the file's mode paired with each mode of the recalibrated model (n_modes,), all assigned at once.

    Parameters
    ----------
    reference : of the nearer model
    nominal : its file
    channels : at which shapes are compared
    """
    there = nominal.reference
    apart = np.log(reference.frequency[:, None] / there.frequency)
    unlike = 1 - mac_matrix(reference.at_channels(channels).T, there.at_channels(channels).T)
    apart = np.abs(apart - np.median(np.diag(apart)))
    row, answer = linear_sum_assignment(unlike + apart)
    found: IndexArray = np.argmin(apart, axis=1)  # nearest of the remaining modes
    found[row] = answer
    return found
