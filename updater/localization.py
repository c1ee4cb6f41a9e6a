"""Where a mass was added, and how much: a likelihood over all positions.

Every hypothesis is re-analysed exactly in the reference's modes: a body m at s makes the modal mass I + m Phi_s^T
Phi_s (Phi_s the three translations there), a small eigenproblem. Measured are ratios to the baseline: log
frequencies, and shapes, so that what the model gets wrong about the structure as it was cancels to first order. The
body's centre may lie beside the member's axis: its two offsets are fitted with a prior, because where two modes are
close (a symmetric column's first two) even a centimetre turns their planes.
"""

from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from daq import FloatArray, IndexArray
from updater.fe.element import local_axes
from updater.reference import Reference
from updater.statistics import COMMON_STD, ModalMean

_MODEL_ERROR = 0.06  # of each predicted change: what the reference gets wrong about it
_DENSITY_STD = 0.015  # of the structure's own mass: frequencies weigh a body only as a share of it
_COARSE = 0.01  # m between re-analysed positions
_FINE = 0.001  # m between them where the posterior is
_NEAR = 60.0  # of chi-square over the best: a centimetre may hide a posterior of a millimetre
_MOST_FINE = 300  # fine positions on one member
_NEWTON = 5
_MASS_STD = 0.2  # of the structure's mass, prior of the body's
_LARGEST_REMOVED = 0.1  # of the structure's mass: what can be taken off without taking the structure
_OFFSET_STD = 0.02  # m, prior of a body's centre beside the member's axis
_STEPS = np.array([1e-4, 1e-4, 1e-4])  # of the finite differences: share of the total mass, and m


@dataclass(frozen=True, kw_only=True)
class Stretch:
    """A part of a member."""

    member: str
    start: float  #: distance from the member's start [m]
    stop: float  #: [m]


@dataclass(frozen=True, eq=False, kw_only=True)
class MassChange:
    """A located mass; negative if it was removed."""

    member: str
    distance: float  #: posterior mean, from the member's start [m]
    distance_std: float  #: [m]
    mass: float  #: [kg]
    mass_std: float  #: [kg]
    region: tuple[Stretch, ...]  #: 95 % credible
    member_probability: float  #: that it is on this member [-]
    p_value: float  #: chance of a worse fit if one added mass is the cause [-]
    members: tuple[str, ...]  #: (n_positions,) of the profile
    position: FloatArray  #: (n_positions,) distance from the member's start [m]
    density: FloatArray  #: (n_positions,) posterior [1/m]
    profile_mass: FloatArray  #: (n_positions,) best mass at each position [kg]


@dataclass(frozen=True, eq=False)
class _Data:
    """Changes against the baseline, whitened."""

    tracks: IndexArray  #: (n,) indices of the tracks that entered
    paired: IndexArray  #: (n,) their model modes
    log_ratio: FloatArray  #: (n,)
    whitener: FloatArray  #: (n, n)
    shape_change: FloatArray  #: (n, n_channels)
    shape_std: FloatArray  #: (n, n_channels)
    base_shape: FloatArray  #: (n, n_channels) of the reference at the channels, unit norm
    at_channels: FloatArray  #: (n_channels, n_modes)


def locate_mass(reference: Reference, event: ModalMean) -> MassChange:
    """Locate one added or removed mass.

    Parameters
    ----------
    reference : learnt before the change
    event : (n_tracks,) mean of the windows since the change

    Raises
    ------
    ValueError
        If fewer than three modes can be compared.
    """
    data = _changes(reference, event)
    coarse = []
    for member in reference.calibration.structure.member:
        grid = np.linspace(0, member.length, max(4, round(member.length / _COARSE)) + 1)
        coarse.append(_along(reference, data, member.name, grid))
    best = min(float(curve.chi_square.min()) for curve in coarse)
    curves = [_along(reference, data, curve.member, _closer(curve, best)) for curve in coarse]
    # each shape change lies beside the base: one component fewer than channels; place and mass are fitted
    return _posterior(curves, data.shape_change.size - 2)


def _changes(reference: Reference, event: ModalMean) -> _Data:
    base = reference.baseline
    tracks = np.flatnonzero(np.isfinite(event.log_frequency) & np.isfinite(event.shape[:, 0]))
    if len(tracks) < 3:
        raise ValueError(f"modes to compare: expected at least 3, found {len(tracks)}")
    ratio = (event.log_frequency - base.log_frequency)[tracks]
    variance = (event.log_frequency_std**2 + base.log_frequency_std**2)[tracks] + (_MODEL_ERROR * ratio) ** 2
    covariance = np.diag(variance) + COMMON_STD**2  # inside every hypothesis
    change = _off(event.shape[tracks], base.shape[tracks])
    own = np.hypot(event.shape_std, base.shape_std)[tracks]
    at_channels = reference.at_channels(event.channels)
    paired = reference.paired[tracks]
    expected = at_channels[:, paired].T
    return _Data(
        tracks=tracks,
        paired=paired,
        log_ratio=ratio,
        whitener=np.linalg.inv(np.linalg.cholesky(covariance)),
        shape_change=change,
        shape_std=np.hypot(own, _MODEL_ERROR * np.abs(change)),
        base_shape=expected / np.linalg.norm(expected, axis=1, keepdims=True),
        at_channels=at_channels,
    )


