"""The one-step update: measured modes put in the place of model modes, as low-rank operators.

In the reference's mass-normalised modes B (B^T M B = I) a measured mode is a = B t. With X = [T, E] (E picks the
replaced modes) eq. 7 is M_u^-1 = M^-1 + B X S X^T B^T, S = diag(1 .. -1 ..), and Woodbury gives M_u = M - (M B X)
(S^-1 + X^T X)^-1 (M B X)^T, exact and never larger than (2 m, 2 m). Eq. 8 alike with K and omega.
"""

from dataclasses import dataclass

import numpy as np

from daq import FloatArray
from updater.errors import PairingError

_SINGULAR = 1e6  # condition of [A B2]: two measured modes correspond to one of the structure
_MIN_SHARE = 1e-3  # eq. 14 divides by the updated modes' share of 1/M: below this it is noise
_MIN_OF_LARGEST = 1e-2  # or below this part of the largest share, if a fine mesh makes all shares small


@dataclass(frozen=True, eq=False, kw_only=True)
class LowRank:
    """A symmetric change of a matrix, left @ core @ left.T."""

    left: FloatArray  #: (n, k)
    core: FloatArray  #: (k, k)

    def dense(self) -> FloatArray:
        """Return the change as a matrix (n, n)."""
        return self.left @ self.core @ self.left.T

    def diagonal(self) -> FloatArray:
        """Return the diagonal (n,) of the change."""
        return np.asarray(np.einsum("ij,jk,ik->i", self.left, self.core, self.left))


def update_mass(mass_times_modes: FloatArray, t: FloatArray, replaced: FloatArray) -> LowRank:
    """Return M_u - M of eq. 7.

    Parameters
    ----------
    mass_times_modes : (n_dofs, n_modes) M B
    t : (n_modes, m) measured modes in the model's
    replaced : (n_modes, m) columns of the identity: the modes they replace

    Raises
    ------
    PairingError
        If two measured modes are the same in the model's, so that [A B2] is singular.
    """
    refuse_singular(t, replaced)
    gram = np.concatenate([t, replaced], axis=1)
    sign = np.repeat([1.0, -1.0], t.shape[1])
    return LowRank(left=mass_times_modes @ gram, core=-np.linalg.inv(np.diag(sign) + gram.T @ gram))


def update_stiffness(
    stiffness_times_modes: FloatArray,
    omega: FloatArray,
    t: FloatArray,
    replaced: FloatArray,
    omega_measured: FloatArray,
) -> LowRank:
    """Return K_u - K of eq. 8; `omega` (n_modes,) of the model, `omega_measured` (m,) of the modes t [rad/s].

    `stiffness_times_modes` is K B, so K B = M B diag(omega^2) and B^T K B = diag(omega^2).

    Raises
    ------
    PairingError
        As `update_mass`.
    """
    refuse_singular(t, replaced)
    gram = np.concatenate([t, replaced], axis=1)
    inverse = np.concatenate([omega_measured**2, -((replaced.T @ omega) ** 2)])
    core = -np.linalg.inv(np.diag(inverse) + gram.T @ (omega[:, None] ** 2 * gram))
    return LowRank(left=stiffness_times_modes @ gram, core=core)


def refuse_singular(t: FloatArray, replaced: FloatArray, *, worst: float = _SINGULAR) -> None:
    """Check that the measured modes (n_modes, m) are independent of each other and of the modes that are kept.

    det [A B2] = det B det(E^T T): the components of the measured modes in the replaced ones decide.

    Raises
    ------
    PairingError
        If they are not, naming the two that are most alike.
    """
    condition = np.linalg.cond(replaced.T @ t)
    if condition < worst:
        return
    unit = t / np.linalg.norm(t, axis=0)
    alike = np.abs(np.triu(unit.T @ unit, 1))
    first, second = np.unravel_index(np.argmax(alike), alike.shape)
    raise PairingError(
        f"[A B2] is singular (condition {condition:.1e}): measured modes {first + 1} and {second + 1} are the same in "
        "the model's modes"
    )


def mass_slope(mass_times_modes: FloatArray, t: FloatArray, replaced: FloatArray) -> FloatArray:
    """Return the derivative (m, n_dofs, n_modes) of diag(M_u) by the measured modes t, exactly.

    d M_u = -M_u d(M_u^-1) M_u and d(M_u^-1) = sum da a^T + a da^T, so
    d diag(M_u)_j = -2 sum (M_u a_i)_j (M_u B dt_i)_j. Parameters and errors as for `update_mass`.
    """
    gram = np.concatenate([t, replaced], axis=1)
    change = update_mass(mass_times_modes, t, replaced)
    updated = mass_times_modes + change.left @ (change.core @ gram.T)  # M_u B
    return np.asarray(-2 * np.einsum("ji,jk->ijk", updated @ t, updated))


def scale_by_stiffness(t: FloatArray, omega_reference: FloatArray, omega_updated: FloatArray) -> FloatArray:
    """Scale modes t (n_modes, m) so that their modal stiffness is the reference's, eqs 12 and 13."""
    return np.asarray(t / np.linalg.norm(t, axis=0) * omega_updated / omega_reference)


def normalised_increments(increment: FloatArray, inverse_mass: FloatArray, updated_share: FloatArray) -> FloatArray:
    """Return increments (n,) over the updated modes' share of the inverse mass, eq. 14; NaN where it is too small.

    Too small is under 1e-3, or under a hundredth of the largest share where a fine mesh makes all of them small: the
    increments of a body do not depend on the mesh then.

    Parameters
    ----------
    increment : (n,) [kg]
    inverse_mass : (n,) diagonal of M^-1 [1/kg]
    updated_share : (n,) sum over the updated modes of b_i(j)^2 [1/kg]
    """
    share = updated_share / inverse_mass
    seen = share > min(_MIN_SHARE, _MIN_OF_LARGEST * float(share.max()))
    return np.where(seen, increment / np.where(seen, share, 1.0), np.nan)
