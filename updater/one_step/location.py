"""Location of one point mass from the increments of the one-step update: a matched filter along the members.

The increments of a point mass m at s are m times the resolution of the update, which is known: to first order
m M_j (sum_i b_i(j) b_i(s))^2, smeared over all nodes. Their largest value is therefore no estimate of s. Here the whole
field of increments is compared with the one that a mass at each position would give, by an exact re-analysis in the
reference's modes and the same expansion and update, in the metric of the covariance that the update propagates. A
common change of all frequencies and an error of the model at the position are part of that covariance.

A place is claimed only where one mass fits and its 95 % region is short. Both can fail: other causes than one mass
leave a misfit, and a weak or symmetric change leaves several positions.
"""

from dataclasses import dataclass, fields, replace
from itertools import combinations_with_replacement

import numpy as np
import numpy.typing as npt
from scipy.special import fdtrc

from daq import FloatArray, IndexArray
from updater.causes import LARGEST_REMOVED
from updater.inference import credible
from updater.modal_data import ModalMean
from updater.one_step.increments import Increments
from updater.one_step.lumped_mass import Particles
from updater.reference import ExpandedChange, Reference
from updater.structure import extent, fineness, size

_SPACING = 0.01  # m between positions on a structure of 1.5 m
_MAX_POSITIONS = 2000
_MAX_ROWS = 2000  # increments that are compared; of more every n-th, between which they are smooth
_FITS = 0.05  # of chi-square: with a worse fit the larger error is tried
#: error of the reference's modes at the position of the mass, over a mode's typical displacement
_MODEL_ERROR, _LARGE_ERROR = 0.03, 0.08
_OUTSIDE_ERROR = 0.2  # model error with which the region is calculated if no single mass fits
_OFFSET_STD = 0.02  # m on a structure of 1.5 m: offset of the body's centre from the member's axis
_GYRATION = 0.02  # m on such a structure: its radius of gyration
_MIN_SINGULAR = 1e-6  # of the largest: combinations of increments that noise hardly moves
_MIN_P = 0.01  # of chi-square: a worse fit is not one mass
_MAX_DISTANCE = 0.1  # m, less on smaller structures: half length of a region that is a place
_MIN_MOTION = 1e-3  # of the largest displacement: a position that is held shows no mass
_MIN_SEEN = 1e-6  # of a mode at the channels [1/sqrt(kg)]
_NEAR = 30.0  # of log density under the best: positions farther below are left out
_MIN_GAP = 1e-3  # of squared frequencies
_STEP = 1e-6  # of modal mass, by which slopes are taken
_MIN_MASS = 1e-9  # of the structure's mass
_ITERATIONS = 5
_CONVERGED = 0.1  # standard deviations of the mass
_DRAWS = 200
_SEED = 1  # a log replayed gives the same place


@dataclass(frozen=True, eq=False, kw_only=True)
class IncrementLocation:
    """Position of one point mass that explains the increments of all nodes best."""

    position: FloatArray  #: (3,) [m]
    member: str
    region: tuple[tuple[str, FloatArray, FloatArray], ...]  #: 95 %: member and ends (3,), (3,) of stretches [m]
    mass: float  #: fitted mass at the position; of the order of the change [kg]
    p_value: float  #: probability of a worse fit if one mass is the cause [-]
    fits: bool  #: whether one mass explains the increments
    is_located: bool  #: whether it does and the region is short

    @property
    def radius(self) -> float:
        """Return the distance from the position to the farthest end of the region [m]."""
        return max(float(np.linalg.norm(end - self.position)) for _, *ends in self.region for end in ends)


