"""Exact re-analysis of many hypotheses at once, in the modes of the reference.

In mass-normalised modes B of frequencies omega a structural change is one of modal mass, M' = I + dM, and of modal
flexibility, F' = Lambda^-1 + dF: a small eigenproblem F' M' x = x / omega'^2. Its derivatives follow from the same
eigenvectors (`tangent`), so that a step of Gauss-Newton costs one decomposition per alternative. Flexibility is given
as compliance in modes and in states of self-stress (`self_stress`), by which a redundant structure redistributes its
load to stiffer parts.

An oscillator appends a degree of freedom: its motion relative to the structure's, with unit mass, a flexibility 1 /
omega_o^2 and a coupling in the mass matrix. So does a ground that moves supports: the modes, of fixed supports, are
then relative to the structure's static motion with it (Craig and Bampton 1968).
"""

from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np

from daq import FloatArray, IndexArray
from updater.inference.comparison import Comparison, one_to_one
from updater.inference.residuals import Prediction
from updater.inference.shape_covariance import inner
from updater.modal_data import FREQUENCY_WEIGHT, Mixing

_EITHER = 0.1  # of the largest share of a mode in a changed one, from which on another one may be its successor
_SPLIT = 0.05  # share of an oscillator in a compared mode above which either of two modes may be its successor
_NEAR = 0.5  # ln f: largest distance of an oscillator's mode from its start
_OWN = ("coupling", "own", "own_log_damping", "carried")  # parts of an effect that have every alternative, or none
_MIN = 1e-12  # of 1/omega^2 over the largest: a mode without inertia is infinitely high, never a NaN


@dataclass(frozen=True, eq=False, kw_only=True)
class Effect:
    """Effect of each of some alternatives.

    A part that no alternative changes has a length of 1 along the first axis in the place of n_alternatives.
    """

    mass: FloatArray  #: (n_alternatives, n_modes, n_modes) change of modal mass
    #: (n_alternatives, n_modes + n_stress, same) compliance added in modes [s2], states of self-stress [-], and across
    compliance: FloatArray
    #: (n_alternatives, n_channels, 3 n_channels) reading of the channels relative to the truth along their own
    #: directions, along the first axis across each of them, and along the second (`updater.structure.sensor_axes`)
    chain: FloatArray
    #: (n_alternatives, n_channels, n_modes) the modes at the places of the sensors, less those at the stated places
    moved: FloatArray
    imaginary: FloatArray  #: (n_alternatives, n_channels) how late the channels are [s]
    log_damping: FloatArray  #: (n_alternatives, n_modes) of the modes' damping to the baseline's
    coupling: FloatArray  #: (n_alternatives, n_modes, n_own) of the modes with degrees of freedom appended, in mass
    own: FloatArray  #: (n_alternatives, n_own) their flexibility 1/omega_o^2 [s2]
    own_log_damping: FloatArray  #: (n_alternatives, n_own) of their damping to that of the structure's modes
    #: (n_alternatives, n_channels, n_own) motion of the channels with them, in addition to that of the modes
    carried: FloatArray

    @property
    def whole_mass(self) -> FloatArray:
        """Change of mass (n_alternatives, n_modes + n_own, same), over unit mass."""
        return _bordered(self.mass, self.coupling, np.zeros(self.own.shape))

    @property
    def whole_flexibility(self) -> FloatArray:
        """Change of flexibility (n_alternatives, n_modes + n_own, same), over that of the modes [s2]."""
        return _bordered(self.flexibility, np.zeros(self.coupling.shape), self.own)

    @property
    def flexibility(self) -> FloatArray:
        """Change of modal flexibility (n_alternatives, n_modes, n_modes), self-stress having shifted the load [s2]."""
        n = self.mass.shape[1]
        own, across = self.compliance[:, :n, :n], self.compliance[:, n:, :n]
        return np.asarray(own + across.transpose(0, 2, 1) @ self.shifted) if across.any() else own

    @property
    def shifted(self) -> FloatArray:
        """Self-stress (n_alternatives, n_stress, n_modes) that shifts the load of modes to where less gives."""
        n = self.mass.shape[1]
        across, within = self.compliance[:, n:, :n], self.compliance[:, n:, n:]
        return np.asarray(-np.linalg.solve(np.eye(within.shape[1]) + within, across))

    def rows(self, rows: IndexArray) -> "Effect":
        """Return some alternatives."""
        chosen = {}
        for f in fields(self):
            values = getattr(self, f.name)
            chosen[f.name] = values if len(values) == 1 and f.name not in _OWN else values[rows]
        return Effect(**chosen)

    @property
    def alike(self) -> bool:
        """True if all alternatives have the same effect: places make no difference before their cause has one."""
        return all(bool((values == values[:1]).all()) for values in vars(self).values() if len(values) > 1)

    def without_structure(self) -> "Effect":
        """Return the effect on the channels, and the degrees of freedom appended, alone."""
        mass, compliance = (np.zeros((1, *values.shape[1:])) for values in (self.mass, self.compliance))
        return replace(self, mass=mass, compliance=compliance)

    def then(self, other: "Effect") -> "Effect":
        """Return both together; the other's effect on the channels acts after this one."""
        n = other.imaginary.shape[1]
        own = other.chain[:, :, :n]
        chain = own @ self.chain
        for k in (1, 2):
            across = other.chain[:, :, k * n : (k + 1) * n]
            if across.any():  # of the place that this one's channels are read at
                chain[:, :, k * n : (k + 1) * n] += across @ self.chain[:, :, :n]
        # channel whose lag applies: a swap moves it
        share = own**2 / np.maximum((own**2).sum(2, keepdims=True), _MIN)
        return Effect(
            mass=_added(self.mass, other.mass),
            compliance=_added(self.compliance, other.compliance),
            chain=chain,
            moved=self.moved + other.moved,
            imaginary=(share @ self.imaginary[:, :, None])[:, :, 0] + other.imaginary,
            log_damping=self.log_damping + other.log_damping,
            coupling=np.concatenate([self.coupling, other.coupling], axis=2),
            own=np.concatenate([self.own, other.own], axis=1),
            own_log_damping=np.concatenate([self.own_log_damping, other.own_log_damping], axis=1),
            carried=np.concatenate([self.carried, other.carried], axis=2),
        )


