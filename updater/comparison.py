"""What is measured now against what was measured before: the data that every hypothesis is judged by.

Ratios to the baseline, log frequencies and shapes, so that what the model gets wrong about the structure as it was
cancels to first order.

Four blocks of data: log frequencies; shapes; the shapes' imaginary parts, each mode turned so that its own is least
(`lag`: complex modes of the structure itself cancel against the baseline, a late channel does not); log damping. A
block of which nothing was measured is empty or zero and adds nothing to the degrees of freedom.
"""

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from daq import FloatArray, IndexArray
from updater.circumstances import NOTHING_KNOWN, Circumstances
from updater.errors import ModalDataError
from updater.lags import dampings_of, lags_of, unsure_of
from updater.modal_checks import check_event
from updater.reference import Reference
from updater.shape_errors import beside, foreign_modes, nearer_modes, own_phases, shape_whiteners, turned_back
from updater.statistics import COMMON_STD, ModalMean

BoolArray = npt.NDArray[np.bool_]
MODEL_ERROR = 0.01  #: of a mode's typical displacement: what the reference gets wrong about it at any point
_NARROW = 0.02  # of a squared frequency: nearer than this a mode resonates
_FREQUENCY_BIAS = 1e-4  # of ln f of a mode that is new
_UNKNOWN = 0.1  # of a unit shape's square, from which on it is not known
_BIAS_OF_BANDWIDTH = 0.1  # of what a mode's half bandwidth has changed by: how far identification errs otherwise then
SHAPE_BIAS = 6e-4  # of a unit shape: what identification errs beyond its noise, otherwise once something has changed


@dataclass(frozen=True, eq=False)
class Whitener:
    """Inverse Cholesky factor of the log frequencies' covariance."""

    matrix: FloatArray  #: (n, n)
    log_det: float  #: of the matrix


@dataclass(frozen=True, eq=False)
class Prediction:
    """What alternatives say would be measured."""

    log_ratio: FloatArray  #: (n_alternatives, n) of frequency to the baseline's
    shape: FloatArray  #: (n_alternatives, n, n_channels) of any norm and sign
    lag: FloatArray  #: (n_alternatives, n, n_channels) the shape's imaginary part where the real one has unit norm
    log_damping: FloatArray  #: (n_alternatives, n) of damping to the baseline's
    new_frequency: FloatArray  #: (n_alternatives, n_new) of modes that came with something [Hz]
    new_shape: FloatArray  #: (n_alternatives, n_new, n_channels) of any norm and sign
    undone: FloatArray | None = None  #: (n_alternatives, n_channels, n_channels) exchanges and turns of channels undone


@dataclass(frozen=True, eq=False, kw_only=True)
class NewModes:
    """Modes now that the baseline has not."""

    log_frequency: FloatArray  #: (n_extra,) [ln Hz]
    log_frequency_std: FloatArray  #: (n_extra,)
    damping: FloatArray  #: (n_extra,) [-], NaN where it is not known
    damping_std: FloatArray  #: (n_extra,)
    shape: FloatArray  #: (n_extra, n_channels) unit norm
    whitener: FloatArray  #: (n_extra, n_channels, n_channels) inverse Cholesky factors of its covariance


