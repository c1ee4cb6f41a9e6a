"""Results of an analysis of a state, with noise; and the records of its accelerometers."""

from dataclasses import replace

import numpy as np
import numpy.typing as npt
from scipy.signal import firwin, lfilter, upfirdn

from daq import Channel, FloatArray, Recording
from oma import ModalEstimate
from oma.selection import uncertainty_law
from tests.examiner.models.specimen import Random, State

SHAPE_STD = 3e-3  #: of a component of a unit shape, in one window
_OVER = 2  # simulated samples a recorded one
_QUANTUM = 9.80665 * 2.0**-20  # m/s2
_NOISE = 2e-6  # m/s2/Hz^1/2
_DENSITY = 5e-9  # of each force, N2/Hz
START = 1_767_225_600_000_000_000
N_MODES = 16  #: that are looked at
_UNSEEN = 0.02


def modal_std(state: State, n_modes: int, noise: str) -> tuple[FloatArray, float]:
    """Return standard deviations of one window: of log frequency (n_modes,), and of a unit shape's components.

    Parameters
    ----------
    noise : "law": that of a well excited window, and 0.3 %; "coarse": 0.1 % and 2 %
    """
    if noise == "coarse":
        return np.full(n_modes, 1e-3), 0.02
    frequency = state.motion(n_modes).frequency
    pairs = zip(frequency, state.modal_damping(n_modes), strict=True)
    return np.array([uncertainty_law(f, z, state.scale.window)[0] / f for f, z in pairs]), SHAPE_STD


def is_seen(state: State, n_modes: int) -> npt.NDArray[np.bool_]:
    """Return which modes (n_modes,) are in the band and move sensors by a twentieth of the usual motion."""
    frequency, moves = state.claimed_frequency(n_modes), np.linalg.norm(state.claimed_shape(n_modes), axis=1)
    usual = np.median(moves[moves > _UNSEEN * moves.max()])
    return np.asarray((frequency < state.scale.band) & (moves > 0.05 * usual))


def estimated(state: State, n_windows: int, random: Random, *, first: int = 0, noise: str) -> list[ModalEstimate]:
    """Return the results of an analysis of windows; modes above the band or with hardly any motion at the sensors are
    missing.
    """
    total, seconds = N_MODES, state.scale.window
    frequency, shape = state.claimed_frequency(total), state.claimed_shape(total)
    moves, seen = np.linalg.norm(shape, axis=1), np.flatnonzero(is_seen(state, total))
    std, shape_std = (np.asarray(s)[seen] if np.ndim(s) else s for s in modal_std(state, total, noise))
    turned = np.exp(-2j * np.pi * frequency[seen, None] * state.delay[state.order])
    exact = shape[seen] / moves[seen, None] * turned
    damping = state.modal_damping(total)[seen]
    damping_std = np.array([uncertainty_law(f, z, seconds)[1] for f, z in zip(frequency[seen], damping, strict=True)])
    n, m = exact.shape
    found = []
    for window in range(first, first + n_windows):
        blurred = exact + shape_std * (random.standard_normal((n, m)) + 1j * random.standard_normal((n, m)))
        found.append(
            ModalEstimate(
                channels=state.channels,
                frequency=frequency[seen] * np.exp(std * random.standard_normal(n)),
                frequency_std=std * frequency[seen],
                damping=np.maximum(damping + damping_std * random.standard_normal(n), 1e-4),
                damping_std=damping_std,
                shape=_as_real_as_can_be(blurred / np.linalg.norm(blurred, axis=1, keepdims=True)),
                shape_std=np.full((n, m), float(shape_std)),
                support=np.ones(n),
                law_ratio=np.ones(n),
                start=START + round(window * seconds * 1e9),
                end=START + round((window + 1) * seconds * 1e9),
            )
        )
    return found


def _as_real_as_can_be(shape: np.ndarray) -> np.ndarray:
    return np.asarray(shape * np.exp(-0.5j * np.angle((shape**2).sum(1)))[:, None])


def recorded(state: State, seconds: float, random: Random, *, rate: float = 1000.0, n_displaced: int = 0) -> Recording:
    """Record for a while: wind, delays, an anti-alias filter, noise and quantization.

    The last `n_displaced` channels follow the displacement of the modes, the others their acceleration.
    """
    true_rate = rate * state.clock
    fine, settling = _OVER * true_rate, round(20 * _OVER * true_rate)
    total = settling + round(seconds * fine)
    # modes above the recorded band keep their place in it as quasi-static motion, up to the simulated band
    motion = state.motion(30)
    keep = motion.frequency < 0.45 * fine
    push = state.loudness * np.sqrt(_DENSITY * fine / 2) * random.standard_normal((total, motion.at_forces.shape[1]))
    accelerated = len(state.sensors) - n_displaced
    signal = np.zeros((total, len(state.sensors)))
    for f, z, there, pushed in zip(
        motion.frequency[keep],
        state.modal_damping(30)[keep],
        motion.at_sensors[keep],
        motion.at_forces[keep],
        strict=True,
    ):
        displacement, acceleration = _modal_response(push @ pushed, 2 * np.pi * f, z, 1 / fine)
        signal[:, :accelerated] += acceleration[:, None] * there[:accelerated]
        signal[:, accelerated:] += displacement[:, None] * there[accelerated:]
    reported = _delayed(signal * state.gain, state.delay, fine)[settling:, state.order]
    reported = upfirdn(firwin(129, 0.9 / _OVER), reported, down=_OVER, axis=0)[: round(seconds * rate)]
    reported[:, [state.channels.index(c) for c in state.dead]] = 0.0
    reported += _NOISE * np.sqrt(rate / 2) * random.standard_normal(reported.shape)
    sensors = state.sensors
    axes = {"x": 0, "y": 1, "z": 2}
    channels = tuple(Channel(name=s.channel, device=s.device, axis=axes[s.channel[-1]]) for s in sensors)
    data: FloatArray = _QUANTUM * np.round(reported / _QUANTUM)
    return Recording(channels=channels, data=data, rate=rate, start=START, temperature=state.temperature)


def _modal_response(force: FloatArray, omega: float, damping: float, dt: float) -> tuple[FloatArray, FloatArray]:
    """Return q and q'' of q'' + 2 zeta omega q' + omega^2 q = p, p constant over a sample, by one complex pole."""
    decay = omega * np.sqrt(1 - damping**2)
    pole = -damping * omega + 1j * decay
    step = np.exp(pole * dt)
    state = lfilter([0.0, (step - 1) / pole], [1.0, -step], force.astype(complex))
    # the impulse response of q is Im(exp(pole t)) / decay, and each derivative brings the pole down once
    return np.asarray(state.imag / decay), np.asarray((pole**2 * state).imag / decay + force)


def _delayed(signal: FloatArray, delay: FloatArray, rate: float) -> FloatArray:
    """Shift each channel by its delay [s], exactly for frequencies below half the rate."""
    n = len(signal)
    frequency = np.fft.rfftfreq(n, 1 / rate)
    turned = np.fft.rfft(signal, axis=0) * np.exp(-2j * np.pi * frequency[:, None] * delay)
    return np.asarray(np.fft.irfft(turned, n, axis=0))


def joined(parts: list[Recording]) -> Recording:
    """Return recordings one after another as one: changes during the log."""
    return replace(parts[0], data=np.concatenate([p.data for p in parts]))
