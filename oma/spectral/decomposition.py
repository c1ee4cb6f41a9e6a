"""Singular value decomposition of a spectral matrix per line, and the influence of blocks of time.

References
----------
Brincker, R., Zhang, L., Andersen, P. (2001). Modal identification of output-only systems using frequency domain
decomposition. Smart Materials and Structures 10(3), 441-445.
Stewart, G. W., Sun, J.-G. (1990). Matrix perturbation theory. Academic Press, chapter 5: vectors of a moved matrix.
"""

from dataclasses import dataclass

import numpy as np

from daq import FloatArray
from oma.spectral.bell_fit import Windowed
from oma.spectral.spectra import SpectralSums
from oma.types import ComplexArray

MIN_LINES = 8  #: lines on each side of a resonance required for a background
_HALF_WIDTHS = 16  # half widths on each side of a resonance: its tails contain half of the information on its damping
_LEVELS = 3  # singular values that are searched: as many modes may be close to each other


@dataclass(frozen=True, eq=False)
class Decomposition:
    """Singular values and vectors of a spectral matrix, and their changes by each block of time."""

    sums: SpectralSums
    matrix: ComplexArray  #: (n_lines, n_channels, n_channels)
    values: FloatArray  #: (n_lines, n_levels), falling
    vectors: ComplexArray  #: (n_lines, n_levels, n_channels)

    @property
    def width(self) -> float:
        """Distance of two lines [rad/s]."""
        return 2 * np.pi * self.sums.rate / self.sums.n_fft

    def windowed(self, lines: slice) -> Windowed:
        """Return the spectra of poles on some of the lines."""
        first = self.sums.first
        return Windowed(
            window=self.sums.window, rate=self.sums.rate, lines=slice(lines.start + first, lines.stop + first)
        )

    def around(self, pole: complex) -> slice:
        """Return the lines that the bell of a pole covers."""
        reach = max(MIN_LINES, round(_HALF_WIDTHS * -pole.real / self.width))
        centre = round(pole.imag / self.width) - self.sums.first
        n = len(self.matrix)
        centre, reach = min(max(centre, 0), n - 1), min(reach, n // 4)
        return slice(max(centre - reach, 0), min(centre + reach + 1, n))

    def moved(self, vector: ComplexArray, lines: slice) -> FloatArray:
        """Return the changes by each block of the spectrum that is filtered by a vector, (n_blocks, n_lines)."""
        moves = self.sums.influences(lines)
        return np.stack([np.einsum("i,lij,j->l", vector.conj(), move, vector).real for move in moves])

    def moved_vectors(self, lines: slice, weight: FloatArray, like: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
        """Return the eigenvector of a weighted sum of lines most similar to another one, and its changes by each block.

        Parameters
        ----------
        lines : slice
        weight : (n_lines,) array
        like : (n_channels,) array

        Returns
        -------
        vector : (n_channels,) array
        moves : (n_blocks, n_channels) array
        """
        values, vectors = np.linalg.eigh(np.einsum("l,lij->ij", weight, self.matrix[lines]))
        k = int(np.argmax(np.abs(like.conj() @ vectors)))
        first, gap = vectors[:, k], values[k] - values
        gap[k] = np.inf
        turned = (vectors / gap) @ vectors.conj().T
        moves = [turned @ (np.einsum("l,lij->ij", weight, move) @ first) for move in self.sums.influences(lines)]
        return first, np.array(moves)

    def filtered(self, vector: ComplexArray, lines: slice) -> FloatArray:
        """Return the spectrum (n_frequencies,) of the signals combined by the weights of a vector."""
        return np.asarray(np.einsum("i,lij,j->l", vector.conj(), self.matrix[lines], vector).real)


def decompose(sums: SpectralSums) -> Decomposition:
    """Return the singular value decomposition of every line."""
    matrix = sums.mean()
    values, vectors = np.linalg.eigh(matrix)
    n_levels = max(1, min(_LEVELS, sums.n_channels // 2))
    return Decomposition(
        sums=sums,
        matrix=matrix,
        values=values[:, : -n_levels - 1 : -1],
        vectors=vectors[:, :, : -n_levels - 1 : -1].transpose(0, 2, 1),
    )
