"""The reference: a calibrated model, one-step updated to the baseline's modes, and the baseline's own statistics."""

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.optimize import linear_sum_assignment

from daq import FloatArray, IndexArray
from oma import mac_matrix, pair_modes
from updater.fe import Model, Modes
from updater.modal_data import BaselineModes, DeviceDelays, ModalMean, Scatter, TrackedModes
from updater.quantities import ASKEW_STD
from updater.reference.calibration import Calibration, channel_rows
from updater.reference.expansion import LARGEST_CLUSTER, expand, orthonormal
from updater.reference.model_error import mesh_covariance
from updater.structure import Structure

SAME_SHAPE = 0.9  #: MAC, and
NEAR = 0.05  #: ln f: modes that may be mistaken for each other
#: relative to a unit shape's components: assumed error of a model's; gains are known to half a per cent, positions to
#: millimetres
SHAPE_STD = 0.01
_HIDDEN = 0.05  # relative to the usual motion of sensors by modes: a smaller one is hardly measured
_GOOD = 1e-3  # rms of ln f: agreement of a good model with the baseline
#: times this: a model with more does not describe the structure. Two bodies of 1 kg that the file lacks give 34, and
#: changes are still found; a portal with the sections of some or all members turned by 90 degrees has 58 to 112
_NOT_OF_THE_STRUCTURE = 50.0