def _added(one: FloatArray, other: FloatArray) -> FloatArray:
    """Return the sum of matrices (p or 1, n, n), one of them itself where the other is a single zero."""
    for each, rest in ((one, other), (other, one)):
        if len(rest) == 1 and not rest.any():
            return each
    return one + other


def in_modes(flexibility: FloatArray, comparison: Comparison) -> FloatArray:
    """Extend a change of modal flexibility by the states of self-stress of the model, which it does not change.

    Parameters
    ----------
    flexibility : (n_alternatives, n_modes, n_modes) in modes of unit modal mass [s2]
    comparison : measured, with the number of states of self-stress

    Returns
    -------
    (n_alternatives, n_modes + n_stress, n_modes + n_stress)
        Zero for the states of self-stress.
    """
    n = comparison.n_stress
    return np.pad(flexibility, ((0, 0), (0, n), (0, n))) if n else flexibility


def _bordered(matrix: FloatArray, border: FloatArray, corner: FloatArray) -> FloatArray:
    """Return matrices (p, n, n) bordered by (p, n, k) on both sides, with a diagonal (p, k) in the corner."""
    if not corner.shape[1]:
        return matrix
    matrix = np.broadcast_to(matrix, (len(corner), *matrix.shape[1:]))
    lower = np.concatenate([border.transpose(0, 2, 1), corner[:, :, None] * np.eye(corner.shape[1])], axis=2)
    return np.concatenate([np.concatenate([matrix, border], axis=2), lower], axis=1)


def _in_corner(diagonal: FloatArray, n: int) -> FloatArray:
    """Return matrices (..., n + n_own, same) with diagonals (..., n_own) in their corners, zero else."""
    n_own = diagonal.shape[-1]
    if not n_own:
        return np.zeros((1, 1, n, n))
    matrix = np.zeros((*diagonal.shape[:-1], n + n_own, n + n_own))
    matrix[..., range(n, n + n_own), range(n, n + n_own)] = diagonal
    return matrix