@dataclass(frozen=True, eq=False)
class _Candidates:
    """Positions along the members and the reference's modes there."""

    member: IndexArray  #: (n,)
    distance: FloatArray  #: (n,) from the member's start [m]
    point: FloatArray  #: (n, 3) [m]
    translation: FloatArray  #: (n, 3, n_modes) [1/sqrt(kg)]
    rotation: FloatArray  #: (n, 3, n_modes)
    length: FloatArray  #: (n,) length that each position represents [m]
    offset: FloatArray  #: (n, 3, 3) standard deviations of the offset of a body's centre in three directions [m]

    def only(self, kept: IndexArray | npt.NDArray[np.bool_]) -> "_Candidates":
        """Return some positions."""
        return _Candidates(**{f.name: getattr(self, f.name)[kept] for f in fields(self)})


class IncrementLocator:
    """Matched filter for one reference.

    Parameters
    ----------
    reference : learned before the change
    at : the reference with particle masses
    """

    def __init__(self, reference: Reference, at: Particles) -> None:
        self._reference, self._at = reference, at
        self._extent = extent(reference.structure)
        self._places = _candidates(reference, at, size(reference.structure))

    def locate(
        self, event: ModalMean, tracks: IndexArray, found: Increments, changes: list[ExpandedChange], variance: float
    ) -> IncrementLocation:
        """Fit one point mass at every position.

        Parameters
        ----------
        event : (n_tracks,) mean of the windows since the change
        tracks : (m,) that are used
        found : (n,) increments
        changes : (m,) expansion of each track
        variance : of the noise over the propagated one, as the baseline's windows show
        """
        response = _Response(self._reference, self._at, event, tracks, found, changes, variance)
        answer = self._fit(response, _MODEL_ERROR)
        if answer.p_value < _FITS:
            answer = self._fit(response, _LARGE_ERROR)
        if answer.p_value < _FITS:  # the probability of the fit stays: only the region is wider
            wide = self._fit(response, _OUTSIDE_ERROR)
            answer = self._judged(replace(wide, p_value=answer.p_value))
        return answer

    def _fit(self, response: "_Response", error: float) -> IncrementLocation:
        """Fit with an error of the model at the position, over a mode's typical displacement."""
        rank = len(response.measured)
        known = self._reference.scatter.degrees_of_freedom  # of the variance: Student's t instead of a Gaussian
        kept, mass = self._screened(response)
        near = np.ones(len(kept), bool)
        exponent = -0.5 * (known + rank)
        for _ in range(_ITERATIONS):
            kept, mass = kept[near], mass[near]
            places = self._places.only(kept)
            predicted = response.exact(self._gram(places, mass)) / mass[:, None]  # per kg
            spread = self._spread(places, response, mass, error)
            covariance = response.noise + spread @ spread.transpose(0, 2, 1)
            both = np.stack([predicted, np.broadcast_to(response.measured, predicted.shape)], axis=2)
            weighed = np.linalg.solve(covariance, both)
            (information, common), (_, square) = np.einsum("prk,prl->klp", both, weighed)
            chi_square = square - 2 * mass * common + mass**2 * information
            # prior of the mass: uniform in its logarithm
            log_prior = -np.log(np.maximum(np.abs(mass) * np.sqrt(information), 1.0))
            log_prior -= 0.5 * np.linalg.slogdet(covariance)[1]
            log_density = log_prior + exponent * np.log1p(chi_square / known)
            fitted, mass = mass, self._bounded(common / information)
            moving = np.abs(mass - fitted) * np.sqrt(information) > _CONVERGED
            if not moving.any():
                break
            near = moving | (log_density > log_density.max() - _NEAR)  # at a mass yet to be fitted none is ruled out
        best = int(np.argmax(log_density))
        statistic = float(chi_square[best]) / max(rank - 2, 1)
        p_value = float(fdtrc(max(rank - 2, 1), known, statistic))
        # a fit that leaves more than its errors is as much less sure of the position (Birge 1932)
        log_density = log_prior + exponent * np.log1p(chi_square / (known * max(statistic, 1.0)))
        density = np.zeros(len(self._places.point))
        density[kept] = np.exp(log_density - log_density.max())
        return self._answer(density, float(fitted[np.argmax(log_density)]), p_value)

    def _screened(self, response: "_Response") -> tuple[IndexArray, FloatArray]:
        """Return the positions that explain at least half as much as the best one to first order, and their masses."""
        places = self._places
        predicted = _flat(_gram(places.translation, places.translation)) @ response.by_mass.T  # per kg
        weighed = np.linalg.solve(response.noise, predicted.T).T
        information, common = (predicted * weighed).sum(1), weighed @ response.measured
        gain = common**2 / information
        kept = np.flatnonzero(gain > gain.max() / 2 - _NEAR)
        return kept, self._bounded((common / information)[kept])

    def _bounded(self, mass: FloatArray) -> FloatArray:
        """Return masses within possible added or removed masses, none exactly 0."""
        mass = np.clip(mass, -LARGEST_REMOVED * self._total, self._total)
        return np.where(mass == 0, _MIN_MASS * self._total, mass)

    @property
    def _total(self) -> float:
        return self._reference.model.total_mass()

    def _gram(self, p: _Candidates, mass: FloatArray) -> FloatArray:
        """Return the change of modal mass (n, n_modes, n_modes) of a body of usual inertia."""
        inertia = self._extent**2 * (_GYRATION**2 + _OFFSET_STD**2) * _gram(p.rotation, p.rotation)
        return mass[:, None, None] * (_gram(p.translation, p.translation) + inertia)

    def _spread(self, p: _Candidates, response: "_Response", mass: FloatArray, error: float) -> FloatArray:
        """Return the effect (n, rank, n_inputs) of the model's error and the body's unknown shape on the increments."""
        error = error * self._reference.model_error_factor
        by_mass = response.by_mass.reshape(len(response.measured), *2 * (p.translation.shape[2],))
        by_mode = 2 * np.einsum("rik,pai->prak", by_mass, p.translation) * (error * self._typical)
        turn = p.rotation.transpose(0, 2, 1)[:, :, None, :]
        beside = np.cross(turn, p.offset[:, None]).transpose(2, 0, 3, 1)  # (3, n, 3, n_modes)
        by_offset = [2 * _gram(p.translation, b) for b in beside]
        by_body = np.stack([response.by_mass @ _flat(g).T for g in (*by_offset, *self._inertia_spread(p))], axis=-1)
        columns = np.concatenate([by_mode.reshape(*by_mode.shape[:2], -1), by_body.transpose(1, 0, 2)], axis=2)
        return np.asarray(mass[:, None, None] * columns)

    def _inertia_spread(self, p: _Candidates) -> list[FloatArray]:
        """Return one standard deviation of each moment and product of inertia, as modal mass (n, n_modes, n_modes).

        Products of inertia are second order in the offset. They couple close modes of a symmetric section.
        """
        moment, product = self._extent**2 * (_GYRATION**2 + _OFFSET_STD**2), (self._extent * _OFFSET_STD) ** 2
        pairs = combinations_with_replacement(range(3), 2)
        return [(moment if a == b else 2 * product) * _gram(p.rotation[:, [a]], p.rotation[:, [b]]) for a, b in pairs]

    @property
    def _typical(self) -> FloatArray:
        """Return the root mean square displacement (n_modes,) of each mode along one axis."""
        return np.asarray(np.sqrt((self._places.translation**2).mean((0, 1))))

    def _answer(self, density: FloatArray, mass: float, p_value: float) -> IncrementLocation:
        """Return the answer from the posterior density (n,) over all positions, the largest 1."""
        p, structure = self._places, self._reference.structure
        best, members = int(np.argmax(density)), structure.member
        half = 0.5 * float(p.length.max())  # a position represents the points that are nearest to it
        region = [
            (members[m], max(a - half, 0.0), min(b + half, members[m].length))
            for m, a, b in credible(p.member, p.distance, density, density * p.length / (density @ p.length))
        ]
        found = IncrementLocation(
            position=p.point[best],
            member=members[int(p.member[best])].name,
            region=tuple((member.name, member.point(a), member.point(b)) for member, a, b in region),
            mass=mass,
            p_value=p_value,
            fits=False,
            is_located=False,
        )
        return self._judged(found)

    def _judged(self, found: IncrementLocation) -> IncrementLocation:
        """Return a location with whether one mass fits and its region is short."""
        fits = found.p_value > _MIN_P
        short = found.radius <= fineness(self._reference.structure) * _MAX_DISTANCE
        return replace(found, fits=fits, is_located=fits and short)