@dataclass(frozen=True, eq=False, kw_only=True)
class Reference:
    """Structure before the change."""

    calibration: Calibration
    baseline: ModalMean
    scatter: Scatter
    frequency: FloatArray  #: (n_modes,) measured where a track answers, the model's elsewhere [Hz]
    shape: FloatArray  #: (n_dofs, n_modes) mass-normalised [A B2], in the order of the model's modes
    windows: TrackedModes  #: windows of the baseline, without a change
    delays: DeviceDelays  #: constant delays of the devices, removed from the baseline's windows
    unpaired_modes: ModalMean | None = None  #: modes that were measured too, to which none of the model's answers
    measured: bool = True  #: whether the baseline was measured; else it is the model's own modes
    of_file: bool = False  #: whether the baseline is a structure file's modes, with the errors that a file has
    nominal: "NominalModel | None" = None  #: nominal model of a structure file that is far off

    @property
    def structure(self) -> Structure:
        """Calibrated structure."""
        return self.calibration.structure

    @property
    def model(self) -> Model:
        """Finite element model of the calibrated structure."""
        return self.calibration.model

    @property
    def baseline_modes(self) -> BaselineModes:
        """Measured modes of the baseline, without the model."""
        return BaselineModes(windows=self.windows, scatter=self.scatter, mean=self.baseline, delays=self.delays)

    @property
    def known(self) -> ModalMean:
        """All modes of the baseline, the tracks first: candidates for the modes of other windows."""
        return self.baseline if self.unpaired_modes is None else self.baseline.joined(self.unpaired_modes)

    @property
    def file(self) -> "Reference":
        """The reference of the structure as it is in the file."""
        return self.nominal.reference if self.nominal else self

    @property
    def paired(self) -> IndexArray:
        """Model mode of each track (n_tracks,)."""
        return self.calibration.paired

    @property
    def model_error_factor(self) -> float:
        """Factor on the model error, relative to a model that agrees with the baseline as it should.

        At least 1: the rms of the whitened differences of frequencies. Errors of the model in the undisturbed state
        increase it, such as a body missing in the file; those of its mesh are expected, and are an error of their own.
        Those of walls that bend increase it: nothing else allows for them in shapes and sensitivities.
        An uncertain baseline is weak evidence for a good model.
        """
        mesh = self.calibration.frequency_error.mesh[self.paired]
        expected = np.linalg.cholesky(_GOOD**2 * np.eye(len(mesh)) + mesh_covariance(mesh))
        errors = self._log_frequency_errors
        off = np.copysign(np.maximum(np.abs(errors), self.baseline.log_frequency_std), errors)
        return float(max(np.sqrt(np.mean(np.linalg.solve(expected, off) ** 2)), 1.0))

    @property
    def frequency_error(self) -> float:
        """Largest relative difference of the calibrated model's frequencies from the baseline's."""
        return float(np.abs(self._log_frequency_errors).max())

    @property
    def fits_baseline(self) -> bool:
        """False if the calibrated model's frequencies are that far from the baseline's that it is of another structure.

        A factor on all of them does not count: it changes no predicted ratio.
        """
        off = self._log_frequency_errors - np.mean(self._log_frequency_errors)
        expected = np.hypot(_GOOD, self.calibration.frequency_error.std[self.paired])
        return bool(np.sqrt(np.mean((off / expected) ** 2)) <= _NOT_OF_THE_STRUCTURE)

    @property
    def _log_frequency_errors(self) -> FloatArray:
        """Log ratios (n_tracks,) of the calibrated model's frequencies to the baseline's."""
        calibrated = np.log(self.calibration.modes.frequency[self.paired])
        return np.asarray(calibrated - self.baseline.log_frequency)

    @property
    def common_error(self) -> FloatArray:
        """Standard deviations (n_tracks, n_errors) of the baseline's ln f by errors with one factor for all modes.

        A measured baseline has none. A model's own modes have those of walls, and those of a file also the mesh's; a
        calibration has fitted the moduli to the latter.
        """
        error = self.calibration.frequency_error.only(self.paired)
        if self.of_file:
            return error.common
        return np.zeros((len(self.paired), 0)) if self.measured else error.walls

    @property
    def ambiguous_tracks(self) -> npt.NDArray[np.bool_]:
        """Mask of tracks (n_tracks,) near a mode of the model that sensors hardly see, but where the two mix."""
        moves = np.linalg.norm(self.at_channels(self.baseline.channels), axis=0)
        hidden = np.setdiff1d(np.flatnonzero(moves < _HIDDEN * np.median(moves[self.paired])), self.paired)
        apart = np.abs(np.log(self.frequency[self.paired, None] / self.frequency[hidden]))
        return np.asarray((apart < NEAR).any(1))

    def comparable(self, channels: tuple[str, ...]) -> tuple[str, ...]:
        """Return channels of an event at which its shapes can be compared: the baseline's, then further sensors.

        Only the baseline's where fewer than two of them would scale the model's shapes, and of a file without reference
        logs, whose modes are known at the channels of the logs.
        """
        first = tuple(c for c in self.baseline.channels if c in channels)
        further = () if self.of_file or len(first) < 2 else self.structure.channels
        return (*first, *(c for c in further if c in channels and c not in first))

    def unmeasured(self, channels: tuple[str, ...]) -> npt.NDArray[np.bool_]:
        """Return a mask of channels (n_channels,) that the baseline did not measure: its shapes are the model's."""
        return np.array([self.of_file or c not in self.baseline.channels for c in channels])

    def baseline_at(self, channels: tuple[str, ...]) -> ModalMean:
        """Return the baseline at channels; of sensors that were added later, the shapes by the model.

        The model's modes that are one-step updated to the baseline have its shapes at its sensors. Their phases at
        another sensor are not known.
        """
        further = self.unmeasured(channels)
        if self.of_file or not further.any():
            return self.baseline.at(channels)
        known = self.baseline.at(tuple(c for c, new in zip(channels, further, strict=True) if not new))
        shape = self.at_channels(channels)[:, self.paired]
        across = np.linalg.norm(self.across_channels(channels)[:, self.paired].reshape(2, *shape.shape), axis=0)
        of_model = shape[~further]
        scale = (known.shape.T * of_model).sum(0) / np.maximum((of_model**2).sum(0), np.finfo(float).tiny)
        error = np.hypot(SHAPE_STD * self.model_error_factor, ASKEW_STD * np.abs(scale) * across[further])

        def joined(measured: FloatArray, predicted: FloatArray) -> FloatArray:
            values = np.empty(shape.T.shape)
            values[:, ~further], values[:, further] = measured, predicted.T
            return values

        predicted = scale * shape[further]
        whole = replace(
            known,
            channels=channels,
            shape=joined(known.shape, predicted),
            shape_std=joined(known.shape_std, error),
            imaginary=joined(known.imaginary, np.zeros(predicted.shape)),
            imaginary_std=joined(known.imaginary_std, np.ones(predicted.shape)),
        )
        return whole.at_unit_norm()

    def without(self, channels: Collection[str]) -> "Reference":
        """Return the reference with shapes that are expanded from the other channels alone.

        The calibrated model, frequencies and damping stay as they are.
        """
        baseline = self.baseline.at(tuple(c for c in self.baseline.channels if c not in channels))
        modes = first_stage(self.model, self.calibration.modes, self.paired, baseline)
        return replace(self, baseline=baseline, shape=modes.shape)

    def with_own_error(self, share: float) -> "Reference":
        """Return the reference with a share of the errors that are assumed for a model's own frequencies and shapes.

        The baseline is the model's own modes (`of_file`). Sensors may be turned as before.
        """
        own = self.baseline
        shape_std = np.sqrt(own.shape_std**2 - (1 - share**2) * SHAPE_STD**2)
        less = replace(own, log_frequency_std=share * own.log_frequency_std, shape_std=shape_std)
        return replace(self, baseline=less)

    def at_channels(self, channels: tuple[str, ...]) -> FloatArray:
        """Return the modes at sensors (n_channels, n_modes)."""
        return channel_rows(self.model, channels) @ self.shape

    def across_channels(self, channels: tuple[str, ...]) -> FloatArray:
        """Return the modes at sensors along the two axes across each (2 n_channels, n_modes), first axes first."""
        return channel_rows(self.model, channels, across=True) @ self.shape

    def per_offset(self, channels: tuple[str, ...]) -> FloatArray:
        """Return the change of the modes at sensors per metre along each global axis (3, n_channels, n_modes) [1/m]."""
        known = self.model.structure.channels
        return np.asarray(self.model.offset_rows[:, [known.index(c) for c in channels]] @ self.shape)

    def rows(self, model: Model) -> FloatArray:
        """Return the rows (n_channels, n_dofs) of a model of the same structure that read the baseline's channels."""
        return channel_rows(model, self.baseline.channels)

    def mean_of(self, modes: TrackedModes) -> ModalMean:
        """Average windows with the standard deviations that the baseline's scatter has shown to be real."""
        return self.scatter.mean(modes)


