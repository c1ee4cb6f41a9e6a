"""Detectability and Cramér-Rao bound of a body anywhere on a structure, from the structure file alone.

To first order in the body's mass log frequencies move by -dM_ii / 2 and shapes turn by omega_i^2 dM_ki / (omega_k^2 -
omega_i^2), dM = m Phi^T Phi of the modes where the body is. Set against the expected errors of a record before and
one after, that is the least mass which raises the alarm, and the Cramér-Rao bound of its place.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.optimize import brentq
from scipy.stats import chi2, ncx2

from daq import FloatArray, IndexArray
from updater.causes import AddedMass, propose_added_mass
from updater.errors import ModelError
from updater.fe import Model, Modes
from updater.inference import SHAPE_BIAS, compare
from updater.modal_data import COMMON_STD
from updater.planning.expected_reference import expected_reference, shape_covariance, told_apart
from updater.planning.record_noise import Record, shape_errors
from updater.reference import Reference, best_model
from updater.structure import Sensor, Structure

_HEAVY = 0.1  # of the structure's mass: where not even so much is noticed, the rig is blind
Stretches = list[tuple[float, float]]

_N_MODES = 30
_USUAL = 0.01  # m between places
# on all members, more than a centimetre apart: default, and maximum if a target requires it
_PLACES, _MAX_PLACES = 600, 2400
_PLACES_WITHIN = 2.5  # places per distance that is to be resolved
_STILL = 1e-6  # of the largest signature: a body there moves nothing
_WHOLE = 1e3  # m: a place that nothing is known of
_OFFSET_STD = 0.02  # m: unknown offset of a body's centre from the member's axis


@dataclass(frozen=True, eq=False, kw_only=True)
class DetectabilityStudy:
    """A structure with its sensors and two records of it, nothing having been measured yet."""

    record: Record
    reference: Reference  #: the structure file taken at its word, with the errors expected of a record's modes
    places: AddedMass  #: possible places of a body: positions and modal motions, which do not depend on sensors
    #: (n_modes, n_modes, 3, n_places) changes of modal mass per kilogram, and per kilogram and metre of the two offsets
    modal_mass: FloatArray

    @cached_property
    def bodies(self) -> AddedMass:
        """A body at any of these places, compared by the measurable modes."""
        return replace(
            self.places, reference=self.reference, comparison=compare(self.reference, self.reference.baseline)
        )

    @property
    def member(self) -> IndexArray:
        """Member of each place (n_places,)."""
        return self.places.member

    @cached_property
    def point(self) -> FloatArray:
        """The places (n_places, 3) [m]."""
        members = self.reference.structure.member
        pairs = zip(self.places.member, self.places.position, strict=True)
        return np.array([members[m].point(s) for m, s in pairs])

    @property
    def frequency(self) -> FloatArray:
        """Frequencies (n,) of the modes that the sensors measure [Hz]."""
        return self.reference.frequency[self.reference.paired]

    @cached_property
    def shape_error(self) -> FloatArray:
        """Directions (n, n_modes, n_channels) in which one record's shapes err, each by one standard deviation."""
        at = self.reference.at_channels(self.reference.baseline.channels)
        leaks = self.record.leaks(self.reference.frequency, self.reference.paired)
        return shape_errors(at, leaks, at[:, self.reference.paired].T)

    def lasting(self, seconds: float) -> "DetectabilityStudy":
        """Return the same with longer or shorter records."""
        calibration = self.reference.calibration
        record = replace(self.record, seconds=seconds)
        return _outlook(calibration.model, calibration.modes, record, self)

    def weakest_mass(self, power: float = 0.95) -> FloatArray:
        """Return the least mass at each place (n_places,) that raises the alarm [kg]; infinite where none does.

        The alarm's own test: squared shifts of the seen modes' frequencies over their variances, before and after.

        Parameters
        ----------
        power : chance that it does [-]
        """
        n, alpha = len(self.frequency), self.record.false_alarm_probability
        limit = float(chi2.isf(alpha, n))

        def lacking(root: float) -> float:
            return float(ncx2.sf(limit, n, root**2)) - power

        needed = brentq(lacking, 1e-3, 10 * np.sqrt(limit) + 10)
        z = self._log_frequency[0] / (np.sqrt(2) * self.record.log_frequency_std(self.frequency))
        strength = np.linalg.norm(z, axis=1)
        moved = strength > _STILL * strength.max()
        return np.where(moved, needed / np.where(moved, strength, 1.0), np.inf)

    def bound(self, mass: float) -> tuple[FloatArray, FloatArray]:
        """Return the Cramér-Rao bounds of place [m] and mass [kg] at each place (n_places,).

        Also unknown: two offsets of the body's centre and a change common to all frequencies, both with a prior.
        """
        return sharpest(self._data, self.places, mass)

    @cached_property
    def _log_frequency(self) -> FloatArray:
        """Changes of log frequency (3, n_places, n)."""
        paired = self.reference.paired
        return np.moveaxis(-0.5 * self.modal_mass[paired, paired], 0, 2)

    @cached_property
    def _data(self) -> FloatArray:
        """The same with the changes of shapes, over their errors (3, n_places, n + n n_rows)."""
        paired, omega2 = self.reference.paired, self.reference.frequency**2
        gap = omega2 / omega2[paired, None] - 1
        turned = gap / (gap**2 + (2 * self.record.damping) ** 2)  # (n, n_modes), bounded where modes coincide
        shares = self.modal_mass[paired].reshape(len(paired), len(omega2), -1)
        moved = (self._of_modes * turned[:, None]) @ shares
        shape = np.moveaxis(moved.reshape(-1, *self.modal_mass.shape[2:]), 0, 2)
        std = np.sqrt(2) * self.record.log_frequency_std(self.frequency)
        rest = without(self._log_frequency / std, COMMON_STD / std)
        return np.concatenate([rest, shape], axis=2)

    @cached_property
    def _of_modes(self) -> FloatArray:
        """Effect of a share of each mode on measured unit shapes, over their errors (n, n_rows, n_modes).

        Of more channels than modes as many rows are left, by an orthogonal transformation of the channels: shapes err
        along modes and in all channels alike.
        """
        paired = self.reference.paired
        at = self.reference.at_channels(self.reference.baseline.channels)
        if len(at) > at.shape[1]:
            at = np.asarray(np.linalg.qr(at, mode="r"))
        error = shape_errors(at, self.record.leaks(self.reference.frequency, paired), at[:, paired].T)
        blur = np.hypot(np.sqrt(2) * self.record.blur(self.frequency), SHAPE_BIAS)
        length = np.linalg.norm(at[:, paired], axis=0)
        unit = (at[:, paired] / length).T
        beside = np.eye(len(at)) - unit[:, :, None] * unit[:, None]
        whitener = np.linalg.inv(np.linalg.cholesky(shape_covariance(np.sqrt(2) * error, blur)))
        return np.asarray(whitener @ beside @ at / length[:, None, None])


