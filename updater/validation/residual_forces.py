"""Residual forces of measured modes in the equations of the model, by place on the structure.

A measured mode psi of frequency omega, expanded on the model, has the residual r = (K - omega^2 M) psi: zero if the
model is right. With few sensors, psi is the smoothest field that agrees with them within their noise: its residual
forces are drawn from a prior, as of elements whose stiffness is wrong (by r^T K^-1 r) or of masses that are (by r^T
M^-1 r), whose size is determined by evidence. This is a minimum dynamic residual expansion in the model's modes; r is
linear in the data, so that it has a deviation.

The residual can be interpreted as missing stiffness, K d = r, or as missing mass, omega^2 M a = r: along the structure
the strain of d is compared with the mode's own, the motion a with the mode's. Each interpretation alone explains one
mode; over all modes, stiffness couples them as omega_i omega_k and mass as omega_i^2, so that the evidence for the two
priors shows the better one. Other interpretations are left to a diagnosis.

References
----------
Fritzen, Jennewein & Kiefer, "Damage detection based on model updating methods", MSSP 12 (1998) 163-186;
Pascual, Golinval & Razeto, "A frequency domain correlation technique for model correlation and updating",
IMAC XV (1997) 587-592; Balmes, "Review and evaluation of shape expansion methods", IMAC XVIII (2000) 555-561.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy import sparse
from scipy.spatial import KDTree

from daq import FloatArray
from updater.errors import ModelError
from updater.fe import Model, flexibility, hinges_of
from updater.inference import Comparison, compare
from updater.modal_data import ModalMean
from updater.reference import Reference

Reading = Literal["stiffness", "mass"]
_SIZES = np.geomspace(1e-4, 1.0, 41)  # of a relative error of K or M between two modes, that the data may choose
_FREE = 30.0  # prior standard deviation of a mode's own share: as good as none
_MIN_GAP = 1e-3  # of squared frequencies, relative: nearer modes mix freely
_QUIET = 0.05  # relative to the mean strain or motion, added everywhere: a place without any has no information


@dataclass(frozen=True, eq=False, kw_only=True)
class ForceBalance:
    """Model error at each node from the residual forces of all modes; NaN where nothing is known.

    Both readings are averages over a stretch as long as the sensors and modes can resolve: a short one shows with a
    part of its loss, at its place. Standard deviations are those of noise.
    """

    loss: FloatArray  #: (n_nodes,) share of stiffness that the model has too much there [-]
    loss_std: FloatArray  #: (n_nodes,)
    added: FloatArray  #: (n_nodes,) mass that the model lacks there, over its own [-]
    added_std: FloatArray  #: (n_nodes,)
    log_odds: float  #: log evidence of errors of mass over that of errors of stiffness [-]


def force_balance(reference: Reference, event: ModalMean) -> ForceBalance:
    """Return mass or stiffness errors of the reference's model per node, from residual forces.

    Parameters
    ----------
    reference : with the model; its errors in its own baseline cancel to first order
    event : (n_tracks,) measurement, in the order of the baseline's tracks

    Raises
    ------
    ModalDataError
        If fewer than three modes or two channels can be compared.
    """
    data = compare(reference, event)
    model, shape = reference.model, reference.shape
    omega2 = (2 * np.pi * reference.frequency) ** 2
    by_stiffness, less = _left_over(reference, data, event, "stiffness")
    by_mass, more = _left_over(reference, data, event, "mass")
    loss, added = _along(_strains(model, shape), by_stiffness, omega2), _along(_motions(model, shape), by_mass, None)
    return ForceBalance(loss=loss[0], loss_std=loss[1], added=added[0], added_std=added[1], log_odds=more - less)


@dataclass(frozen=True, eq=False)
class _LeftOver:
    """Residual forces of one mode by the model's modes, r = M B rho."""

    omega2: float  #: squared frequency of the measured mode [rad2/s2]
    shape: FloatArray  #: (n_modes,) the expanded mode, its own share one
    rho: FloatArray  #: (n_modes,) [rad2/s2]
    noise: FloatArray  #: (n_modes, n_sources) a factor of rho's covariance


def _left_over(
    reference: Reference, data: Comparison, event: ModalMean, reading: Reading
) -> tuple[list[_LeftOver], float]:
    """Return the residual forces of every compared mode, and the log evidence for the error's size that they choose."""
    before = reference.baseline_at(data.channels).only(data.tracks)
    now = event.at(data.channels).only(data.tracks)
    variance = np.nan_to_num(now.shape_std) ** 2 + before.shape_std**2
    log_variance = now.log_frequency_std**2 + before.log_frequency_std**2
    own = data.at_channels[:, data.paired].T
    length = np.linalg.norm(own, axis=1)
    seen = own + length[:, None] * (data.shape - data.base)
    omega2 = (2 * np.pi * data.frequency) ** 2
    modes = [
        _Expansion(
            paired=int(paired),
            at=data.at_channels,
            omega2=omega2,
            now2=float(omega2[paired] * np.exp(2 * data.log_ratio[n])),
            seen=seen[n],
            variance=length[n] ** 2 * variance[n],
            log_variance=float(log_variance[n]),
            reading=reading,
        )
        for n, paired in enumerate(data.paired)
    ]
    evidence = [sum(mode.log_evidence(size) for mode in modes) for size in _SIZES.tolist()]
    best = int(np.argmax(evidence))
    return [mode.left_over(float(_SIZES[best])) for mode in modes], evidence[best]


