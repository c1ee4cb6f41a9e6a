"""Residues of known poles, with a lower and an upper residual term, and the responses that they make up.

References
----------
Ewins, D. J. (2000). Modal testing: theory, practice and application. 2nd edition, section 4.4: residual terms.
Heylen, W., Lammens, S., Sas, P. (1997). Modal analysis theory and testing. KU Leuven: least squares frequency domain.
"""

import numpy as np

from oma.responses.lines import Lines
from oma.types import ComplexArray


def residues(lines: Lines, pole: ComplexArray, participation: ComplexArray) -> ComplexArray:
    """Return shapes (n_poles, n_channels) by least squares: each residue is a shape times a known participation.

    Parameters
    ----------
    lines : Lines
    pole : (n_poles,) [rad/s]
    participation : (n_poles, n_inputs)
    """
    s, n_inputs = lines.laplace, lines.response.shape[2]
    halves = [
        factor / (s[:, None, None] - p[:, None])
        for p, factor in ((pole, participation), (pole.conj(), participation.conj()))
    ]
    beyond = [term[:, None, None] * np.eye(n_inputs) for term in _residual_terms(lines).T]
    design = np.concatenate([*(half.transpose(0, 2, 1) for half in halves), *beyond], axis=2)
    design = design.reshape(len(s) * n_inputs, -1)
    weight = 1 / np.sqrt(np.sum(np.abs(lines.response) ** 2, axis=(1, 2)))
    rows = np.repeat(weight, n_inputs)[:, None]
    wanted = lines.response.transpose(0, 2, 1).reshape(len(s) * n_inputs, -1)
    return np.asarray(np.linalg.lstsq(design * rows, wanted * rows, rcond=None)[0][: len(pole)])


def synthesis(lines: Lines, pole: ComplexArray) -> ComplexArray:
    """Return the responses (n_lines, n_channels, n_inputs) of poles, with residues and residual terms fitted to all.

    Residues of a pole and of its conjugate are free: shapes may be complex.

    Parameters
    ----------
    lines : Lines
    pole : (n_poles,) [rad/s]
    """
    s = lines.laplace[:, None]
    halves = np.concatenate([s**2 / (s - pole), s**2 / (s - pole.conj())], axis=1)
    # the two halves of a mode as real and imaginary part of its residue, so that responses are of real signals
    n = len(pole)
    design = np.concatenate(
        [halves[:, :n] + halves[:, n:], 1j * (halves[:, :n] - halves[:, n:]), _residual_terms(lines)], axis=1
    )
    size = np.linalg.norm(design, axis=0)
    stacked = np.concatenate([(design / size).real, (design / size).imag])
    wanted = np.concatenate([lines.flat.real, lines.flat.imag])
    found = np.linalg.lstsq(stacked, wanted, rcond=None)[0]
    return np.asarray((design / size) @ found).reshape(lines.response.shape)


def _residual_terms(lines: Lines) -> ComplexArray:
    """Return what modes below and above the band add to accelerances: a constant, and the square of s, (n_lines, 2)."""
    s = lines.laplace / np.abs(lines.laplace[-1])
    return np.stack([np.ones_like(s), s**2], axis=1)