def without(frequency: FloatArray, drift: FloatArray) -> FloatArray:
    """Return whitened data (..., n) once more whitened of a common change, `drift` (n,) a standard deviation of it.

    (I + d d^T)^-1/2 = I - (1 - 1 / sqrt(1 + d^T d)) d d^T / d^T d.
    """
    size = float(drift @ drift)
    share = (1 - 1 / np.sqrt(1 + size)) / size
    return np.asarray(frequency - share * (frequency @ drift)[..., None] * drift)


def sharpest(data: FloatArray, bodies: AddedMass, mass: float) -> tuple[FloatArray, FloatArray]:
    """Return the bounds of place [m] and mass [kg] (n_places,) from whitened signatures (3, n_places, n_data)."""
    along = np.concatenate(
        [
            np.gradient(data[0, bodies.member == m], bodies.position[bodies.member == m], axis=0)
            for m in np.unique(bodies.member)
        ]
    )
    columns = np.stack([data[0], mass * along, mass * data[1], mass * data[2]], axis=2)
    prior = np.diag([bodies.prior_std[0] ** -2, _WHOLE**-2, _OFFSET_STD**-2, _OFFSET_STD**-2])
    covariance = np.linalg.inv(columns.transpose(0, 2, 1) @ columns + prior)
    return np.sqrt(covariance[:, 1, 1]), np.sqrt(covariance[:, 0, 0])


