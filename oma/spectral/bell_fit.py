"""Spectral bell of a resonance, smoothed by the windows of the spectrum's segments.

The window of a segment broadens a bell that is narrow compared with a line; a direct fit would give too large a
damping. Here the model has the same window as the data (`SpectralSums.window`), so that no correction is needed.

References
----------
Whittle, P. (1953). Estimation and information in stationary time series. Arkiv för Matematik 2(5), 423-434: the
likelihood of a spectrum.
Osborne, M. R. (1992). Fisher's method of scoring. International Statistical Review 60(1), 99-117.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy  # its parts at their first use

from daq import FloatArray

_STEPS, _CLOSE_ENOUGH = 30, 1e-3
_LARGEST_STEP = 0.7  # of a logarithm, or of a bell's half width, in one step
_RIDGE = 1e-4  # relative to the number of lines: parameters that the lines do not determine are unchanged
_RELATIVE_RIDGE = 1e-9  # of each parameter's information: two parts may look alike
_STEPS_IN_VAIN, _MIN_SHARE = 5, 0.1  # a bell that is less of every line by then comes to nothing
_SLOPE = 1.0  # standard deviation of the logarithm by which the background rises across half of the lines
_KNOWN = [3, 5]  # parameters that something is known of beforehand: phase and slope
_TILT = 10.0  # standard deviation of a bell's phase, in damping ratios: spectrum of the forces and type of the signal
_MIN_TILT = 1e-3  # damping ratio that this is counted from
_MIN_DECAY = 1e-3  # of the distance of two lines: a tone
_MIN_FLOOR = 1e-6  # of the median line


@dataclass(frozen=True, eq=False, kw_only=True)
class Windowed:
    """Operator from poles to spectral lines."""

    window: FloatArray  #: (n_fft,) autocorrelation of the segments' windows, 1 at lag 0 [-]
    rate: float  #: [Hz]
    lines: slice  #: numbers of the lines of the transform that are kept

    @property
    def width(self) -> float:
        """Distance of two lines [rad/s]."""
        return 2 * np.pi * self.rate / len(self.window)

    def bell(self, pole: complex) -> FloatArray:
        """Return spectra of a pole [rad/s] and their derivatives, (4, n_lines).

        The first is of the correlation function ``Re exp(pole t)``, then its derivatives by the pole's imaginary and
        real part, and last the spectrum of ``Im exp(pole t)``.
        """
        lag = np.arange(len(self.window)) / self.rate
        decay = np.asarray(self.window * np.exp(pole * lag))
        decay[0] /= 2
        steeper = lag * decay
        parts = np.stack((decay.real, -steeper.imag, steeper.real, -decay.imag))
        return np.asarray(parts @ self._cosines) * (2 / self.rate)

    @cached_property
    def _cosines(self) -> FloatArray:
        """The transform to the lines, of both signs of frequency, (n_fft, n_lines): quicker than all lines by FFT."""
        n = len(self.window)
        table = np.cos(2 * np.pi / n * np.arange(n))
        return np.asarray(table[np.outer(np.arange(n), np.arange(self.lines.start, self.lines.stop)) % n])


@dataclass(frozen=True, eq=False, kw_only=True)
class BellFit:
    """A pole, and how lines of the spectrum move it."""

    pole: complex  #: [rad/s]
    gain: float  #: logarithm of the likelihood over that of the background alone, for one periodogram a line
    influence: FloatArray  #: (2, n_lines): change of the pole's imaginary and real part with the spectrum


@dataclass(frozen=True, eq=False)
class _Spectrum:
    """Lines to fit, and the components of their model: one bell, a power of frequency, and known bells."""

    values: FloatArray  # (n_lines,)
    windowed: Windowed
    known: FloatArray  # (n_others, n_lines)

    def background(self, theta: FloatArray) -> FloatArray:
        """Return the parts of the background, (2 + n_others, n_lines), the first two being one part."""
        across = np.linspace(-1, 1, len(self.values))
        floor = np.exp(theta[0] + theta[1] * across)
        return np.vstack((floor, floor * across, np.exp(theta[2:, None]) * self.known))

    def with_bell(self, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the model and its relative derivatives by imaginary part, log decay, log height, phase, background."""
        decay, height = np.exp(theta[1]), np.exp(theta[2])
        even, by_frequency, by_growth, odd = height * self.windowed.bell(complex(-decay, theta[0]))
        bell, background = even + theta[3] * odd, self.background(theta[4:])
        model = np.maximum(bell + background.sum(axis=0) - background[1], 1e-3 * background[0])
        return model, np.vstack((by_frequency, -decay * by_growth, bell, odd, background)) / model

    def without(self) -> FloatArray:
        """Return the most likely spectrum of the background alone."""
        level = np.log(np.mean(self.values))
        theta = np.concatenate(([level, 0.0], level - 1 - np.log(self.known.max(axis=1))))
        for _ in range(_STEPS):
            parts = self.background(theta)
            model = parts.sum(axis=0) - parts[1]
            step = self.step(model, parts / model, _RIDGE, 0.0)
            theta = theta + np.clip(step, -_LARGEST_STEP, _LARGEST_STEP)
            if np.all(np.abs(step) < _CLOSE_ENOUGH):
                break
        return np.asarray(parts.sum(axis=0) - parts[1])

    def step(
        self, model: FloatArray, jacobian: FloatArray, ridge: float | FloatArray, pull: float | FloatArray
    ) -> FloatArray:
        """Return the step of Fisher's scoring with the prior: curvature and slope of its logarithm."""
        return np.asarray(_solved(jacobian, ridge, jacobian @ (self.values / model - 1) + pull))

    def likelihood(self, model: FloatArray) -> float:
        """Return the logarithm of Whittle's likelihood for one periodogram a line."""
        return float(-np.sum(self.values / model + np.log(model)))


