"""The gain of a structure with its causes written in, over all modes that windows show."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from daq import IndexArray
from updater.causes import SelectedCause, prediction
from updater.diagnosis.held_out_gain import Gained, change_gain_left_out, change_gain_on, gain_of
from updater.inference import Comparison, compare
from updater.modal_data import ModalMean
from updater.reference import ModelFit, Reference, fit_of_model
from updater.structure import Structure, dump_structure, parse_structure


@dataclass(frozen=True, eq=False)
class WindowModes:
    """Modes of some windows."""

    event: ModalMean  #: (n_tracks,) in the order of the baseline's tracks, NaN where there is none
    every: ModalMean  #: (n_modes,) all that were measured, in any order

    @classmethod
    def of(cls, event: ModalMean, every: ModalMean | None) -> Self:
        """Return modes; all are those of the tracks where no others are given."""
        return cls(event, event.only(np.flatnonzero(np.isfinite(event.log_frequency))) if every is None else every)

    def rows(self, modes: ModalMean) -> IndexArray:
        """Return which of all modes some of them (n,) are: those of the same frequency."""
        return np.asarray(np.argmin(np.abs(self.every.log_frequency - modes.log_frequency[:, None]), axis=1))


def written_gain(
    reference: Reference,
    data: Comparison,
    measured: WindowModes,
    heldout: WindowModes | None,
    chosen: Sequence[SelectedCause],
    written: tuple[Structure, Structure],
) -> Gained:
    """Return the gain of a written structure over the same without causes.

    Parameters
    ----------
    reference : that the causes were sought with
    data, measured : the modes that were explained
    heldout : modes of windows that were not used, which the gain is measured on where they have all channels
    chosen : causes
    written : the structure without causes, and with them written into it
    """
    unused = compare(reference, heldout.event) if heldout else None
    if heldout and unused is not None and unused.channels == data.channels:
        change, data, modes = change_gain_on(unused, chosen), unused, heldout
    else:
        change, modes = change_gain_left_out(data, chosen), measured
    before, after = (fit_of_written(reference, data, modes, s, c) for s, c in zip(written, (None, chosen), strict=True))
    return gain_of(before, after, change, heldout=modes is heldout)


def fit_of_written(
    reference: Reference,
    data: Comparison,
    modes: WindowModes,
    structure: Structure,
    chosen: Sequence[SelectedCause] | None,
) -> ModelFit:
    """Return the fit of a structure, as it is read back from its text, to all modes of windows.

    Parameters
    ----------
    reference : that the causes were sought with
    data : these modes compared with the baseline's
    structure : with the causes chosen, if any, written in
    """
    structure = parse_structure(dump_structure(structure))
    expected = np.full(len(modes.every.n), np.nan)
    ratio = prediction(data, chosen).log_ratio[0]
    # the model's own frequencies, which it may miss the measured ones by
    frequency = reference.calibration.modes.frequency if reference.measured else data.frequency
    expected[modes.rows(modes.event.only(data.tracks))] = frequency[data.paired] * np.exp(ratio)
    every = modes.every.at(data.channels)
    return fit_of_model(structure, every, expected=expected, overdispersion=data.overdispersion)


def fit_of_compared(
    reference: Reference, data: Comparison, modes: WindowModes, written: Structure, chosen: Sequence[SelectedCause]
) -> ModelFit:
    """Return the fit of a written structure to the modes compared, then to those that the baseline has not."""
    rows = modes.rows(modes.event.only(data.tracks))
    if data.circumstances.extra is not None:
        rows = np.concatenate([rows, modes.rows(data.circumstances.extra)])
    return fit_of_written(reference, data, modes, written, chosen).only(rows)