def study_detectability(structure: Structure, record: Record, within: float | None = None) -> DetectabilityStudy:
    """Return the expected accuracy of the structure's sensors.

    Parameters
    ----------
    structure : with at least two sensors
    record : how long is measured, before and after
    within : distance to be resolved [m]. Default: places a centimetre apart, or farther on long members

    Raises
    ------
    ModelError
        If the structure is a mechanism, its sensors measure fewer than three modes, or it has far more places than can
        be evaluated in useful time.
    """
    spacing = _spacing(structure, within)
    model = best_model(structure)
    modes = model.modes(min(_N_MODES, int((model.dofs[:, :3] >= 0).sum())))
    return _outlook(model, modes, record, spacing=spacing)


def _spacing(structure: Structure, within: float | None) -> float:
    """Return the distance between places [m]."""
    length = sum(member.length for member in structure.member)
    usual = max(_USUAL, length / _PLACES)
    if within is None:
        return usual
    spacing = min(within / _PLACES_WITHIN, usual)
    if length / spacing > _MAX_PLACES:
        raise ModelError(
            f"{structure.name}: {within:g} m on {length:.4g} m of members are too many places; "
            f"expected {_PLACES_WITHIN * length / _MAX_PLACES:.2g} m or more"
        )
    return spacing


def with_sensors(outlook: DetectabilityStudy, sensors: tuple[Sensor, ...]) -> DetectabilityStudy:
    """Return the same structure with other sensors.

    Raises
    ------
    ModelError
        If they see fewer than three modes.
    """
    calibration = outlook.reference.calibration
    structure = calibration.structure.model_copy(update={"sensor": sensors})
    return _outlook(replace(calibration.model, structure=structure), calibration.modes, outlook.record, outlook)


def _outlook(
    model: Model, modes: Modes, record: Record, known: DetectabilityStudy | None = None, *, spacing: float = _USUAL
) -> DetectabilityStudy:
    """Return a study, with the places of one that is `known` of the same modes."""
    seen = told_apart(model, modes, record)
    if len(seen) < 3 or len(model.structure.sensor) < 2:
        raise ModelError(
            f"{model.structure.name}: to locate a mass, expected at least two sensors that measure three modes up to "
            f"{record.highest:g} Hz, found {len(model.structure.sensor)} that measure {len(seen)}"
        )
    reference = expected_reference(model, modes, seen, record)
    if known is not None:
        return replace(known, record=record, reference=reference)
    places = propose_added_mass(reference, compare(reference, reference.baseline), spacing)
    return DetectabilityStudy(record=record, reference=reference, places=places, modal_mass=_modal_mass(places))


def _modal_mass(places: AddedMass) -> FloatArray:
    here = places.translation  # (n_places, 3, n_modes)
    rows = here.transpose(0, 2, 1)
    offset = rows @ places.by_offset
    changes = np.stack([rows @ here, *(offset + offset.transpose(0, 1, 3, 2))])
    return np.ascontiguousarray(changes.transpose(2, 3, 0, 1))


def heaviest(outlook: DetectabilityStudy) -> float:
    """Return the mass [kg] above which a place counts as blind."""
    return _HEAVY * outlook.reference.model.total_mass()


def blind(outlook: DetectabilityStudy, weakest: list[float], member: int) -> Stretches:
    """Return the stretches of a member [m] on which a tenth of the structure's mass raises no alarm.

    Parameters
    ----------
    outlook : of the structure
    weakest : (n_places,) mass that raises the alarm [kg]
    member : its index
    """
    found: Stretches = []
    going = False
    for here, position, mass in zip(outlook.member, outlook.places.position, weakest, strict=True):
        if here != member or mass <= heaviest(outlook):
            going = False
        elif going:
            found[-1] = found[-1][0], float(position)
        else:
            found.append((float(position), float(position)))
            going = True
    return found
