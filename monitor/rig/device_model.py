"""Measurement of the motion by a device: filter, own clock, gain error, noise and rounding."""

import zlib
from typing import Protocol

import numpy as np

from daq import FloatArray, IntArray
from daq.drivers import EPSON_SCALE
from monitor.rig.scenario import RigDevice, Scenario
from monitor.rig.world import LEAD, OVERSAMPLING, World
from updater import Structure

_BLOCK = 0.25  # s measured at once
_CUTOFF = 0.43  # of the device's rate, where the filter lets half through
_HALF_TAPS = 16  # of the filter, in scans
_KAISER = 8.0  # -81 dB (Kaiser 1974)
_NODES = np.arange(-2, 4)  # simulated samples that an interpolated one is taken from
#: powers (rows) of each node's Lagrange polynomial (columns)
_LAGRANGE = np.linalg.inv(np.vander(_NODES.astype(float), increasing=True))


class Motion(Protocol):
    """Interface of the world to a device."""

    @property
    def rate(self) -> float:
        """Simulated samples per second [Hz]."""

    def sample(self, time: int) -> float:
        """Return which simulated sample, whole and part, a time [ns UTC] is."""

    def motion(self, first: int, last: int, device: int) -> FloatArray:
        """Return accelerations (last - first, 3) [m/s2] of a device, samples first .. last - 1."""


class DeviceSource:
    """Measurement of the world by one device, as the `SampleSource` of its emulator.

    Scan k is the filtered motion at start + k / rate, between simulated samples by its clock. The filter passes 0.35 of
    the rate within 0.001 dB, and stops -80 dB from 0.51 of it on. Having linear phase, it delays every scan equally, by
    16 scans and 3 simulated samples: 16.75 ms at 1000 Hz, as the filter of a device does; the device's own `delay` is
    added.

    Parameters
    ----------
    world : shared by all devices
    scenario : that the world plays
    number : of the device in the scenario
    """

    def __init__(self, world: Motion, scenario: Scenario, number: int) -> None:
        self._world, self._number, self._scenario = world, number, scenario
        self._delay = scenario.device[number].delay
        self._random = np.random.default_rng((scenario.seed, 3, number))
        self._gain = 1 + scenario.truth.gain_scatter * self._random.standard_normal(3)

    def start(self, time: int, rate: float) -> None:
        """Begin: scan k is taken at time + k / rate [ns UTC, Hz].

        Raises
        ------
        ValueError
            If the rate is one that the scenario cannot feed.
        """
        delay = self._delay * self._world.rate
        step = self._world.rate / rate
        half = round(_HALF_TAPS * step)
        if step < 0.98 * OVERSAMPLING or 2 * half + delay + len(_NODES) > LEAD:
            slowest = 2 * _HALF_TAPS * self._world.rate / (LEAD - len(_NODES))
            raise ValueError(f"rate: expected {slowest:.3g} to {self._scenario.rate:g} Hz, found {rate:g}")
        self._taps = lowpass(half, _CUTOFF / step)
        self._start, self._step, self._half = self._world.sample(time) - delay, step, half
        self._noise = self._scenario.truth.noise_density * np.sqrt(rate / 2)
        self._size = max(1, round(_BLOCK * rate))
        self._block = np.zeros((0, 3), np.int32)
        self._first = 0  # scan that the block begins with

    def read(self, index: int, n: int) -> IntArray:
        """Return scans index .. index + n - 1 as counts (n, 3); each scan can be had once, in order.

        Raises
        ------
        ValueError
            If they are not the next ones.
        """
        if index != self._first:
            raise ValueError(f"scans: expected the next one, {self._first}, found {index}")
        blocks = [self._block]
        have = len(self._block)
        while have < n:
            blocks.append(self._measure(index + have + np.arange(self._size, dtype=float)))
            have += self._size
        counts = np.concatenate(blocks)
        self._block, self._first = counts[n:], index + n
        return counts[:n]

    def _measure(self, scans: FloatArray) -> IntArray:
        """Return counts (n, 3) of scans (n,)."""
        signal = self._gain * self._filtered(np.asarray(self._start + self._step * scans))
        signal += self._noise * self._random.standard_normal(signal.shape)
        return np.asarray(np.round(signal / EPSON_SCALE), np.int32)

    def _filtered(self, position: FloatArray) -> FloatArray:
        """Return the filtered motion (n, 3) [m/s2], taken from the past of simulated samples (n,), whole and part."""
        base = np.floor(position).astype(np.intp)
        first = int(base[0]) - 2 * self._half - len(_NODES) + 1
        raw = self._world.motion(first, int(base[-1]) + 1, self._number)
        return interpolate(convolve(raw, self._taps), base - base[0] + 2, position - base)


def lowpass(half: int, cutoff: float) -> FloatArray:
    """Return the taps (2 half + 1,) of a filter of linear phase, by Kaiser's window.

    numpy has what it takes; importing scipy.signal takes two fifths of the rig's start.

    Parameters
    ----------
    half : taps on each side of the middle one
    cutoff : frequency of half the amplitude, of the sampling rate [-]
    """
    taps = np.sinc(2 * cutoff * np.arange(-half, half + 1)) * np.kaiser(2 * half + 1, _KAISER)
    return np.asarray(taps / taps.sum())


def convolve(signal: FloatArray, taps: FloatArray) -> FloatArray:
    """Return signals (n_samples, n) after a filter, where all its taps are on samples."""
    n = 1 << (len(signal) - 1).bit_length()
    spectrum = np.fft.rfft(signal, n, axis=0) * np.fft.rfft(taps, n)[:, None]
    return np.fft.irfft(spectrum, n, axis=0)[len(taps) - 1 : len(signal)]


def interpolate(signal: FloatArray, base: IntArray, part: FloatArray) -> FloatArray:
    """Return a signal (n_samples, n) between samples, at base + part (m,), by the polynomial through six samples.

    The error is -90 dB at 0.068 of the sampling rate (271 Hz of 4 kHz), -67 dB at 0.11: its leading term is
    (2 pi f)^6 / 720 times the product of the distances to the six samples.
    """
    weight = np.vander(part, len(_NODES), increasing=True) @ _LAGRANGE
    return np.asarray(np.einsum("mk,mkn->mn", weight, signal[base[:, None] + _NODES]))


def make_sources(structure: Structure, scenario: Scenario) -> tuple[World, list[DeviceSource]]:
    """Return the world and one source a device."""
    world = World(structure, scenario)
    return world, [DeviceSource(world, scenario, i) for i in range(len(scenario.device))]


def serial_word(device: RigDevice) -> int:
    """Return a CAN node's serial number, 32 bits made of its name."""
    return zlib.crc32(device.name.encode())


def serial_number(device: RigDevice) -> str:
    """Return a device's serial number: its name's last eight letters."""
    return device.name[-8:].upper()
