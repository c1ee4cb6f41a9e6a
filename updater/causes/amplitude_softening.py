"""Frequencies fall as the structure shakes harder: joints that slip, bolts that gape, cracks that open.

Told from all else by windows of several levels: their log frequencies go with the rms, ln f_i = a_i + s_i rms, which no
linear cause brings about. The modes' slopes are drawn to a common one. If the event's mean level is another than the
baseline's, the slopes also say how far its frequencies have moved by that alone.
"""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.stats import multivariate_normal

from daq import FloatArray, IndexArray
from updater.causes.base import Discrete
from updater.causes.common_factor import stiffened
from updater.circumstances import Trend
from updater.comparison import Comparison
from updater.reanalysis import Effect, no_effect
from updater.reference import Reference
from updater.structure import Structure
from updater.verdict import Quantity

if TYPE_CHECKING:
    from updater.causes.base import Cause
    from updater.fit import Fit

_FALL = 0.01  # of ln f over the spread of the windows' rms: prior standard deviation
_OWN = 0.25  # share of that variance which is a mode's own
_BIAS = 1e-4  # of ln f over the spread of rms: what identification itself brings
_DAMPING_RISE = 0.5  # of ln damping over that spread
_CURVED = 0.3  # of what a straight line says of the mean level: friction and gaps are no straight lines


@dataclass(frozen=True, eq=False, kw_only=True)
class AmplitudeSoftening(Discrete):
    """One alternative; parameters are standard scores.

    Of the modes' slopes and of the damping's, as the windows tell, and of how far the law is from a straight line.
    """

    comparison: Comparison
    trend: Trend
    mean: FloatArray  #: (n,) of the compared modes' slopes, told by the windows [s2/m]
    root: FloatArray  #: (n, n) of their covariance
    damping: tuple[float, float]  #: mean and standard deviation of the slope of log damping [s2/m]
    log_trend: float  #: log likelihood of the windows' slopes over that without the cause
    name: str = "amplitude_softening"
    place_free: bool = True
    advice: str = "Record at several levels of excitation; tighten what is bolted, and see whether the slope is gone."

    def slopes(self, theta: FloatArray) -> FloatArray:
        """Return the modes' slopes (..., n) [s2/m] of parameters (..., n + 2)."""
        return np.asarray(self.mean + theta[..., :-2] @ self.root.T)

    def _level(self, theta: FloatArray) -> FloatArray:
        """Return by how much rms the event's mean level lies over the baseline's, on the line of the slopes [m/s2]."""
        return np.asarray(self.trend.excess * (1 + _CURVED * theta[..., -1]))

    def effect(self, theta: FloatArray, rows: IndexArray) -> Effect:
        """Return what the event's mean level does beside the baseline's; modes not compared go with the mean."""
        data, slopes = self.comparison, self.slopes(theta)
        every = np.tile(slopes.mean(1, keepdims=True), len(data.frequency))
        every[:, data.paired] = slopes
        change = np.expm1(-2 * self._level(theta)[:, None] * every) * (2 * np.pi * data.frequency) ** -2.0
        rise = self.damping[0] + self.damping[1] * theta[:, -2:-1]
        return replace(
            no_effect(len(rows), data),
            flexibility=change[:, :, None] * np.eye(len(data.frequency)),
            log_damping=np.tile(self.trend.excess * rise, len(data.paired)),
        )

    def log_ratio(self, theta: FloatArray, covariance: FloatArray) -> FloatArray:
        """Return what the windows say."""
        del covariance
        return np.full(len(theta), self.log_trend)

    def where(self, fit: "Fit[Cause]") -> None:
        """Return none: the model does not say where it slips."""

    def parameters(self, fit: "Fit[Cause]") -> dict[str, Quantity]:
        """Return the mean slope of log frequencies, and that of log damping."""
        n = len(self.mean)
        weight = self.root.mean(0)
        slope = float(self.slopes(fit.theta[0]).mean())
        std = float(np.sqrt(weight @ fit.covariance[0, :n, :n] @ weight))
        rise, rise_std = self.damping
        growth = rise + rise_std * float(fit.theta[0, n])
        growth_std = rise_std * float(fit.covariance[0, n, n] ** 0.5)
        return {
            "slope": Quantity(value=slope, std=std, unit="s2/m"),
            "damping_slope": Quantity(value=growth, std=growth_std, unit="s2/m"),
        }

    def extend(self, structure: Structure, row: int, theta: FloatArray) -> Structure:
        """Make materials and springs as soft as at the event's mean level."""
        del row
        return stiffened(structure, float(np.exp(2 * self._level(theta) * self.slopes(theta).mean())))


def propose_amplitude_softening(reference: Reference, comparison: Comparison) -> AmplitudeSoftening | None:
    """Return the one alternative; None where the windows' level does not vary."""
    del reference
    trend = comparison.circumstances.trend
    if trend is None:
        return None
    tracks = comparison.tracks
    known = np.isfinite(trend.slope[tracks])
    if not known.any():
        return None
    n = len(tracks)
    prior = (_FALL / trend.spread) ** 2 * ((1 - _OWN) * np.ones((n, n)) + _OWN * np.eye(n))
    slope = np.where(known, trend.slope[tracks], 0.0)
    variance = np.where(known, trend.slope_std[tracks], 1.0) ** 2 + (_BIAS / trend.spread) ** 2
    precision = np.where(known, 1 / variance, 0.0)
    covariance = np.linalg.inv(np.linalg.inv(prior) + np.diag(precision))
    rise = _combined(trend.damping_slope[tracks], trend.damping_slope_std[tracks], _DAMPING_RISE / trend.spread)
    more = (slope - trend.usual[tracks])[known]
    noise = np.diag((variance + trend.usual_std[tracks] ** 2)[known])
    told = multivariate_normal.logpdf(more, cov=noise + prior[np.ix_(known, known)])
    return AmplitudeSoftening(
        prior_std=np.ones(n + 2),
        lower=np.full((1, n + 2), -np.inf),
        drifting=False,
        comparison=comparison,
        trend=trend,
        mean=covariance @ (precision * slope),
        root=np.linalg.cholesky(covariance),
        damping=rise,
        log_trend=float(told - multivariate_normal.logpdf(more, cov=noise)),
    )


def _combined(value: FloatArray, std: FloatArray, prior: float) -> tuple[float, float]:
    """Return mean and standard deviation of one quantity measured several times, with a prior about zero."""
    known = np.isfinite(value) & (std > 0)
    precision = prior**-2.0 + float((std[known] ** -2.0).sum())
    return float((value[known] / std[known] ** 2).sum() / precision), precision**-0.5
