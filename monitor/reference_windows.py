"""Windows of reference logs that show another state: left out, and reported."""

from collections.abc import Sequence

import numpy as np

from daq import FloatArray, IndexArray
from monitor.observation import Observation
from monitor.stretches import utc
from updater import ReferenceStep, windows_of_one_state

_DAY = 86400.0  # s


def of_one_state(observation: Observation) -> tuple[Observation, tuple[ReferenceStep, ...]]:
    """Return the windows of the state that most of them show, and the changes to the others."""
    order = np.argsort([estimate.start for estimate in observation.estimates], kind="stable")
    ordered = observation.chosen(order)
    seconds = _seconds([estimate.start for estimate in ordered.estimates])
    kept, changes = windows_of_one_state(ordered.modes, seconds, ordered.temperature, ordered.rms)
    if not changes:
        return observation, ()
    lost = np.setdiff1d(np.arange(len(order)), kept)
    runs = np.split(lost, np.flatnonzero(np.diff(lost) > 1) + 1)
    steps = tuple(_step(ordered, kept, run, max(change.p_value for change in changes)) for run in runs)
    return ordered.chosen(kept), steps


def step_text(step: ReferenceStep) -> str:
    """Return a sentence on windows that are left out."""
    k = int(np.argmax(np.abs(step.shift_percent)))
    return (
        f"the structure was in another state from {utc(step.start)} to {utc(step.end)}: the mode at "
        f"{step.frequency[k]:.4g} Hz moved by {step.shift_percent[k]:+.2g} ± {step.shift_std_percent[k]:.1g} %; "
        f"{step.n_windows} of {step.of_windows} windows are left out"
    )


def _step(observation: Observation, kept: IndexArray, run: IndexArray, p_value: float) -> ReferenceStep:
    used, left = observation.modes.windows(kept), observation.modes.windows(run)
    seen = np.isfinite(used.log_frequency).any(0) & np.isfinite(left.log_frequency).any(0)
    mean = [np.nanmean(m.log_frequency[:, seen], axis=0) for m in (used, left)]
    n = [np.isfinite(m.log_frequency[:, seen]).sum(0) for m in (used, left)]
    std = np.nanstd(used.log_frequency[:, seen], axis=0, ddof=1) * np.sqrt(1 / n[0] + 1 / n[1])
    first, last = observation.estimates[run[0]], observation.estimates[run[-1]]
    return ReferenceStep(
        start=first.start,
        end=last.end,
        n_windows=len(run),
        of_windows=len(observation.estimates),
        frequency=tuple(np.exp(mean[0]).tolist()),
        shift_percent=tuple((100 * np.expm1(mean[1] - mean[0])).tolist()),
        shift_std_percent=tuple((100 * std).tolist()),
        p_value=p_value,
    )


def _seconds(starts: Sequence[int]) -> FloatArray:
    """Return the starts (n_windows,) from the first on [s]; a day apart where files do not state them."""
    seconds = (np.array(starts) - starts[0]) * 1e-9
    return seconds if np.all(np.diff(seconds) > 0) else _DAY * np.arange(len(starts), dtype=np.float64)
