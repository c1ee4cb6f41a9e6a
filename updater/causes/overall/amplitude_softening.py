"""Frequencies fall as the structure shakes harder: feet and joints that slip, bolts that gape, cracks that open.

Windows of several levels distinguish this cause from all others: their log frequencies depend on the rms, ln f_i = a_i
+ b_i rms, which no linear cause has. A slope b_i = s_i - omega_i^2 / 2 sum_a c_a mu_ia^2 has a part of feet and joints,
whose flexibilities c_a about each axis increase with the rms (mu_ia is the mode's displacement under a unit couple
there), and one that modes have nearly in common. If the mean level of the event differs from the baseline's, the same c
and s give the resulting shifts of its frequencies and shapes.
"""

from dataclasses import dataclass, replace

import numpy as np
import scipy  # its parts at their first use
import scipy.linalg

from daq import FloatArray, IndexArray
from updater.causes.base import Cause, Discrete
from updater.causes.overall.common_factor import stiffened
from updater.causes.stiffness.connections import LOOSE, Springs, propose_joint_stiffness, propose_support_stiffness
from updater.inference import Comparison, Effect, Fit, in_modes, no_effect
from updater.modal_data import Trend
from updater.quantities import Quantity
from updater.reference import Reference
from updater.structure import Structure

_FALL = 0.01  # of ln f over the spread of the windows' rms: prior standard deviation
_OWN = 0.1  # share of that variance which is a mode's own
_BIAS = 1e-4  # ln f over the spread of rms: bias of identification
_DAMPING_RISE = 0.5  # of ln damping over that spread
_STIFFEST = 0.7  # of a connection's flexibility, that amplitude may take off
_CURVED = 0.3  # relative to a straight line at the mean level: friction and gaps are not linear

Connection = tuple[Springs, int]  # foot or joint: its cause, and the alternative with all of its axes


