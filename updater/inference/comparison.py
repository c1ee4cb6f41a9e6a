"""Comparison of an event with the baseline: the data of every hypothesis.

Ratios to the baseline, log frequencies and shapes, so that errors of the model in the undisturbed state cancel to first
order.

Four blocks of data: log frequencies; shapes; the shapes' imaginary parts, each mode turned so that its own is least
(complex modes of the structure itself cancel against the baseline, a late channel does not); log damping. A block of
which nothing was measured is empty or zero and adds nothing to the degrees of freedom.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.linalg import block_diag
from scipy.optimize import linear_sum_assignment

from daq import FloatArray, IndexArray
from updater.modal_data import COMMON_STD, NOTHING_KNOWN, Circumstances

BoolArray = npt.NDArray[np.bool_]

#: times the error e of a mesh: relative error of masses and springs. With a consistent mass matrix of linear elements,
#: the mean square of a wave is (k h)^2 / 6 = 4 e too small, and its squared displacement per modal mass too large
_MESH_ERROR_OF_SIZE = 4.0
LEAST_VARIANCE = 1e-12  #: of a log frequency: a part per million, as clocks are known; modes stated without deviations


@dataclass(frozen=True, eq=False)
class Whitener:
    """Inverse Cholesky factor of the log frequencies' covariance."""

    matrix: FloatArray  #: (n, n)
    log_det: float  #: log determinant of the matrix


@dataclass(frozen=True, eq=False, kw_only=True)
class NewModes:
    """Modes now that the baseline has not."""

    log_frequency: FloatArray  #: (n_extra,) [ln Hz]
    log_frequency_std: FloatArray  #: (n_extra,)
    damping: FloatArray  #: (n_extra,) [-], NaN where it is not known
    damping_std: FloatArray  #: (n_extra,)
    shape: FloatArray  #: (n_extra, n_channels) unit norm
    whitener: FloatArray  #: (n_extra, n_channels, n_channels) inverse Cholesky factors of its covariance


@dataclass(frozen=True, eq=False, kw_only=True)
class MassTest:
    """Frequencies now with a known mass, compared with those without it.

    The noise e of the frequencies without the mass is in two data: in their ratio to the baseline, r = e + .., and in
    the ratio s = .. - e to them. The part of s that r determines is subtracted.
    """

    mass: float  #: [kg]
    position: tuple[float, float, float]  #: of the mass [m]
    rows: IndexArray  #: (k,) compared modes that were measured with the mass
    log_ratio: FloatArray  #: (k,) of their frequencies with the mass to those without it
    covariance: FloatArray  #: (k, k) of these
    noise: FloatArray  #: (k,) variance of the log frequencies without the mass
    translation: FloatArray  #: (3, n_modes) of the reference's modes at the mass, times its root
    correction: FloatArray  #: (k,) by modes of the reference that are not compared
    is_evidence: bool = True  #: whether causes must explain it; else it is compared with the answer only

    def predict(self, value: FloatArray, vector: FloatArray) -> FloatArray:
        """Return the log ratios (n_alternatives, k) that alternatives predict.

        Parameters
        ----------
        value : (n_alternatives, n) 1/omega^2 of the compared modes without the mass [s2]
        vector : (n_alternatives, n_modes, n) of these in the reference's modes
        """
        return frequencies_with_mass(value, self.translation @ vector)[:, self.rows] + self.correction

    def whitened(self, off: FloatArray, before: FloatArray, whitener: "Whitener") -> FloatArray:
        """Return whitened residuals (n_alternatives, k) that are independent of those of the frequencies before.

        Parameters
        ----------
        off : (n_alternatives, k) residuals of the log ratios
        before : (n_alternatives, n) whitened residuals of the frequencies without the mass
        whitener : of these
        """
        known = whitener.matrix[:, self.rows] * self.noise  # covariance with whitened residuals, sign reversed
        return np.asarray((off + before @ known) @ self._matrix(known).T)

    def log_det(self, whitener: "Whitener") -> float:
        """Return the log determinant of the matrix that whitens."""
        matrix = self._matrix(whitener.matrix[:, self.rows] * self.noise)
        return float(np.log(np.diag(matrix)).sum())

    def _matrix(self, known: FloatArray) -> FloatArray:
        return np.asarray(np.linalg.inv(np.linalg.cholesky(self.covariance - known.T @ known)))


