"""Measured against simulated modes, sensors and residual forces, before any cause is sought.

Modes are compared by frequency and MAC; those without a partner on either side are listed. A sensor is evaluated by all
paired modes together: COMAC, and its difference from the simulated shapes, each with its best scale, compared with that
of noise alone.

References
----------
Lieven & Ewins, "Spatial correlation of mode shapes, the coordinate modal assurance criterion (COMAC)", IMAC VI (1988)
690-695; Allemang, "The modal assurance criterion: twenty years of use and abuse", Sound and Vibration 37 (2003) 14-21.
"""

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from daq import FloatArray, IndexArray
from oma import mac_matrix
from updater.errors import ModalDataError
from updater.modal_data import ModalMean, match_modes
from updater.reference import Reference, best_model, channel_rows
from updater.structure import Structure

_ROOM = 1.1  # of the highest measured frequency: up to here a simulated mode should have been seen
_MODAL = tuple(field.name for field in fields(ModalMean) if field.name != "channels")
_SEEN = 1e-3  # relative to the largest simulated mode at the sensors: a smaller motion is not expected to be measured


@dataclass(frozen=True, eq=False, kw_only=True)
class ModalCorrelation:
    """Measured modes compared with simulated ones; -1 and NaN without a partner."""

    channels: tuple[str, ...]
    simulated: FloatArray  #: (n_simulated,) frequencies [Hz]
    measured: FloatArray  #: (n_measured,) frequencies [Hz]
    measured_std: FloatArray  #: (n_measured,) [Hz]
    partner: IndexArray  #: (n_simulated,) the measured mode of each, or -1
    off: FloatArray  #: (n_simulated,) ln of measured over simulated frequency [-]
    off_std: FloatArray  #: (n_simulated,) of both [-]
    mac: FloatArray  #: (n_simulated, n_measured); NaN where a shape was not measured
    comac: FloatArray  #: (n_channels,)
    #: (n_channels,) residual of the measured shapes against the simulated ones, relative to their root mean square [-]
    residual: FloatArray
    residual_std: FloatArray  #: (n_channels,) root mean square of it that noise alone would leave [-]

    @property
    def extra(self) -> IndexArray:
        """Measured modes without a simulated partner."""
        return np.setdiff1d(np.arange(len(self.measured)), self.partner)

    @property
    def unseen(self) -> IndexArray:
        """Simulated modes that were not measured."""
        return np.flatnonzero(self.partner < 0)


def correlate_modes(simulated: ModalMean, measured: ModalMean) -> ModalCorrelation:
    """Compare measured modes with simulated ones.

    Parameters
    ----------
    simulated : (n_simulated,) modes of a model, or of the structure as it was, with their deviations
    measured : (n_measured,) in any order

    Raises
    ------
    ModalDataError
        If fewer than two channels are common to both.
    """
    channels = tuple(c for c in simulated.channels if c in measured.channels)
    if len(channels) < 2:
        raise ModalDataError(f"channels to compare: expected at least 2 in both, found {len(channels)}")
    simulated, measured = simulated.at(channels), known(measured.at(channels))
    partner = match_modes(simulated, measured)
    seen = np.flatnonzero(partner >= 0)
    now, model = measured.only(partner[seen]), simulated.only(seen)
    off, off_std = np.full((2, len(partner)), np.nan)
    off[seen] = now.log_frequency - model.log_frequency
    off_std[seen] = np.hypot(now.log_frequency_std, model.log_frequency_std)
    comac, residual, residual_std = _by_sensor(model, now)
    frequency = np.exp(measured.log_frequency)
    return ModalCorrelation(
        channels=channels,
        simulated=np.exp(simulated.log_frequency),
        measured=frequency,
        measured_std=frequency * measured.log_frequency_std,
        partner=partner,
        off=off,
        off_std=off_std,
        mac=mac_matrix(simulated.shape, measured.shape),
        comac=comac,
        residual=residual,
        residual_std=residual_std,
    )


def known(modes: ModalMean) -> ModalMean:
    """Return the modes that were seen at all."""
    return modes.only(np.flatnonzero(np.isfinite(modes.log_frequency) & np.isfinite(modes.shape).all(1)))


