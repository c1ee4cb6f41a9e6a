"""Spectral densities of modal forces and sensor noise, estimated from a record.

At every line of the spectrum the signals are y = Phi H p + v, with modal forces p of one real covariance at all lines
and independent noise v of each sensor. The expectation-maximisation algorithm of a factor model maximises the Whittle
likelihood: the posterior second moments of p and v are averaged over the lines (Rubin & Thayer, eqs 6 and 7). If there
are as many modes as sensors, the model fits the signals exactly, and the estimated noise is near zero although the
shapes have errors: these are added to v.

References
----------
Rubin, D. B. & Thayer, D. T. (1982). EM algorithms for ML factor analysis. Psychometrika 47(1), 69-76.
Whittle, P. (1953). Estimation and information in stationary time series. Arkiv for Matematik 2(5), 423-434.
"""

from dataclasses import dataclass

import numpy as np

from daq import FloatArray, IndexArray
from oma import ComplexArray
from oma.spectral import spectral_matrix
from updater.validation.response.modal_system import ModalSystem

_ITERATIONS = 60
_LEAST_NOISE = 1e-9  # of a sensor's mean density
_LINES = 4  # per half-power bandwidth of the narrowest mode
_BLOCKS = 4  # of a record, at least
_NEAR = 6  # half bandwidths, or lines, each way of a resonance within which every line is used
_SPACING = 16  # lines between resonances


@dataclass(frozen=True, eq=False, kw_only=True)
class Excitation:
    """Two-sided spectral densities."""

    force: FloatArray  #: (n_modes, n_modes) of the modal forces [N2/(kg Hz)]
    noise: FloatArray  #: (n_channels,) of the sensors [(m/s2)^2/Hz]

    def with_shape_errors(self, lines: FloatArray, system: ModalSystem, std: FloatArray) -> "Excitation":
        """Return densities with the errors of the shapes at the sensors as noise, by their mean over a band.

        Parameters
        ----------
        lines : (n_lines,) of the band, at one spacing [Hz]
        system : modes
        std : (n_modes,) standard deviation of a component of a mass-normalised shape [kg^-1/2]
        """
        motion = (np.abs(system.accelerance(lines)) ** 2).mean(0) * np.diag(self.force)
        return Excitation(force=self.force, noise=self.noise + float(motion @ std**2))


def spectral_matrices(
    data: FloatArray, rate: float, band: tuple[float, float], system: ModalSystem
) -> tuple[FloatArray, ComplexArray]:
    """Return lines (n_lines,) [Hz] in a band, and two-sided spectral matrices (n_lines, n_channels, n_channels).

    Welch's method with half-overlapping Hann windows, as long as the narrowest mode requires and the record allows.

    Parameters
    ----------
    data : (n_samples, n_channels) without gaps [m/s2]
    rate : [Hz]
    band : lowest and highest line [Hz]
    system : modes
    """
    narrowest = float((2 * system.damping * system.frequency).min())
    wanted = 1 << int(np.ceil(np.log2(_LINES * rate / narrowest)))
    most = 1 << int(np.log2(max(len(data) // _BLOCKS, 2)))
    size = min(wanted, most)
    lines: FloatArray = np.fft.rfftfreq(size, 1 / rate).astype(np.float64)
    inside = (band[0] <= lines) & (lines <= band[1])
    return lines[inside], spectral_matrix(data, rate, size)[inside] / 2


def estimate_excitation(
    lines: FloatArray, matrices: ComplexArray, system: ModalSystem, shape: FloatArray
) -> Excitation:
    """Estimate the densities of the modal forces and of the sensors' noise.

    Parameters
    ----------
    lines : (n_lines,) [Hz]
    matrices : (n_lines, n_channels, n_channels) two-sided spectral matrices [(m/s2)^2/Hz]
    system : modes
    shape : (n_channels, n_modes) mass-normalised at the sensors [kg^-1/2]
    """
    kept, share = _thinned(lines, system)
    lines, matrices = lines[kept], matrices[kept]
    response = shape * system.accelerance(lines)[:, None, :]
    back = np.ascontiguousarray(response.conj().swapaxes(1, 2))
    density = np.einsum("lcc->lc", matrices).real
    power = share @ density
    noise = 0.1 * power
    force = np.eye(len(system.frequency)) * power.sum() / (share @ (np.abs(response) ** 2).sum((1, 2)))
    for _ in range(_ITERATIONS):
        # E[p | y] = weight y by a solution for each line: with an explicit inverse of the nearly singular covariance at
        # a resonance, rounding grows to 2e-4 of the noise in 60 steps
        common = force @ back  # covariance of forces and signals
        weight = np.linalg.solve(response @ common + np.diag(noise), common.conj().swapaxes(1, 2)).conj().swapaxes(1, 2)
        measured = weight @ matrices
        moment = (measured - common) @ weight.conj().swapaxes(1, 2) + force
        left = density + (back.conj() * (moment @ back - 2 * measured)).real.sum(1)
        noise = np.maximum(share @ left, _LEAST_NOISE * power)
        force = np.tensordot(share, moment.real, 1)
        force = (force + force.T) / 2
    return Excitation(force=force, noise=noise)


def _thinned(lines: FloatArray, system: ModalSystem) -> tuple[IndexArray, FloatArray]:
    """Return all lines near resonances and some between, and the share of the band that each represents."""
    index = np.arange(len(lines))
    half = np.maximum(_NEAR * system.damping * system.frequency, _NEAR * (lines[1] - lines[0]))
    near = (np.abs(lines[:, None] - system.frequency) < half).any(1)
    kept = np.flatnonzero(near | (index % _SPACING == 0) | (index == len(lines) - 1))
    edges = np.r_[0, (kept[1:] + kept[:-1]) / 2, len(lines) - 1]
    return kept, np.diff(edges) / (len(lines) - 1)