def no_effect(n_alternatives: int, comparison: Comparison) -> Effect:
    """Return the effect of no change, whose parts are to be replaced."""
    n_channels, n_modes = comparison.at_channels.shape
    return Effect(
        mass=np.zeros((1, n_modes, n_modes)),
        compliance=np.zeros((1, *2 * (n_modes + comparison.n_stress,))),
        chain=np.eye(n_channels, 3 * n_channels)[None],
        moved=np.zeros((1, n_channels, n_modes)),
        imaginary=np.zeros((1, n_channels)),
        log_damping=np.zeros((1, n_modes)),
        coupling=np.zeros((n_alternatives, n_modes, 0)),
        own=np.zeros((n_alternatives, 0)),
        own_log_damping=np.zeros((n_alternatives, 0)),
        carried=np.zeros((n_alternatives, n_channels, 0)),
    )


@dataclass(frozen=True, eq=False)
class Changed:
    """The changed structure's modes, with those paired with the compared ones."""

    value: FloatArray  #: (n_alternatives, n_all) 1/omega'^2, n_all = n_modes + n_own [s2]
    vector: FloatArray  #: (n_alternatives, n_all, n_all) in the reference's modes, columns mass-normalised
    weighed: FloatArray  #: (n_alternatives, n_all, n_all) M' times the vectors
    pick: IndexArray  #: (n_alternatives, n + n_own) column of each compared mode, then of those that came with `own`

    def rows(self, rows: IndexArray) -> "Changed":
        """Return some alternatives."""
        return Changed(self.value[rows], self.vector[rows], self.weighed[rows], self.pick[rows])


def reanalyse(comparison: Comparison, effect: Effect) -> Changed:
    """Solve the eigenproblem of each alternative.

    A mode's successor is the one with most of it: the changed mode that holds the largest component of the old one.
    """
    n = len(effect.own)
    if n > 1 and effect.alike:
        return reanalyse(comparison, effect.rows(np.zeros(1, np.intp))).rows(np.zeros(n, np.intp))
    value, vector, weighed = _solve(comparison, effect)
    value = np.maximum(value, _MIN * value[:, -1:])
    share = vector * weighed  # of each reference mode in each changed one; columns sum to 1
    pick = _successors(comparison, share[:, comparison.paired, :], value, vector)
    if effect.own.shape[1]:
        pick = _with_own(comparison, pick, share, value)
    scale = np.sqrt(value)[:, None, :]
    found = Changed(value, vector / scale, weighed * scale, pick)
    return found if len(value) == n else found.rows(np.zeros(n, np.intp))  # none changes the structure


def _successors(comparison: Comparison, share: FloatArray, value: FloatArray, vector: FloatArray) -> IndexArray:
    """Return the changed mode (n_alternatives, n) that each compared one has become.

    Where a change divides a mode between two, pairs of measured modes may have followed either. The measured frequency
    and shape decide, as when modes are paired.

    Parameters
    ----------
    share : (n_alternatives, n, n_all) of each compared mode in each changed one
    value, vector : (n_alternatives, n_all), (n_alternatives, n_all, n_all)
    """
    first: IndexArray = np.argmax(share, axis=2)
    left = np.where(np.arange(share.shape[2]) == first[:, :, None], 0.0, share)
    second = np.argmax(left, axis=2)
    row, mode = np.nonzero(left.max(2) > _EITHER * share.max(2))
    if not len(row):
        return first
    now = np.log(comparison.frequency[comparison.paired]) + comparison.log_ratio

    def misfit(pick: IndexArray) -> FloatArray:
        column = pick[row, mode]
        shape = vector[row, : len(comparison.frequency), column] @ comparison.at_channels.T
        along = (shape * comparison.shape[mode]).sum(1) ** 2
        assurance = along / np.maximum((shape**2).sum(1), _MIN)
        off = np.log(value[row, column]) / -2 - np.log(2 * np.pi) - now[mode]
        return np.asarray(1 - assurance + FREQUENCY_WEIGHT * np.abs(off))

    nearer = misfit(second) < misfit(first)
    found = first.copy()
    found[row[nearer], mode[nearer]] = second[row[nearer], mode[nearer]]
    once = [(np.diff(np.sort(pick, axis=1), axis=1) > 0).sum(1) for pick in (found, first)]
    found[once[0] < once[1]] = first[once[0] < once[1]]
    return found