@dataclass(frozen=True, eq=False, kw_only=True)
class Comparison:
    """Modes now and before, at the channels, with the reference's modes to predict from."""

    channels: tuple[str, ...]  #: that both have
    tracks: IndexArray  #: (n,) indices of the tracks that entered
    paired: IndexArray  #: (n,) their model modes
    log_ratio: FloatArray  #: (n,) of frequency to the baseline's
    log_frequency_std: FloatArray  #: (n,) of what is measured now, without the model's error
    plain: Whitener  #: of the log ratios, if nothing but noise adds to what a hypothesis says
    drifting: Whitener  #: the same with a change common to all, which temperature brings
    model_variance: FloatArray  #: (n,) of the log ratios', that is allowed for what the reference gets wrong
    shaped: BoolArray  #: (n,) whether the shape was measured now; else only the frequency counts
    shape: FloatArray  #: (n, n_channels) measured now, unit norm; where it was not, as before
    base: FloatArray  #: (n, n_channels) measured before, unit norm
    shape_whitener: FloatArray  #: (n, n_channels, n_channels) inverse Cholesky factors of the difference's covariance
    overdispersion: float  #: components of a shape that err as one [-]
    phased: BoolArray  #: (n,) whether phases are known now and before
    lag: FloatArray  #: (n, n_channels) imaginary part of the shape now; 0 where it is not known
    base_lag: FloatArray  #: (n, n_channels) before
    lag_whitener: FloatArray  #: (n n_channels, n n_channels) inverse Cholesky factor, 0 where phases are not known
    lag_overdispersion: float  #: components of the imaginary part that err as one [-]
    log_damping: FloatArray  #: (n,) of damping to the baseline's; 0 where it is not known
    log_damping_std: FloatArray  #: (n,) of what is measured, then and now; NaN where it is not known
    damping_weight: FloatArray  #: (n,) one over the standard deviation with what is not the cause's; 0: not known
    model_base: FloatArray  #: (n, n_channels) of the reference, unit norm
    at_channels: FloatArray  #: (n_channels, n_modes) of the reference's modes
    across: FloatArray  #: (2 n_channels, n_modes) of them along the two axes across each channel, first axes first
    frequency: FloatArray  #: (n_modes,) of the reference [Hz]
    circumstances: Circumstances = NOTHING_KNOWN  #: what else is known
    new: NewModes | None = None  #: of the circumstances, at the channels

    def trusting(self, share: float) -> "Comparison":
        """Return the same with only a share of what log frequencies are allowed for what the reference gets wrong."""
        variance = np.diag(self.plain.matrix) ** -2 - (1 - share**2) * self.model_variance
        return replace(self, plain=_whitener(np.diag(variance)), drifting=_whitener(np.diag(variance) + COMMON_STD**2))

    @property
    def log_det_of_shapes(self) -> float:
        """Log determinant of the shapes' whiteners, as far as their components are data of their own.

        The same for all hypotheses; not for another model error.
        """
        diagonal = np.diagonal(self.shape_whitener[self.shaped], axis1=1, axis2=2)
        return float(np.log(diagonal).sum() / self.overdispersion)

    @property
    def heard_at_channels(self) -> FloatArray:
        """The reference's modes (n_channels, n_modes) as the channels say them, whose faults the baseline has seen."""
        heard = self.at_channels.copy()
        length = np.linalg.norm(heard[:, self.paired], axis=0)
        sign = np.where((self.base * self.model_base).sum(1) < 0, -1.0, 1.0)
        heard[:, self.paired] = (sign * length) * self.base.T
        return heard

    def freedom_of_new(self, n_new: int) -> float:
        """Return how many data new modes are, to a hypothesis that says there are `n_new`."""
        if self.new is None:
            return 0.0
        n_extra, n_channels = (int(n) for n in self.new.shape.shape)
        return min(n_new, n_extra) * (1 + (n_channels - 1) / self.overdispersion)

    @property
    def freedom(self) -> float:
        """Number of data: unit norm leaves a shape one component fewer than it has channels."""
        n_modes, n_channels = (int(n) for n in self.shape.shape)
        of_shapes = int(self.shaped.sum()) * (n_channels - 1) / self.overdispersion
        of_phases = int(self.phased.sum()) * (n_channels - 1) / self.lag_overdispersion
        of_damping = float(np.nansum((self.log_damping_std * self.damping_weight) ** 2))  # the rest is no noise
        return n_modes + of_shapes + of_phases + of_damping

    @property
    def extra_frequency(self) -> FloatArray:
        """Frequencies (n_extra,) of modes that the baseline has not [Hz]."""
        extra = self.circumstances.extra
        return np.exp(extra.log_frequency) if extra else np.empty(0)

    @property
    def extra_frequency_std(self) -> FloatArray:
        """Their standard deviations (n_extra,) [Hz]."""
        extra = self.circumstances.extra
        return self.extra_frequency * extra.log_frequency_std if extra else np.empty(0)


