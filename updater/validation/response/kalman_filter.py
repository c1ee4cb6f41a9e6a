"""Steady-state Kalman filter of modal coordinates from measured accelerations.

Forces act on accelerations without delay, so that the noise of the state and that of the measurement are correlated.
The gain follows from the discrete algebraic Riccati equation with a cross term (Anderson & Moore, s. 5.4).

References
----------
Anderson, B. D. O. & Moore, J. B. (1979). Optimal Filtering. Prentice-Hall.
Maes, K., Smyth, A. W., De Roeck, G. & Lombaert, G. (2016). Joint input-state estimation in structural dynamics. MSSP
70-71, 445-466.
"""

from dataclasses import dataclass

import numpy as np
import scipy  # its parts at their first use

from daq import FloatArray
from oma import ComplexArray
from updater.validation.response.excitation import Excitation
from updater.validation.response.modal_system import ModalSystem

_SETTLED = 1e-3  # of a transient


@dataclass(frozen=True, eq=False, kw_only=True)
class Outputs:
    """Linear outputs y = C x + D p of a modal system."""

    state: FloatArray  #: C (n_outputs, 2 n_modes)
    force: FloatArray  #: D (n_outputs, n_modes)


class ModalKalmanFilter:
    """Outputs of a modal system, estimated from the accelerations up to each sample.

    The recursion x[k+1] = (A - K C) x[k] + K y[k] is run in coordinates in which its components are independent.

    Parameters
    ----------
    system : modes
    shape : (n_channels, n_modes) mass-normalised at the sensors [kg^-1/2]
    excitation : densities of forces and noise
    outputs : quantities to estimate
    rate : [Hz]

    Raises
    ------
    numpy.linalg.LinAlgError
        If the Riccati equation has no solution.
    """

    def __init__(
        self, system: ModalSystem, shape: FloatArray, excitation: Excitation, outputs: Outputs, *, rate: float
    ) -> None:
        a, b = system.transition(1 / rate)
        c, d = (shape @ part for part in system.outputs("acceleration"))
        force = excitation.force * rate
        direct = d @ force @ d.T + np.diag(excitation.noise * rate)
        cross = b @ force @ d.T
        covariance = scipy.linalg.solve_discrete_are(a.T, c.T, b @ force @ b.T, direct, s=cross)
        inverse = np.linalg.inv(c @ covariance @ c.T + direct)
        gain = (a @ covariance @ c.T + cross) @ inverse
        self._pole, self._vector = np.linalg.eig(a - gain @ c)
        into = np.linalg.inv(self._vector)
        self._input, self._push = into @ gain, into @ (b - gain @ d)  # of measurements; of forces, in the error
        update = (outputs.state @ covariance @ c.T + outputs.force @ force @ d.T) @ inverse
        self._read, self._own = c, d
        self._update, self._outputs = update, outputs
        self._excitation, self._rate = excitation, rate
        self._state = np.zeros(len(self._pole), complex)

    @property
    def settling(self) -> int:
        """Number of samples after which a transient has decayed."""
        return int(np.ceil(np.log(_SETTLED) / np.log(np.abs(self._pole).max())))

    def run(self, data: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Continue with measured samples (n, n_channels) [m/s2].

        Returns
        -------
        (n, n_outputs) estimates, and (n, n_channels) innovations [m/s2]: measured less predicted from the past
        """
        driven = data @ self._input.T
        states = np.empty_like(driven)
        for k, pole in enumerate(self._pole):
            start = self._state[k]
            after, _ = scipy.signal.lfilter([1.0], [1.0, -pole], driven[:, k], zi=np.array([pole * start]))
            states[0, k], states[1:, k], self._state[k] = start, after[:-1], after[-1]
        predicted = (states @ self._vector.T).real
        innovation = data - predicted @ self._read.T
        return predicted @ self._outputs.state.T + innovation @ self._update.T, innovation

    def variance(self, lines: FloatArray, weight: FloatArray) -> FloatArray:
        """Return the variance (n_outputs,) of the error of the estimates, for exact shapes.

        Parameters
        ----------
        lines : (n_lines,) that the spectral density of the error is integrated over [Hz]
        weight : (n_lines,) squared gain of the filter that the measurements have passed [-]
        """
        resolvent = 1 / (np.exp(2j * np.pi * lines[:, None] / self._rate) - self._pole)
        # estimate - truth = (C - U c) e + (D - U d) p - U v, with the state's error e driven by p and -v
        own = (self._outputs.state - self._update @ self._read) @ self._vector
        by_force = (own * resolvent[:, None, :]) @ self._push + self._outputs.force - self._update @ self._own
        by_noise = (own * resolvent[:, None, :]) @ self._input + self._update
        density = _quadratic(by_force, self._excitation.force) + _quadratic(by_noise, np.diag(self._excitation.noise))
        return np.asarray(2 * np.trapezoid(density * weight[:, None], lines, axis=0))


def _quadratic(response: ComplexArray, density: FloatArray) -> FloatArray:
    """Return the densities (n_lines, n_outputs) of outputs by inputs (n_lines, n_outputs, n_inputs)."""
    return np.asarray(((response @ density) * response.conj()).sum(2).real)
