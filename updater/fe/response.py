"""Response of a model to ambient forces, exact between samples, chunk by chunk for as long as one likes."""

import itertools
from dataclasses import dataclass

import numpy as np
import scipy  # its parts at their first use

from daq import FloatArray, IndexArray
from oma import ComplexArray
from updater.fe.crack import Crack, ModalCrack
from updater.fe.eigen import Modes
from updater.fe.model import Model

_PARTS = 16  # of a sample, at one of which a crack opens or closes
_RESIDUAL_DAMPING = 0.7  # ratio with which the shape beyond the modes follows a crack


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
    continue, accelerations jump, as they do when a body is clamped on. With a crack, the recursion of all modes
    together is exact as long as the crack is open, or closed. A sample that ends on another side of the moment is
    divided at the nearest of 16 parts to where a moment that changes linearly opens or closes it; with play, at both
    moments if it passes both. With dry friction, it is divided where it begins to slide and where it turns back. An
    opening that begins and ends within one sample is not seen. With a crack, one shape more, the static one under its
    rotation, has the flexibility of all modes beyond those of `damping`, so that shapes have the kink at the crack.

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
        self._adopt(model, model.modes(len(damping)))

    def _adopt(self, model: Model, modes: Modes) -> None:
        self._model, self._modes = model, modes
        damping = np.pad(self._damping, (0, len(modes.omega) - len(self._damping)), constant_values=_RESIDUAL_DAMPING)
        self._pole = modes.omega * (-damping + 1j * np.sqrt(1 - damping**2))

    def change(self, model: Model, crack: Crack | None = None) -> None:
        """Continue with another model on the same mesh, and a crack, from the present displacements and velocities."""
        q, dq = self._state.imag / self._pole.imag, (self._pole * self._state).imag / self._pole.imag
        x, dx = self._modes.shape @ q, self._modes.shape @ dq
        modes, before = model.modes(len(self._damping)), self._crack
        self._crack = None
        if crack:
            modal = ModalCrack.of(crack, model, modes)
            modes, coupled = modal.modes, _SlippingModes if crack.opens == "slips" else _CrackedModes
            self._crack = coupled(modal, self._damping, self._rate)
        self._adopt(model, modes)
        onto = modes.shape.T @ model.mass
        q, dq = onto @ x, onto @ dx
        self._state = dq - self._pole.real * q + 1j * self._pole.imag * q
        if isinstance(self._crack, _SlippingModes) and isinstance(before, _SlippingModes):
            self._crack.follow(before)

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
    """Modes of a structure that a crack couples: their transitions over parts of a sample, open and closed.

    Its rotation beyond that of the model is d m - e under a moment m, with d its flexibility less that of the model,
    and e = 0 on the near side of its moment m0, (far - near) m0 on the far side, with the flexibilities there; of two
    far sides, the other sign on the other. For displacements q the moment is a^T q - g (d m - e), with the moment g of
    a unit rotation.

    A shape beyond the damped modes follows what moves it, without a resonance: its damper acts on its displacement less
    that of the static shape under the present rotation. One on its displacement would damp the modes.
    """

    def __init__(self, modal: ModalCrack, damping: FloatArray, rate: float) -> None:
        n, omega = len(modal.modes.omega), modal.modes.omega
        self._crack, self._rate, self._n_damped = modal.crack, rate, len(damping)
        self._action, opens, crack, own = modal.action, modal.opens, modal.crack, modal.stiffness
        near, far = crack.by_sides
        self._opens = opens * (1 + (near - crack.mean) * own)  # in a^T q
        self._two_sided = crack.opens in ("within", "beyond")
        self._sides = []
        for flexibility, offset in ((near, 0.0), (far, far - near)):
            # (Lambda^-1 + c a a^T)^-1 by the matrix inversion lemma, with the actions Lambda a for displacements
            share = (flexibility - crack.mean) / (1 + (flexibility - crack.mean) * own)
            constant = -offset * opens / (1 + (flexibility - crack.mean) * own) * self._action
            stiffness = np.diag(omega**2) - share * np.outer(self._action, self._action)
            rates = np.zeros((3 * n, 3 * n))
            rates[:n, n : 2 * n] = np.eye(n)
            follows = np.eye(n)[len(damping) :]
            follows = follows - share * follows @ np.outer(self._action / omega**2, self._action)
            dampers = np.diag(2 * omega * np.pad(damping, (0, len(follows))))
            dampers += 2 * _RESIDUAL_DAMPING * follows.T @ (omega[len(damping) :, None] * follows)
            rates[n : 2 * n] = np.hstack([-stiffness, -dampers, np.eye(n)])
            part = scipy.linalg.expm(rates / (rate * _PARTS))
            steps = [over[: 2 * n] for over in itertools.accumulate(_PARTS * [part], np.matmul, initial=np.eye(3 * n))]
            self._sides.append((steps, rates[n : 2 * n, : 2 * n], constant))

    def run(self, state: ComplexArray, pole: ComplexArray, force: FloatArray) -> tuple[FloatArray, ComplexArray]:
        """Return accelerations (n, n_modes) by modal forces (n, n_modes), and the state (n_modes,) afterwards."""
        n = len(pole)
        now = np.concatenate([state.imag / pole.imag, (pole * state).imag / pole.imag])
        whole = [(steps[-1][:, : 2 * n], force @ steps[-1][:, 2 * n :].T) for steps, _, _ in self._sides]
        shift = self._sides[1][0][-1][:, 2 * n :] @ self._sides[1][2]
        forward, pushed = whole[1]
        of_side = (whole[0], (forward, pushed + shift), (forward, pushed - shift))  # numbers 0, 1 and -1, as the sides
        states, sides = np.empty((len(force) + 1, 2 * n)), np.empty(len(force), np.intp)
        states[0] = now
        side, moment = self._side(now)
        for k, own in enumerate(force):
            forward, pushed = of_side[side]
            after = forward @ now + pushed[k]
            reached, turned = self._side(after)
            if reached != side:
                after = self._divided(now, own, (side, reached), (moment, turned))
                reached, turned = self._side(after)
            states[k + 1], sides[k] = after, reached
            now, side, moment = after, reached, turned
        q, dq = now[:n], now[n:]
        return self._accelerations(states, force, sides, sides), dq - pole.real * q + 1j * pole.imag * q

    def _accelerations(
        self, states: FloatArray, force: FloatArray, side: IndexArray, push: FloatArray | IndexArray
    ) -> FloatArray:
        """Return the accelerations (n, n_modes) at the ends of samples; of the residual shape, its means over samples.

        The residual shape moves in pulses that are shorter than a sample, where a crack opens or closes.

        Parameters
        ----------
        states : (n + 1, 2 n_modes) at the start and at the ends of the samples
        force : (n, n_modes)
        side : (n,) at the ends
        push : (n,) constant modal force, over that of the far side
        """
        found = force + push[:, None] * self._sides[1][2]
        for number, (_, rates, _) in enumerate(self._sides):
            rows = np.abs(side) == number
            found[rows] += states[1:][rows] @ rates.T
        residual = len(self._action) + self._n_damped
        found[:, self._n_damped :] = np.diff(states[:, residual:], axis=0) * self._rate
        return np.asarray(found)

    def _side(self, state: FloatArray) -> tuple[int, float]:
        """Return 1 on the far side of its moment, -1 on that of the opposite moment, else 0; and a^T q."""
        moment = float(self._action @ state[: len(self._action)])
        return int(moment > self._opens) - int(self._two_sided and moment < -self._opens), moment

    def _divided(
        self, state: FloatArray, force: FloatArray, sides: tuple[int, int], moments: tuple[float, float]
    ) -> FloatArray:
        """Return the state after a sample that begins and ends on other sides, divided at each moment in between."""
        side, last = sides
        done, further = 0, 1 if last > side else -1
        while side != last:
            limit = self._opens * (side or further)
            part = round(_PARTS * (limit - moments[0]) / (moments[1] - moments[0]))
            state = self._stepped(state, force, side, part - done)
            side, done = side + further, part
        return self._stepped(state, force, side, _PARTS - done)

    def _stepped(self, state: FloatArray, force: FloatArray, side: int, parts: int) -> FloatArray:
        """Return the state after parts of a sample on one side."""
        steps, _, constant = self._sides[abs(side)]
        return np.asarray(steps[parts] @ np.concatenate([state, force + side * constant]))