class _Response:
    """Increments that a change of modal mass gives, in combinations of them that err independently."""

    def __init__(
        self,
        reference: Reference,
        at: Particles,
        event: ModalMean,
        tracks: IndexArray,
        found: Increments,
        changes: list[ExpandedChange],
        variance: float,
    ) -> None:
        every = -(-len(found.value) // _MAX_ROWS)
        root = found.deviations(np.array(variance))[::every]
        left, singular, _ = np.linalg.svd(root, full_matrices=False)
        kept = singular > _MIN_SINGULAR * singular[0]
        basis = left[:, kept] / singular[kept]  # unit variance
        weighed = at.weighed[::every]
        self._read = np.einsum("jr,jk,jl->rkl", basis, weighed, weighed, optimize=True).reshape(basis.shape[1], -1)
        self._changes, self._paired, self._omega = changes, at.paired[tracks], at.modes.omega
        expected = at.at_channels[self._paired]
        self._expected = expected / np.linalg.norm(expected, axis=1, keepdims=True)
        base = reference.baseline.shape[tracks]
        self._base = base * np.where((base * self._expected).sum(1) < 0, -1, 1)[:, None]
        self._at_channels = at.at_channels
        self.measured = found.value[::every] @ basis
        self.by_mass = self._slope()
        baseline = reference.baseline
        scale = float(np.sqrt(variance))
        frequency_std = scale * np.hypot(event.log_frequency_std, baseline.log_frequency_std)[tracks]
        shape_std = scale * np.hypot(event.shape_std, baseline.shape_std)[tracks]
        self.noise = np.eye(len(self.measured)) + self._second_order(frequency_std, shape_std)

    def exact(self, gram: FloatArray) -> FloatArray:
        """Return the increments (n, rank) of changes of modal mass (n, n_modes, n_modes)."""
        root = 1 / self._omega
        value, unit = np.linalg.eigh(root[:, None] * (np.eye(len(root)) + gram) * root)
        value = np.maximum(value, 1e-12 * value[:, -1:])
        vector = root[:, None] * unit / np.sqrt(value)[:, None, :]
        share = (unit**2)[:, self._paired]
        pick = np.argmax(share, axis=2)
        vector = np.take_along_axis(vector, pick[:, None, :], axis=2)
        ratio = np.take_along_axis(value, pick, axis=1) ** -0.5 / self._omega[self._paired]
        return self._increments(self._shape(vector), ratio)

    def _shape(self, vector: FloatArray) -> FloatArray:
        """Return shapes (n, m, n_channels) as measured of modes (n, n_modes, m) in the reference's."""
        shape = (self._at_channels.T @ vector).transpose(0, 2, 1)
        along = (shape * self._expected).sum(-1, keepdims=True)
        return np.asarray(self._base + shape / np.where(np.abs(along) < _MIN_SEEN, _MIN_SEEN, along) - self._expected)

    def _second_order(self, frequency_std: FloatArray, shape_std: FloatArray) -> FloatArray:
        """Return the second moment (rank, rank) of noise (m,), (m, n_channels) beyond the first order.

        Combinations of increments that noise hardly moves to first order are moved by its square: by close modes that
        turn into each other. Half the sum of two draws of opposite sign has no first order.
        """
        random = np.random.default_rng(_SEED)
        by_frequency = frequency_std * random.standard_normal((_DRAWS, len(frequency_std)))
        by_shape = shape_std * random.standard_normal((_DRAWS, *shape_std.shape))
        one, other = (self._increments(self._base + s * by_shape, np.exp(s * by_frequency)) for s in (1, -1))
        even = 0.5 * (one + other)
        return np.asarray(even.T @ even / _DRAWS)

    def _increments(self, read: FloatArray, ratio: FloatArray) -> FloatArray:
        """Return increments (n, rank) of shapes (n, m, n_channels) at frequency ratios (n, m)."""
        t = np.stack([c.expand(read[:, i]) for i, c in enumerate(self._changes)], axis=2) * ratio[:, None, :]
        replaced = np.broadcast_to(np.eye(len(self._omega))[:, self._paired], t.shape)
        gram = np.concatenate([t, replaced], axis=2)
        sign = np.diag(np.repeat([1.0, -1.0], t.shape[2]))
        core = gram @ np.linalg.solve(-(sign + gram.transpose(0, 2, 1) @ gram), gram.transpose(0, 2, 1))
        return np.asarray(core.reshape(len(core), -1) @ self._read.T)

    def _slope(self) -> FloatArray:
        """Return the increments (rank, n_modes^2) per unit change of each entry of the modal mass, to first order.

        By differences of the update; modes change by -G_ii / 2 and, towards mode k, by G_ik / (omega_k^2 / omega_i^2
        - 1). Entries between modes that are not updated have no effect.
        """
        n, paired = len(self._omega), self._paired
        first, second = np.triu_indices(n)
        seen = np.isin(first, paired) | np.isin(second, paired)
        first, second = first[seen], second[seen]
        every = np.arange(len(first))
        gram = np.zeros((len(first), n, n))
        gram[every, first, second] = gram[every, second, first] = 1.0
        gap = (self._omega[:, None] / self._omega[paired]) ** 2 - 1  # (n_modes, m)
        own = np.arange(n)[:, None] == paired
        gap[~own & (np.abs(gap) < _MIN_GAP)] = _MIN_GAP
        turn = gram[:, :, paired] * np.where(own, -0.5, 1 / np.where(own, 1.0, gap))
        ratio = 1 - 0.5 * _STEP * gram[:, paired, paired]
        found = self._increments(self._shape(own + _STEP * turn), ratio) / _STEP
        slope = np.zeros((found.shape[1], n, n))
        slope[:, first, second] = found.T / np.where(first == second, 1, 2)
        slope[:, second, first] = slope[:, first, second]
        return slope.reshape(len(slope), -1)


def _candidates(reference: Reference, at: Particles, scale: float) -> _Candidates:
    members = reference.structure.member
    step = max(_SPACING * scale, sum(m.length for m in members) / _MAX_POSITIONS)
    grids = [np.linspace(0, m.length, max(4, round(m.length / step)) + 1) for m in members]
    point = np.concatenate([m.point(grid) for m, grid in zip(members, grids, strict=True)])
    here = np.asarray(at.model.reader(point) @ at.modes.shape).reshape(len(point), 6, -1)
    member = np.repeat(np.arange(len(members)), [len(g) for g in grids])
    moves = np.linalg.norm(here[:, :3], axis=(1, 2))
    free = moves > _MIN_MOTION * moves.max()
    along = np.array([np.subtract(m.end, m.start) / m.length for m in members])
    onto = along[:, :, None] * along[:, None, :]
    # along the member the offset is one of the position; across it bodies are as large as the whole structure suggests
    offset = _OFFSET_STD * (extent(reference.structure) * (np.eye(3) - onto) + scale * onto)
    return _Candidates(
        member=member,
        distance=np.concatenate(grids),
        point=point,
        translation=here[:, :3],
        rotation=here[:, 3:],
        length=np.concatenate([np.gradient(g) for g in grids]),
        offset=offset[member],
    ).only(free)


def _gram(one: FloatArray, other: FloatArray) -> FloatArray:
    """Return the symmetric part of one^T other (n, n_modes, n_modes)."""
    product = one.transpose(0, 2, 1) @ other
    return np.asarray(0.5 * (product + product.transpose(0, 2, 1)))


def _flat(gram: FloatArray) -> FloatArray:
    return gram.reshape(len(gram), -1)
