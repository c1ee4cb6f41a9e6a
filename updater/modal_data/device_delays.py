"""Time delays of devices from the phases of the modes.

Shapes of lightly damped modes are real. A phase that grows with frequency and is common to all channels of a device is
therefore a delay of that device's clock, which arrival times do not show. The delay of a device is a constant (its
filter, its cable, its place on the bus); the rest is the variation of the fit of its clock to arrival times, from
window to window. The baseline determines both: the constants, and the variation of windows about them.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from daq import FloatArray, IndexArray
from oma import ComplexArray, ModalEstimate

_ITERATIONS = 8
_MIN_STD = 1e-6  # of a shape's entry, whatever is stated
_ASTRAY = 3.0  # times their variation: possible difference of the means of two periods
_SAME_MODE = 5e-3  # by which its frequency may differ from one window to the next, relative
_MIN_WANDER = 1e-9  # s: a prior narrower than this is a constant
_FARTHEST = 0.01  # s, of the delays that a fit may begin at
_BETTER = 1.001  # times as real: a device is moved for no less
_PHASE_STEP = 0.5  # rad of the highest mode between them: a fit finds its way within one


@dataclass(frozen=True, eq=False, kw_only=True)
class DeviceDelays:
    """Constant delays of devices, of which only differences mean anything, and how far a window's stray from them."""

    seconds: Mapping[str, float]  #: device -> delay [s]
    std: Mapping[str, float]  #: device -> standard deviation of it [s]
    wander: float  #: standard deviation of a window's delay about the constant [s]
    noise_factor: float  #: real over stated standard deviation of phases [-]

    def astray(self, wander: float = 0.0) -> dict[str, float]:
        """Return by how much a device may differ from its constant [s], in the mean of a stretch of time of its own.

        The variation of clocks is a random walk: the means of two consecutive periods differ by twice the variation of
        windows within one, for any number of windows; and the host may be busier in one of them.

        Parameters
        ----------
        wander : of that stretch [s], where it is more than the baseline's: a busy host reads its ports late
        """
        late = _ASTRAY * max(self.wander, wander)
        return {name: float(np.hypot(self.std.get(name, 0.0), late)) for name in self.seconds}

    def beyond(self, removed: Mapping[str, float]) -> "DeviceDelays":
        """Return the residual delays after delays [s] have been removed already."""
        return replace(self, seconds={name: late - removed.get(name, 0.0) for name, late in self.seconds.items()})


NO_DELAYS = DeviceDelays(seconds={}, std={}, wander=0.0, noise_factor=1.0)


@dataclass(frozen=True, eq=False)
class _Fit:
    """Delays of one window by itself, or drawn towards constants."""

    names: tuple[str, ...]
    delay: FloatArray  #: (n_devices,) [s]
    covariance: FloatArray  #: (n_devices, n_devices) for phases as sure as stated [s2]
    frequency: FloatArray  #: (n_modes,) [Hz]
    information: FloatArray  #: (n_modes, n_devices, n_devices) information of each mode on delays [1/s2]
    pull: FloatArray  #: (n_modes, n_devices) which way from the fit, in sum 0 without a prior [1/s]
    misfit: float  #: sum of squares of phases over their stated deviations
    degrees_of_freedom: int


def estimate_delays(
    estimate: ModalEstimate, devices: Mapping[str, str], known: DeviceDelays = NO_DELAYS
) -> dict[str, float]:
    """Return the delay of each device [s], relative to their mean.

    Least squares on phase(i, c) = theta_i - 2 pi f_i tau_device(c) modulo pi, weighted by amplitude over its standard
    deviation; begun also at the delays up to 10 ms that make shapes most real, as phases repeat.

    Parameters
    ----------
    estimate : modes of one recording
    devices : channel name -> device name
    known : constants that the delays are drawn to, as strongly as their wander is small
    """
    fit = _fit(estimate, devices, known)
    return dict(zip(fit.names, fit.delay.tolist(), strict=True))