def _off(shape: FloatArray, base: FloatArray) -> FloatArray:
    """Return the part of shapes (..., n_channels) beside the base, at a base component of one."""
    return np.asarray(shape / (shape * base).sum(-1, keepdims=True) - base)


@dataclass(frozen=True, eq=False)
class _Curve:
    member: str
    position: FloatArray  #: (n,)
    chi_square: FloatArray  #: (n,)
    mass: FloatArray  #: (n,)
    mass_std: FloatArray  #: (n,)
    log_volume: FloatArray  #: (n,) log determinant of the body's covariance


@dataclass(frozen=True, eq=False)
class _Line:
    """The reference's modes along one member."""

    position: FloatArray  #: (n,)
    translation: FloatArray  #: (n, 3, n_modes) at each position
    by_offset: FloatArray  #: (2, n, 3, n_modes) more of it a metre of offset along the two cross axes

    def gram(self, offset: FloatArray) -> FloatArray:
        """Return Phi^T Phi (n, n_modes, n_modes) at offsets (n, 2)."""
        at = self.translation + np.einsum("po,opar->par", offset, self.by_offset)
        return np.asarray(at.transpose(0, 2, 1) @ at)


def _line(reference: Reference, name: str, position: FloatArray) -> _Line:
    structure, model = reference.calibration.structure, reference.calibration.model
    member = structure.member_named(name)
    modes = np.array([model.read(p) @ reference.shape for p in member.point(position)])
    cross_axes = local_axes(np.subtract(member.end, member.start))[1:]
    turned = [np.cross(modes[:, 3:], axis, axisa=1, axisc=1) for axis in cross_axes]
    return _Line(position, modes[:, :3], np.array(turned))


def _along(reference: Reference, data: _Data, name: str, position: FloatArray) -> _Curve:
    """Profile the likelihood along one member: the best body at every position, by Gauss-Newton on all at once."""
    line = _line(reference, name, position)
    total = reference.calibration.model.total_mass()
    scale = np.array([total, 1.0, 1.0])
    none = np.zeros((len(line.position), 2))
    # where a mass hardly moves there is hardly an effect to divide by: start no farther than the prior reaches
    start = np.clip(_first_order(data, line.gram(none)), -_LARGEST_REMOVED * total, _MASS_STD * total)
    body = np.column_stack([start, none])  # mass, two offsets
    residual = _residual(reference, data, line, body)
    for _ in range(_NEWTON):
        slope = np.stack(
            [(_residual(reference, data, line, body + h) - residual) / h.sum() for h in np.diag(_STEPS * scale)], axis=2
        )
        covariance = np.linalg.inv(slope.transpose(0, 2, 1) @ slope)
        step = np.einsum("pij,pkj,pk->pi", covariance, slope, residual)
        body, residual = _descend(reference, data, line, body, residual, step)
    std = np.sqrt(covariance[:, 0, 0])
    return _Curve(name, line.position, (residual**2).sum(1), body[:, 0], std, np.linalg.slogdet(covariance)[1])


