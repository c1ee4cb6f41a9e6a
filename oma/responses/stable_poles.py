"""Poles that repeat from order to order of rational fractions of frequency responses.

References
----------
Guillaume, P., Verboven, P., Vanlanduit, S., Van der Auweraer, H., Peeters, B. (2003). A poly-reference implementation
of the least-squares complex frequency-domain estimator. Proceedings of IMAC XXI.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from daq import FloatArray, IndexArray
from oma.methods import HalfSpectrum, MatrixFraction, matrix_fractions
from oma.responses.lines import Lines
from oma.responses.residues import residues
from oma.selection import Selection, groups, join, stabilization
from oma.types import ComplexArray, Stabilization

SELECTION = Selection(min_damping=1e-5)
_LINES_A_POWER = 4
_N_ORDERS, _MAX_ORDER = 12, 80
_MIN_SHARE = 0.5  # of the orders that show a mode, with one of the weightings
_NOISE_POWERS = (0.0, 1.0)  # noise variance over the squared response: alike in all lines, in proportion to it
_BEYOND = 1.1  # of the highest line: poles up to there are of use


@dataclass(frozen=True, kw_only=True)
class StablePole:
    """A pole that repeats from order to order."""

    frequency: float  #: [Hz]
    damping: float  #: [-]
    support: float  #: share of the orders that show it [-]


@dataclass(frozen=True, eq=False, kw_only=True)
class _Order:
    """Poles and shapes of one order."""

    order: int
    continuous: ComplexArray
    shape: ComplexArray


def stable_poles(lines: Lines, band: tuple[float, float]) -> tuple[list[StablePole], Stabilization]:
    """Return the poles that most orders show, and the stabilization diagram.

    Lines weigh by their noise in one half of the fractions (alike unless it is known), and by the inverse of their
    squared size in the other half. The first are best if the noise is as stated; the second keep modes whose
    accelerations are small beside those of higher modes. A mode needs half of the orders of one of the two.

    Parameters
    ----------
    lines : Lines
    band : frequencies in which modes are sought [Hz]
    """
    diagrams = [_diagram(lines, band, power) for power in _NOISE_POWERS]
    stable = [found[found.stable & (found.damping > 0)] for found, _ in diagrams]
    which = np.repeat(np.arange(len(stable)), [len(found) for found in stable])
    n_orders = [n for _, n in diagrams]
    return list(_grouped(join(stable), which, n_orders)), join([found for found, _ in diagrams])


def _diagram(lines: Lines, band: tuple[float, float], noise_power: float) -> tuple[Stabilization, int]:
    """Return the poles of all orders with one weighting, and the number of orders."""
    n_fft = 2 * (int(np.ceil(lines.frequency[-1] / lines.spacing)) + 1)
    place = np.rint(lines.frequency / lines.spacing).astype(np.intp)
    values = np.zeros((n_fft, *lines.response.shape[1:]), np.complex128)
    values[place], values[-place] = lines.response, lines.response.conj()
    size = np.sum(np.abs(values) ** 2, axis=(1, 2))
    weight = np.where(size > 0, 1 / np.maximum(size, 1e-12 * size.max()) ** noise_power, 0.0)
    if not noise_power:
        weight[place] /= lines.line_noise**2
        weight[-place] /= lines.line_noise**2
    n_inputs = lines.response.shape[2]
    largest = max(2, min(_MAX_ORDER // n_inputs, len(lines.frequency) // (_LINES_A_POWER * n_inputs)))
    powers = sorted({int(p) for p in np.linspace(max(2, largest / 3), largest, _N_ORDERS)})
    fractions = matrix_fractions(HalfSpectrum(values=values, weight=weight), powers)
    orders = [_order(fraction, lines, n_fft * lines.spacing) for fraction in fractions]
    return stabilization(orders, band, SELECTION), len(orders)


def _order(fraction: MatrixFraction, lines: Lines, rate: float) -> _Order:
    """Return the poles of a fraction in the band, with shapes by least squares over the lines."""
    pole = lines.decay - np.log(fraction.root) * rate
    kept = (pole.imag > 0) & (pole.real < lines.decay) & (pole.imag < 2 * np.pi * lines.frequency[-1] * _BEYOND)
    pole = pole[kept]
    shape = residues(lines, pole, fraction.left_vector[kept])
    return _Order(order=len(fraction.root), continuous=pole, shape=shape)


def _grouped(poles: Stabilization, which: IndexArray, n_orders: list[int]) -> Iterator[StablePole]:
    """Yield the middle of each group of poles that enough orders of one weighting show."""
    order = poles.order + which * (poles.order.max(initial=0) + 1)  # no order of one weighting is one of the other
    for group in groups(poles.frequency, poles.shape, order, SELECTION.cut):
        shares = [len(np.unique(order[group[which[group] == k]])) / n for k, n in enumerate(n_orders)]
        best = group[which[group] == int(np.argmax(shares))]
        if max(shares) >= _MIN_SHARE:
            yield StablePole(
                frequency=_middle(poles.frequency[best]), damping=_middle(poles.damping[best]), support=max(shares)
            )


def _middle(values: FloatArray) -> float:
    return float(np.median(values))
