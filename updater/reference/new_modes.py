"""Modes of a log that are new: neither measured before nor modes of the model."""

from dataclasses import fields

import numpy as np

from daq import FloatArray, IndexArray
from oma import mac_matrix
from updater.modal_data import ModalMean, match_modes, matched, may_answer, without_fault
from updater.reference.reference import NEAR, SAME_SHAPE, Reference

_NEAR = 0.05  # of ln f: how far a mode may have moved, and how near others are that it mixes with
_ALIKE = 0.8  # share of a shape that is of them
_FEWEST = 3  # modes that a diagnosis compares
_SEEN = 0.1  # relative to the motion of sensors by the measured modes


def matched_and_new(reference: Reference, event: ModalMean) -> tuple[IndexArray, IndexArray]:
    """Return the mode of each of the baseline's tracks (n_tracks,), -1 for none, and which modes are new (n_new,).

    One of two close modes was perhaps not separated from the other before: a counterpart of the model is not new.

    Parameters
    ----------
    reference : with the modes of the baseline and of the model
    event : (n_modes,) at some of the baseline's channels
    """
    channels = tuple(c for c in reference.baseline.channels if c in event.channels)
    event = event.at(channels)
    found = match_modes(reference.known.at(channels), event)
    new = np.setdiff1d(np.arange(len(event.log_frequency)), found)
    found, new = _without_doubles(reference, event, found, new)
    found, new = _without_rivals(reference.known.at(channels), event, found, new)
    frequency, shape = reference.frequency, reference.at_channels(channels)
    size = np.linalg.norm(shape, axis=0)
    of_model = np.setdiff1d(np.flatnonzero(size > _SEEN * np.median(size[reference.paired])), reference.paired)
    known = []
    for own in of_model.tolist():
        beside = shape[:, np.abs(np.log(frequency / frequency[own])) < _NEAR]
        fits = [mode for mode in new.tolist() if mode not in known and _answers(event, mode, frequency[own], beside)]
        known += sorted(fits, key=lambda mode: abs(event.log_frequency[mode] - np.log(frequency[own])))[:1]
    return found[: len(reference.baseline.n)], np.setdiff1d(new, known)


def _without_doubles(
    reference: Reference, event: ModalMean, found: IndexArray, new: IndexArray
) -> tuple[IndexArray, IndexArray]:
    """Leave out similar modes where the model has a mode that sensors hardly measure: either may be the other.

    A twist contains a part of the adjacent bending mode, and the sensors measure this part.
    """
    found = found.copy()
    for track in np.flatnonzero(reference.ambiguous_tracks & (found[: len(reference.baseline.n)] >= 0)).tolist():
        alike = mac_matrix(event.shape[new], event.shape[found[track], None])[:, 0] > SAME_SHAPE
        near = np.abs(event.log_frequency[new] - event.log_frequency[found[track]]) < NEAR
        if (alike & near).any():
            found[track], new = -1, new[~(alike & near)]
    return found, new


def _without_rivals(
    baseline: ModalMean, event: ModalMean, found: IndexArray, new: IndexArray
) -> tuple[IndexArray, IndexArray]:
    """Leave out a mode of the baseline whose shape changed so much that either of two modes may have followed it.

    A bearing that loses most of its stiffness moves each mode half of the way to the next one's shape and frequency.
    Two similar modes of the event are no rivals: an oscillator splits one. Modes left out are data again once causes
    are found (`updater.diagnosis.model_extension`). At least three are left.

    Parameters
    ----------
    baseline, event : (n_tracks,) and (n_modes,) at the same channels
    found : (n_tracks,) mode of the event for each of the baseline, -1 where there is none
    new : (n_new,) modes of the event without one of the baseline
    """
    tracks = np.flatnonzero(found >= 0)
    corrected = without_fault(baseline, event)
    likeness = mac_matrix(baseline.shape[tracks], corrected.shape)
    changed = likeness[np.arange(len(tracks)), found[tracks]] < SAME_SHAPE
    split = mac_matrix(corrected.shape[found[tracks]], corrected.shape[new]) > SAME_SHAPE
    rival = may_answer(baseline.only(tracks), corrected.only(new)) & changed[:, None] & ~split
    if (~rival.any(1)).sum() < _FEWEST:
        return found, new
    found = found.copy()
    found[tracks[rival.any(1)]] = -1
    return found, new[~rival.any(0)]


def matched_surely(reference: Reference, event: ModalMean, original: ModalMean | None = None) -> ModalMean:
    """Return the event's modes in the order of the baseline's tracks, NaN if there is none or it is uncertain.

    Parameters and errors as for `matched`.
    """
    corrected = matched(reference.known, event, original).only(np.arange(len(reference.baseline.n)))
    found, _ = matched_and_new(reference, event)
    for name in (field.name for field in fields(corrected) if field.name not in {"channels", "n"}):
        getattr(corrected, name)[found < 0] = np.nan
    return corrected


def _answers(event: ModalMean, mode: int, frequency: float, shapes: FloatArray) -> bool:
    """Return whether a mode is near a frequency [Hz], and its shape a mixture of others (n_channels, n)."""
    if not abs(event.log_frequency[mode] - np.log(frequency)) < _NEAR:
        return False
    shape = event.shape[mode]
    if not np.isfinite(shape).all():
        return True
    basis, _ = np.linalg.qr(shapes)
    return bool(((basis.T @ shape) ** 2).sum() > _ALIKE * (shape @ shape))
