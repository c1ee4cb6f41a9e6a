"""Standard deviations of poles and shapes from the influence of each block of time on them."""

from dataclasses import dataclass

import numpy as np

from daq import FloatArray
from oma.mac import normalise
from oma.types import ComplexArray


@dataclass(frozen=True, eq=False, kw_only=True)
class PoleInfluence:
    """First-order influence of each block of time on a pole."""

    frequency: FloatArray  #: (n_blocks,) [Hz]
    damping: FloatArray  #: (n_blocks,) [-]
    shape: ComplexArray  #: (n_blocks, n_channels), of the normalised shape


def pole_moves(pole: complex, moves: ComplexArray) -> tuple[FloatArray, FloatArray]:
    """Turn moves of a pole [rad/s] into moves of its frequency [Hz] and its damping [-].

    Parameters
    ----------
    pole : complex
    moves : (n_moves,) array

    Returns
    -------
    frequency, damping : (n_moves,) arrays
    """
    growth = np.real(moves * np.conj(pole)) / abs(pole)
    return growth / (2 * np.pi), -moves.real / abs(pole) + pole.real * growth / abs(pole) ** 2


def normalised_move(shape: ComplexArray, move: ComplexArray) -> ComplexArray:
    """Turn moves of a raw shape into moves of the shape of unit norm turned to its principal direction.

    Parameters
    ----------
    shape : (n_channels,) array
    move : (n_moves, n_channels) array

    Returns
    -------
    (n_moves, n_channels) array
    """
    unit = normalise(shape)
    move = move / (shape @ unit.conj())
    move = move - np.outer(np.real(move @ unit.conj()), unit)
    turn = -np.imag(move @ unit) / np.real(np.sum(unit**2))
    result: ComplexArray = move + 1j * np.outer(turn, unit)
    return result


def block_std(influence: FloatArray) -> FloatArray:
    """Return the standard deviation of a sum of blocks from their scatter.

    Blocks count as independent, even if a mode decays more slowly than one lasts: a pole is changed by the forces that
    are new in a block, not by the vibration from the previous block (measured correlation of successive blocks'
    influences: -0.05 to -0.2 at damping 0.2 to 1 %, for any block length).

    Parameters
    ----------
    influence : (n_blocks, ...) array

    Returns
    -------
    (...) array
    """
    result: FloatArray = np.std(influence, axis=0, ddof=1) * np.sqrt(len(influence))
    return result