@dataclass(frozen=True, eq=False, kw_only=True)
class _Expansion:
    """A measured mode to be expanded in the model's, whose components t have a Gaussian prior."""

    paired: int
    at: FloatArray  #: (n_channels, n_modes) of the model's modes
    omega2: FloatArray  #: (n_modes,) theirs [rad2/s2]
    now2: float  #: squared frequency of the measured mode
    seen: FloatArray  #: (n_channels,) measured, on the scale of the model's
    variance: FloatArray  #: (n_channels,)
    log_variance: float  #: variance of its log frequency
    reading: Reading

    def _prior(self, size: float) -> FloatArray:
        """Return prior variances (n_modes,) of t: b_k^T r of a relative error `size`, over the gap in omega^2."""
        own = self.omega2[self.paired]
        coupling = np.sqrt(own * self.omega2) if self.reading == "stiffness" else np.full(len(self.omega2), own)
        gap = np.maximum(np.abs(self.omega2 - self.now2), _MIN_GAP * own)
        spread = size * coupling / gap
        spread[self.paired] = _FREE
        return np.asarray(spread**2)

    def log_evidence(self, size: float) -> float:
        """Return the log probability of shape and frequency if errors are of a size."""
        lower = np.linalg.cholesky((self.at * self._prior(size)) @ self.at.T + np.diag(self.variance))
        white = np.linalg.solve(lower, self.seen)
        off, spread = self.now2 / self.omega2[self.paired] - 1, size**2 + 4 * self.log_variance
        return float(-0.5 * (white @ white + off**2 / spread + np.log(spread)) - np.log(np.diag(lower)).sum())

    def left_over(self, size: float) -> _LeftOver:
        """Return the residual forces of the most probable field if errors are of a size."""
        prior = self._prior(size)
        covariance = (self.at * prior) @ self.at.T + np.diag(self.variance)
        gain = prior[:, None] * np.linalg.solve(covariance, self.at).T
        t = gain @ self.seen
        gain, t = gain / t[self.paired], t / t[self.paired]
        gain = gain - np.outer(t, gain[self.paired])  # its own share is one whatever the noise
        away = self.omega2 - self.now2
        by_frequency = np.zeros((len(t), 1))
        by_frequency[self.paired] = 2 * self.now2 * np.sqrt(self.log_variance)
        noise = np.concatenate([away[:, None] * gain * np.sqrt(self.variance), by_frequency], axis=1)
        return _LeftOver(self.now2, t, away * t, noise)


@dataclass(frozen=True, eq=False)
class _Readers:
    """Rows that read strain or motion of the model's modes, and their nodes."""

    rows: FloatArray  #: (n_rows, n_modes) weighed by the root of stiffness or mass
    nodes: sparse.csr_array  #: (n_nodes, n_rows) shares of each row


def _strains(model: Model, shape: FloatArray) -> _Readers:
    """Return rotations of hinges, an element's shared by its nodes; no rows where the nodes have no rotations."""
    n_nodes = len(model.nodes)
    try:
        hinges = hinges_of(model)
    except ModelError:
        return _Readers(np.zeros((0, shape.shape[1])), sparse.csr_array((n_nodes, 0)))
    rows = (hinges.rows @ shape) / np.sqrt(flexibility(model, hinges.rows))[:, None]
    found = KDTree(model.nodes).query(hinges.position, k=np.arange(1, min(4, len(model.nodes)) + 1))
    distance, near = np.asarray(found[0], np.float64), np.asarray(found[1], np.intp)
    shared = (distance <= distance[:, :1] * (1 + 1e-6) + 1e-9).astype(float)
    shared /= shared.sum(1, keepdims=True)
    row = np.repeat(np.arange(len(near)), near.shape[1])
    return _Readers(rows, sparse.csr_array((shared.ravel(), (near.ravel(), row)), shape=(n_nodes, len(near))))


def _motions(model: Model, shape: FloatArray) -> _Readers:
    """Return the translations of all nodes."""
    padded = np.concatenate([shape, np.zeros((1, shape.shape[1]))])
    node = np.repeat(np.arange(len(model.nodes)), 3)
    ones = (np.ones(len(node)), (node, np.arange(len(node))))
    return _Readers(padded[model.dofs[:, :3].ravel()], sparse.csr_array(ones, shape=(len(model.nodes), len(node))))


def _along(readers: _Readers, modes: list[_LeftOver], omega2: FloatArray | None) -> tuple[FloatArray, FloatArray]:
    """Return missing strain or motion over the modes' own, least squares over all modes, with its deviation (n_nodes,).

    Parameters
    ----------
    readers : of strain or of motion
    modes : residual
    omega2 : (n_modes,) of the model's modes, by which stiffness responds to forces [rad2/s2]; None for mass
    """
    missing, there, variance = np.zeros((3, readers.nodes.shape[0]))
    for mode in modes:
        answer = np.full(len(mode.rho), mode.omega2) if omega2 is None else omega2
        scale = 1.0 if omega2 is None else mode.omega2**-0.5  # each mode counts by its energy, whatever its frequency
        rows = scale * readers.rows
        own = rows @ mode.shape
        at_nodes = readers.nodes @ (own[:, None] * rows) / answer
        missing += at_nodes @ mode.rho
        there += readers.nodes @ own**2
        variance += ((at_nodes @ mode.noise) ** 2).sum(1)
    whole = np.where(there > 0, there, np.nan)
    if (there > 0).any():
        whole += _QUIET * float(np.nanmean(whole))
    return missing / whole, np.sqrt(variance) / whole
