"""What is measured now against what was measured before: the data that every hypothesis is judged by.

Ratios to the baseline, log frequencies and shapes, so that what the model gets wrong about the structure as it was
cancels to first order.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from daq import FloatArray, IndexArray
from updater.circumstances import NOTHING_KNOWN, Circumstances
from updater.errors import ModalDataError
from updater.modal_checks import check_event
from updater.reference import Reference
from updater.statistics import COMMON_STD, ModalMean

BoolArray = npt.NDArray[np.bool_]
_MODEL_ERROR = 0.03  # of a mode's typical displacement: what the reference gets wrong about it at any point
_MOST_TURNED = 0.5  # rad: what close modes may turn into each other by such an error
_LEAST_GAP = 1e-6  # of squared frequencies
_SHAPE_BIAS = 1e-3  # of a unit shape: what identification errs beyond its noise, otherwise once something has changed


@dataclass(frozen=True, eq=False)
class Whitener:
    """Inverse Cholesky factor of the log frequencies' covariance."""

    matrix: FloatArray  #: (n, n)
    log_det: float  #: of the matrix


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
    shaped: BoolArray  #: (n,) whether the shape was measured now; else only the frequency counts
    shape: FloatArray  #: (n, n_channels) measured now, unit norm; where it was not, as before
    base: FloatArray  #: (n, n_channels) measured before, unit norm
    shape_whitener: FloatArray  #: (n, n_channels, n_channels) inverse Cholesky factors of the difference's covariance
    overdispersion: float  #: components of a shape that err as one [-]
    model_base: FloatArray  #: (n, n_channels) of the reference, unit norm
    at_channels: FloatArray  #: (n_channels, n_modes) of the reference's modes
    frequency: FloatArray  #: (n_modes,) of the reference [Hz]
    circumstances: Circumstances = NOTHING_KNOWN  #: what else is known

    @property
    def freedom(self) -> float:
        """Number of data: unit norm leaves a shape one component fewer than it has channels."""
        n_modes, n_channels = (int(n) for n in self.shape.shape)
        return n_modes + int(self.shaped.sum()) * (n_channels - 1) / self.overdispersion

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
    model_error: float = _MODEL_ERROR,
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
    ratio = (event.log_frequency - base.log_frequency)[tracks]
    shift = np.abs(ratio)
    variance = (event.log_frequency_std**2 + base.log_frequency_std**2)[tracks]
    variance += (2 * model_error) ** 2 * shift * shift.mean()
    check_event(base.only(tracks), event.only(tracks))
    before = base.shape[tracks]
    shaped = np.asarray(np.isfinite(event.shape[tracks]).all(1))
    shape = np.where(shaped[:, None], event.shape[tracks], before)
    shape = shape * np.where((shape * before).sum(1) < 0, -1, 1)[:, None]
    # components that err together are so much less data: each is believed less, all together as much as they are worth
    overdispersion = reference.scatter.shape_overdispersion
    spread = np.where(shaped[:, None], event.shape_std[tracks], 0.0) ** 2 + base.shape_std[tracks] ** 2
    own = overdispersion * spread + _SHAPE_BIAS**2
    at_channels = reference.at_channels(event.channels)
    expected = at_channels[:, reference.paired[tracks]].T
    return Comparison(
        channels=channels,
        tracks=tracks,
        paired=reference.paired[tracks],
        log_ratio=ratio,
        log_frequency_std=event.log_frequency_std[tracks],
        plain=_whitener(np.diag(variance)),
        drifting=_whitener(np.diag(variance) + COMMON_STD**2),
        shaped=shaped,
        shape=shape,
        base=before,
        shape_whitener=shaped[:, None, None]
        * _shape_whiteners(own, before, _foreign(reference, tracks, ratio, at_channels, model_error)),
        overdispersion=overdispersion,
        model_base=expected / np.linalg.norm(expected, axis=1, keepdims=True),
        at_channels=at_channels,
        frequency=reference.frequency,
        circumstances=circumstances,
    )


