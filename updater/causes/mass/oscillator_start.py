"""First-order estimate of the place of an attached oscillator.

A mass on a spring that responds at omega acts along the spring like m / (1 - omega_i^2 / omega^2) on mode i, and like m
across it.
"""

import numpy as np

from daq import FloatArray, IndexArray
from updater.inference import Comparison, NewModes, beside, linear_in_mass, shaken
from updater.reference import Reference

_MIN_START = 0.01  # of the largest mass, from where a fit begins
_SAME_FREQUENCY, _SAME_SHAPE = 0.1, 0.6  # of ln f, and MAC: a mode of the reference that was not seen before


def not_known(reference: Reference, comparison: Comparison) -> IndexArray:
    """Return the new modes without a counterpart in the reference; a counterpart existed before."""
    new = comparison.new
    assert new is not None
    others = np.setdiff1d(np.arange(len(reference.frequency)), reference.paired)
    shape = comparison.at_channels[:, others]
    assurance = (new.shape @ shape) ** 2 / np.maximum((shape**2).sum(0), 1e-300)
    near = np.abs(new.log_frequency[:, None] - np.log(reference.frequency[others])) < _SAME_FREQUENCY
    return np.flatnonzero(~(near & (assurance > _SAME_SHAPE)).any(1))


def translations(reference: Reference, member: IndexArray, position: FloatArray) -> FloatArray:
    """Return the modes' translations (n, 3, n_modes) along the local axes of members at distances from their starts."""
    structure, model = reference.structure, reference.model
    members = structure.member
    points = np.array([members[m].point(float(s)) for m, s in zip(member.tolist(), position.tolist(), strict=True)])
    moved = (model.reader(points) @ reference.shape).reshape(len(points), 6, -1)[:, :3]
    axes = np.array([m.axes for m in members])
    return np.asarray(axes[member] @ moved)


def shaking(
    comparison: Comparison, new: NewModes, mode: int, translation: FloatArray, largest: float
) -> tuple[FloatArray, FloatArray]:
    """Return how badly each place and direction (n, 3) explains a new mode, and where its fit begins (n, 3, 2).

    A mass m on a spring that answers at omega acts along its direction like m / (1 - omega_i^2 / omega^2) on a mode
    omega_i, and like m across it; the structure shaken there moves by the sum of phi phi_s / (omega_r^2 - omega^2).
    """
    answer = shaken(np.exp(new.log_frequency[mode]), comparison.frequency)
    shape = (translation * answer) @ comparison.new_at_channels.T
    shape = np.where(np.linalg.norm(shape, axis=-1, keepdims=True) > 0, shape, 1.0)
    off = ((beside(new.shape[mode], shape) @ new.whitener[mode].T) ** 2).sum(-1)
    squared = translation[:, :, comparison.paired] ** 2
    across = squared.sum(1, keepdims=True) - squared
    whitener = comparison.drifting.matrix
    effect = -0.5 * (across - squared * answer[comparison.paired]) @ whitener.T
    shift = whitener @ comparison.log_ratio
    mass = effect @ shift / np.maximum((effect**2).sum(-1), 1e-12)
    mass = np.clip(mass, _MIN_START * largest, largest)
    off += ((shift - mass[:, :, None] * effect) ** 2).sum(-1)
    # the structure's receptance at its foot: omega_o^2 = omega^2 / (1 - m sum phi_s^2 / (omega_r^2 / omega^2 - 1))
    foot = np.clip(mass * (translation**2 * answer).sum(-1), -0.3, 0.3)
    return np.asarray(off), np.stack([mass, -0.5 * np.log(1 - foot)], axis=-1)


def hung(
    comparison: Comparison, translation: FloatArray, own: FloatArray, largest: float
) -> list[tuple[FloatArray, FloatArray]]:
    """Return the chi-square residual of a mass on a spring at each position, in each direction, and the start of a fit.

    A mass that responds at omega acts along its direction like m / (1 - omega_i^2 / omega^2) on mode i, and like m
    across it.

    Parameters
    ----------
    translation : (n, 3, n_modes) of the reference's modes at the places, along the directions
    own : (n_own,) frequencies at which it may answer [Hz]
    largest : standard deviation of the mass beforehand [kg], and the most that a fit begins from

    Returns
    -------
    for each own frequency: (n, 3) minus the gain in chi-square, and (n, 3, 2) mass [kg] and zero
    """
    linear, paired = linear_in_mass(comparison), comparison.paired
    along = translation[:, :, paired]  # (n, 3, n_compared)
    shift = np.einsum("pai,ij->paij", along**2, linear.by_shift.T)
    turned = np.einsum("pai,pak,ikc->paic", along, translation, linear.by_coupling, optimize=True)
    found = []
    for frequency in own.tolist():
        more = -shaken(np.array(frequency), comparison.frequency[paired]) - 1  # than the mass alone, along it
        by_shift = shift.sum((1, 2))[:, None] + np.einsum("i,paij->paj", more, shift)
        by_turn = turned.sum(1)[:, None] + more[:, None] * turned
        rest = by_shift @ linear.log_ratio + np.einsum("paic,ic->pa", by_turn, linear.shape)
        slope = (by_shift**2).sum(-1) + (by_turn**2).sum((-1, -2)) + largest**-2
        mass = np.clip(rest / slope, 0.0, largest)
        left = slope * mass**2 - 2 * rest * mass
        found.append((left, np.stack([mass, np.zeros(mass.shape)], axis=-1)))
    return found