def learn_delays(
    estimates: Sequence[ModalEstimate], devices: Mapping[str, str], removed: Sequence[Mapping[str, float]] = ()
) -> DeviceDelays:
    """Return the constant delays that the windows of a baseline share, and how far these stray from them.

    The delays of a window are the constants, the variation of its clocks, and the noise of its phases; the variance of
    the variation is the scatter of the windows beyond that noise (DerSimonian & Laird 1986, moments of a random-effects
    model). Phases also have a small error common to all windows of a mode, which does not decrease with their number;
    its effect on the constants is estimated by leaving out modes. Devices missing in some windows have no constant.

    Parameters
    ----------
    estimates : modes of each window
    devices : channel name -> device name
    removed : per window, device -> delay removed from its modes already [s]; empty: none
    """
    removed = removed or ({},) * len(estimates)
    names = sorted(set(devices.values()))
    median = {name: float(np.median([r.get(name, 0.0) for r in removed])) for name in names}
    # starting delays, without effect on the result: the medians of the removed ones
    typical = replace(NO_DELAYS, seconds=median, wander=float("inf"))
    fits = [_fit(e, devices, typical.beyond(r)) for e, r in zip(estimates, removed, strict=True)]
    everywhere = sorted(set.intersection(*(set(fit.names) for fit in fits)))
    if len(everywhere) < 2:
        return NO_DELAYS
    pick = [[fit.names.index(name) for name in everywhere] for fit in fits]
    before = np.array([[r.get(name, 0.0) for name in everywhere] for r in removed])
    delay = before + np.array([fit.delay[p] for fit, p in zip(fits, pick, strict=True)])
    delay = delay - delay.mean(1, keepdims=True)
    noise_factor2 = sum(f.misfit for f in fits) / max(sum(f.degrees_of_freedom for f in fits), 1)
    free = len(everywhere) - 1  # delays are relative to their mean
    noise = noise_factor2 * np.array([np.trace(f.covariance) / free for f in fits])
    scatter = ((delay - delay.mean(0)) ** 2).sum() / (free * max(len(fits) - 1, 1))
    wander2 = max(scatter - noise.mean(), 0.0) if len(fits) > 1 else 0.0
    weight = 1 / (wander2 + noise)
    mean = weight @ delay / weight.sum()
    variance = 1 / weight.sum() + max(_of_modes(fits, pick) / free - noise.mean() / len(fits), 0.0)
    return DeviceDelays(
        seconds=dict(zip(everywhere, mean.tolist(), strict=True)),
        std=dict.fromkeys(everywhere, float(np.sqrt(free / len(everywhere) * variance))),
        wander=float(np.sqrt(wander2)),
        noise_factor=float(np.sqrt(noise_factor2)),
    )


def _of_modes(fits: Sequence[_Fit], pick: Sequence[list[int]]) -> float:
    """Return the variance of all constants together [s2] as leaving out one mode after the other shows it.

    Windows that share their errors are no sample of them, modes are (Efron & Tibshirani 1993, chapter 11: jackknife).
    Zero of fewer than three modes.
    """
    frequency = np.concatenate([fit.frequency for fit in fits])
    information = np.concatenate([fit.information[:, p][:, :, p] for fit, p in zip(fits, pick, strict=True)])
    pull = np.concatenate([fit.pull[:, p] for fit, p in zip(fits, pick, strict=True)])
    order = np.argsort(frequency)
    begins = np.flatnonzero(np.r_[True, np.diff(np.log(frequency[order])) > _SAME_MODE])
    information, pull = np.add.reduceat(information[order], begins), np.add.reduceat(pull[order], begins)
    if len(begins) < 3:
        return 0.0
    others = np.linalg.pinv(information.sum(0) - information, rcond=1e-8, hermitian=True)
    moved = np.einsum("mij,mj->mi", others, pull)
    return float((len(begins) - 1) / len(begins) * (moved**2).sum())


def _fit(estimate: ModalEstimate, devices: Mapping[str, str], known: DeviceDelays) -> _Fit:
    """Fit delays from the constants, from zero and from the most real shapes; return the fit with the lowest cost."""
    names = tuple(sorted({devices[c] for c in estimate.channels}))
    column = np.array([names.index(devices[c]) for c in estimate.channels])
    n_modes, n_channels = estimate.shape.shape
    weight = (np.abs(estimate.shape) / np.maximum(estimate.shape_std, _MIN_STD)).ravel()
    # the unit of delays is such that all columns are of one size, and the pseudo-inverse leaves the common delay out
    unit = 1 / (2 * np.pi * float(estimate.frequency.max()))
    design = np.zeros((n_modes * n_channels, n_modes + len(names)))
    row = np.arange(n_modes * n_channels)
    design[row, np.repeat(np.arange(n_modes), n_channels)] = 1
    design[row, n_modes + np.tile(column, n_modes)] = -np.repeat(estimate.frequency, n_channels) * 2 * np.pi * unit
    prior, start = _prior(names, known)
    constant = np.r_[np.zeros(n_modes), start / unit]
    rows = np.pad(prior * unit * known.noise_factor, ((0, 0), (n_modes, 0)))
    inverse = np.linalg.pinv(np.concatenate([design * weight[:, None], rows]), rcond=1e-8)

    def off(solution: FloatArray) -> FloatArray:
        residual = (np.angle(estimate.shape).ravel() - design @ solution + np.pi / 2) % np.pi - np.pi / 2
        return np.concatenate([residual * weight, rows @ (constant - solution)])

    doubled = (weight.reshape(n_modes, -1) ** 2 * np.exp(2j * np.angle(estimate.shape))) @ np.eye(len(names))[column]
    theta, late = _most_real(doubled, estimate.frequency, start)
    starts = (constant, np.zeros(len(constant)), np.r_[theta, late / unit])
    solution = min((_settled(inverse, off, begin) for begin in starts), key=lambda end: float((off(end) ** 2).sum()))
    centre = np.eye(len(names)) - 1 / len(names)
    information, pull = _delay_information(
        estimate.frequency, column, weight.reshape(n_modes, -1), off(solution)[: len(weight)]
    )
    return _Fit(
        names=names,
        delay=centre @ solution[n_modes:] * unit,
        covariance=centre @ (inverse @ inverse.T)[n_modes:, n_modes:] @ centre * unit**2,
        frequency=estimate.frequency,
        information=information,
        pull=pull,
        misfit=float((off(solution)[: len(weight)] ** 2).sum()),
        degrees_of_freedom=max(len(weight) - n_modes - len(names) + 1, 0),
    )