def _with_own(comparison: Comparison, pick: IndexArray, share: FloatArray, value: FloatArray) -> IndexArray:
    """Append the modes of an oscillator: most of its share, and not the successor of a compared one.

    If it splits a mode in two of about half a share each, the order of the measured modes decides; if only one was
    measured, it is the compared mode's.
    """
    every = np.arange(len(pick))
    for own in range(len(comparison.frequency), share.shape[1]):
        left = share[:, own, :].copy()
        np.put_along_axis(left, pick, -1.0, axis=1)
        column = np.argmax(left, axis=1)
        split = np.argmax(np.take_along_axis(share[:, own, :], pick[:, : len(comparison.paired)], axis=1), axis=1)
        other = pick[every, split]
        mixed = share[every, own, other] > _SPLIT
        now = (comparison.frequency[comparison.paired] * np.exp(comparison.log_ratio))[split]
        first, second = (value[every, each] ** -0.5 / (2 * np.pi) for each in (column, other))
        new = _nearest_extra(comparison, first)
        nearer = np.abs(np.log(first / now)) < np.abs(np.log(second / now))
        wrong = mixed & np.where(np.isnan(new), nearer, (new < now) != (first < second))
        pick = np.column_stack([pick, np.where(wrong, other, column)])
        pick[wrong, split[wrong]] = column[wrong]
    return pick


def _nearest_extra(comparison: Comparison, frequency: FloatArray) -> FloatArray:
    """Return the frequency of the nearest mode that the baseline has not (n,) [Hz]; NaN where none is near."""
    extra = comparison.extra_frequency
    if not len(extra):
        return np.full(len(frequency), np.nan)
    away = np.abs(np.log(extra / frequency[:, None]))
    return np.where(away.min(1) < _NEAR, extra[np.argmin(away, axis=1)], np.nan)