def fit_bell(
    spectrum: FloatArray, start: complex, windowed: Windowed, others: Sequence[complex] = ()
) -> BellFit | None:
    """Fit one bell over a background to a real spectrum, each line weighing as its own scatter permits.

    Maximum of Whittle's likelihood by Fisher scoring. The background is a power of frequency, plus the bells of other
    modes nearby, whose poles are known. The bell's phase distinguishes displacement from acceleration and white from
    coloured forces; it is limited to small values.

    Parameters
    ----------
    spectrum : (n_lines,) array
    start : complex
        First guess of the pole [rad/s].
    windowed : Windowed
        Of the same lines.
    others : sequence of complex
        Poles of the other modes.

    Returns
    -------
    BellFit or None
        None if the likelihood has no maximum among these lines.
    """
    known = np.array([windowed.bell(pole)[0] for pole in others]).reshape(len(others), len(spectrum))
    lines = _Spectrum(spectrum, windowed, np.maximum(known, 1e-300))
    floor = np.log(np.median(spectrum))
    height = np.log(spectrum.max() / windowed.bell(start)[0].max())
    theta = np.array([start.imag, np.log(-start.real), height, 0.0, floor, 0.0])
    theta = np.concatenate((theta, floor - np.log(known.max(axis=1, initial=1e-300))))
    least = np.full(len(theta), -np.inf)
    least[[1, 4]] = np.log(_MIN_DECAY * windowed.width), floor + np.log(_MIN_FLOOR)
    middle = windowed.width * (windowed.lines.start + windowed.lines.stop - 1) / 2
    reach = windowed.width * (windowed.lines.stop - 1 - windowed.lines.start) / 2
    for k in range(_STEPS):
        model, jacobian = lines.with_bell(theta)
        if k >= _STEPS_IN_VAIN and jacobian[2].max() < _MIN_SHARE:
            return None
        unit, ridge = _scales(theta, windowed)
        pull = np.zeros(len(theta))
        pull[_KNOWN] = -ridge[_KNOWN] * theta[_KNOWN]
        step = lines.step(model, jacobian * unit[:, None], ridge, pull)
        theta = theta + np.clip(step, -_LARGEST_STEP, _LARGEST_STEP) * unit
        theta = np.maximum(theta, least)
        if abs(theta[0] - middle) > reach:
            return None
        if np.all(np.abs(step[:3]) < _CLOSE_ENOUGH):
            break
    pole = complex(-np.exp(theta[1]), theta[0])
    model, jacobian = lines.with_bell(theta)
    unit, ridge = _scales(theta, windowed)
    scaled = jacobian * unit[:, None]
    influence = unit[:2, None] * _solved(scaled, ridge, scaled / model)[:2]
    influence[1] *= pole.real
    gain = lines.likelihood(model) - lines.likelihood(lines.without())
    return BellFit(pole=pole, gain=gain, influence=influence)


def _solved(jacobian: FloatArray, ridge: float | FloatArray, right: FloatArray) -> FloatArray:
    """Return the information matrix's solution, the parameters brought to one scale."""
    fisher = jacobian @ jacobian.T + np.diag(np.broadcast_to(ridge, len(jacobian)))
    scale = 1 / np.sqrt(np.diag(fisher))
    level = scale[:, None] * fisher * scale + _RELATIVE_RIDGE * np.eye(len(scale))
    columns = right.reshape(len(scale), -1) * scale[:, None]
    return np.asarray((scale[:, None] * scipy.linalg.solve(level, columns, assume_a="pos")).reshape(right.shape))


def _scales(theta: FloatArray, windowed: Windowed) -> tuple[FloatArray, FloatArray]:
    """Return the unit of each parameter, and the curvature of its prior."""
    unit, ridge = np.ones(len(theta)), np.full(len(theta), _RIDGE)
    unit[0] = max(np.exp(theta[1]), 0.1 * windowed.width)
    ridge[3] = (_TILT * max(np.exp(theta[1]) / theta[0], _MIN_TILT)) ** -2
    ridge[5] = _SLOPE**-2
    return unit, ridge