def frequencies_with_mass(value: FloatArray, moved: FloatArray) -> FloatArray:
    """Return the log ratios (p, n) of frequencies of modes with a mass to those without it.

    Parameters
    ----------
    value : (p, n) 1/omega^2 of the modes [s2]
    moved : (p, 3, n) their mass-normalised displacements at the mass, times its root
    """
    root = np.sqrt(value)[:, :, None]
    mass = np.eye(value.shape[1]) + moved.transpose(0, 2, 1) @ moved
    found, vector = np.linalg.eigh(root * mass * root.transpose(0, 2, 1))
    successor = one_to_one(vector**2)
    return np.asarray(-0.5 * np.log(np.take_along_axis(found, successor, axis=1) / value))


def one_to_one(share: FloatArray) -> IndexArray:
    """Return the successor (p, n) of each mode, no two the same.

    A mass that shifts a mode by more than the distance to the next one mixes both: each may have its largest share in
    the same successor. Then all shares together are the largest.

    Parameters
    ----------
    share : (p, n, m) of each mode before in each one after, m >= n
    """
    found: IndexArray = np.argmax(share, axis=2)
    for row in np.flatnonzero((np.diff(np.sort(found, axis=1), axis=1) == 0).any(1)).tolist():
        found[row] = linear_sum_assignment(share[row], maximize=True)[1]
    return found


@dataclass(frozen=True, eq=False, kw_only=True)
class NominalModes:
    """Modes of the structure file in the place of those compared, where a nearer model is used."""

    log_ratio: FloatArray  #: (n,) of its frequencies to the baseline's
    shape: FloatArray  #: (n, n_channels) unit norm