def _solve(comparison: Comparison, effect: Effect) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return 1/omega'^2 (n_alternatives, n_modes), vectors and M' times them, neither scaled yet.

    By the root of F', not of M': more mass may be taken off than the modes can hold.
    """
    plain = (2 * np.pi * comparison.frequency) ** -2.0
    plain = np.append(plain, np.zeros(effect.own.shape[1]))
    mass = np.eye(len(plain)) + effect.whole_mass
    flexibility = effect.flexibility
    if not flexibility.any():  # its root is diagonal
        own = np.broadcast_to(plain[: len(comparison.frequency)], (len(effect.own), len(comparison.frequency)))
        factor = np.sqrt(np.concatenate([own, effect.own], axis=1) if effect.own.shape[1] else plain[None])
        value, unit = np.linalg.eigh(factor[:, :, None] * mass * factor[:, None, :])
        return value, factor[:, :, None] * unit, unit / factor[:, :, None]
    if not effect.mass.any() and not effect.own.shape[1]:  # F' x = x / omega'^2
        value, unit = np.linalg.eigh(np.diag(plain) + flexibility)
        scale = np.sqrt(np.maximum(value, _MIN * value[:, -1:]))[:, None]
        return value, unit * scale, unit / scale
    root = _root(np.diag(plain) + effect.whole_flexibility)
    value, unit = np.linalg.eigh(root.transpose(0, 2, 1) @ mass @ root)
    return value, root @ unit, np.linalg.solve(root.transpose(0, 2, 1), unit)


def _root(flexibility: FloatArray) -> FloatArray:
    """Return A with A A^T the flexibility (p, n, n); an indefinite one, after too large a step, is cut to the least."""
    try:
        return np.asarray(np.linalg.cholesky(flexibility), float)
    except np.linalg.LinAlgError:
        value, vector = np.linalg.eigh(flexibility)
        return np.asarray(vector * np.sqrt(np.maximum(value, _MIN * value[:, -1:]))[:, None, :])


def predict(comparison: Comparison, value: FloatArray, vector: FloatArray, effect: Effect) -> Prediction:
    """Return the predicted measurement.

    A changed shape consists of the measured baseline shapes, so that errors of sensors cancel also where a mode takes
    the shape of another one; it is then read by the channels. A channel with a delay tau rotates its component of a
    mode by -2 pi f tau.

    Parameters
    ----------
    value : (n_alternatives, n + n_own) 1/omega'^2 of the compared modes and of those that came with the effect [s2]
    vector : (n_alternatives, n_modes + n_own, n + n_own) theirs
    effect : (n_alternatives,) of which chain, lag and damping enter here
    """
    n_compared, n_modes = len(comparison.paired), len(comparison.frequency)
    new = np.zeros((len(value), 0, len(comparison.channels)))
    log_damping = effect.log_damping[:, comparison.paired]
    if effect.own.shape[1]:
        there = comparison.baseline_at_channels + effect.moved
        new = there @ vector[:, :n_modes, n_compared:] + effect.carried @ vector[:, n_modes:, n_compared:]
        new = new.transpose(0, 2, 1)
        log_damping = log_damping + _damped_by_own(effect, value[:, :n_compared], vector[:, n_modes:, :n_compared])
    new_frequency = value[:, n_compared:] ** -0.5 / (2 * np.pi)
    static = effect.carried @ vector[:, n_modes:, :n_compared]
    value, vector = value[:, :n_compared], vector[:, :n_modes, :n_compared]
    old = (2 * np.pi * comparison.frequency[comparison.paired]) ** -2.0
    value = np.maximum(value, _MIN * old)
    shape = (comparison.baseline_at_channels @ vector + static).transpose(0, 2, 1)
    own = inner(shape, comparison.base)
    along = np.where(np.abs(own) < 1e-6, 1e-6, own)  # else the mode is not seen at the channels
    if effect.moved.any():
        shape = shape + (effect.moved @ vector).transpose(0, 2, 1)
    true = comparison.base + (shape - own * comparison.base) / along
    n = true.shape[2]
    read = true @ effect.chain[:, :, :n].transpose(0, 2, 1)
    if effect.chain[:, :, n:].any():
        across = (comparison.across @ vector).transpose(0, 2, 1) / along
        read = read + across @ effect.chain[:, :, n:].transpose(0, 2, 1)
    log_ratio = -0.5 * np.log(value / old)
    frequency = comparison.frequency[comparison.paired] * np.exp(log_ratio)
    shape, imaginary = _delayed(
        read, comparison.baseline_imaginary @ effect.chain[:, :, :n].transpose(0, 2, 1), frequency, effect.imaginary
    )
    return Prediction(
        log_ratio=log_ratio,
        shape=shape,
        imaginary=imaginary,
        log_damping=np.broadcast_to(log_damping, log_ratio.shape),
        new_frequency=new_frequency,
        with_mass=tuple(test.predict(value, vector) for test in comparison.mass_tests),
        new_shape=new @ effect.chain[:, :, :n].transpose(0, 2, 1),
        undone=_undone(effect.chain[:, :, :n]),
    )


def _damped_by_own(effect: Effect, value: FloatArray, moved: FloatArray) -> FloatArray:
    """Return log damping (n_alternatives, n) of modes that share their energy with an oscillator.

    Each part damps by its share of the elastic energy, z^2 omega_o^2 / omega^2 of unit modal mass.

    Parameters
    ----------
    value : (n_alternatives, n) 1/omega^2 of the modes [s2]
    moved : (n_alternatives, n_own, n) z, their motion of the oscillator relative to the structure
    """
    share = np.clip(moved**2 * value[:, None] / effect.own[:, :, None], 0.0, 1.0)
    more = np.expm1(effect.own_log_damping)[:, :, None]
    return np.asarray(np.log(np.maximum(1 + (share * more).sum(1), _MIN)))


def _undone(chain: FloatArray) -> FloatArray | None:
    """Return the inverse of exchanges and rotations of channels (n_alternatives, n_channels, n_channels), None if none.

    Each channel is assigned to its largest component, if these are different channels for all.
    """
    n = chain.shape[1]
    plain = (chain.reshape(-1, n * n)[:, :: n + 1] > 0).all(1, keepdims=True)
    if plain.all():
        return None
    source = np.argmax(np.abs(chain), axis=2)
    other = np.sort(source, axis=1) == np.arange(n)
    source = np.where(other.all(1, keepdims=True) & ~plain, source, np.arange(n))
    sign = np.where(np.take_along_axis(chain, source[:, :, None], 2)[:, :, 0] < 0, -1.0, 1.0)
    return np.asarray(np.eye(n)[source].transpose(0, 2, 1) * sign[:, None, :])


def _delayed(
    real: FloatArray, imaginary: FloatArray, frequency: FloatArray, late: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the real part of shapes (p, n, n_channels) with delays, and the imaginary one where that has unit norm.

    Parameters
    ----------
    real, imaginary : (p, n, n_channels) in time
    frequency : (p, n) [Hz]
    late : (p, n_channels) [s]
    """
    late, imaginary = np.broadcast_to(late, real[:, 0].shape), np.broadcast_to(imaginary, real.shape)
    rows = late.any(1)
    if rows.any():
        real, imaginary = real.copy(), imaginary.copy()
        delay = np.exp(-2j * np.pi * frequency[rows, :, None] * late[rows, None, :])
        turned = (real[rows] + 1j * imaginary[rows]) * delay
        turned = turned * np.exp(-0.5j * np.angle((turned**2).sum(-1, keepdims=True)))
        sign = np.where((turned.real * real[rows]).sum(-1, keepdims=True) < 0, -1.0, 1.0)
        real[rows], imaginary[rows] = sign * turned.real, sign * turned.imag
    return real, imaginary / np.maximum(np.sqrt(inner(real, real)), _MIN)