def compare(
    reference: Reference,
    event: ModalMean,
    *,
    circumstances: Circumstances = NOTHING_KNOWN,
    model_error: float = MODEL_ERROR,
) -> Comparison:
    """Set an event beside the baseline.

    Parameters
    ----------
    reference : learnt before
    event : (n_tracks,) mean of the windows since; NaN where a track is not seen, or only its frequency is known
    circumstances : what else is known of the event
    model_error : of a mode's typical displacement, what the reference gets wrong about it at any point; a larger one
        makes a rougher search that misses less

    Raises
    ------
    ModalDataError
        If fewer than three modes or two channels can be compared, or the event's modes cannot be right.
    """
    channels = tuple(c for c in reference.baseline.channels if c in event.channels)
    if len(channels) < 2:
        raise ModalDataError(f"channels to compare: expected at least 2 in both, found {len(channels)}")
    base, event = reference.baseline.at(channels), event.at(channels)
    tracks = np.flatnonzero(np.isfinite(event.log_frequency))
    if len(tracks) < 3:
        raise ModalDataError(f"modes to compare: expected at least 3, found {len(tracks)}")
    base, event = base.only(tracks), event.only(tracks)
    ratio = event.log_frequency - base.log_frequency
    shift = np.abs(ratio)
    model_error = model_error * reference.doubt
    model_variance = (2 * model_error) ** 2 * shift * shift.mean()
    wider = np.nan_to_num(_BIAS_OF_BANDWIDTH * (event.damping - base.damping))
    variance = event.log_frequency_std**2 + base.log_frequency_std**2 + model_variance + wider**2
    check_event(base, event)
    before = base.shape
    shaped = np.asarray(np.isfinite(event.shape).all(1))
    shape = np.where(shaped[:, None], event.shape, before)
    sign = np.where((shape * before).sum(1) < 0, -1, 1)[:, None]
    shape = shape * sign
    # components that err together are so much less data: each is believed less, all together as much as they are worth
    overdispersion = reference.scatter.shape_overdispersion
    spread = np.where(shaped[:, None], event.shape_std, 0.0) ** 2 + base.shape_std**2
    own = (
        overdispersion * spread
        + SHAPE_BIAS**2
        + (_blurred(event, max(reference.delays.wander, circumstances.wander))[:, None] * before) ** 2
    )
    imaginary = np.where(shaped[:, None] & np.isfinite(event.imaginary), event.imaginary, 0.0)
    at_channels = reference.at_channels(event.channels)
    foreign = foreign_modes(reference, tracks, ratio, at_channels, model_error)
    foreign = np.concatenate([foreign, own_phases(shape, imaginary, overdispersion * spread, before)], axis=1)
    expected = at_channels[:, reference.paired[tracks]].T
    return Comparison(
        channels=channels,
        tracks=tracks,
        paired=reference.paired[tracks],
        log_ratio=ratio,
        log_frequency_std=event.log_frequency_std,
        plain=_whitener(np.diag(variance)),
        drifting=_whitener(np.diag(variance) + COMMON_STD**2),
        model_variance=model_variance,
        shaped=shaped,
        shape=shape,
        base=before,
        shape_whitener=shaped[:, None, None] * shape_whiteners(own, before, foreign),
        overdispersion=overdispersion,
        **lags_of(
            base,
            event,
            sign,
            reference.scatter,
            nearer_modes(reference, tracks, ratio, at_channels, base.damping),
            unsure_of(reference, base, event, circumstances),
        ),
        **dampings_of(base, event),
        model_base=expected / np.linalg.norm(expected, axis=1, keepdims=True),
        at_channels=at_channels,
        across=reference.across_channels(channels),
        frequency=reference.frequency,
        circumstances=circumstances,
        new=_new_modes(circumstances.extra, channels, overdispersion, at_channels, reference.frequency, model_error),
    )


def _new_modes(
    extra: ModalMean | None,
    channels: tuple[str, ...],
    overdispersion: float,
    at_channels: FloatArray,
    frequency: FloatArray,
    model_error: float,
) -> NewModes | None:
    """Return those whose shape is known at the channels: what mixes two close modes is no new one.

    Their shapes are of what shakes the structure at one place: of each mode as much as that moves there, which the
    reference gets wrong as for `_foreign`, and as it answers.
    """
    if extra is None:
        return None
    extra = extra.at(channels)
    known = np.isfinite(extra.shape + extra.shape_std).all(1) & ((extra.shape_std**2).sum(1) < _UNKNOWN)
    extra = extra.only(np.flatnonzero(known))
    if not len(extra.log_frequency):
        return None
    variance = overdispersion * extra.shape_std**2 + SHAPE_BIAS**2 + model_error**2 / len(channels)
    share = np.linalg.norm(at_channels, axis=0) * shaken(np.exp(extra.log_frequency)[:, None], frequency)
    turned = 2 * model_error * np.abs(share) / np.linalg.norm(share, axis=1, keepdims=True)
    unit = at_channels / np.maximum(np.linalg.norm(at_channels, axis=0), 1e-300)
    return NewModes(
        log_frequency=extra.log_frequency,
        log_frequency_std=np.hypot(extra.log_frequency_std, _FREQUENCY_BIAS),
        damping=extra.damping,
        damping_std=extra.damping_std,
        shape=extra.shape,
        whitener=shape_whiteners(variance, extra.shape, turned[:, :, None] * unit.T),
    )