@dataclass(frozen=True, eq=False, kw_only=True)
class Comparison:
    """Modes now and before, at the channels, with the reference's modes to predict from."""

    channels: tuple[str, ...]  #: common channels
    tracks: IndexArray  #: (n,) indices of the tracks that entered
    paired: IndexArray  #: (n,) their model modes
    log_ratio: FloatArray  #: (n,) of frequency to the baseline's
    log_frequency_std: FloatArray  #: (n,) measurement now, without the model's error
    plain: Whitener  #: whitener of the log frequency ratios under measurement noise alone
    drifting: Whitener  #: the same with a change common to all, which temperature brings
    model_variance: FloatArray  #: (n,) variance of the log ratios for errors of the reference
    mesh_error: FloatArray  #: (n,) estimated relative error of the model's frequencies by its mesh; 0 without faces
    common_deviation: FloatArray  #: (n, n_errors) of the log ratios by errors of a model with one factor for all modes
    shaped: BoolArray  #: (n,) whether the shape was measured now; else only the frequency counts
    shape: FloatArray  #: (n, n_channels) measured now, unit norm; where it was not, as before
    base: FloatArray  #: (n, n_channels) measured before, unit norm
    shape_whitener: FloatArray  #: (n, n_channels, n_channels) inverse Cholesky factors of the difference's covariance
    #: (n, n_channels, n_errors) standard deviations of shapes by errors of sensors that all modes have in common
    sensor_errors: FloatArray
    #: the same by the error of a mesh, and by sensors that read modes that were not measured (n, n_channels, n_more)
    common_errors: FloatArray
    overdispersion: float  #: components of a shape that err as one [-]
    phased: BoolArray  #: (n,) whether phases are known now and before
    imaginary: FloatArray  #: (n, n_channels) imaginary part of the shape now; 0 where it is not known
    baseline_imaginary: FloatArray  #: (n, n_channels) before
    imaginary_whitener: FloatArray  #: (n n_channels, n n_channels) inverse Cholesky factor, 0 where it is not known
    imaginary_overdispersion: float  #: components of the imaginary part that err as one [-]
    log_damping: FloatArray  #: (n,) of damping to the baseline's; 0 where it is not known
    log_damping_std: FloatArray  #: (n,) measurement, before and now; NaN if unknown
    damping_weight: FloatArray  #: (n,) one over the standard deviation of changes by other reasons; 0: unknown
    model_base: FloatArray  #: (n, n_channels) of the reference, unit norm
    at_channels: FloatArray  #: (n_channels, n_modes) of the reference's modes
    across: FloatArray  #: (2 n_channels, n_modes) of them along the two axes across each channel, first axes first
    frequency: FloatArray  #: (n_modes,) of the reference [Hz]
    n_stress: int = 0  #: states of self-stress of the reference's model
    circumstances: Circumstances = NOTHING_KNOWN  #: further knowledge
    new: NewModes | None = None  #: new modes of the circumstances, at the channels
    mass_tests: tuple[MassTest, ...] = ()  #: further records with a known mass
    nominal: NominalModes | None = None  #: modes of a file that is far off: the state before any cause

    def trusting(self, share: float) -> "Comparison":
        """Return the same with a share of the tolerance of log frequencies for errors of the reference."""
        less = 1 - share**2
        covariance = self.frequency_covariance - less * self.model_covariance
        plain, drifting = whiteners_of(covariance)
        return replace(
            self,
            plain=plain,
            drifting=drifting,
            model_variance=share**2 * self.model_variance,
            common_deviation=share * self.common_deviation,
        )

    @property
    def frequency_covariance(self) -> FloatArray:
        """Covariance (n, n) of the log ratios by noise and by errors of the reference."""
        root = np.linalg.inv(self.plain.matrix)
        return np.asarray(root @ root.T)

    @property
    def model_covariance(self) -> FloatArray:
        """Part (n, n) of it by errors of the reference."""
        return np.diag(self.model_variance) + self.common_deviation @ self.common_deviation.T

    def with_frequencies(
        self, modes: IndexArray, log_ratio: FloatArray, std: FloatArray, model_std: FloatArray
    ) -> "Comparison":
        """Return the same with frequencies of further modes, of which shapes, phases and damping are not compared.

        Parameters
        ----------
        modes : (k,) of the reference
        log_ratio, std : (k,) of their frequencies to the reference's own, and its standard deviation
        model_std : (k,) standard deviation of the predicted change by errors of the reference
        """
        k, n = len(modes), len(self.paired)
        plain, drifting = whiteners_of(block_diag(self.frequency_covariance, np.diag(std**2 + model_std**2)))
        shape = self.at_channels[:, modes].T
        shape = shape / np.linalg.norm(shape, axis=1, keepdims=True)
        whitener = np.zeros((n + k, *self.shape_whitener.shape[1:]))
        whitener[:n] = self.shape_whitener
        imaginary_whitener = np.zeros((n + k) * len(self.channels) * np.ones(2, int))
        imaginary_whitener[: len(self.imaginary_whitener), : len(self.imaginary_whitener)] = self.imaginary_whitener
        more: dict[str, FloatArray | IndexArray | BoolArray] = {
            "tracks": np.full(k, -1),
            "paired": modes,
            "log_ratio": log_ratio,
            "log_frequency_std": std,
            "model_variance": model_std**2,
            "mesh_error": np.zeros(k),
            "common_deviation": np.zeros((k, self.common_deviation.shape[1])),
            "shaped": np.zeros(k, bool),
            "shape": shape,
            "base": shape,
            "sensor_errors": np.zeros((k, *self.sensor_errors.shape[1:])),
            "common_errors": np.zeros((k, *self.common_errors.shape[1:])),
            "phased": np.zeros(k, bool),
            "imaginary": np.zeros(shape.shape),
            "baseline_imaginary": np.zeros(shape.shape),
            "log_damping": np.zeros(k),
            "log_damping_std": np.full(k, np.nan),
            "damping_weight": np.zeros(k),
            "model_base": shape,
        }
        joined: dict[str, Any] = {name: np.concatenate([getattr(self, name), added]) for name, added in more.items()}
        return replace(
            self,
            plain=plain,
            drifting=drifting,
            shape_whitener=whitener,
            imaginary_whitener=imaginary_whitener,
            **joined,
        )

    @cached_property
    def common_to_modes(self) -> FloatArray:
        """Directions S (n n_channels, k) of errors that all modes have in common among whitened residuals of shapes.

        Residuals of covariance I + V V^T, with the singular values s of V, are white after (I - S S^T), the columns of
        S the left singular vectors times (1 - (1 + s^2)^-1/2)^1/2.
        """
        errors = self.shape_whitener @ np.concatenate([self.sensor_errors, self.common_errors], axis=2)
        errors = errors.reshape(errors.shape[0] * errors.shape[1], -1)
        left, value, _ = np.linalg.svd(errors, full_matrices=False)
        return np.asarray(left * np.sqrt(1 - (1 + value**2) ** -0.5))

    @property
    def size_error(self) -> float:
        """Relative standard deviation of masses and of changes of compliance by the error of the mesh.

        It has one sign in all modes, so that more modes do not reduce it. Modes count by the squares of their changes.
        """
        weight = self.log_ratio**2
        total = float(weight.sum())
        return _MESH_ERROR_OF_SIZE * float(weight @ self.mesh_error) / total if total else 0.0

    @property
    def log_det_of_shapes(self) -> float:
        """Log determinant of the shapes' whiteners, as far as their components are data of their own.

        The same for all hypotheses; not for another model error.
        """
        diagonal = np.diagonal(self.shape_whitener[self.shaped], axis1=1, axis2=2)
        of_sensors = np.log1p(-(self.common_to_modes**2).sum(0)).sum()
        return float(np.log(diagonal).sum() / self.overdispersion + of_sensors)

    @cached_property
    def baseline_at_channels(self) -> FloatArray:
        """The reference's modes (n_channels, n_modes) as they were measured, errors of sensors included.

        Those that are not compared are the model's.
        """
        scaled = self.at_channels.copy()
        length = np.linalg.norm(scaled[:, self.paired], axis=0)
        sign = np.where((self.base * self.model_base).sum(1) < 0, -1.0, 1.0)
        scaled[:, self.paired] = (sign * length) * self.base.T
        return scaled

    def freedom_of_new(self, n_new: int) -> float:
        """Return the number of data of new modes, for a hypothesis with `n_new`."""
        if self.new is None:
            return 0.0
        n_extra, n_channels = (int(n) for n in self.new.shape.shape)
        return min(n_new, n_extra) * (1 + (n_channels - 1) / self.overdispersion)

    @property
    def freedom(self) -> float:
        """Number of data: unit norm leaves a shape one component fewer than it has channels."""
        n_modes, n_channels = (int(n) for n in self.shape.shape)
        of_shapes = int(self.shaped.sum()) * (n_channels - 1) / self.overdispersion
        of_phases = int(self.phased.sum()) * (n_channels - 1) / self.imaginary_overdispersion
        of_damping = float(np.nansum((self.log_damping_std * self.damping_weight) ** 2))  # the rest is no noise
        with_mass = sum(len(test.rows) for test in self.mass_tests if test.is_evidence)
        return n_modes + with_mass + of_shapes + of_phases + of_damping

    def log_det_of_frequencies(self, *, drifting: bool) -> float:
        """Log determinant of the whiteners of frequencies, without and with known masses."""
        whitener = self.drifting if drifting else self.plain
        return whitener.log_det + sum(test.log_det(whitener) for test in self.mass_tests if test.is_evidence)

    @property
    def extra_frequency(self) -> FloatArray:
        """Frequencies (n_extra,) of modes that the baseline has not [Hz]."""
        extra = self.circumstances.extra
        return np.exp(extra.log_frequency) if extra else np.empty(0)


def whiteners_of(covariance: FloatArray) -> tuple[Whitener, Whitener]:
    """Return the whiteners of log frequencies of a covariance (n, n), and of those with a change common to all."""
    return _whitener(covariance), _whitener(covariance + COMMON_STD**2)


def _whitener(covariance: FloatArray) -> Whitener:
    lower = np.linalg.cholesky(covariance)
    return Whitener(np.linalg.inv(lower), -float(np.log(np.diag(lower)).sum()))