def picked(changed: Changed) -> tuple[FloatArray, FloatArray]:
    """Return the modes that are compared, of all modes of the changed structure.

    Returns
    -------
    value : (n_alternatives, n + n_own)
        Eigenvalues [1/s2].
    vector : (n_alternatives, n_all, n + n_own)
        In the coordinates of the modes before the change [-].
    """
    return changed.value[np.arange(len(changed.pick))[:, None], changed.pick], _columns(changed.vector, changed.pick)


def mixing_of(comparison: Comparison, effect: Effect, known: IndexArray, std: float) -> Mixing:
    """Return the modes of the reference as one alternative mixes them.

    If the model has mode k at a frequency that is too high by s_k, its flexibility 1 / omega_k^2 is too low by 2 s_k of
    itself. To first order, a mode that takes the share c of mode k is too high by c s_k, and two modes are turned into
    each other the more, the closer they are. Each mode has its own successor, all together those with the largest
    shares.

    Parameters
    ----------
    effect : (1,) or more alternatives, of which the first counts
    known : modes of the reference that were measured: their frequencies have no such error
    std : standard deviation of ln f of the others
    """
    n = len(comparison.frequency)
    effect = effect.rows(np.zeros(1, np.intp))
    changed = reanalyse(comparison, effect)
    changed = replace(changed, pick=one_to_one((changed.vector * changed.weighed)[:, :n]))
    value, vector = picked(changed)
    others = np.setdiff1d(np.arange(n), known)
    flexibility = np.zeros((len(others), 1, *2 * (len(changed.vector[0]),)))
    flexibility[np.arange(len(others)), 0, others, others] = -2 * std / (2 * np.pi * comparison.frequency[others]) ** 2
    by_value, turned = Tangent(changed, effect).by(np.zeros((1, *flexibility.shape[2:])), flexibility)
    return Mixing(
        shifts=-0.5 * np.log(value[0]) - np.log(2 * np.pi * comparison.frequency),
        log_frequency=-0.5 * by_value[:, 0] / value,
        shape=vector[0, :n],
        turned=turned[:, 0, :n],
    )