def _by_sensor(model: ModalMean, now: ModalMean) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return COMAC, residual and its noise (n_channels,) of paired modes."""
    along = (now.shape * model.shape).sum(1, keepdims=True) / (model.shape**2).sum(1, keepdims=True)
    expected = along * model.shape
    cross = np.abs(now.shape * expected).sum(0) ** 2
    comac = cross / np.maximum((now.shape**2).sum(0) * (expected**2).sum(0), 1e-300)
    typical = np.sqrt((now.shape**2).mean())
    rest = np.sqrt(((now.shape - expected) ** 2).mean(0)) / typical
    noise = np.sqrt((now.shape_std**2 + (along * model.shape_std) ** 2).mean(0)) / typical
    return comac, rest, noise


def modes_before(reference: Reference, highest: float) -> ModalMean:
    """Return the modes that a reference expects: its baseline's, and the model's others that sensors should see.

    A mode of the baseline without a confident match in the model represents the nearest one: a mode that was measured
    before is not new, however far off the model is.

    Parameters
    ----------
    reference : of the structure as it was, or of the nominal model
    highest : frequency up to which modes were measured [Hz]
    """
    base = reference.baseline
    at = reference.at_channels(base.channels)
    length = np.linalg.norm(at, axis=0)
    others = np.setdiff1d(np.flatnonzero(length > _SEEN * length.max()), reference.paired)
    others = others[reference.frequency[others] < _ROOM * highest]
    lone = _simulated(base, np.log(reference.frequency[others]), (at[:, others] / length[others]).T)
    if reference.unpaired_modes is None:
        return _in_order(base, lone)
    measured = known(reference.unpaired_modes)
    measured = measured.only(np.flatnonzero(measured.log_frequency < np.log(_ROOM * highest)))
    return _in_order(base.joined(measured), lone.only(np.flatnonzero(match_modes(lone, measured) < 0)))


def modes_with_causes(reference: Reference, extended: Structure, expected: ModalMean) -> ModalMean:
    """Return the modes that a reference expects once causes are written into its structure.

    The difference between the two models is added to the expected modes, so that their common errors remain; a mode
    that only the extended one has, of an attached oscillator, is taken from it. Exchanged channels have the signals of
    each other: that is not a difference to add.

    Parameters
    ----------
    reference : that was diagnosed
    extended : its structure with the causes written in
    expected : (n,) by `modes_before`
    """
    own = reference.structure
    carried = _carried(own, extended, expected.channels)
    before, after = _of_model(own, expected), _of_model(extended, expected, carried)
    old, new = match_modes(expected, before), match_modes(before, after)
    new = np.where(old >= 0, new[np.maximum(old, 0)], -1)
    there = np.flatnonzero(new >= 0)
    one, other = before.only(old[there]), after.only(new[there])
    kept = expected.only(there)
    turned = np.sign((one.shape * kept.shape).sum(1, keepdims=True)) * one.shape
    along = (other.shape * turned).sum(1, keepdims=True)
    shape = kept.shape + other.shape / np.where(np.abs(along) < 1e-6, 1.0, along) - turned
    changed = replace(
        kept,
        log_frequency=kept.log_frequency + other.log_frequency - one.log_frequency,
        shape=shape / np.linalg.norm(shape, axis=1, keepdims=True),
    )
    fresh = np.setdiff1d(np.flatnonzero(after.log_frequency <= expected.log_frequency.max()), new)
    return replace(_in_order(changed, after.only(fresh)), channels=carried).at(expected.channels)


def as_written(extended: Structure, like: ModalMean) -> ModalMean:
    """Return the modes of a structure with causes written in, as they follow from its file."""
    return _of_model(extended, like)


def _carried(own: Structure, extended: Structure, channels: tuple[str, ...]) -> tuple[str, ...]:
    """Return the channels of the sensors with the causes; unchanged if these are not among them."""
    carrier = dict(zip(own.channels, extended.channels, strict=True))
    carried = tuple(carrier[channel] for channel in channels)
    return carried if set(carried) == set(channels) else channels


def _of_model(structure: Structure, like: ModalMean, channels: tuple[str, ...] | None = None) -> ModalMean:
    """Return the modes of a structure, as `like` has them; at its channels unless others are given."""
    model = best_model(structure)
    modes = model.modes(min(30, model.n_dofs))
    at = (channel_rows(model, channels or like.channels) @ modes.shape).T
    length = np.linalg.norm(at, axis=1)
    seen = np.flatnonzero(length > _SEEN * length.max())
    return _simulated(like, np.log(modes.frequency[seen]), at[seen] / length[seen, None])


def _simulated(like: ModalMean, log_frequency: FloatArray, shape: FloatArray) -> ModalMean:
    """Return modes of a model, with the median deviations of `like`; unknown values are NaN."""
    n = len(log_frequency)
    given: dict[str, Any] = {
        "n": np.zeros(n, np.intp),
        "log_frequency": log_frequency,
        "log_frequency_std": np.full(n, np.nanmedian(like.log_frequency_std)),
        "shape": shape,
        "shape_std": np.full(shape.shape, np.nanmedian(like.shape_std)),
    }
    unknown: dict[str, Any] = {
        name: np.full((n, *getattr(like, name).shape[1:]), np.nan) for name in _MODAL if name not in given
    }
    return ModalMean(channels=like.channels, **given, **unknown)


def _in_order(one: ModalMean, other: ModalMean) -> ModalMean:
    """Return the modes of both, ascending in frequency."""
    both: dict[str, Any] = {name: np.concatenate([getattr(one, name), getattr(other, name)]) for name in _MODAL}
    return ModalMean(channels=one.channels, **both).only(np.argsort(both["log_frequency"], kind="stable"))
