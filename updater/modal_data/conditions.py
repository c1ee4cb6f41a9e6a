"""Conditions of an event in addition to its tracked modes: temperature, tones, new modes, amplitude.

All of it compares now with before. It is optional: unknown values are NaN or empty, and have no effect.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from daq import FloatArray, IndexArray, Recording
from oma import ChannelFault
from updater.modal_data.tracked import ModalMean, TrackedModes

_SAME_TONE = 0.05  # of ln f: tones farther apart are different ones
_MIN_LEVELS = 4  # windows that a slope over amplitude needs
_MIN_SPREAD = 0.1  # of the windows' rms over its mean, under which there is no trend to see
_MIN_DAMPING = 1e-6


@dataclass(frozen=True, eq=False, kw_only=True)
class Trend:
    """Trends of the frequency and damping of tracked modes with the rms of the vibration, over windows."""

    slope: FloatArray  #: (n_tracks,) d ln f / d rms [s2/m], NaN where it is not known
    slope_std: FloatArray  #: (n_tracks,) [s2/m]
    usual: FloatArray  #: (n_tracks,) the same in the baseline, 0 if unknown [s2/m]
    usual_std: FloatArray  #: (n_tracks,) [s2/m]
    damping_slope: FloatArray  #: (n_tracks,) d ln damping / d rms [s2/m]
    damping_slope_std: FloatArray  #: (n_tracks,) [s2/m]
    spread: float  #: standard deviation of the windows' rms [m/s2]
    excess: float  #: mean rms of the event less the baseline's [m/s2], 0 where that is not known


@dataclass(frozen=True, eq=False, kw_only=True)
class KnownMass:
    """A further record of the same state of a structure, with a known mass on it."""

    mass: float  #: [kg]
    position: tuple[float, float, float]  #: of the mass, on a member [m]
    modes: ModalMean  #: (n_tracks,) with the mass, in the order of the baseline's tracks
    is_evidence: bool = True  #: whether causes must explain it; else it is compared with the answer only


@dataclass(frozen=True, eq=False, kw_only=True)
class Signals:
    """Signals with which a loss of stiffness is tested for opening and closing."""

    now: Recording  #: of a window with the loss
    before: Recording  #: of a window without it
    heldout: Recording | None = None  #: of a further window with it, which is predicted


@dataclass(frozen=True, eq=False, kw_only=True)
class Sites:
    """Places of losses of stiffness, and the axes about which stiffness is lost there."""

    path: IndexArray  #: (n,) number of the member, or of the connection
    distance: FloatArray  #: (n,) from the start of the member, 0 of a connection [m]
    share: FloatArray  #: (n, 3) flexibility that is added about each axis, over that about the most affected one [-]


@dataclass(frozen=True, eq=False, kw_only=True)
class OpeningEvidence:
    """Evidence of the signals that a loss of stiffness opens and closes, by its place and axis.

    The likelihood under the action about each axis is a smooth function of the place on a member.
    """

    path: IndexArray  #: (n_places,) tested; as for `Sites`
    distance: FloatArray  #: (n_places,) [m]
    log_ratio: FloatArray  #: (n_places, 3) log likelihood ratio to a linear structure, 0 about axes that are not tested
    n_tests: int = 0  #: number of tests of all losses, by which the p value of a place found with them is multiplied

    def at(self, sites: Sites) -> FloatArray:
        """Return the log likelihood ratio (n,): linear between tested places, constant beyond, zero on other paths.

        Half of all losses open and close, about one axis each, with a probability in proportion to the flexibility that
        is added about it.
        """
        of_axes = np.zeros(sites.share.shape)
        for path in np.unique(self.path):
            tested, here = np.flatnonzero(self.path == path), sites.path == path
            tested = tested[np.argsort(self.distance[tested])]
            for axis, known in enumerate(self.log_ratio[tested].T):
                of_axes[here, axis] = np.interp(sites.distance[here], self.distance[tested], known)
        total = sites.share.sum(1)
        most = np.maximum(of_axes.max(1), 0.0)
        opens = (sites.share * np.exp(of_axes - most[:, None])).sum(1) / np.where(total > 0, total, 1.0)
        return np.where(total > 0, most + np.log((opens + np.exp(-most)) / 2), 0.0)


@dataclass(frozen=True, kw_only=True)
class Effort:
    """Time that further measurements take [h]."""

    sensor: float = 2.0  #: to fix one more sensor
    known_mass: float = 0.5  #: to fix a known mass, and to remove it
    instrument: float = 1.0  #: to connect a thermometer, or a source of a tone
    record: float = 1 / 6  #: to record as long as before


@dataclass(frozen=True, eq=False, kw_only=True)
class Mixing:
    """Modes of the reference as a cause mixes them, and their errors by the frequencies of modes not measured."""

    shifts: FloatArray  #: (n_modes,) log ratios of frequencies, of modes not measured that come close; else NaN
    #: (n_errors, n_modes) change of ln f by one standard deviation of the frequency of each mode not measured
    log_frequency: FloatArray
    shape: FloatArray  #: (n_modes, n_modes) changed modes as columns, in modes of the reference, unit modal mass
    turned: FloatArray  #: (n_errors, n_modes, n_modes) change of `shape` by one standard deviation of each frequency


@dataclass(frozen=True, eq=False, kw_only=True)
class Circumstances:
    """Of an event, against the baseline."""

    warmer: float = float("nan")  #: temperature now less that before [K]
    warmer_std: float = float("nan")  #: [K]
    tones: FloatArray = field(default_factory=lambda: np.empty(0))  #: (n_tones,) ln of each steady tone's f over before
    extra: ModalMean | None = None  #: modes that the baseline has not
    trend: Trend | None = None
    devices: Mapping[str, str] = field(default_factory=dict)  #: channel -> device that sampled it
    faults: Mapping[str, ChannelFault] = field(default_factory=dict)  #: faults of channels that were left out since
    wander: float = 0.0  #: standard deviation of a window's delay about its device's constant, in these windows [s]
    known_masses: tuple[KnownMass, ...] = ()  #: further records of the event's state
    effort: Effort = field(default_factory=Effort)  #: of further measurements
    signals: Signals | None = None  #: of windows now and before
    opening: Mapping[str, OpeningEvidence] = field(default_factory=dict)  #: by the name of the loss of stiffness
    mixing: Mixing | None = None  #: by the likeliest single cause, where errors of modes not measured are important
    steady: bool = True  #: whether the event's windows are of one state (`updater.modal_data.states.stationarity`)

    def opening_at(self, cause: str, sites: Sites) -> FloatArray:
        """Return the log likelihood ratio (n,) of opening and closing to none for losses of a cause."""
        found = self.opening.get(cause)
        return np.zeros(len(sites.path)) if found is None else found.at(sites)


NOTHING_KNOWN = Circumstances()


def tone_ratios(before: FloatArray, now: FloatArray) -> FloatArray:
    """Return ln of the frequency over before of each tone that both have (n_tones,).

    Parameters
    ----------
    before, now : (n,) frequencies [Hz]; a tone is paired with the nearest one within 5 %
    """
    if not len(before) or not len(now):
        return np.empty(0)
    ratio = np.log(now[None, :] / before[:, None])
    nearest = ratio[np.arange(len(before)), np.argmin(np.abs(ratio), axis=1)]
    return np.asarray(nearest[np.abs(nearest) < _SAME_TONE])


def trend_of(
    windows: TrackedModes, rms: FloatArray, before: tuple[TrackedModes, FloatArray] | None = None
) -> Trend | None:
    """Return the trends of modes over amplitude, by weighted least squares; None where the amplitude hardly varies.

    Parameters
    ----------
    windows : (n_windows, n_tracks) of the event
    rms : (n_windows,) of the vibration [m/s2]
    before : windows of the baseline and their rms, in which a trend may have been there already
    """
    if not _varies(rms):
        return None
    slope, slope_std = _slopes(windows.log_frequency, windows.log_frequency_std, rms)
    usual, usual_std = np.zeros(len(slope)), np.zeros(len(slope))
    if before is not None and _varies(before[1]):
        earlier, std = _slopes(before[0].log_frequency, before[0].log_frequency_std, before[1])
        known = np.isfinite(earlier)
        usual, usual_std = np.where(known, earlier, 0.0), np.where(known, std, 0.0)
    log_damping = np.log(np.maximum(windows.damping, _MIN_DAMPING))
    damping_slope, damping_slope_std = _slopes(log_damping, np.ones(log_damping.shape), rms)
    return Trend(
        slope=slope,
        slope_std=slope_std,
        usual=usual,
        usual_std=usual_std,
        damping_slope=damping_slope,
        damping_slope_std=damping_slope_std,
        spread=float(np.std(rms)),
        excess=float(rms.mean() - before[1].mean()) if before is not None else 0.0,
    )


def _varies(rms: FloatArray) -> bool:
    return len(rms) >= _MIN_LEVELS and bool(np.std(rms) > _MIN_SPREAD * np.mean(rms))


def _slopes(value: FloatArray, std: FloatArray, rms: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return slopes (n_tracks,) of values (n_windows, n_tracks), and their deviations by the scatter about them.

    The scatter is pooled over tracks, relative to the stated one, so that a few windows determine its size.
    """
    weight = np.where(np.isfinite(value), 1 / std**2, 0.0)
    value, total = np.where(np.isfinite(value), value, 0.0), np.maximum(weight.sum(0), 1e-300)
    off = rms[:, None] - (weight * rms[:, None]).sum(0) / total
    inertia = (weight * off**2).sum(0)
    count = (weight > 0).sum(0)
    known = (count >= _MIN_LEVELS) & (inertia > 0)
    slope = (weight * off * value).sum(0) / np.where(known, inertia, 1.0)
    rest = value - (weight * value).sum(0) / total - slope * off
    freedom = np.maximum(count - 2, 0)[known].sum()
    scatter = np.sqrt((weight * rest**2)[:, known].sum() / max(freedom, 1))
    spread = scatter / np.sqrt(np.where(known, inertia, 1.0))
    return np.where(known, slope, np.nan), np.where(known, spread, np.nan)