def shaken(at: FloatArray, frequency: FloatArray) -> FloatArray:
    """Return how much modes of frequencies (n_modes,) answer to what shakes the structure at others [Hz].

    1 / (omega_r^2 / omega^2 - 1), cut where a mode would resonate: then it takes over what shakes it.
    """
    gap = (frequency / at) ** 2 - 1
    return np.asarray(1 / np.where(np.abs(gap) < _NARROW, np.copysign(_NARROW, gap), gap))


def _blurred(event: ModalMean, wander: float) -> FloatArray:
    """Return the share of a shape's component (n,) that a clock's wander [s] takes, here and there: 1 - cos(omega tau).

    What a window's delay strays by is also what it strays by within the window, which no constant delay mends.
    """
    return np.asarray(1 - np.cos(2 * np.pi * np.exp(event.log_frequency) * wander))


def _whitener(covariance: FloatArray) -> Whitener:
    lower = np.linalg.cholesky(covariance)
    return Whitener(np.linalg.inv(lower), -float(np.log(np.diag(lower)).sum()))


def residual(comparison: Comparison, predicted: Prediction, whitener: Whitener) -> FloatArray:
    """Return whitened residuals (n_alternatives, n_data): log frequencies, shapes, their lags, log damping."""
    shape, n = predicted.shape, len(predicted.shape)
    frequency = (comparison.log_ratio - predicted.log_ratio) @ whitener.matrix.T
    rest = turned_back(_undone(predicted, beside(comparison.shape, shape)), _undone(predicted, shape), comparison.base)
    off = np.einsum("icd,pid->pic", comparison.shape_whitener, rest)
    blocks = [frequency, off.reshape(n, -1)]
    if comparison.phased.any():
        sign = np.where((shape * comparison.shape).sum(-1, keepdims=True) < 0, -1.0, 1.0)
        late = beside(comparison.lag - sign * predicted.lag, shape)  # a mode's own phase is no one's
        blocks.append(_undone(predicted, late).reshape(n, -1) @ comparison.lag_whitener.T)
    if comparison.damping_weight.any():
        blocks.append((comparison.log_damping - predicted.log_damping) * comparison.damping_weight)
    if comparison.new is not None:
        blocks.append(_off_new(comparison.new, predicted))
    return np.concatenate(blocks, axis=1)


def _undone(predicted: Prediction, off: FloatArray) -> FloatArray:
    """Return what is left of shapes (p, n, n_channels) at the channels as they were: errors in common are known there.

    Where modes are close they turn into each other by what a model gets wrong. Of two channels that were exchanged that
    says the one what is the other's.
    """
    return off if predicted.undone is None else np.asarray(off @ predicted.undone.transpose(0, 2, 1))


def _off_new(new: NewModes, predicted: Prediction) -> FloatArray:
    """Return whitened residuals (p, n_extra (1 + n_channels)) of new modes, each from the nearest that is predicted.

    A mode that nothing predicts is nobody's: zeros. What predicts it says in its evidence what that is worth.
    """
    n_alternatives, n_new = predicted.new_frequency.shape
    off = np.zeros((n_alternatives, len(new.shape), 1 + new.shape.shape[1]))
    every = np.arange(n_alternatives)
    for k in range(n_new):
        away = new.log_frequency - np.log(predicted.new_frequency[:, k, None])
        nearest = np.argmin(np.abs(away), axis=1)
        off[every, nearest, 0] = away[every, nearest] / new.log_frequency_std[nearest]
        shape = predicted.new_shape[:, k]
        moves = np.linalg.norm(shape, axis=1, keepdims=True) > 0  # not what hangs on a foot
        beside_it = beside(new.shape[nearest], np.where(moves, shape, 1.0))
        off[every, nearest, 1:] = np.einsum("pij,pj->pi", new.whitener[nearest], beside_it)
    return off.reshape(n_alternatives, -1)