@dataclass(frozen=True, eq=False, kw_only=True)
class NominalModel:
    """Inconsistent structure file, for which causes are sought about a recalibrated model.

    Modes are paired incorrectly there, and small causes do not have the same effect on them as on the structure.
    """

    reference: Reference  #: the model as it is in the file
    value: FloatArray  #: (n_knobs,) of the nearer model's parameters
    far: bool  #: whether the file is so far off that its parameters have wider priors


def first_stage(model: Model, modes: Modes, paired: IndexArray, baseline: ModalMean) -> Modes:
    """Replace the paired modes of a model by the measured ones: the first stage of the one-step update (eq. 8).

    Parameters
    ----------
    model, modes : calibrated model and its modes, frequencies [Hz], shapes of unit modal mass
    paired : (n_tracks,) mode of the model paired with each measured one
    baseline : (n_tracks,) measured; their shapes are expanded and orthonormalised, so that the mass is not altered
    """
    frequency, shape = modes.frequency.copy(), modes.shape.copy()
    frequency[paired] = np.exp(baseline.log_frequency)
    seen = (channel_rows(model, baseline.channels) @ shape[:, paired]).T
    t = [expand(s, seen, modes.omega[paired], i, largest=LARGEST_CLUSTER) for i, s in enumerate(baseline.shape)]
    shape[:, paired] = shape[:, paired] @ orthonormal(np.array([x / np.linalg.norm(x) for x in t]).T)
    return Modes(frequency=frequency, shape=shape)


def pair_baseline(model: Model, modes: Modes, baseline: ModalMean) -> IndexArray:
    """Pair the modes of a baseline with those of a model, by frequency and MAC.

    Parameters
    ----------
    model, modes : with the sensors, and its modes
    baseline : (n_tracks,) measured

    Returns
    -------
    (n_tracks,)
        Number of the mode of the model, -1 for none.
    """
    seen = (channel_rows(model, baseline.channels) @ modes.shape).T
    return pair_modes(np.exp(baseline.log_frequency), baseline.shape, modes.frequency, seen)


def match_nominal_modes(reference: Reference, nominal: NominalModel, channels: tuple[str, ...]) -> IndexArray:
    """Pair the modes of the structure file with those of the recalibrated model, all at once.

    Parameters
    ----------
    reference : of the recalibrated model
    nominal : model of the file
    channels : names of those at which shapes are compared

    Returns
    -------
    (n_modes,)
        Number of the file's mode, -1 for none.
    """
    there = nominal.reference
    apart = np.log(reference.frequency[:, None] / there.frequency)
    unlike = 1 - mac_matrix(reference.at_channels(channels).T, there.at_channels(channels).T)
    apart = np.abs(apart - np.median(np.diag(apart)))
    row, answer = linear_sum_assignment(unlike + apart)
    found: IndexArray = np.argmin(apart, axis=1)  # nearest of the remaining modes
    found[row] = answer
    return found