@dataclass(frozen=True, eq=False, kw_only=True)
class AmplitudeSoftening(Discrete):
    """One alternative; parameters are standard scores.

    Of the windows' increasing flexibilities and the modes' own slopes, of the slope of damping, and of the deviation of
    the law from a straight line.
    """

    trend: Trend
    connections: tuple[Connection, ...]
    couple: FloatArray  #: (n_axes, n_modes + n_stress) mu [s2] of every axis of them that can turn, and self-stress
    least: FloatArray  #: (n_axes,) flexibility that can be taken off [rad/(N m)], negative
    by_axis: FloatArray  #: (n, n_axes) slope of each compared mode for a unit flexibility a m/s2
    mean: FloatArray  #: (n_axes + n,) flexibilities per rms and the modes' own slopes, from the windows
    root: FloatArray  #: (n_axes + n, n_axes + n) of their covariance
    damping: tuple[float, float]  #: mean and standard deviation of the slope of log damping [s2/m]
    log_trend: float  #: log likelihood of the windows' slopes over that without the cause
    name: str = "amplitude_softening"
    place_free: bool = True
    advice: str = "Record at several levels of excitation. Tighten the bolts and check whether the slope disappears."

    def _told(self, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return flexibilities (..., n_axes) and own slopes (..., n) a rms, of parameters (..., n_axes + n + 2)."""
        both = self.mean + theta[..., :-2] @ self.root.T
        return both[..., : len(self.couple)], both[..., len(self.couple) :]

    def _level(self, theta: FloatArray) -> FloatArray:
        """Return by how much rms the event's mean level lies over the baseline's, on the line of the slopes [m/s2]."""
        return np.asarray(self.trend.excess * (1 + _CURVED * theta[..., -1]))

    def effect(self, theta: FloatArray, rows: IndexArray) -> Effect:
        """Return the effect of the event's mean level relative to the baseline's; other modes follow the mean."""
        data, level = self.comparison, self._level(theta)[:, None]
        flexible, own = self._told(theta)
        every = np.tile(own.mean(1, keepdims=True), len(data.frequency))
        every[:, data.paired] = own
        change = np.expm1(-2 * level * every) * (2 * np.pi * data.frequency) ** -2.0
        in_common = in_modes(change[:, :, None] * np.eye(len(data.frequency)), data)
        turned = np.einsum("pa,ar,as->prs", np.maximum(level * flexible, self.least), self.couple, self.couple)
        rise = self.damping[0] + self.damping[1] * theta[:, -2:-1]
        return replace(
            no_effect(len(rows), data),
            compliance=turned + in_common,
            log_damping=np.tile(self.trend.excess * rise, len(data.frequency)),
        )

    def log_ratio(self, theta: FloatArray, covariance: FloatArray, rows: IndexArray) -> FloatArray:
        """Return the log evidence of the windows."""
        del covariance, rows
        return np.full(len(theta), self.log_trend)

    def parameters(self, fit: Fit[Cause]) -> dict[str, Quantity]:
        """Return the mean slope of log frequencies, and that of log damping."""
        n = len(self.mean)
        onto = np.concatenate([self.by_axis.mean(0), np.full(len(self.by_axis), 1 / len(self.by_axis))])
        weight = onto @ self.root
        slope = float(onto @ np.concatenate(self._told(fit.theta[0])))
        rise, rise_std = self.damping
        growth = rise + rise_std * float(fit.theta[0, n])
        growth_std = rise_std * float(fit.covariance[0, n, n] ** 0.5)
        return {
            "slope": Quantity(
                value=slope, std=float(np.sqrt(weight @ fit.covariance[0, :n, :n] @ weight)), unit="s2/m"
            ),
            "damping_slope": Quantity(value=growth, std=growth_std, unit="s2/m"),
        }

    def extend(self, structure: Structure, row: int, theta: FloatArray) -> Structure:
        """Make feet, joints and then everything as soft as at the event's mean level."""
        del row
        flexible, own = self._told(theta)
        level, at = self._level(theta), 0
        for springs, number in self.connections:
            turn = np.zeros(3)
            turning = np.flatnonzero(springs.couple[number].any(1))
            own_axes = slice(at, at + len(turning))
            turn[turning] = np.maximum(level * flexible[own_axes], self.least[own_axes]) * springs.unit[number, turning]
            structure = springs.extend(structure, number, turn)
            at += len(turning)
        return stiffened(structure, float(np.exp(2 * level * own.mean())))


def propose_amplitude_softening(reference: Reference, comparison: Comparison) -> AmplitudeSoftening | None:
    """Return the one alternative; None where the windows' level does not vary."""
    trend = comparison.circumstances.trend
    tracks = comparison.tracks
    if trend is None or not np.isfinite(trend.slope[tracks]).any():
        return None
    known, n = np.isfinite(trend.slope[tracks]), len(tracks)
    connections = _connections(reference, comparison)
    n_modes = len(comparison.frequency)
    couple = np.concatenate([np.empty((0, n_modes + comparison.n_stress)), *(_turning(c) for c in connections)])
    by_axis = -0.5 * ((2 * np.pi * comparison.frequency) ** 2 * couple[:, :n_modes] ** 2).T[comparison.paired]
    scale = _FALL / trend.spread
    # an axis that moves no compared mode would be free to grow without end: at most it comes loose over the spread
    loose = np.concatenate([np.empty(0), *(_loose(c) for c in connections)]) / trend.spread
    flexible = 1 / np.maximum(np.abs(by_axis).max(0) / scale, 1 / loose)
    prior = scipy.linalg.block_diag(np.diag(flexible**2), scale**2 * ((1 - _OWN) * np.ones((n, n)) + _OWN * np.eye(n)))
    onto = np.concatenate([by_axis, np.eye(n)], axis=1)[known]
    variance = trend.slope_std[tracks][known] ** 2 + (_BIAS / trend.spread) ** 2
    covariance = np.linalg.inv(np.linalg.inv(prior) + (onto.T / variance) @ onto)
    more = (trend.slope - trend.usual)[tracks][known]
    noise = np.diag(variance + trend.usual_std[tracks][known] ** 2)
    log_density = scipy.stats.multivariate_normal.logpdf(more, cov=noise + onto @ prior @ onto.T)
    n_parameters = len(prior) + 2
    return AmplitudeSoftening(
        prior_std=np.ones(n_parameters),
        lower=np.full((1, n_parameters), -np.inf),
        comparison=comparison,
        trend=trend,
        connections=connections,
        couple=couple,
        least=np.concatenate([np.empty(0), *(_stiffest(c) for c in connections)]),
        by_axis=by_axis,
        mean=covariance @ (onto.T @ (trend.slope[tracks][known] / variance)),
        root=np.linalg.cholesky(covariance),
        damping=_combined(trend.damping_slope[tracks], trend.damping_slope_std[tracks], _DAMPING_RISE / trend.spread),
        log_trend=float(log_density - scipy.stats.multivariate_normal.logpdf(more, cov=noise)),
    )


def _connections(reference: Reference, comparison: Comparison) -> tuple[Connection, ...]:
    """Return feet and joints that can turn, each with the alternative of all its axes."""
    found: list[Connection] = []
    for springs in (propose_support_stiffness(reference, comparison), propose_joint_stiffness(reference, comparison)):
        if springs is not None:
            axes = springs.active.sum(1)
            places = [(c.at, getattr(c, "member", "")) for c in springs.connections]
            rows = [[i for i, other in enumerate(places) if other == place] for place in dict.fromkeys(places)]
            found += [(springs, max(own, key=axes.__getitem__)) for own in rows]
    return tuple(found)


def _turning(connection: Connection) -> FloatArray:
    """Return the effect of unit couples about the free axes (n_axes, n_modes + n_stress)."""
    springs, number = connection
    couple = springs.couple[number]
    return np.asarray(couple[couple.any(1)])


def _stiffest(connection: Connection) -> FloatArray:
    """Return the flexibilities (n_axes,) that can be taken off about those axes, negative [rad/(N m)]."""
    springs, number = connection
    turning = springs.couple[number].any(1)
    return np.asarray(_STIFFEST * (springs.lower[number] / springs.unit[number])[turning])


def _loose(connection: Connection) -> FloatArray:
    """Return the flexibilities (n_axes,) that connections add about those axes as they come loose [rad/(N m)]."""
    springs, number = connection
    turning = springs.couple[number].any(1)
    return np.asarray(LOOSE / springs.unit[number, turning])


def _combined(value: FloatArray, std: FloatArray, prior: float) -> tuple[float, float]:
    """Return mean and standard deviation of one quantity measured several times, with a prior about zero."""
    known = np.isfinite(value) & (std > 0)
    precision = prior**-2.0 + float((std[known] ** -2.0).sum())
    return float((value[known] / std[known] ** 2).sum() / precision), precision**-0.5
