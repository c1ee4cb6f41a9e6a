"""Virtual sensors: each signal predicted from the others through simulated modes.

About every resonance the signals are modelled as S = sum_k q_k |H_k|^2 phi_k phi_k^T + N: modes phi_k with the measured
frequencies and damping, forced by white noise of density q_k, and noise N. The best linear prediction of a sensor by
all others follows from S^-1 at once, x_c - (S^-1 x)_c / (S^-1)_cc: a modal filter whose weights change with frequency,
so that near a resonance its mode dominates. N is the part of a sensor that the measured spectral matrix itself cannot
predict, 1 / (S^-1)_cc of it, for any shapes: an error beyond that is caused by shapes or sensors. Between resonances,
with small contributions of all modes, nothing is predicted. Modes that were not measured are assumed to be forced as
the others in the median: some of the error is theirs.

References
----------
Kammer, "Estimation of structural response using remote sensor locations", J. Guidance, Control, and Dynamics 20 (1997)
501-508; Rasmussen & Williams, Gaussian Processes for Machine Learning (2006), eq. 5.12; Bendat & Piersol, Random Data
(2010), s. 7.3 on conditioned spectra.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from daq import FloatArray, IndexArray, Recording
from oma import ComplexArray
from oma.preparation import gapless_stretches
from updater.errors import ModalDataError
from updater.modal_data import ModalMean, match_modes
from updater.validation.modal_correlation import known

_MAX = 1 << 16  # samples that are looked at
_BELL = 1.5  # half-power bandwidths each way of a resonance that are looked at: farther off other modes speak
_LINES = 2  # a channel, each way of a resonance at least: from fewer no spectral matrix is known
_SHOWN = 40  # lines of the spectra about a resonance
_DAMPING = 0.005  # damping ratio of a mode whose damping was not measured


@dataclass(frozen=True, eq=False, kw_only=True)
class VirtualSensing:
    """Signals about the resonances: measured, and predicted from the other sensors."""

    channels: tuple[str, ...]
    rate: float  #: [Hz]
    start: int  #: time of the first sample [ns UTC]
    measured: FloatArray  #: (n_samples, n_channels) [m/s2]
    predicted: FloatArray  #: (n_samples, n_channels) [m/s2]
    error: FloatArray  #: (n_channels,) root mean square of the prediction error, relative to the signal's [-]
    expected: FloatArray  #: (n_channels,) the same of the best linear prediction that there is [-]
    frequency: FloatArray  #: (n_lines,) of the spectra, means over neighbours; NaN between resonances [Hz]
    spectrum: FloatArray  #: (n_lines, n_channels) of the measured signals [(m/s2)^2/Hz]
    missed: FloatArray  #: (n_lines, n_channels) prediction error [(m/s2)^2/Hz]


def virtual_sensing(
    recording: Recording, simulated: ModalMean, measured: ModalMean, compared: Sequence[ModalMean] = ()
) -> VirtualSensing:
    """Predict every sensor from the others.

    Parameters
    ----------
    recording : signals; of the longest stretch without a gap the last 2^16 samples
    simulated : (n,) modes whose shapes are tested
    measured : (n_measured,) modes whose frequencies and damping determine their resonances; a mode that was not
        measured keeps the simulated frequency
    compared : other simulated modes, whose resonances are evaluated as well: models are compared on the same lines

    Raises
    ------
    ModalDataError
        If fewer than three channels are common, or the recording is too short.
    """
    channels = tuple(c.name for c in recording.channels if c.name in simulated.channels and c.name in measured.channels)
    if len(channels) < 3:
        raise ModalDataError(f"channels to predict from each other: expected at least 3, found {len(channels)}")
    first, data = gapless_part(recording, channels)
    lines: FloatArray = np.fft.rfftfreq(len(data), 1 / recording.rate).astype(np.float64)
    measured = known(measured.at(channels))
    modes, paired = _modes(simulated.at(channels), measured)
    for other in compared:
        paired = np.union1d(paired, _modes(other.at(channels), measured)[1])
    parts = _about(_resonances(measured, paired), lines, 2 * _LINES * len(channels))
    if not parts:
        raise ModalDataError(
            f"recording: {len(data) / recording.rate:.3g} s are too short, or its rate too low, for a mode"
        )
    spectrum: ComplexArray = np.fft.rfft(data - data.mean(0), axis=0)
    found = [_left_out(spectrum[part], lines[part], modes) for part in parts]
    inside = np.concatenate(parts)
    missed = np.concatenate([missed for missed, _ in found])
    lost = sum(len(part) * floor for part, (_, floor) in zip(parts, found, strict=True))
    power = (np.abs(spectrum[inside]) ** 2).sum(0)
    density = 2 / (recording.rate * len(data))
    return VirtualSensing(
        channels=channels,
        rate=recording.rate,
        start=recording.start + round(first / recording.rate * 1e9),
        measured=_back(spectrum[inside], inside, len(data)),
        predicted=_back(spectrum[inside] - missed, inside, len(data)),
        error=np.sqrt((np.abs(missed) ** 2).sum(0) / power),
        expected=np.sqrt(lost / power),
        frequency=_means([lines[part, None] for part in parts])[:, 0],
        spectrum=density * _means([np.abs(spectrum[part]) ** 2 for part in parts]),
        missed=density * _means([np.abs(part) ** 2 for part, _ in found]),
    )


def gapless_part(recording: Recording, channels: tuple[str, ...]) -> tuple[int, FloatArray]:
    """Return the number of the first sample of the longest stretch without a gap, and its data.

    The data (n_samples, n_channels) [m/s2] are cut to the longest length that is analysed.

    Raises
    ------
    ModalDataError
        If no sample is without a gap.
    """
    names = [c.name for c in recording.channels]
    data = recording.data[:, [names.index(c) for c in channels]]
    stretches = gapless_stretches(data)
    if not stretches:
        raise ModalDataError("recording: no sample without a gap")
    start, stop = max(stretches, key=lambda part: part[1] - part[0])
    first = max(start, stop - _MAX)
    return first, data[first:stop]


@dataclass(frozen=True, eq=False)
class _Modes:
    """Predictor of the signals."""

    frequency: FloatArray  #: (n,) [Hz]
    damping: FloatArray  #: (n,) [-]
    shape: FloatArray  #: (n, n_channels) unit norm [-]

    def response(self, lines: FloatArray) -> FloatArray:
        """Return |H|^2 (n_lines, n), of acceleration by a modal force."""
        ratio2 = (lines[:, None] / self.frequency) ** 2
        return np.asarray(ratio2**2 / ((1 - ratio2) ** 2 + 4 * self.damping**2 * ratio2))


def _modes(simulated: ModalMean, measured: ModalMean) -> tuple[_Modes, IndexArray]:
    """Return the modes, and the measured modes (n,) that are paired with one of them, ascending."""
    partner = match_modes(simulated, measured)
    there = partner >= 0
    frequency, damping = np.exp(simulated.log_frequency), np.full(len(partner), _DAMPING)
    frequency[there] = np.exp(measured.log_frequency[partner[there]])
    damping[there] = _damping(measured)[partner[there]]
    return _Modes(frequency, damping, simulated.shape), np.unique(partner[there])


def _damping(measured: ModalMean) -> FloatArray:
    """Return the damping (n,) of measured modes, a usual one where it is not known [-]."""
    return np.where(np.isfinite(measured.damping), measured.damping, _DAMPING)


def _resonances(measured: ModalMean, which: IndexArray) -> FloatArray:
    """Return frequency and half-power bandwidth (n, 2) of some measured modes [Hz]."""
    frequency = np.exp(measured.log_frequency[which])
    return np.column_stack([frequency, 2 * _damping(measured)[which] * frequency])


def _about(resonances: FloatArray, lines: FloatArray, least: int) -> list[IndexArray]:
    """Return the lines about resonances, overlapping ones together; lines outside the spectrum are left out."""
    step = float(lines[1] - lines[0])
    inside = np.zeros(len(lines), bool)
    for frequency, width in resonances:
        reach = max(_BELL * width, 0.5 * least * step)
        if step < frequency - reach and frequency + reach < lines[-1]:
            inside |= np.abs(lines - frequency) <= reach
    runs = np.split(np.arange(len(lines)), np.flatnonzero(np.diff(inside.astype(np.int8))) + 1)
    return [run for run in runs if inside[run[0]]]


def _left_out(spectrum: ComplexArray, lines: FloatArray, modes: _Modes) -> tuple[ComplexArray, FloatArray]:
    """Return each sensor's prediction error by the others (n_lines, n_channels), and its minimum (n_channels,).

    Parameters
    ----------
    spectrum : (n_lines, n_channels) about some resonances
    lines : (n_lines,) [Hz]
    """
    response, floor = modes.response(lines), _unpredictable(spectrum)
    force = _forces(spectrum, lines, modes, response)
    signal = np.einsum("lk,kc,kd->lcd", response * force, modes.shape, modes.shape, optimize=True)
    inverse = np.linalg.inv(signal + np.diag(floor))
    return np.einsum("lcd,ld->lc", inverse, spectrum) / np.diagonal(inverse, axis1=1, axis2=2), floor


def _forces(spectrum: ComplexArray, lines: FloatArray, modes: _Modes, response: FloatArray) -> FloatArray:
    """Return the density (n,) of each mode's force: by the lines about its resonance, else the others' median.

    None where no mode has its resonance there: a model that lacks the mode predicts nothing.
    """
    found = np.full(len(modes.frequency), np.nan)
    for k, (frequency, shape) in enumerate(zip(modes.frequency, modes.shape, strict=True)):
        if lines[0] < frequency < lines[-1]:
            near = np.argsort(np.abs(lines - frequency))[: max(4, len(lines) // 4)]
            found[k] = (np.abs(spectrum[near] @ shape) ** 2).mean() / response[near, k].mean()
    known = np.isfinite(found)
    return np.where(known, found, np.median(found[known]) if known.any() else 0.0)


def _unpredictable(spectrum: ComplexArray) -> FloatArray:
    """Return the power (n_channels,) that the best linear prediction by the other sensors leaves, without bias."""
    n_lines, n_channels = spectrum.shape
    matrix = (spectrum.T @ spectrum.conj()) / n_lines
    floor = 1e-12 * float(np.trace(matrix).real)  # exact copies of a channel leave nothing
    inverse = np.linalg.inv(matrix + floor * np.eye(n_channels))
    return np.asarray(n_lines / (n_lines - n_channels + 1) / np.diagonal(inverse).real)


def _means(parts: list[FloatArray]) -> FloatArray:
    """Return means over neighbouring rows of each part, a row of NaN after each."""
    rows: list[FloatArray] = []
    for part in parts:
        rows += [block.mean(0) for block in np.array_split(part, min(len(part), _SHOWN))]
        rows.append(np.full(part.shape[1], np.nan))
    return np.array(rows[:-1])


def _back(spectrum: ComplexArray, inside: IndexArray, n_samples: int) -> FloatArray:
    """Return signals (n_samples, n_channels) of some lines."""
    whole = np.zeros((n_samples // 2 + 1, spectrum.shape[1]), complex)
    whole[inside] = spectrum
    return np.asarray(np.fft.irfft(whole, n_samples, axis=0))
