"""Removal of a drift from the modes of windows, for the state at their mean time."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from daq import FloatArray, IndexArray
from oma import ModalEstimate

_FEWEST = 4  # windows that show a mode, from which its drift is removed


def without_drift(estimates: Sequence[ModalEstimate], tracks: Sequence[IndexArray]) -> tuple[ModalEstimate, ...]:
    """Remove the lines in time from frequencies and shapes of windows, about the windows' mean time.

    The residuals are enlarged for the slope that was fitted to them.

    Parameters
    ----------
    estimates : of the windows
    tracks : for each window (n_tracks,) indices into its modes, or -1
    """
    time = np.array([estimate.start for estimate in estimates], dtype=np.float64)
    estimates = [_copy(estimate) for estimate in estimates]
    for track in range(len(tracks[0])):
        seen = np.array([w for w, own in enumerate(tracks) if own[track] >= 0])
        if len(seen) < _FEWEST:
            continue
        modes = [int(tracks[w][track]) for w in seen]
        log_frequency = np.log([estimates[w].frequency[mode] for w, mode in zip(seen, modes, strict=True)])
        level = _level(time[seen], log_frequency[:, None])[:, 0]
        for w, mode, value in zip(seen, modes, level, strict=True):
            estimates[w].frequency[mode] = np.exp(value)
        _level_shapes([estimates[w] for w in seen], modes, time[seen])
    return tuple(estimates)


def _copy(estimate: ModalEstimate) -> ModalEstimate:
    return replace(estimate, frequency=estimate.frequency.copy(), shape=estimate.shape.astype(np.complex128))


def _level_shapes(estimates: Sequence[ModalEstimate], modes: Sequence[int], time: FloatArray) -> None:
    """Remove the lines in time from the shapes of one mode, in place; windows that lack channels keep theirs."""
    channels = max((estimate.channels for estimate in estimates), key=len)
    full = [k for k, estimate in enumerate(estimates) if estimate.channels == channels]
    if len(full) < _FEWEST:
        return
    shape = np.array([estimates[k].shape[modes[k]] for k in full])
    turn = shape @ shape[0].conj()
    aligned = shape * (turn.conj() / np.maximum(np.abs(turn), 1e-300))[:, None]
    level = _level(time[full], aligned)
    for k, row in zip(full, level, strict=True):
        estimates[k].shape[modes[k]] = row / np.linalg.norm(row)


def _level(time: FloatArray, value: np.ndarray) -> np.ndarray:
    """Return values (n, m) without their lines in time."""
    n = len(time)
    design = np.column_stack([np.ones(n), (time - time.mean()) / np.ptp(time)])
    rest = value - design @ np.linalg.lstsq(design, value, rcond=None)[0]
    return np.asarray(value.mean(0) + rest * np.sqrt((n - 1) / (n - 2)))
