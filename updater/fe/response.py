"""Response of a model to ambient forces, exact between samples, chunk by chunk for as long as one likes."""

import itertools
from dataclasses import dataclass
from typing import Literal

import numpy as np
import scipy  # its parts at their first use

from daq import FloatArray
from oma import ComplexArray
from updater.errors import ModelError
from updater.fe.eigen import Modes
from updater.fe.factorization import factorise
from updater.fe.model import Model
from updater.fe.section_forces import element_at, section_rigidity, weighted_actions
from updater.quantities import Opens
from updater.structure import BreathingCrack, Structure

_PARTS = 16  # of a sample, at one of which a crack opens or closes
_RESIDUAL_DAMPING = 0.7  # ratio with which the shape beyond the modes follows a crack
_COMPLETE = 1e-9  # of a crack's flexibility beyond the modes: less is rounding


@dataclass(frozen=True, kw_only=True)
class Ambient:
    """Independent white forces, one a row of `points` and a global axis each."""

    points: tuple[tuple[float, float, float], ...]  #: points on members [m]
    axes: tuple[int, ...]  #: global axis of each force, 0 1 2 = x y z
    density: float  #: two-sided force spectral density of each [N2/Hz]


@dataclass(frozen=True, kw_only=True)
class Crack:
    """A crack of a member that is open on one side of a moment about a local axis, and closed on the other.

    Or it is open within, or beyond, a moment on both sides of zero, as play, or a joint that gapes under both signs. Or
    it slips with dry friction: a Coulomb slider in series with a spring, beside another spring (Iwan 1966). It is
    closed while it sticks, and open while it slides, until it turns back. It sticks until the moment has changed by
    twice that at which it slipped first.

    It changes the flexibility of the model, in its modes: F' = Lambda^-1 + c a a^T, with the modes' moments a over
    omega^2, and c the difference from what the model contains.
    """

    member: str
    distance: float  #: from the member's start [m]
    axis: Literal["x", "y", "z"]
    flexibility: float  #: rotation per moment while it is open, over 1 / (E I) or 1 / (G J) [m]
    closed: float = 0.0  #: the same while it is closed [m]
    mean: float = 0.0  #: the same in the model [m]
    moment: float = 0.0  #: moment at which it opens, closes, or first slips [N m]
    opens: Opens = "above"  #: side of that moment on which it is open

    @classmethod
    def of(cls, structure: Structure) -> "Crack | None":
        """Return the crack of a structure file; None if it has none.

        Raises
        ------
        ModelError
            If there are several.
        """
        found = structure.breathing_crack
        if len(found) > 1:
            raise ModelError(f"breathing_crack: expected at most one in a simulation, found {len(found)}")
        return next((cls._of(structure, crack) for crack in found), None)

    @classmethod
    def _of(cls, structure: Structure, crack: BreathingCrack) -> "Crack":
        start = structure.member_named(crack.member).start
        known = {key: value for key, value in crack if key != "at"}
        return cls(distance=float(np.linalg.norm(np.subtract(crack.at, start))), **known)

    @property
    def side(self) -> float:
        """-1 if it opens below its moment, else 1."""
        return -1.0 if self.opens == "below" else 1.0

    @property
    def place(self) -> tuple[str, float, str]:
        """Member, distance from its start [m], and axis."""
        return self.member, self.distance, self.axis

    @property
    def by_sides(self) -> tuple[float, float]:
        """Flexibility on the near side of its moment, where zero is if it is positive, and on the far side."""
        both = self.closed, self.flexibility
        return both[::-1] if self.opens == "within" else both

    def actions(self, model: Model, modes: Modes) -> tuple[FloatArray, float]:
        """Return the moments (n_modes,) for unit modal displacements, and that at which it opens, over root E I.

        Positive on the side on which it is open.
        """
        structure, at, action = model.structure, np.array([self.distance]), 3 + "xyz".index(self.axis)
        m = [member.name for member in structure.member].index(self.member)
        found = weighted_actions(model, modes, {m: at})[m][0, action]
        own = section_rigidity(model, structure.member[m], at)[0, action]  # segments of the place included
        rigidity = structure.rigidity(structure.member[m])[action - 3]
        return self.side * np.sqrt(own / rigidity) * found, self.side * self.moment / float(np.sqrt(rigidity))

    def with_residual(self, model: Model, modes: Modes) -> tuple[Modes, tuple[FloatArray, float]]:
        """Return modes with one shape more, and their actions.

        The shape is the static one under the crack's rotation, less its part in the modes: a Ritz vector (Wilson, Yuan
        & Dickens 1982), orthogonal to them in mass and stiffness. It contains the flexibility of all modes left out. A
        crack whose mean flexibility the model contains has none: its rotation is in the modes, and a hinge cannot take
        back the flexibility of a stretch in shapes that are as short.
        """
        action, opens = self.actions(model, modes)
        if self.mean:
            return modes, (action, opens)
        row = self._moment_row(model)
        static = factorise(model.stiffness)(row)
        shape = static - modes.shape @ (modes.shape.T @ (model.mass @ static))
        stiffness = float(shape @ (model.stiffness @ shape))
        if stiffness < _COMPLETE * float(row @ static):
            return modes, (action, opens)
        mass = float(shape @ (model.mass @ shape))
        frequency = np.append(modes.frequency, np.sqrt(stiffness / mass) / (2 * np.pi))
        shape /= np.sqrt(mass)
        extended = Modes(frequency=frequency, shape=np.column_stack([modes.shape, shape]))
        return extended, (np.append(action, row @ shape), opens)

    def _moment_row(self, model: Model) -> FloatArray:
        """Return the moment (n_dofs,) for unit displacements at rest, over root E I."""
        structure = model.structure
        span = element_at(model, structure.member_named(self.member), self.distance)
        dofs = model.dofs[list(model.elements[span][:2])].ravel()
        dofs = dofs[dofs >= 0]
        unit = np.zeros((model.n_dofs, len(dofs)))
        unit[dofs, np.arange(len(dofs))] = 1.0
        row = np.zeros(model.n_dofs)
        row[dofs], _ = self.actions(model, Modes(frequency=np.zeros(len(dofs)), shape=unit))
        return row