def _whitener(covariance: FloatArray) -> Whitener:
    lower = np.linalg.cholesky(covariance)
    return Whitener(np.linalg.inv(lower), -float(np.log(np.diag(lower)).sum()))


def _foreign(
    reference: Reference, tracks: IndexArray, ratio: FloatArray, at_channels: FloatArray, error: float
) -> FloatArray:
    """Return how far a wrong displacement where something has changed brings other modes into compared shapes.

    A mass m at a point where mode i moves by u_i lowers it by d_i = m u_i^2 / 2, couples it with mode k by m u_i u_k,
    and turns it towards k by that times omega_i^2 / (omega_k^2 - omega_i^2); a spring does the same. If each u is
    wrong by e times its typical size, d_i is wrong by 2 e (d_i d)^1/2 and the coupling by 2 e (d (d_i + d_k))^1/2, d
    the mean of all: most where modes are close, and not nothing where a mode has its node.

    Returns
    -------
    (n, n_modes, n_channels)
        Standard deviation of each mode's share in unit shapes, times the mode.
    """
    paired, shift = reference.paired[tracks], np.abs(ratio)
    shifts = np.full(len(reference.frequency), shift.mean())
    shifts[paired] = shift
    coupling = 2 * error * np.sqrt(shift.mean() * (shifts[paired, None] + shifts))
    turned = np.minimum(coupling * _closeness(reference.frequency, paired, ratio), _MOST_TURNED)
    length = np.linalg.norm(at_channels[:, paired], axis=0)
    return np.asarray((turned / length[:, None])[:, :, None] * at_channels.T)


def _closeness(frequency: FloatArray, paired: IndexArray, ratio: FloatArray) -> FloatArray:
    """Return omega_i^2 / |omega_k^2 - omega_i^2| (n, n_modes), before or after the change, whichever is larger.

    What is not seen after the change is taken as close as twice the mean of what the others moved allows.
    """
    reach = 2 * np.abs(ratio).mean()
    own, now = frequency[paired, None], (frequency[paired] * np.exp(ratio))[:, None]
    after = np.clip(now, frequency * np.exp(-reach), frequency * np.exp(reach))
    after[:, paired] = now.T
    gap = np.minimum(np.abs((frequency / own) ** 2 - 1), np.abs((after / now) ** 2 - 1))
    itself = np.arange(len(frequency)) == paired[:, None]
    return np.where(itself, 0.0, 1 / np.maximum(gap, _LEAST_GAP))


def _shape_whiteners(variance: FloatArray, base: FloatArray, foreign: FloatArray) -> FloatArray:
    """Return inverse Cholesky factors (n, n_channels, n_channels) of the shapes' covariances.

    Parameters
    ----------
    variance : (n, n_channels) of what is measured
    base : (n, n_channels) unit shapes
    foreign : (n, n_modes, n_channels) of other modes, by what the reference gets wrong
    """
    error = beside(foreign, base[:, None])
    covariance = variance[:, :, None] * np.eye(variance.shape[1]) + error.transpose(0, 2, 1) @ error
    return np.asarray(np.linalg.inv(np.linalg.cholesky(covariance)))


def beside(shape: FloatArray, direction: FloatArray) -> FloatArray:
    """Return what of unit shapes (..., n_channels) no multiple of others (..., n_channels) explains."""
    direction = direction / np.linalg.norm(direction, axis=-1, keepdims=True)
    return np.asarray(shape - (shape * direction).sum(-1, keepdims=True) * direction)


def residual(comparison: Comparison, log_ratio: FloatArray, shape: FloatArray, whitener: Whitener) -> FloatArray:
    """Return whitened residuals (n_alternatives, n_data).

    Parameters
    ----------
    log_ratio : (n_alternatives, n) predicted
    shape : (n_alternatives, n, n_channels) predicted, of any norm and sign
    """
    frequency = (comparison.log_ratio - log_ratio) @ whitener.matrix.T
    off = np.einsum("icd,pid->pic", comparison.shape_whitener, beside(comparison.shape, shape))
    return np.concatenate([frequency, off.reshape(len(shape), -1)], axis=1)