def _most_real(doubled: ComplexArray, frequency: FloatArray, late: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the modes' phases (n_modes,) and the delays (n_devices,) [s] that make shapes most real, on a grid.

    One device after another is moved, the one with the largest gain first, while there is a gain.

    Parameters
    ----------
    doubled : (n_modes, n_devices) sums of weight times exp(2i phase) over a device's channels
    frequency : (n_modes,) [Hz]
    late : (n_devices,) delays to begin at [s]
    """
    step = _PHASE_STEP / (2 * np.pi * float(frequency.max()))
    grid = step * np.arange(-round(_FARTHEST / step), round(_FARTHEST / step) + 1)
    turn = 4j * np.pi * frequency[:, None]
    late = late.copy()
    while True:
        each = doubled * np.exp(turn * late)
        total = each.sum(1)
        others = total[:, None] - each
        realness = np.abs(others[:, :, None] + doubled[:, :, None] * np.exp(turn * grid)[:, None]).sum(0)
        device, row = np.unravel_index(np.argmax(realness), realness.shape)
        if realness[device, row] <= _BETTER * np.abs(total).sum():
            return 0.5 * np.angle(total), late
        late[device] = grid[row]


def _delay_information(
    frequency: FloatArray, column: IndexArray, weight: FloatArray, residual: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return each mode's information on the devices' delays with its own phase free, and its pull.

    Parameters
    ----------
    frequency : (n_modes,) [Hz]
    column : (n_channels,) number of each channel's device
    weight : (n_modes, n_channels) one over the standard deviation of phases [1/rad]
    residual : (n_modes * n_channels,) of phases, over that
    """
    of_device = np.eye(column.max() + 1)[column]
    each = weight**2 @ of_device  # (n_modes, n_devices)
    total = each.sum(1, keepdims=True)
    slope = 2 * np.pi * frequency[:, None]
    information = (
        np.einsum("mi,ij->mij", each, np.eye(each.shape[1])) - each[:, :, None] * each[:, None] / total[:, None]
    )
    weighted = weight * residual.reshape(weight.shape)
    pull = weighted @ of_device - weighted.sum(1, keepdims=True) * each / total
    return slope[:, :, None] ** 2 * information, -slope * pull


def _settled(inverse: FloatArray, off: Callable[[FloatArray], FloatArray], start: FloatArray) -> FloatArray:
    """Return where steps of least squares with repeated residuals end."""
    solution = start
    for _ in range(_ITERATIONS):
        solution = solution + inverse @ off(solution)
    return solution


def _prior(names: tuple[str, ...], known: DeviceDelays) -> tuple[FloatArray, FloatArray]:
    """Return rows (n_known, n_devices) of one over the wander, and the constants (n_devices,), 0 for an unknown."""
    start = np.array([known.seconds.get(name, 0.0) for name in names])
    is_known = np.array([name in known.seconds for name in names])
    return np.eye(len(names))[is_known] / max(known.wander, _MIN_WANDER), start


def remove_delays(estimate: ModalEstimate, devices: Mapping[str, str], delays: Mapping[str, float]) -> ModalEstimate:
    """Return the estimate as it would be without the delays [s] of its devices, shapes turned to be real again."""
    tau = np.array([delays[devices[c]] for c in estimate.channels])
    shape = estimate.shape * np.exp(2j * np.pi * estimate.frequency[:, None] * tau)
    return replace(estimate, shape=shape * np.exp(-0.5j * np.angle((shape**2).sum(1)))[:, None])


def split_shape(shape: ComplexArray) -> tuple[FloatArray, FloatArray]:
    """Return real and imaginary parts (n_modes, n_channels), each mode turned so that its imaginary part is least.

    The turn makes the sum of squares real, so that the parts are at right angles; the real part has unit norm and its
    largest entry positive.
    """
    turned = shape * np.exp(-0.5j * np.angle((shape**2).sum(1)))[:, None]
    size = np.linalg.norm(turned.real, axis=1)
    peak = turned.real[np.arange(len(turned)), np.argmax(np.abs(turned.real), axis=1)]
    unit = turned / (size * np.sign(peak))[:, None]
    return np.asarray(unit.real), np.asarray(unit.imag)


def real_shape(shape: ComplexArray) -> FloatArray:
    """Return the real part (n_modes, n_channels) [-] of shapes (n_modes, n_channels) [-].

    It has unit norm, and its largest entry is positive.
    """
    real = np.asarray(shape.real / np.linalg.norm(shape.real, axis=1, keepdims=True))
    peak = real[np.arange(len(real)), np.argmax(np.abs(real), axis=1)]
    return np.asarray(real * np.sign(peak)[:, None])