class AmbientResponse:
    """Accelerations of a structure in a given number of modes.

    Forces are constant over a sample (zero-order hold), for which the recursion of each mode, z' = exp(lambda dt) z +
    (exp(lambda dt) - 1)/lambda f, is exact. The model may be changed during the motion: displacements and velocities
    continue, accelerations jump, as they do when a body is clamped on. With a crack, the recursion of all modes
    together is exact as long as the crack is open, or closed. A sample that ends on another side of the moment is
    divided at the nearest of 16 parts to where a moment that changes linearly opens or closes it; with play, at both
    moments if it passes both. With dry friction, it is divided where it begins to slide and where it turns back. An
    opening that begins and ends within one sample is not seen. With a crack that the model does not
    contain, one shape more, the static one under its rotation, has the flexibility of all modes beyond those of
    `damping`, so that shapes have the kink at the crack.

    Parameters
    ----------
    model : the structure
    read : (n_outputs, n_dofs) rows of the outputs, as from `Model.read`
    damping : (n_modes,) ratios of critical [-]
    ambient : the forces
    rate : of the simulation [Hz]
    seed : of the forces

    References
    ----------
    Wilson, E. L., Yuan, M.-W. & Dickens, J. M. (1982). Dynamic analysis by direct superposition of Ritz vectors.
    Earthquake Engineering & Structural Dynamics 10(6), 813-821.
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
            modes, actions = crack.with_residual(model, modes)
            coupled = _SlippingModes if crack.opens == "slips" else _CrackedModes
            self._crack = coupled(modes, actions, self._damping, crack, self._rate)
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
    far sides, the other sign on the other. For displacements q the moment is a^T q - g (d m - e), with g = a^T
    Lambda^-1 a.

    A shape beyond the damped modes follows what moves it, without a resonance: its damper acts on its displacement less
    that of the static shape under the present rotation. One on its displacement would damp the modes.
    """

    def __init__(
        self, modes: Modes, actions: tuple[FloatArray, float], damping: FloatArray, crack: Crack, rate: float
    ) -> None:
        n, omega = len(modes.omega), modes.omega
        self._crack, self._rate, self._n_damped = crack, rate, len(damping)
        self._action, opens = actions
        own = float((self._action / omega) @ (self._action / omega))
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
        acceleration = np.empty_like(force)
        side, moment = self._side(now)
        for k, own in enumerate(force):
            forward, pushed = whole[abs(side)]
            after = forward @ now + pushed[k]
            if side:
                after += side * shift
            reached, turned = self._side(after)
            if reached != side:
                after = self._divided(now, own, (side, reached), (moment, turned))
                reached, turned = self._side(after)
            acceleration[k] = self._acceleration(now, after, own, reached, reached)
            now, side, moment = after, reached, turned
        q, dq = now[:n], now[n:]
        return acceleration, dq - pole.real * q + 1j * pole.imag * q

    def _acceleration(
        self, before: FloatArray, now: FloatArray, force: FloatArray, side: int, push: float
    ) -> FloatArray:
        """Return the accelerations (n_modes,) at the end of a sample; of the residual shape, its mean over the sample.

        The residual shape moves in pulses that are shorter than a sample, where a crack opens or closes.
        """
        n = len(self._action)
        found = self._sides[abs(side)][1] @ now + force + push * self._sides[1][2]
        found[self._n_damped :] = (now - before)[n + self._n_damped :] * self._rate
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

    def __init__(
        self, modes: Modes, actions: tuple[FloatArray, float], damping: FloatArray, crack: Crack, rate: float
    ) -> None:
        super().__init__(modes, actions, damping, crack, rate)
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
        acceleration = np.empty_like(force)
        for k, own in enumerate(force):
            after = self._sample(now, own)
            acceleration[k] = self._acceleration(now, after, own, self._side_of_slip, self._push)
            now = after
        q, dq = now[:n], now[n:]
        return acceleration, dq - pole.real * q + 1j * pole.imag * q

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
