"""Length scale of a structure, relative to the frame of 1.5 m on which the length constants were tuned."""

import numpy as np

from updater.structure import Structure

_USUAL = 1.48  # m, the longest member of the frame that lengths were chosen on


def size(structure: Structure) -> float:
    """Return the longest member over that of the usual frame: what a body's offset or a neighbourhood scales by."""
    return max(member.length for member in structure.member) / _USUAL


def extent(structure: Structure) -> float:
    """Return the largest dimension along an axis over that of the usual frame, however lines are cut into members."""
    ends = np.array([end for member in structure.member for end in (member.start, member.end)])
    return float(np.ptp(ends, axis=0).max()) / _USUAL


def fineness(structure: Structure) -> float:
    """Return what spacings of places scale by: small structures need smaller ones, large ones bear the usual."""
    return min(1.0, size(structure))
