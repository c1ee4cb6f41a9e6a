"""Comparing and judging mode shapes.

References
----------
Lieven, N. A. J., Ewins, D. J. (1988). Spatial correlation of mode shapes, the coordinate modal assurance criterion
(COMAC). Proceedings of IMAC VI, 690-695.
Allemang, R. J. (2003). The modal assurance criterion, twenty years of use and abuse. Sound and Vibration 37(8), 14-21.
Pappa, R. S., Elliott, K. B., Schenk, A. (1993). Consistent-mode indicator for the eigensystem realization algorithm.
Journal of Guidance, Control, and Dynamics 16(5), 852-858.
Reynders, E., Houbrechts, J., De Roeck, G. (2012). Fully automated (operational) modal analysis. MSSP 29, 228-250.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from daq import ComplexArray, FloatArray

Shapes = npt.NDArray[Any]  #: (..., n_channels) real or complex


def normalise(shapes: Shapes) -> ComplexArray:
    """Scale each shape to unit Euclidean norm and turn it as real as it can be.

    The phase is that of the principal direction in the complex plane, found from the sum of squares; the
    largest component is made positive.

    Parameters
    ----------
    shapes : (..., n_channels) array
        Mode shapes [-].

    Returns
    -------
    (..., n_channels) complex array

    Raises
    ------
    ValueError
        If a shape is zero.
    """
    shapes = np.asarray(shapes, dtype=np.complex128)
    norm = np.linalg.norm(shapes, axis=-1, keepdims=True)
    if np.any(norm == 0):
        raise ValueError("shapes: expected nonzero vectors, found a zero one")
    turned = shapes / norm * np.exp(-0.5j * np.angle(np.sum(shapes**2, axis=-1, keepdims=True)))
    largest = np.take_along_axis(turned, np.argmax(np.abs(turned.real), axis=-1)[..., None], axis=-1)
    result: ComplexArray = turned * np.where(largest.real < 0, -1.0, 1.0)
    return result


def mac_matrix(a: Shapes, b: Shapes) -> FloatArray:
    """Modal assurance criterion between every shape of `a` and every shape of `b`.

    Parameters
    ----------
    a : (n_a, n_channels) array
    b : (n_b, n_channels) array

    Returns
    -------
    (n_a, n_b) array
        0 (orthogonal) to 1 (the same up to a complex factor).

    Raises
    ------
    ValueError
        If the numbers of channels differ.
    """
    if a.shape[-1] != b.shape[-1]:
        raise ValueError(f"shapes: expected equal numbers of channels, found {a.shape[-1]} and {b.shape[-1]}")
    power = np.sum(np.abs(a) ** 2, axis=-1)[:, None] * np.sum(np.abs(b) ** 2, axis=-1)
    result: FloatArray = np.abs(a.conj() @ b.T) ** 2 / power
    return result


def mac(a: Shapes, b: Shapes) -> float:
    """Modal assurance criterion [-] of two shapes, (n_channels,) each; 1 if they agree up to a complex factor.

    Raises
    ------
    ValueError
        If the numbers of channels differ.
    """
    return float(mac_matrix(np.atleast_2d(a), np.atleast_2d(b))[0, 0])


def mpc(shapes: Shapes) -> FloatArray:
    """Modal phase collinearity: 1 for a real (or turned real) shape, 0 for a circle in the complex plane.

    Written as ``|sum phi^2|^2 / (sum |phi|^2)^2``, which equals the eigenvalue form of Pappa et al. (1993). Two
    devices of equal share with the phase difference ``d`` give ``cos^2(d)``: a constant delay of 0.3 ms at 271 Hz
    (29 degrees) leaves 0.76.

    Parameters
    ----------
    shapes : (..., n_channels) array

    Returns
    -------
    (...) array
    """
    result: FloatArray = np.abs(np.sum(shapes**2, axis=-1)) ** 2 / np.sum(np.abs(shapes) ** 2, axis=-1) ** 2
    return result


def mpd(shapes: Shapes) -> FloatArray:
    """Mean phase deviation from the best straight line, weighted with the amplitude [rad].

    Parameters
    ----------
    shapes : (..., n_channels) array

    Returns
    -------
    (...) array
        0 for a real shape, at most pi / 2.
    """
    turned = normalise(shapes)
    weight = np.abs(turned)
    phase = np.arctan2(np.abs(turned.imag), np.abs(turned.real))
    result: FloatArray = np.sum(weight * phase, axis=-1) / np.sum(weight, axis=-1)
    return result


def comac(a: Shapes, b: Shapes) -> FloatArray:
    """Coordinate modal assurance criterion: how far two sets of paired shapes agree at each channel.

    Parameters
    ----------
    a, b : (n_pairs, n_channels) arrays
        Of any norm and phase; each pair is brought to the same first.

    Returns
    -------
    (n_channels,) array
        1 where all pairs agree; low at a channel that is turned, mislabelled or badly coupled. NaN where neither moves.

    Raises
    ------
    ValueError
        If the shapes differ in number or channels.
    """
    if a.shape != b.shape:
        raise ValueError(f"shapes: expected as many pairs at as many channels, found {a.shape} and {b.shape}")
    a, b = normalise(a), normalise(b)
    both = np.sum(np.abs(a * b.conj()), axis=0) ** 2
    power = np.sum(np.abs(a) ** 2, axis=0) * np.sum(np.abs(b) ** 2, axis=0)
    result: FloatArray = np.divide(both, power, out=np.full(len(power), np.nan), where=power > 0)
    return result
