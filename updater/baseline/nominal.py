"""Reference made from the structure file alone, for errors of the file against measured modes.

If the file is far off - by more than 5 % in the median frequency - the model is moved first: its parameters are fitted
to the measured frequencies, then to shapes too, with modes paired again, until they no longer change. The values of the
file remain the prior.
"""

from collections.abc import Sequence
from dataclasses import replace

from updater.baseline.recalibration import Measured, is_far, model_reference, recalibrated
from updater.modal_data import TrackedModes, learn_scatter, stated_scatter
from updater.reference import NominalModel, Reference, best_model
from updater.structure import Structure, nominal_parameters, with_springs


def nominal_reference(
    structure: Structure,
    windows: TrackedModes,
    devices: Sequence[str] = (),
    *,
    n_modes: int = 30,
    stated: bool = False,
) -> Reference:
    """Return a reference whose baseline is the model's own modes, at the channels of the measured ones.

    Parameters
    ----------
    structure : as in the file; rigid feet and joints get springs that are stiff enough to have no effect. If it is far
        off, the reference is of a recalibrated one, and `nominal` of this
    windows : (n_windows, n_tracks) modes that the model is to be compared with
    devices : that sampled the channels; the model has them in time, as well as devices are
    n_modes : of the model to keep, at least
    stated : whether the windows' standard deviations are taken at their word; else their scatter is learnt

    Raises
    ------
    PairingError
        If fewer than three measured modes have a partner in the model.
    ValueError
        With fewer than three windows, unless `stated`.
    """
    scatter = stated_scatter(windows) if stated else learn_scatter(windows)
    measured = Measured(windows=windows, scatter=scatter, devices=devices, n_modes=n_modes, of_file=True)
    there = model_reference(best_model(with_springs(structure)), structure, measured)
    if not there.calibration.knobs or not is_far(there.calibration, measured.mean):
        return there
    found = recalibrated(structure, there, measured, far=True)
    if found is None:  # where too little can be paired with a model it stays where it is
        value = nominal_parameters(there.calibration.knobs)
        return replace(there, nominal=NominalModel(reference=there, value=value, far=True))
    return found.reference
