"""Alignment of devices: delays from the phases of cross spectra, removed before identification.

Shapes of lightly damped modes are real: two channels move in phase or in antiphase. Twice the phase of their cross
spectrum is therefore zero wherever a mode dominates, for any sign of the shape. A device with a delay tau changes it by
4 pi f tau. All frequencies together determine tau without the ambiguity of a single one. A real shape is required of a
mode (`mpc`): without correction, a device with a delay of a millisecond costs all modes above 100 Hz.

References
----------
Carter, G. C. (1987). Coherence and time delay estimation. Proceedings of the IEEE 75(2), 236-255: the weight of a line.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy import fft

from daq import FloatArray, IndexArray, Recording
from oma.preparation import PASS, BoolArray, bridged, detrended_pieces, usable
from oma.spectral.spectra import SpectrumAccumulator
from oma.spectral.transforms import fast_length
from oma.types import ComplexArray

_LARGEST = 0.01  # s: delay that is looked for
_MIN = 3e-4  # s: smaller delays cost no modes (see `mpc`), and are estimated better from the phases of the modes
_N_FFT, _MIN_FFT, _MIN_SEGMENTS = 4096, 256, 8  # half overlapping
_SPREAD, _JOINED = 24, 6  # pieces, of two segments, of a long record that are looked at first, and at a time
_GRID = 1 << 16  # delays that one transform tries: 31 us apart at 1000 Hz
_MIN_INCOHERENT = 0.01  # share of a line's power resolved by a window of finite length
_MIN_REAL = 0.7  # of 1: how real shapes must be with a delay taken out ...
_MIN_GAIN = 0.1  # ... and required improvement of real shapes by a delay
_ALL_REAL = 0.95  # of 1: as real that a delay can improve it by half of that at most
_SWEEPS = 10
_MARGIN = 16  # samples at the ends and around gaps that a shift spoils


def device_delays(recording: Recording) -> dict[str, float]:
    """Return the delay of each device [s] relative to most of them; zero if it is under 0.3 ms or not significant.

    Parameters
    ----------
    recording : Recording
        Of ambient vibration, a few hundred periods of the lowest modes long; shorter ones have no result (zeros).

    Raises
    ------
    TooFewChannels
        If fewer than two channels carry a signal.
    """
    zero = dict.fromkeys(sorted({channel.device for channel in recording.channels}), 0.0)
    return zero | delays_of_clean(usable(recording))


def delays_of_clean(recording: Recording) -> dict[str, float]:
    """Return device -> delay [s], as `device_delays`, for a recording whose channels all have a signal."""
    return _delays(recording, [channel.device for channel in recording.channels])


def channel_delays(recording: Recording) -> dict[str, float]:
    """Return the delay of each channel that carries a signal [s], as if each had a device of its own.

    For recordings with channels of one device that are not synchronous; see `device_delays`.
    """
    clean = usable(recording)
    return _delays(clean, [channel.name for channel in clean.channels])


def _delays(recording: Recording, column: Sequence[str]) -> dict[str, float]:
    """Return the delays of groups of channels; `column` names the group of each channel."""
    data = recording.data
    devices = sorted(set(column))
    zero = dict.fromkeys(devices, 0.0)
    n_fft = min(_N_FFT, 1 << (2 * len(data) // (_MIN_SEGMENTS + 1)).bit_length() >> 1)
    if len(devices) < 2 or n_fft < _MIN_FFT:
        return zero
    group = np.array([devices.index(name) for name in column])
    few = _spread(data, n_fft)
    if few and _are_real(_doubled_phases(_spectrum(map(np.concatenate, few), len(column), n_fft), group)):
        return zero
    doubled, most = _doubled_phases(_spectrum([data], len(column), n_fft), group)
    if _are_real((doubled, most)):
        return zero
    step = n_fft / recording.rate / 2 / _GRID
    n_steps = int(_LARGEST / step)
    realness = _realness(doubled, 2 * n_steps)
    found = _most_real(realness, most, n_steps)
    believed = _sure(realness, most, found) & (np.abs(step * found) >= _MIN)
    late = np.where(believed, step * found, 0.0)
    return zero | dict(zip(devices, late.tolist(), strict=True))


def aligned(recording: Recording, delays: Mapping[str, float], *, in_place: bool = False) -> Recording:
    """Return a recording without its devices' delays; NaN where a shift leaves no sample.

    Parameters
    ----------
    recording : Recording
    delays : device -> its delay [s]
    in_place : write into the data of the recording, instead of a copy
    """
    data = recording.data if in_place else recording.data.copy()
    for k, channel in enumerate(recording.channels):
        if delays[channel.device]:
            data[:, k] = _advanced(data[:, k], delays[channel.device] * recording.rate)
    return replace(recording, data=data)


def _spectrum(records: Iterable[FloatArray], n_channels: int, n_fft: int) -> ComplexArray:
    """Return the spectral matrix of records, one after the other, each without its mean and slope.

    Up to the highest line used, (n_lines, n_channels, n_channels), in any unit.
    """
    sums = SpectrumAccumulator(n_channels, 1.0, n_fft, (0.0, PASS), single=True)
    pieces = (piece for record in records for piece in detrended_pieces(record, sums.at_once))
    total = sums.total(next(pieces))[0]
    for piece in pieces:
        total += sums.total(piece)[0]
    return total


def _spread(data: FloatArray, n_fft: int) -> list[list[FloatArray]]:
    """Return some pieces of a long record, spread evenly over it, a few at a time; nothing of a short one."""
    length = 2 * n_fft
    if len(data) < 2 * _SPREAD * length:
        return []
    starts = np.linspace(0, len(data) - length, _SPREAD).astype(np.intp).tolist()
    pieces = [data[start : start + length] for start in starts]
    if not all(np.isfinite(piece).all() for piece in pieces):
        return []
    return [pieces[k : k + _JOINED] for k in range(0, _SPREAD, _JOINED)]


def _doubled_phases(spectrum: ComplexArray, group: IndexArray) -> tuple[ComplexArray, FloatArray]:
    """Return exp(2i phase) times its weight, the inverse variance, summed over the pairs of channels of two groups.

    Parameters
    ----------
    spectrum : (n_used, n_channels, n_channels), the first one not used
    group : (n_channels,) number of each channel's group

    Returns
    -------
    doubled : (n_groups, n_groups, n_lines)
        Of a group and a later one; zero elsewhere and on lines that are not used.
    most : (n_groups, n_groups)
        Sums of the weights, symmetric.
    """
    used = slice(1, len(spectrum))
    one, other = np.nonzero(group[:, None] < group)
    power = np.einsum("fii->if", spectrum[used]).real
    cross = np.ascontiguousarray(spectrum[used, one, other].T)
    squared = np.maximum(cross.real**2 + cross.imag**2, 1e-300)
    coherence = squared / np.maximum(power[one] * power[other], 1e-300)
    weight = coherence / np.maximum(1 - coherence, _MIN_INCOHERENT)
    cross *= cross
    cross *= weight / squared
    n = int(group.max()) + 1
    place = group[one] * n + group[other]
    doubled, most = np.zeros((n * n, len(spectrum)), np.complex128), np.zeros(n * n)
    for pair in np.unique(place):
        doubled[pair, used] = cross[place == pair].sum(0)
        most[pair] = weight[place == pair].sum()
    square = most.reshape(n, n)
    return doubled.reshape(n, n, -1), square + square.T


def _are_real(phases: tuple[ComplexArray, FloatArray]) -> bool:
    """Return whether shapes are so real without any delay that no delay can make them clearly more so."""
    real = phases[0].real.sum(-1)
    return bool(np.all((real + real.T).sum(1) > _ALL_REAL * phases[1].sum(1)))


def _realness(doubled: ComplexArray, reach: int) -> FloatArray:
    """Return how real shapes are if group a is later than b by each delay of the grid (a, b, grid).

    The grid has `reach` steps on each side of zero, which is its first entry, negative delays last.
    """
    n = len(doubled)
    first, second = np.triu_indices(n, 1)
    realness = np.zeros((n, n, 2 * reach + 1))
    values = _transform(doubled[first, second], reach).real
    realness[first, second] = np.concatenate((values[:, reach:], values[:, :reach]), axis=1)
    mirrored = values[:, ::-1]  # the same, of minus the delay
    realness[second, first] = np.concatenate((mirrored[:, reach:], mirrored[:, :reach]), axis=1)
    return realness


def _transform(lines: ComplexArray, reach: int) -> ComplexArray:
    """Return sum_k lines[k] exp(2 pi i k m / _GRID) for m from -reach to reach, (n, 2 reach + 1).

    The chirp transform (Bluestein): k m is (k^2 + m^2 - (m - k)^2) / 2, which is a convolution.
    """
    k, m = np.arange(lines.shape[1]), np.arange(-reach, reach + 1)
    lag = np.arange(m[0] - k[-1], m[-1] - k[0] + 1)
    size = fast_length(len(lag) + len(k) - 1)
    chirped = fft.fft(lines * _chirp(k), size, axis=1) * fft.fft(_chirp(lag).conj(), size)
    return np.asarray(fft.ifft(chirped, axis=1)[:, len(k) - 1 : len(lag)] * _chirp(m))


def _chirp(k: IndexArray) -> ComplexArray:
    """Return exp(pi i k^2 / _GRID)."""
    return np.asarray(np.exp(1j * np.pi / _GRID * (k * k % (2 * _GRID))))


def _total(realness: FloatArray, found: IndexArray, device: int, span: IndexArray) -> FloatArray:
    """Return how real shapes are for each delay of one device (n,), those of the others as found."""
    others = [b for b in range(len(found)) if b != device]
    return np.asarray(sum(realness[device, b, span - found[b]] for b in others))


def _most_real(realness: FloatArray, most: FloatArray, n_steps: int) -> IndexArray:
    """Return the delays [grid] that make shapes most real: against the surest device, then each against all."""
    span = np.arange(-n_steps, n_steps + 1)
    first = int(np.argmax(most.sum(1)))
    found: IndexArray = span[np.argmax(realness[:, first][:, span], axis=1)]
    found[first] = 0
    for _ in range(_SWEEPS):
        before = found.copy()
        for device in range(len(found)):
            found[device] = span[np.argmax(_total(realness, found, device, span))]
        found -= int(np.median(found))
        if np.array_equal(found, before):
            break
    return found


def _sure(realness: FloatArray, most: FloatArray, found: IndexArray) -> BoolArray:
    """Return for which devices the delay makes shapes real that were not."""
    each = range(len(found))
    without = np.array([_total(realness, found, d, np.zeros(1, np.intp))[0] for d in each]) / most.sum(1)
    with_it = np.array([_total(realness, found, d, found[d : d + 1])[0] for d in each]) / most.sum(1)
    return np.asarray((with_it > _MIN_REAL) & (with_it > without + _MIN_GAIN))


def _advanced(signal: FloatArray, n: float) -> FloatArray:
    """Return a signal (n_samples,) n samples earlier, by its Fourier transform; NaN near ends and gaps."""
    missing = np.isnan(signal)
    pad = int(abs(n)) + _MARGIN
    padded = np.pad(bridged(signal[:, None], missing[:, None])[:, 0], pad, mode="edge")
    size = fast_length(len(padded), real=True)
    turned = fft.rfft(padded, size) * np.exp(2j * np.pi * fft.rfftfreq(size) * n)
    moved = np.asarray(fft.irfft(turned, size)[pad : pad + len(signal)])
    spoilt = np.convolve(np.pad(missing, pad, constant_values=True), np.ones(2 * pad + 1), mode="valid") > 0
    moved[spoilt] = np.nan
    return moved
