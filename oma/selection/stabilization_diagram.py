"""Poles of all model orders, and those that repeat from one order to the next.

References
----------
Reynders, E., Houbrechts, J., De Roeck, G. (2012). Fully automated (operational) modal analysis. MSSP 29, 228-250.
"""

from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Protocol

import numpy as np

from daq import FloatArray
from oma.mac import normalise
from oma.selection.selection import Selection
from oma.types import ComplexArray, Stabilization


class PoleModel(Protocol):
    """A model of one order, as far as its poles go."""

    @property
    def order(self) -> int:
        """Number of poles."""

    @property
    def continuous(self) -> ComplexArray:
        """Poles, (n_poles,) [rad/s]."""

    @property
    def shape(self) -> ComplexArray:
        """Their shapes, (n_poles, n_channels)."""


def stabilization(models: Sequence[PoleModel], band: tuple[float, float], limits: Selection) -> Stabilization:
    """Collect the poles that meet the hard criteria, and mark those that the next order has too.

    Parameters
    ----------
    models : sequence of PoleModel
        Of rising order.
    band : (float, float)
        [Hz].
    limits : Selection

    Returns
    -------
    Stabilization
    """
    poles = _plausible(models, band, limits)
    level = np.searchsorted([model.order for model in models], poles.order)
    following = np.where(level < len(models) - 1, level + 1, level - 1)  # the last one is held against the one before
    shift = np.abs(poles.frequency[:, None] - poles.frequency) / poles.frequency[:, None]
    near = (shift < limits.max_shift) & (following[:, None] == level)
    now, after = np.nonzero(near)
    same = _macs(poles.shape[now], poles.shape[after]) > 1 - limits.max_mac_loss
    stable = np.zeros(len(poles), dtype=np.bool_)
    stable[now[same]] = True
    return replace(poles, stable=stable)


def join(parts: list[Stabilization]) -> Stabilization:
    """Combine the diagrams of several bands."""
    return Stabilization(**{f.name: np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(Stabilization)})


def _plausible(models: Sequence[PoleModel], band: tuple[float, float], limits: Selection) -> Stabilization:
    """Keep the oscillating, damped poles of all orders inside the band.

    Shapes need not be real: in a finite window two close modes mix with complex factors. A required phase collinearity
    of 0.5 of poles lost one of two modes 1 to 2 % apart in one of four windows of 25 s.
    """
    pole = np.concatenate([model.continuous for model in models])
    frequency = np.abs(pole) / (2 * np.pi)
    damping = -pole.real / np.abs(pole)
    kept = np.flatnonzero(
        (pole.imag > 0)
        & (frequency > band[0])
        & (frequency < band[1])
        & (damping > -limits.min_damping)  # noise may drive a tone to either side of none
        & (damping < limits.max_damping)
    )
    return Stabilization(
        frequency=frequency[kept],
        damping=damping[kept],
        shape=normalise(np.concatenate([model.shape for model in models])[kept]),
        order=np.concatenate([np.full(len(model.continuous), model.order) for model in models])[kept],
        column=np.concatenate([np.arange(len(model.continuous)) for model in models])[kept],
        stable=np.zeros(len(kept), dtype=np.bool_),
    )


def _macs(a: ComplexArray, b: ComplexArray) -> FloatArray:
    """Return the modal assurance criterion of pairs of shapes of unit norm, (n_pairs, n_channels) each."""
    return np.asarray(np.abs(np.einsum("ij,ij->i", a.conj(), b)) ** 2)
