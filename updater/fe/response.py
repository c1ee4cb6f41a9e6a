"""Response of a model to ambient forces, exact between samples, chunk by chunk for as long as one likes."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
import scipy  # its parts at their first use

from daq import FloatArray
from oma import ComplexArray
from updater.fe.eigen import Modes
from updater.fe.model import Model
from updater.fe.section_forces import weighted_actions


@dataclass(frozen=True, kw_only=True)
class Ambient:
    """Independent white forces, one a row of `points` and a global axis each."""

    points: tuple[tuple[float, float, float], ...]  #: points on members [m]
    axes: tuple[int, ...]  #: global axis of each force, 0 1 2 = x y z
    density: float  #: two-sided force spectral density of each [N2/Hz]


@dataclass(frozen=True, kw_only=True)
class Crack:
    """A crack of a member that opens under a positive moment about a local axis, and closes under a negative one.

    It adds flexibility to the model, in its modes: F' = Lambda^-1 + c a a^T, with the modes' moments a over omega^2.
    """

    member: str
    distance: float  #: from the member's start [m]
    axis: Literal["y", "z"]
    flexibility: float  #: rotation per moment while it is open, over 1 / (E I) [m]
    closed: float = 0.0  #: the same while it is closed [m]

    def actions(self, model: Model, modes: Modes) -> FloatArray:
        """Return the moments (n_modes,) for unit modal displacements, over the root of E I."""
        names = [member.name for member in model.structure.member]
        m = names.index(self.member)
        found = weighted_actions(model, modes, {m: np.array([self.distance])})[m]
        return np.asarray(found[0, {"y": 4, "z": 5}[self.axis]])


class AmbientResponse:
    """Accelerations of a structure in a given number of modes.

    Forces are constant over a sample (zero-order hold), for which the recursion of each mode, z' = exp(lambda dt) z +
    (exp(lambda dt) - 1)/lambda f, is exact. The model may be changed during the motion: displacements and velocities
    continue, accelerations jump, as they do when a body is clamped on. With a crack, the recursion of all modes
    together is exact as long as the crack is open, or closed; which of both is decided at each sample.

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
        self._crack: _CrackedModes | None = None
        self._adopt(model)

    def _adopt(self, model: Model) -> None:
        self._model = model
        self._modes = model.modes(len(self._damping))
        omega = self._modes.omega
        self._pole = -self._damping * omega + 1j * omega * np.sqrt(1 - self._damping**2)

    def change(self, model: Model, crack: Crack | None = None) -> None:
        """Continue with another model on the same mesh, and a crack, from the present displacements and velocities."""
        q, dq = self._state.imag / self._pole.imag, (self._pole * self._state).imag / self._pole.imag
        x, dx = self._modes.shape @ q, self._modes.shape @ dq
        self._adopt(model)
        onto = self._modes.shape.T @ model.mass
        q, dq = onto @ x, onto @ dx
        self._state = dq - self._pole.real * q + 1j * self._pole.imag * q
        self._crack = _CrackedModes(model, self._modes, self._damping, crack, self._rate) if crack else None

    def step(self, n: int) -> FloatArray:
        """Return the next accelerations (n, n_outputs) [m/s2]."""
        noise = self._rms * self._random.standard_normal((n, len(self._force)))
        modal_force = noise @ (self._force @ self._modes.shape)
        if self._crack:
            acceleration, self._state = self._crack.run(self._state, self._pole, modal_force)
        else:
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


class _CrackedModes:
    """Modes of a structure that a crack couples: their transitions over a sample, open and closed."""

    def __init__(self, model: Model, modes: Modes, damping: FloatArray, crack: Crack, rate: float) -> None:
        n, omega = len(modes.omega), modes.omega
        self._action = crack.actions(model, modes)
        self._steps = []
        for flexibility in (crack.closed, crack.flexibility):
            # (Lambda^-1 + c a a^T)^-1 by the matrix inversion lemma, with the actions Lambda a for displacements
            share = flexibility / (1 + flexibility * float((self._action / omega) @ (self._action / omega)))
            stiffness = np.diag(omega**2) - share * np.outer(self._action, self._action)
            rates = np.zeros((3 * n, 3 * n))
            rates[:n, n : 2 * n] = np.eye(n)
            rates[n : 2 * n] = np.hstack([-stiffness, -np.diag(2 * damping * omega), np.eye(n)])
            over = scipy.linalg.expm(rates / rate)
            self._steps.append((over[: 2 * n, : 2 * n], over[: 2 * n, 2 * n :], rates[n : 2 * n, : 2 * n]))

    def run(self, state: ComplexArray, pole: ComplexArray, force: FloatArray) -> tuple[FloatArray, ComplexArray]:
        """Return accelerations (n, n_modes) by modal forces (n, n_modes), and the state (n_modes,) afterwards."""
        n = len(pole)
        now = np.concatenate([state.imag / pole.imag, (pole * state).imag / pole.imag])
        pushed = [force @ push.T for _, push, _ in self._steps]
        acceleration = np.empty_like(force)
        for k, own in enumerate(force):
            open_now = int(self._action @ now[:n] > 0)  # the moment has this sign, open or closed
            now = self._steps[open_now][0] @ now + pushed[open_now][k]
            open_now = int(self._action @ now[:n] > 0)
            acceleration[k] = self._steps[open_now][2] @ now + own
        q, dq = now[:n], now[n:]
        return acceleration, dq - pole.real * q + 1j * pole.imag * q