def _descend(
    reference: Reference, data: _Data, line: _Line, body: FloatArray, residual: FloatArray, step: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Take the longest of four shares of each position's step that fits better; none where none does."""
    best = (residual**2).sum(1)
    for share in (0.1, 0.3, 0.6, 1.0):
        trial = body - share * step
        trial[:, 0] = np.maximum(trial[:, 0], -_LARGEST_REMOVED * reference.calibration.model.total_mass())
        tried = _residual(reference, data, line, trial)
        better = (tried**2).sum(1) < best
        best = np.where(better, (tried**2).sum(1), best)
        body = np.where(better[:, None], trial, body)
        residual = np.where(better[:, None], tried, residual)
    return body, residual


def _first_order(data: _Data, gram: FloatArray) -> FloatArray:
    """Start: d ln f_i = -m/2 sum_a phi_ia^2, least squares in whitened log frequencies."""
    effect = -0.5 * np.einsum("pii->pi", gram)[:, data.paired] @ data.whitener.T
    return np.asarray(effect @ (data.whitener @ data.log_ratio) / np.maximum((effect**2).sum(1), 1e-12))


def _residual(reference: Reference, data: _Data, line: _Line, body: FloatArray) -> FloatArray:
    """Return whitened residuals (n_positions, n_data) of bodies (n_positions, 3), their prior's included."""
    log_ratio, shape = reanalyse(reference.frequency, line.gram(body[:, 1:]), body[:, 0], data.paired)
    prior = np.array([_MASS_STD * reference.calibration.model.total_mass(), _OFFSET_STD, _OFFSET_STD])
    change = _off(np.einsum("cr,pri->pic", data.at_channels, shape), data.base_shape)
    frequency_part = (data.log_ratio - log_ratio) @ data.whitener.T
    shape_part = ((data.shape_change - change) / data.shape_std).reshape(len(body), -1)
    return np.concatenate([frequency_part, shape_part, body / prior], axis=1)


def reanalyse(
    frequency: FloatArray, gram: FloatArray, mass: FloatArray, wanted: IndexArray
) -> tuple[FloatArray, FloatArray]:
    """Re-analyse exactly, in the space of the given modes, the structure with one mass at each of many positions.

    With B = D + Q E Q^T, D = Lambda^-1/2 and so on, the symmetric problem is Lambda^-1/2 (I + m gram) Lambda^-1/2,
    whose eigenvalues are 1/omega^2.

    Parameters
    ----------
    frequency : (n_modes,) of the reference [Hz]
    gram : (n_positions, n_modes, n_modes) Phi_s^T Phi_s [1/kg]
    mass : (n_positions,) [kg]
    wanted : (n,) modes to follow

    Returns
    -------
    log_ratio : (n_positions, n) log of frequency over the reference's
    shape : (n_positions, n_modes, n) modes in the reference's modes
    """
    root = 1 / (2 * np.pi * frequency)
    matrix = root[:, None] * (np.eye(len(frequency)) + mass[:, None, None] * gram) * root
    value, vector = np.linalg.eigh(matrix)
    shape = root[:, None] * vector
    shape = shape / np.abs(shape).max(axis=1, keepdims=True)
    pick = np.argmax(np.abs(shape[:, wanted, :]), axis=2)  # the perturbed mode with most of the wanted one in it
    chosen = np.take_along_axis(value, pick, axis=1)
    # a removed mass larger than the model can hold makes a mode without inertia: infinitely high, never a NaN
    log_ratio = -0.5 * np.log(np.maximum(chosen, 1e-12 * value[:, -1:])) + np.log(root[wanted])
    return log_ratio, np.take_along_axis(shape, pick[:, None, :], axis=2)


def _posterior(curves: list[_Curve], freedom: int) -> MassChange:

    chi_square = np.concatenate([c.chi_square for c in curves])
    mass, mass_std = np.concatenate([c.mass for c in curves]), np.concatenate([c.mass_std for c in curves])
    position = np.concatenate([c.position for c in curves])
    members = np.repeat([c.member for c in curves], [len(c.position) for c in curves])
    weight = np.concatenate([np.gradient(c.position) for c in curves])
    log_density = 0.5 * (np.concatenate([c.log_volume for c in curves]) - (chi_square - chi_square.min()))
    density = np.exp(log_density - log_density.max())
    probability = density * weight
    density, probability = density / probability.sum(), probability / probability.sum()
    share = {c.member: float(probability[members == c.member].sum()) for c in curves}
    member = max(share, key=lambda name: share[name])
    here = np.where(members == member, probability, 0) / share[member]
    distance = float(here @ position)
    mean = float(here @ mass)
    return MassChange(
        member=member,
        distance=distance,
        distance_std=float(np.sqrt(here @ (position - distance) ** 2 + _FINE**2 / 12)),
        mass=mean,
        mass_std=float(np.sqrt(here @ (mass_std**2 + (mass - mean) ** 2) + (_DENSITY_STD * mean) ** 2)),
        region=_credible(members, position, density, probability),
        member_probability=share[member],
        p_value=float(chi2.sf(chi_square.min(), freedom)),
        members=tuple(members.tolist()),
        position=position,
        density=density,
        profile_mass=mass,
    )


def _closer(curve: _Curve, best: float) -> FloatArray:
    """Return the positions of a profile and, where it comes near the best of all members', many more between."""
    near = curve.position[curve.chi_square < best + _NEAR]
    if not len(near):
        return curve.position
    spacing = max(_FINE, 2 * _COARSE * len(near) / _MOST_FINE)
    steps = np.arange(-_COARSE, _COARSE + spacing / 2, spacing)
    fine = np.clip((near[:, None] + steps).ravel(), 0, curve.position[-1])
    return np.unique(np.round(np.concatenate([curve.position, fine]), 6))


def _credible(
    members: FloatArray, position: FloatArray, density: FloatArray, probability: FloatArray
) -> tuple[Stretch, ...]:
    """Return the stretches of highest density that hold 95 %."""
    order = np.argsort(-density, kind="stable")
    inside = np.zeros(len(density), bool)
    inside[order[: int(np.searchsorted(np.cumsum(probability[order]), 0.95)) + 1]] = True
    starts = np.flatnonzero(inside & ~np.r_[False, inside[:-1] & (members[1:] == members[:-1])])
    stops = np.flatnonzero(inside & ~np.r_[inside[1:] & (members[1:] == members[:-1]), False])
    return tuple(
        Stretch(member=str(members[a]), start=float(position[a]), stop=float(position[b]))
        for a, b in zip(starts, stops, strict=True)
    )
