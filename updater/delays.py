"""Constant time delays of devices, told from the phases of the modes.

Shapes of lightly damped modes are real, so a phase that grows with frequency and is common to all channels of a device
is a delay of that device's clock, which arrival times cannot show.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from daq import FloatArray
from oma import ComplexArray, ModalEstimate

_ITERATIONS = 8


def estimate_delays(estimate: ModalEstimate, devices: Mapping[str, str]) -> dict[str, float]:
    """Return the delay of each device [s], relative to their mean.

    Least squares on phase(i, c) = theta_i - 2 pi f_i tau_device(c) modulo pi, weighted by amplitude over its standard
    deviation; right for delays under a quarter period of the highest mode.

    Parameters
    ----------
    estimate : modes of one recording
    devices : channel name -> device name
    """
    names = sorted({devices[c] for c in estimate.channels})
    column = np.array([names.index(devices[c]) for c in estimate.channels])
    omega = 2 * np.pi * estimate.frequency
    n_modes, n_channels = estimate.shape.shape
    weight = (np.abs(estimate.shape) / np.maximum(estimate.shape_std, 1e-6)).ravel()
    design = np.zeros((n_modes * n_channels, n_modes + len(names)))
    row = np.arange(n_modes * n_channels)
    design[row, np.repeat(np.arange(n_modes), n_channels)] = 1
    design[row, n_modes + np.tile(column, n_modes)] = -np.repeat(omega, n_channels)
    scale = np.r_[
        np.ones(n_modes), np.full(len(names), 1 / omega.max())
    ]  # so that the pseudo-inverse sees like numbers
    solution = np.zeros(n_modes + len(names))
    for _ in range(_ITERATIONS):
        residual = np.angle(estimate.shape).ravel() - design @ solution
        residual = (residual + np.pi / 2) % np.pi - np.pi / 2
        step = np.linalg.lstsq(design * scale * weight[:, None], residual * weight, rcond=1e-8)[0]
        solution = solution + scale * step
    delay = solution[n_modes:] - solution[n_modes:].mean()
    return dict(zip(names, delay.tolist(), strict=True))


def remove_delays(estimate: ModalEstimate, devices: Mapping[str, str], delays: Mapping[str, float]) -> ModalEstimate:
    """Return the estimate as it would be without the delays [s] of its devices, shapes turned to be real again."""
    tau = np.array([delays[devices[c]] for c in estimate.channels])
    shape = estimate.shape * np.exp(2j * np.pi * estimate.frequency[:, None] * tau)
    return replace(estimate, shape=shape * np.exp(-0.5j * np.angle((shape**2).sum(1)))[:, None])


def real_shape(shape: ComplexArray) -> FloatArray:
    """Return the real part (n_modes, n_channels), at unit norm and with its largest entry positive."""
    real = np.asarray(shape.real / np.linalg.norm(shape.real, axis=1, keepdims=True))
    peak = real[np.arange(len(real)), np.argmax(np.abs(real), axis=1)]
    return np.asarray(real * np.sign(peak)[:, None])