def _columns(matrix: FloatArray, pick: IndexArray) -> FloatArray:
    """Return columns (p, n, k) of matrices (p, n, n), those picked (p, k) of each."""
    return matrix.transpose(0, 2, 1)[np.arange(len(pick))[:, None], pick].transpose(0, 2, 1)


_Slope = tuple[FloatArray, FloatArray]


class Tangent:
    """Derivatives of the modes picked, d value (..., n_alternatives, n + n_own), d vector (..., n_all, n + n_own)."""

    def __init__(self, changed: Changed, effect: Effect) -> None:
        """Derive at alternatives that an effect changed so."""
        self._changed, self._effect = changed, effect
        n_alternatives, n = changed.pick.shape
        self._at = np.arange(n_alternatives)[:, None], changed.pick, np.arange(n)  # row and column of each mode picked
        value, self._vector = picked(changed)
        self._weighed = _columns(changed.weighed, changed.pick)
        gap = value[:, None, :] - changed.value[:, :, None]
        gap[self._at] = np.inf
        self._gap = np.where(gap == 0, np.inf, gap)

    def by(self, mass: FloatArray, flexibility: FloatArray) -> _Slope:
        """Return the derivatives by something of which dM and dF (..., n_alternatives or 1, n_all, n_all) are."""
        changed = self._changed
        numerator = by_mass = np.zeros(self._vector.shape)  # (..., p, k, i)
        if mass.any():
            by_mass = changed.vector.transpose(0, 2, 1) @ (mass @ self._vector)
            numerator = changed.value[:, :, None] * by_mass
        if flexibility.any():
            numerator = numerator + changed.weighed.transpose(0, 2, 1) @ (flexibility @ self._weighed)
        return self._of(numerator, np.broadcast_to(by_mass, numerator.shape))

    def between(self, before: Effect, after: Effect, n_steps: int) -> _Slope:
        """Return the changes (n_steps, ...), to first order, from one effect to that after steps of parameters.

        Parameters
        ----------
        before : (n_alternatives,)
        after : (n_steps n_alternatives,) of each step all alternatives
        """

        def change(old: FloatArray, new: FloatArray) -> FloatArray:
            steps = n_steps if len(new) > 1 else 1
            return new.reshape(steps, len(new) // steps, *new.shape[1:]) - old

        compliance = change(before.compliance, after.compliance)
        mass = change(before.whole_mass, after.whole_mass)
        own = _in_corner(change(before.own, after.own), before.mass.shape[1])
        if not compliance.any():
            return self.by(mass, own)
        value, vector = self.by_compliance(compliance)
        if not (mass.any() or own.any()):
            return value, vector
        by_mass = self.by(mass, own)
        return value + by_mass[0], vector + by_mass[1]

    def by_compliance(self, compliance: FloatArray) -> _Slope:
        """Return the derivatives by a compliance (..., n_modes + n_stress, same), the same or one per alternative."""
        every, picked = self._with_stress
        numerator = every.transpose(0, 2, 1) @ (compliance @ picked)
        return self._of(numerator, np.broadcast_to(0.0, numerator.shape))

    @cached_property
    def _with_stress(self) -> _Slope:
        """Left vectors (n_alternatives, n_modes + n_stress, n_all) with the self-stress they shift, and those picked.

        F = C_mm + C_ms S with S = -(I + C_ss)^-1 C_sm has the derivative [I; S]^T dC [I; S].
        """
        n, shifted = self._effect.mass.shape[1], self._effect.shifted
        both = [
            np.concatenate([each[:, :n], shifted @ each[:, :n]], axis=1)
            for each in (self._changed.weighed, self._weighed)
        ]
        return both[0], both[1]

    def _of(self, numerator: FloatArray, by_mass: FloatArray) -> _Slope:
        picked = (..., *self._at)
        component = numerator / self._gap
        component[picked] = -0.5 * by_mass[picked]
        return numerator[picked], self._changed.vector @ component
