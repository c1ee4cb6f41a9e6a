"""Modes of a structure as a linear system that is excited by random modal forces, sampled in time.

Each mode is q'' + 2 zeta omega q' + omega^2 q = p. The modal forces p are constant during a sample (zero-order hold),
for which the transition is exact. The state holds omega q and q' of every mode.

References
----------
Juang, Applied System Identification (1994), ch. 2.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from daq import FloatArray, IndexArray
from oma import ComplexArray

NYQUIST = 0.45  #: of the rate: highest frequency of a mode in the system
_MARGIN = (0.6, 1.15)  # times the lowest and the highest measured frequency: the band
_USUAL_DAMPING = 0.005  # damping ratio where none was measured
MotionQuantity = Literal["displacement", "velocity", "acceleration"]


@dataclass(frozen=True, eq=False, kw_only=True)
class ModalSystem:
    """Modes with unit modal mass."""

    frequency: FloatArray  #: (n_modes,) undamped [Hz]
    damping: FloatArray  #: (n_modes,) of critical [-]

    @property
    def omega(self) -> FloatArray:
        """Natural frequencies (n_modes,) [rad/s]."""
        return 2 * np.pi * self.frequency

    def transition(self, dt: float) -> tuple[FloatArray, FloatArray]:
        """Return A (2 n, 2 n) and B (2 n, n) of x[k+1] = A x[k] + B p[k], the modes' omega q first, then their q'."""
        omega, zeta = self.omega, self.damping
        damped = omega * np.sqrt(1 - zeta**2)
        decay = np.exp(-zeta * omega * dt)
        cos, sin = decay * np.cos(damped * dt), decay * np.sin(damped * dt)
        ratio = zeta * omega / damped
        # columns: response to unit omega q, to unit q'
        from_q = np.array([cos + ratio * sin, -omega / damped * sin])
        from_dq = np.array([omega / damped * sin, cos - ratio * sin])
        a = np.block([[np.diag(q), np.diag(dq)] for q, dq in zip(from_q, from_dq, strict=True)])
        # a constant force moves the equilibrium to p / omega^2
        b = np.vstack([np.diag((1 - from_q[0]) / omega), np.diag(-from_q[1] / omega)])
        return a, b

    def outputs(self, quantity: MotionQuantity) -> tuple[FloatArray, FloatArray]:
        """Return C (n, 2 n) and D (n, n) of the modal displacements, velocities or accelerations C x + D p."""
        omega, none = self.omega, np.zeros((len(self.frequency),) * 2)
        if quantity == "displacement":
            return np.hstack([np.diag(1 / omega), none]), none
        if quantity == "velocity":
            return np.hstack([none, np.eye(len(omega))]), none
        return np.hstack([np.diag(-omega), np.diag(-2 * self.damping * omega)]), np.eye(len(omega))

    def accelerance(self, lines: FloatArray) -> ComplexArray:
        """Return the modal accelerations by unit modal forces (n_lines, n_modes), complex [1/kg].

        Parameters
        ----------
        lines : (n_lines,) [Hz]
        """
        ratio = lines[:, None] / self.frequency
        return np.asarray(-(ratio**2) / (1 - ratio**2 + 2j * self.damping * ratio))


def band_about(measured: FloatArray) -> tuple[float, float]:
    """Return the band [Hz] about measured frequencies (n,) [Hz]."""
    return float(_MARGIN[0] * measured.min()), float(_MARGIN[1] * measured.max())


def damping_of_all(measured: FloatArray, modes: IndexArray, n_modes: int) -> FloatArray:
    """Return the damping (n_modes,) of all modes, the median of the measured ones where it was not measured [-].

    Parameters
    ----------
    measured : (n,) NaN or 0 where it is not known [-]
    modes : (n,) their numbers
    """
    known = np.isfinite(measured) & (measured > 0)
    damping = np.full(n_modes, np.median(measured[known]) if known.any() else _USUAL_DAMPING)
    damping[modes[known]] = measured[known]
    return damping