class _SlippingModes(_CrackedModes):
    """Modes of a structure that a place with dry friction couples: their transitions while it sticks, and slides.

    A slider follows a^T q at a distance of `_opens` at most, and slides at that distance. Its position v while it
    sticks adds a modal force: at v = `_opens`, that of the far side on the other side. Moment and slider then agree
    with the play operator of Iwan (1966) for the moment itself, because both are linear in a^T q and v.
    """

    def __init__(self, modal: ModalCrack, damping: FloatArray, rate: float) -> None:
        super().__init__(modal, damping, rate)
        self._slider = 0.0  # v
        self._side_of_slip = 0  # 1 while it slides up, -1 down, 0 while it sticks

    def follow(self, before: "_SlippingModes") -> None:
        """Continue from where the same place stuck, or slid, in another model; another place begins without slip."""
        if self._crack.place == before._crack.place:
            moment = before._slider / before._opens * before._crack.moment
            self._slider = moment / self._crack.moment * self._opens
            self._side_of_slip = before._side_of_slip

    def run(self, state: ComplexArray, pole: ComplexArray, force: FloatArray) -> tuple[FloatArray, ComplexArray]:
        """Return accelerations (n, n_modes) by modal forces (n, n_modes), and the state (n_modes,) afterwards."""
        n = len(pole)
        now = np.concatenate([state.imag / pole.imag, (pole * state).imag / pole.imag])
        states, sides, push = np.empty((len(force) + 1, 2 * n)), np.empty(len(force), np.intp), np.empty(len(force))
        states[0] = now
        for k, own in enumerate(force):
            now = self._sample(now, own)
            states[k + 1], sides[k], push[k] = now, self._side_of_slip, self._push
        q, dq = now[:n], now[n:]
        return self._accelerations(states, force, sides, push), dq - pole.real * q + 1j * pole.imag * q

    @property
    def _push(self) -> float:
        """Constant modal force, over that of sliding up."""
        return float(self._side_of_slip) if self._side_of_slip else -self._slider / self._opens

    def _sample(self, state: FloatArray, force: FloatArray) -> FloatArray:
        """Return the state after a sample, divided where it begins to slide and where it turns back."""
        left = _PARTS
        while left:
            after = self._stepped_slip(state, force, left)
            end = self._excess(after)
            if end <= 0:
                return after
            begin = min(self._excess(state), 0.0)
            parts = max(round(left * begin / (begin - end)), 1)
            state = self._stepped_slip(state, force, parts)
            self._turn(state)
            left -= parts
        return state

    def _excess(self, state: FloatArray) -> float:
        """Return what is positive where it begins to slide, and where a slide ends."""
        n = len(self._action)
        if self._side_of_slip:
            return -self._side_of_slip * float(self._action @ state[n:])
        return abs(float(self._action @ state[:n]) - self._slider) - self._opens

    def _turn(self, state: FloatArray) -> None:
        """Begin or end to slide."""
        moment = float(self._action @ state[: len(self._action)])
        if self._side_of_slip:
            self._slider, self._side_of_slip = moment - self._side_of_slip * self._opens, 0
        else:
            self._side_of_slip = 1 if moment > self._slider else -1

    def _stepped_slip(self, state: FloatArray, force: FloatArray, parts: int) -> FloatArray:
        """Return the state after parts of a sample without a change between sticking and sliding."""
        steps = self._sides[abs(self._side_of_slip)][0]
        return np.asarray(steps[parts] @ np.concatenate([state, force + self._push * self._sides[1][2]]))
