"""Poles of all model orders, and which of them repeat from one order to the next.

References
----------
Reynders, E., Houbrechts, J., De Roeck, G. (2012). Fully automated (operational) modal analysis. MSSP 29, 228-250.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Protocol

import numpy as np
import numpy.typing as npt

from daq import FloatArray
from oma.conditioning import BoolArray
from oma.estimate import ComplexArray
from oma.mac import mac_matrix, normalise
from oma.selection import Selection

IndexArray = npt.NDArray[np.intp]


@dataclass(frozen=True, eq=False, kw_only=True)
class Stabilization:
    """Poles of all orders that could be modes: the stabilization diagram."""

    frequency: FloatArray  #: (n_poles,) [Hz]
    damping: FloatArray  #: (n_poles,) [-]
    shape: ComplexArray  #: (n_poles, n_channels), unit norm, as real as it can be
    order: IndexArray  #: (n_poles,) model order [-]
    column: IndexArray  #: (n_poles,) place among the eigenvalues of that order's model [-]
    stable: BoolArray  #: (n_poles,) the next order shows it too

    def __len__(self) -> int:
        """Return the number of poles."""
        return len(self.frequency)

    def __getitem__(self, chosen: BoolArray | IndexArray) -> "Stabilization":
        """Return some of the poles."""
        return Stabilization(**{f.name: getattr(self, f.name)[chosen] for f in fields(self)})


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
    """Collect the poles that meet the hard criteria and mark those that the next order shows too.

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
    orders = [_plausible(model, band, limits) for model in models]
    stable = [_repeats(now, after, limits) for now, after in zip(orders, orders[1:] + orders[-2:-1], strict=False)]
    joined = {f.name: np.concatenate([getattr(poles, f.name) for poles in orders]) for f in fields(Stabilization)}
    return Stabilization(**{**joined, "stable": np.concatenate(stable)})


def join(parts: list[Stabilization]) -> Stabilization:
    """Put diagrams of several bands into one."""
    return Stabilization(**{f.name: np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(Stabilization)})


def _plausible(model: PoleModel, band: tuple[float, float], limits: Selection) -> Stabilization:
    """Keep oscillating, damped poles inside the band.

    Shapes need not be real: in a finite window two close modes mix with complex factors, and a phase collinearity of
    0.5 asked of poles was measured to lose one of two modes 1 to 2 % apart in one of four windows of 25 s.
    """
    pole = model.continuous
    frequency = np.abs(pole) / (2 * np.pi)
    damping = -pole.real / np.abs(pole)
    column = np.flatnonzero(
        (pole.imag > 0)
        & (frequency > band[0])
        & (frequency < band[1])
        & (damping > -limits.min_damping)  # noise may drive a tone to either side of none
        & (damping < limits.max_damping)
    )
    return Stabilization(
        frequency=frequency[column],
        damping=damping[column],
        shape=normalise(model.shape[column]),
        order=np.full(len(column), model.order),
        column=column,
        stable=np.zeros(len(column), dtype=np.bool_),
    )


def _repeats(now: Stabilization, after: Stabilization, limits: Selection) -> BoolArray:
    """Tell which poles of one order have a neighbour in another."""
    shift = np.abs(now.frequency[:, None] - after.frequency) / now.frequency[:, None]
    near: BoolArray = (shift < limits.max_shift) & (1 - mac_matrix(now.shape, after.shape) < limits.max_mac_loss)
    result: BoolArray = np.any(near, axis=1)
    return result
