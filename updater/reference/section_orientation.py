"""Sections that a structure file has with width and height exchanged, by measured modes."""

import math
from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np

from daq import FloatArray
from oma import pair_modes
from updater.errors import ModalDataError, PairingError
from updater.fe import Model, Modes
from updater.modal_data import ModalMean
from updater.quantities import ExchangedSections
from updater.reference.calibration import FREQUENCY_ERROR, best_model, calibrate, channel_rows, enough_modes
from updater.structure import TURNS, Structure, flexibility_unit

_ALIKE = 0.15  # of ln of second moments: a smaller difference may be an error of the section itself
_UNPAIRED = 0.3  # of ln f: a mode without a partner is that far from the model's, or farther (`oma.pair_modes`)
#: natural log of the posterior odds from which an exchange is reported (20), over the odds that one is in a file (0.01)
_CERTAIN = math.log(20.0 / 0.01)
#: times smaller error that an exchange has at least; nearly square sections with moments wrong by 15 % reached 2.4
_FAR_BETTER = 4.0
_MORE_PAIRS = 3  # modes paired by an exchange that are evidence without a smaller error
_MAX_GROUPS = 4  # of members whose combinations are all tried
_CALIBRATED = 2  # exchanges with the least misfit before calibration that are calibrated


def exchanged_sections(structure: Structure, measured: ModalMean) -> ExchangedSections | None:
    """Return the members whose exchanged sections explain measured modes that the file does not.

    Both are calibrated to the frequencies, with the feet as in the file, and with springs in place of rigid ones. The
    scale of the errors is not known beforehand; with a uniform prior of its logarithm, the evidence of n modes is
    rms^-n (Jeffreys). Errors below those of every beam model are no evidence, and each combination of members that is
    tried must explain correspondingly more. Errors of several modes have common causes: the error must be several times
    smaller, however many modes there are.

    Parameters
    ----------
    structure : as in the file
    measured : (n_modes,); channels name sensors of the structure

    Returns
    -------
    None if the file is at least as probable, or no section has two different second moments.
    """
    known = set(measured.channels) <= set(structure.channels)
    tried = list(_combinations(_groups(structure))) if known else []
    as_filed = (structure, _with_springs(structure)) if tried else ()
    at_least = min((_nominal_misfit(one, measured) for one in as_filed), default=0.0)
    turned, nominal = dict[tuple[str, ...], Structure](), dict[tuple[str, ...], float]()
    for members in tried:
        found = {_nominal_misfit(one, measured): one for one in (_turned(one, members) for one in as_filed)}
        nominal[members] = min(found)
        turned[members] = found[nominal[members]]
    nearest = sorted((members for members in tried if nominal[members] < at_least), key=nominal.__getitem__)
    if not nearest:
        return None
    own = min((_calibrated_misfit(one, measured) for one in as_filed), key=_log_rms)
    fitted = {members: _calibrated_misfit(turned[members], measured) for members in nearest[:_CALIBRATED]}
    best = min(fitted, key=lambda members: _log_rms(fitted[members]))
    n, gained = int(np.isfinite(measured.log_frequency).sum()), _log_rms(own) - _log_rms(fitted[best])
    if gained < max(math.log(_FAR_BETTER), (_CERTAIN + math.log(len(tried))) / n):
        return None
    before, after = own[np.isfinite(own)], fitted[best][np.isfinite(fitted[best])]
    if len(after) - len(before) < _MORE_PAIRS and _rms(before) < _FAR_BETTER * max(_rms(after), FREQUENCY_ERROR):
        return None  # by one or two modes alone, which close modes may have cost their partner
    return ExchangedSections(
        members=best,
        paired=len(before),
        paired_exchanged=len(after),
        error_percent=100 * _rms(before) if len(before) else None,
        error_percent_exchanged=100 * _rms(after),
    )


def _groups(structure: Structure) -> list[tuple[str, ...]]:
    """Return members of equal section and kind of direction, upright or not, whose section has two second moments."""
    found: dict[tuple[str, bool], list[str]] = {}
    for member in structure.member if structure.external is None else ():
        about_y, about_z = structure.section[member.section].second_moment
        if abs(math.log(about_y / about_z)) > _ALIKE:
            upright = abs(member.axes[0, 2]) > math.sqrt(0.5)
            found.setdefault((member.section, upright), []).append(member.name)
    return [tuple(members) for members in found.values()]


def _combinations(groups: Sequence[tuple[str, ...]]) -> Iterator[tuple[str, ...]]:
    """Yield the members of each combination of groups; of many groups, of each one and of all."""
    sizes = range(1, len(groups) + 1) if len(groups) <= _MAX_GROUPS else (1, len(groups))
    for size in sizes:
        for chosen in combinations(groups, size):
            yield tuple(name for group in chosen for name in group)


def _turned(structure: Structure, members: Sequence[str]) -> Structure:
    """Return the structure with the sections of some members turned by 90 degrees."""
    own = (
        m.model_copy(update={"local_y": tuple(m.axes[2].tolist())}) if m.name in members else m
        for m in structure.member
    )
    return structure.model_copy(update={"member": tuple(own)})


def _with_springs(structure: Structure) -> Structure:
    """Return the structure with springs of E I / L in place of feet that do not turn.

    The frequencies of rigid feet may be so far off that calibration begins with wrong partners.
    """
    feet = []
    for one in structure.support:
        held = tuple(axis for axis in one.fixed if axis in TURNS)
        springs = {axis: flexibility_unit(structure, axis, one.at) for axis in held}
        fixed = tuple(axis for axis in one.fixed if axis not in TURNS)
        feet.append(one.model_copy(update={"fixed": fixed, "stiffness": dict(one.stiffness) | springs}))
    return structure.model_copy(update={"support": tuple(feet)})


def _nominal_misfit(structure: Structure, measured: ModalMean) -> float:
    """Return the log of the frequency error without calibration, but for a factor on all frequencies."""
    model = best_model(structure)
    rows, frequency = channel_rows(model, measured.channels), np.exp(measured.log_frequency)
    modes = enough_modes(model, rows, float(np.nanmax(frequency)), len(frequency))
    residual = _residual(model, modes, measured)
    return _log_rms(residual - np.nanmedian(residual) if np.isfinite(residual).any() else residual)


def _calibrated_misfit(structure: Structure, measured: ModalMean) -> FloatArray:
    """Return the residuals of ln f (n_modes,) with the calibrated model; NaN without a partner.

    Modes are paired again once the model is calibrated: those whose frequency was too far from the file's, as with
    rigid feet, have no partner before.
    """
    try:
        fitted = calibrate(structure, measured)
    except (PairingError, ModalDataError):
        return np.full(len(measured.log_frequency), np.nan)
    return _residual(fitted.model, fitted.modes, measured)


def _residual(model: Model, modes: Modes, measured: ModalMean) -> FloatArray:
    """Return ln of measured frequencies over those of a model's modes (n_modes,); NaN without a partner."""
    frequency, rows = np.exp(measured.log_frequency), channel_rows(model, measured.channels)
    pairs = pair_modes(frequency, measured.shape, modes.frequency, (rows @ modes.shape).T)
    return np.where(pairs >= 0, np.log(frequency / modes.frequency[pairs]), np.nan)


def _log_rms(residual: FloatArray) -> float:
    """Return the log of the root mean square over the error that no beam model explains, at least 0."""
    known = np.where(np.isfinite(residual), residual, _UNPAIRED)
    return max(math.log(_rms(known) / FREQUENCY_ERROR), 0.0) if len(known) else 0.0


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))
