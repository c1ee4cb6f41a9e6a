"""Imaginary parts of shapes and damping as blocks of a comparison."""

from typing import Any

import numpy as np
from scipy.linalg import block_diag

from daq import FloatArray
from updater.inference.shape_covariance import beside, shape_covariances
from updater.modal_data import Circumstances, ModalMean, Scatter
from updater.reference import Reference

_PHASE_BIAS = 1e-3  # relative to a unit shape, of its imaginary part: error of identification beyond its noise
_LARGEST_DAMPING_STD = 1.0  # of log damping: from there on it was not measured, and is no datum
_DAMPING_SPREAD = 0.7  # of log damping, between modes of one structure
_DAMPING_BIAS = 0.1  # of log damping, a mode's own: friction, amplitude and weather change it, whatever else has


def imaginary_parts(
    base: ModalMean, event: ModalMean, sign: FloatArray, scatter: Scatter, foreign: FloatArray, devices: FloatArray
) -> dict[str, Any]:
    """Return the data of the shapes' imaginary parts.

    Parameters
    ----------
    base, event : (n,) of the modes compared
    sign : (n, 1) that turns the event's shapes to the baseline's
    foreign : (n, n_modes, n_channels) imaginary shares of other modes that may have come
    devices : (n_devices, n, n_channels) imaginary parts by a device's clock, all modes together
    """
    phased = np.asarray(np.isfinite(event.imaginary + base.imaginary).all(1))
    known = phased[:, None]
    now, before = np.where(known, event.imaginary * sign, 0.0), np.where(known, base.imaginary, 0.0)
    spread = np.where(known, event.imaginary_std**2 + base.imaginary_std**2, 0.0)
    own = scatter.phase_overdispersion * spread + _PHASE_BIAS**2
    whitener = np.zeros((base.shape.size, base.shape.size))
    every = np.repeat(phased, base.shape.shape[1])
    if phased.any():
        error = beside(devices, base.shape)[:, phased].reshape(len(devices), every.sum())
        covariance = block_diag(*shape_covariances(own, base.shape, foreign)[phased]) + error.T @ error
        whitener[np.ix_(every, every)] = np.linalg.inv(np.linalg.cholesky(covariance))
    return {
        "phased": phased,
        "imaginary": now,
        "baseline_imaginary": before,
        "imaginary_whitener": whitener,
        "imaginary_overdispersion": scatter.phase_overdispersion,
    }


def unsure_of(reference: Reference, base: ModalMean, event: ModalMean, circumstances: Circumstances) -> FloatArray:
    """Return imaginary parts (n_devices, n, n_channels) by the uncertainty of each device's delay."""
    owner = [circumstances.devices.get(c) for c in event.channels]
    found = []
    for device, late in reference.delays.astray(circumstances.wander).items():
        members = np.array([float(name == device) for name in owner])
        found.append(-2 * np.pi * np.exp(base.log_frequency)[:, None] * late * base.shape * members)
    return np.array(found).reshape(-1, *base.shape.shape)


def without_mode(whitener: FloatArray, mode: int, n_channels: int) -> FloatArray:
    """Return the whitener of the phases without the information of one mode.

    Parameters
    ----------
    whitener : (n_modes n_channels, n_modes n_channels) of the imaginary parts of all shapes [-]
    mode : number of the mode whose imaginary part may have any value
    n_channels : number of channels
    """
    precision = whitener.T @ whitener
    out = np.zeros(len(precision), dtype=bool)
    out[mode * n_channels : (mode + 1) * n_channels] = True
    across = precision[np.ix_(~out, out)]
    left = (
        precision[np.ix_(~out, ~out)] - across @ np.linalg.pinv(precision[np.ix_(out, out)], hermitian=True) @ across.T
    )
    value, vector = np.linalg.eigh(left)
    found = np.zeros(whitener.shape)
    found[np.ix_(~out, ~out)] = np.sqrt(np.maximum(value, 0.0))[:, None] * vector.T
    return found


def damping_changes(base: ModalMean, event: ModalMean, mixed: FloatArray) -> dict[str, Any]:
    """Return the data of damping.

    Parameters
    ----------
    base, event : (n,) of the modes compared
    mixed : (n,) share of other modes that the change may have mixed into each, with their damping
    """
    known = (base.damping > 0) & (event.damping > 0)
    now, before = np.where(known, event.damping, 1.0), np.where(known, base.damping, 1.0)
    std = np.hypot(event.damping_std / now, base.damping_std / before)
    known &= std < _LARGEST_DAMPING_STD
    whole = np.sqrt(np.where(known, std, 1.0) ** 2 + _DAMPING_BIAS**2 + (_DAMPING_SPREAD * mixed) ** 2)
    return {
        "log_damping": np.where(known, np.log(now / before), 0.0),
        "log_damping_std": np.where(known, std, np.nan),
        "damping_weight": np.where(known, 1 / whole, 0.0),
    }
