"""Response of a model to ambient forces, exact between samples, chunk by chunk for as long as one likes."""

from dataclasses import dataclass

import numpy as np
import scipy  # its parts at their first use

from daq import FloatArray
from updater.fe.model import Model


@dataclass(frozen=True, kw_only=True)
class Ambient:
    """Independent white forces, one a row of `points` and a global axis each."""

    points: tuple[tuple[float, float, float], ...]  #: points on members [m]
    axes: tuple[int, ...]  #: global axis of each force, 0 1 2 = x y z
    density: float  #: two-sided force spectral density of each [N2/Hz]


class AmbientResponse:
    """Accelerations of a structure in a given number of modes.

    Forces are constant over a sample (zero-order hold), for which the recursion of each mode, z' = exp(lambda dt) z +
    (exp(lambda dt) - 1)/lambda f, is exact. The model may be changed during the motion: displacements and velocities
    continue, accelerations jump, as they do when a body is clamped on.

    Parameters
    ----------
    model : the structure
    read : (n_outputs, n_dofs) rows of the outputs, as from `Model.read`
    damping : (n_modes,) ratios of critical [-]
    ambient : the forces
    rate : of the simulation [Hz]
    seed : of the forces
    """

    def __init__(
        self, model: Model, read: FloatArray, damping: FloatArray, ambient: Ambient, *, rate: float, seed: int
    ) -> None:
        self._read, self._damping, self._rate = read, damping, rate
        self._random = np.random.default_rng(seed)
        self._force = np.array([model.read(np.array(p), a) for p, a in zip(ambient.points, ambient.axes, strict=True)])
        self._rms = np.sqrt(ambient.density * rate)
        self._state = np.zeros(len(damping), complex)
        self._adopt(model)

    def _adopt(self, model: Model) -> None:
        self._model = model
        self._modes = model.modes(len(self._damping))
        omega = self._modes.omega
        self._pole = -self._damping * omega + 1j * omega * np.sqrt(1 - self._damping**2)

    def change(self, model: Model) -> None:
        """Continue with another model on the same mesh from the present displacements and velocities."""
        q, dq = self._state.imag / self._pole.imag, (self._pole * self._state).imag / self._pole.imag
        x, dx = self._modes.shape @ q, self._modes.shape @ dq
        self._adopt(model)
        onto = self._modes.shape.T @ model.mass
        q, dq = onto @ x, onto @ dx
        self._state = dq - self._pole.real * q + 1j * self._pole.imag * q

    def step(self, n: int) -> FloatArray:
        """Return the next accelerations (n, n_outputs) [m/s2]."""
        noise = self._rms * self._random.standard_normal((n, len(self._force)))
        modal_force = noise @ (self._force @ self._modes.shape)
        acceleration = np.empty_like(modal_force)
        for k, pole in enumerate(self._pole):
            acceleration[:, k] = self._run_mode(k, pole, modal_force[:, k])
        return np.asarray(acceleration @ (self._read @ self._modes.shape).T)

    def _run_mode(self, k: int, pole: complex, force: FloatArray) -> FloatArray:
        growth = np.exp(pole / self._rate)
        start = np.array([growth * self._state[k]])
        z, _ = scipy.signal.lfilter([(growth - 1) / pole], [1.0, -growth], force.astype(complex), zi=start)
        self._state[k] = z[-1]
        q, dq = z.imag / pole.imag, (pole * z).imag / pole.imag
        return np.asarray(force + 2 * pole.real * dq - abs(pole) ** 2 * q)
