"""Shapes and modal masses from residues, with standard deviations.

The residue of an accelerance is the product of the mass-normalised components at the response and at the force. With a
shape of unit norm `u` and a modal mass `m`, ``R = u l``, and at a driving point ``l = u_d / m``.

References
----------
Ewins, D. J. (2000). Modal testing: theory, practice and application. 2nd edition, section 4.4.3: modal constants.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from daq import FloatArray
from oma.mac import normalise
from oma.responses.resonance_fit import FittedMode
from oma.types import ComplexArray
from oma.uff import places_by_name

_PARALLEL = 1e-6  # difference of directions


@dataclass(frozen=True, kw_only=True)
class DrivingPoint:
    """A force at the place of a channel."""

    channel: int  #: its column
    force: int  #: the force's column
    sign: float  #: -1 if the two point in opposite directions


def driving_points(channels: Sequence[str], forces: Sequence[str]) -> list[DrivingPoint]:
    """Return the forces along a channel; a name with an axis, ``12_-z``, is a node and a direction.

    Parameters
    ----------
    channels, forces : names, each different
    """
    places = places_by_name(list(dict.fromkeys([*channels, *forces])))
    found = []
    for k, force in enumerate(forces):
        for i, channel in enumerate(channels):
            along = float(np.dot(places[channel].direction, places[force].direction))
            if places[channel].node == places[force].node and abs(along) > 1 - _PARALLEL:
                found.append(DrivingPoint(channel=i, force=k, sign=float(np.sign(along))))
    return found


def unit_shape(mode: FittedMode) -> tuple[ComplexArray, FloatArray]:
    """Return the shape (n_channels,) of unit norm that is in the residues of all forces, and its deviation."""
    left, sizes, right = np.linalg.svd(mode.residue, full_matrices=False)
    deviation = np.sqrt(mode.residue_std**2 @ np.abs(right[0]) ** 2) / sizes[0]
    return normalise(left[:, 0]), deviation


def modal_mass(mode: FittedMode, points: Sequence[DrivingPoint]) -> tuple[float, float]:
    """Return the modal mass of the unit shape and its standard deviation [kg]; NaN without a driving point.

    A negative mass shows that force and response at the driving point have opposite signs. The deviation follows the
    noise of the residues and the errors of the poles to first order. The calibration of the sensors is not in it.
    """
    if not points:
        return np.nan, np.nan
    inverse = _inverse_mass(mode.residue, points)
    step = 1e-4 * float(np.abs(mode.residue).max())
    variance = 0.0
    for place, deviation in np.ndenumerate(mode.residue_std):
        moved = mode.residue.copy()
        moved[place] += step
        turned = mode.residue.copy()
        turned[place] += 1j * step
        slopes = [(_inverse_mass(other, points) - inverse) / step for other in (moved, turned)]
        variance += float(deviation**2 * np.sum(np.square(slopes)))
    size = np.maximum(np.abs(mode.residue_moves).max(axis=(1, 2)), 1e-300)
    for move, largest in zip(mode.residue_moves, size.tolist(), strict=True):
        slope = (_inverse_mass(mode.residue + move * (step / largest), points) - inverse) / (step / largest)
        variance += slope**2
    return 1 / inverse, float(np.sqrt(variance)) / inverse**2


def _inverse_mass(residue: ComplexArray, points: Sequence[DrivingPoint]) -> float:
    """Return 1 / m by least squares over the driving points."""
    shape = normalise(np.linalg.svd(residue, full_matrices=False)[0][:, 0])
    along = shape.conj() @ residue
    own = np.array([point.sign * shape[point.channel] for point in points])
    driven = np.array([along[point.force] for point in points])
    return float(np.real(np.vdot(own, driven)) / np.sum(np.abs(own) ** 2))
