"""The front of experimental modal analysis: frequency responses in, modes out, nothing to choose."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from daq import FloatArray
from oma.errors import IdentificationError, InputError, TooFewModes
from oma.mac import mac_matrix
from oma.responses.lines import Lines, noise_levels
from oma.responses.modal_mass import driving_points, modal_mass, unit_shape
from oma.responses.residues import synthesis
from oma.responses.resonance_fit import FittedMode, fitted_modes
from oma.responses.stable_poles import stable_poles
from oma.types import ComplexArray, ModalEstimate, Stabilization

_MIN_LINES = 60  # in the band


@dataclass(frozen=True, eq=False, kw_only=True)
class ResponseIdentification:
    """Modes of frequency responses, and the poles from which they were selected."""

    estimate: ModalEstimate  #: `support` is the share of orders that show a mode
    modal_mass: FloatArray  #: (n_modes,) of the unit shapes, NaN without a driving point [kg]
    modal_mass_std: FloatArray  #: (n_modes,) [kg]
    poles: Stabilization
    frequency: FloatArray  #: (n_lines,) lines in the band [Hz]
    response: ComplexArray  #: (n_lines, n_channels, n_forces) measured accelerances [m/s2/N]
    synthesis: ComplexArray  #: (n_lines, n_channels, n_forces) those of the modes and residual terms [m/s2/N]
    forces: tuple[str, ...]  #: names of the forces, in the order of the last axis
    silent: tuple[str, ...]  #: channels that are left out: their responses are zero in all lines
    band: tuple[float, float]  #: frequencies in which modes were sought [Hz]
    decay: float  #: decay rate of the exponential window, 0 without a window [1/s]
    weighted: bool  #: whether lines and responses weigh by their coherence

    @property
    def record_seconds(self) -> float:
        """Length of the records that have such lines [s]."""
        return float(1 / np.diff(self.frequency).min())

    @property
    def left_at_end(self) -> FloatArray:
        """Amplitude that free vibration has left at the end of a record, window included, (n_modes,) [-].

        It is the relative error of residues after a blow: the record is cut. Poles have no such error.
        """
        rate = 2 * np.pi * self.estimate.frequency * self.estimate.damping + self.decay
        return np.asarray(np.exp(-rate * self.record_seconds))

    @property
    def mass_normalised_shape(self) -> ComplexArray:
        """Shapes of unit modal mass, (n_modes, n_channels), NaN without a driving point [kg^-1/2]."""
        return np.asarray(self.estimate.shape / np.sqrt(self.modal_mass.astype(np.complex128))[:, None])

    @property
    def agreement(self) -> FloatArray:
        """Frequency response assurance criterion of synthesis and measurement, (n_channels, n_forces) [-].

        NaN for a response that is zero in all lines.

        References
        ----------
        Heylen, W. & Lammens, S. (1996). FRAC: a consistent way of comparing frequency response functions. Proceedings
        of Identification in Engineering Systems, Swansea.
        """
        n_lines, *shape = self.response.shape
        pairs = zip(self.response.reshape(n_lines, -1).T, self.synthesis.reshape(n_lines, -1).T, strict=True)
        found = [mac_matrix(a[None], b[None])[0, 0] if a.any() else np.nan for a, b in pairs]
        return np.array(found).reshape(shape)


def identify_responses(
    frequency: FloatArray,
    response: ComplexArray,
    channels: Sequence[str],
    band: tuple[float, float] | None = None,
) -> ModalEstimate:
    """Identify modes from the responses of a structure to measured forces.

    Parameters
    ----------
    frequency : (n_lines,) evenly spaced lines [Hz]
    response : (n_lines, n_channels, n_inputs) accelerances [m/s2/N]. Lines and channels that are zero are left out
    channels : names
    band : frequencies in which modes are sought [Hz]. Default: that of the lines

    Returns
    -------
    ModalEstimate
        Its `support` is the share of orders that show the mode.

    Raises
    ------
    InputError
        If shapes do not agree, the lines are not even, or a response in the band is not finite.
    TooFewModes, IdentificationError
        If the band has too few lines, or nothing is a mode.
    """
    return identify_responses_all(frequency, response, channels, band=band).estimate


def identify_responses_all(
    frequency: FloatArray,
    response: ComplexArray,
    channels: Sequence[str],
    forces: Sequence[str] = (),
    band: tuple[float, float] | None = None,
    window: float | None = None,
    coherence: FloatArray | None = None,
) -> ResponseIdentification:
    """Identify modes, their modal masses, and the responses synthesised from them.

    Parameters
    ----------
    frequency, response, channels, band : as for `identify_responses`
    forces : names of the forces. Those along a channel, such as ``12_-z`` at ``12_z``, are driving points, which give
        modal masses
    window : time constant of the exponential window of forces and responses [s]; its damping is removed. Default: none
    coherence : (n_lines, n_channels, n_inputs) of each response and force [-]: lines and responses weigh by the noise
        that it states, unless it is one in most lines, as of a single blow. Default: all weigh alike

    Raises
    ------
    InputError, TooFewModes, IdentificationError
        As for `identify_responses`.
    """
    lines, band = _lines(frequency, response, channels, band, 1 / window if window else 0.0)
    moving = lines.moving
    silent = tuple(np.delete(np.array(channels), moving).tolist())
    alike = lines.of_channels(moving)
    lines, weighted = _weighted(lines, frequency, coherence)
    lines = lines.of_channels(moving)
    channels = [channel for channel in channels if channel not in silent]
    poles, diagram = stable_poles(lines, band)
    modes = fitted_modes(poles, lines)
    if weighted:
        modes += _lost(modes, fitted_modes(stable_poles(alike, band)[0], alike))
    modes = sorted(modes, key=lambda mode: mode.frequency)
    if not modes:
        raise TooFewModes(len(diagram))
    forces = forces or tuple(f"force {k + 1}" for k in range(lines.response.shape[2]))
    points = driving_points(channels, forces)
    masses = np.array([modal_mass(mode, points) for mode in modes])
    estimate = _estimate(modes, channels)
    size = 2 * np.pi * estimate.frequency
    continuous = size * (-estimate.damping + 1j * np.sqrt(1 - estimate.damping**2))
    return ResponseIdentification(
        estimate=estimate,
        modal_mass=masses[:, 0],
        modal_mass_std=masses[:, 1],
        poles=diagram,
        frequency=lines.frequency,
        response=lines.response,
        synthesis=synthesis(lines, continuous),
        forces=tuple(forces),
        silent=silent,
        band=band,
        decay=lines.decay,
        weighted=weighted,
    )


def _weighted(lines: Lines, frequency: FloatArray, coherence: FloatArray | None) -> tuple[Lines, bool]:
    """Return lines with the noise of coherences (n_lines, n_channels, n_inputs), and whether that is known."""
    if coherence is None:
        return lines, False
    if coherence.shape != (len(frequency), *lines.response.shape[1:]):
        raise InputError(f"coherence: expected the shape of the responses, found {coherence.shape}")
    levels = noise_levels(lines.response, coherence[np.isin(frequency, lines.frequency)])
    if levels is None:
        return lines, False
    return replace(lines, line_noise=levels[0], response_noise=levels[1]), True


def _lost(modes: Sequence[FittedMode], alike: Sequence[FittedMode]) -> list[FittedMode]:
    """Return the modes of a fit in which all responses weigh alike that are not among those of the weighted fit.

    If a close mode is not separated, the most accurate responses contradict the fit, and the mode seems insignificant.
    """
    return [m for m in alike if all(abs(m.frequency - k.frequency) > m.damping * m.frequency for k in modes)]


def _lines(
    frequency: FloatArray,
    response: ComplexArray,
    channels: Sequence[str],
    band: tuple[float, float] | None,
    decay: float,
) -> tuple[Lines, tuple[float, float]]:
    """Return the lines of the band that are not zero, checked, and the band."""
    if response.ndim != 3 or response.shape[:2] != (len(frequency), len(channels)):
        raise InputError(f"response: expected ({len(frequency)}, {len(channels)}, n_inputs), found {response.shape}")
    spacing = float(np.median(np.diff(frequency))) if len(frequency) > 1 else 0.0
    if spacing <= 0 or np.abs(np.diff(frequency) / spacing - 1).max() > 1e-2:
        raise InputError("frequency: expected evenly spaced, rising lines")
    low, high = band or (max(float(frequency[0]), spacing), float(frequency[-1]))
    inside = (frequency >= low) & (frequency <= high) & (frequency > 0.5 * spacing) & response.any(axis=(1, 2))
    if not np.isfinite(response[inside]).all():
        raise InputError(f"response: expected finite values from {low:g} to {high:g} Hz")
    if np.count_nonzero(inside) < _MIN_LINES:
        raise IdentificationError(f"{low:g} to {high:g} Hz: expected {_MIN_LINES} lines or more")
    lines = Lines(
        frequency=frequency[inside],
        response=response[inside],
        spacing=spacing,
        decay=decay,
        line_noise=np.ones(np.count_nonzero(inside)),
        response_noise=np.ones(response.shape[1:]),
    )
    return lines, (low, high)


def _estimate(modes: Sequence[FittedMode], channels: Sequence[str]) -> ModalEstimate:
    """Put modes into arrays."""
    shapes = [unit_shape(mode) for mode in modes]
    return ModalEstimate(
        channels=tuple(channels),
        frequency=np.array([mode.frequency for mode in modes]),
        frequency_std=np.array([mode.frequency_std for mode in modes]),
        damping=np.array([mode.damping for mode in modes]),
        damping_std=np.array([mode.damping_std for mode in modes]),
        shape=np.array([shape for shape, _ in shapes]),
        shape_std=np.array([deviation for _, deviation in shapes]),
        support=np.array([mode.support for mode in modes]),
        law_ratio=np.ones(len(modes)),
        start=0,
        end=0,
    )
