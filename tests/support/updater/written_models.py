"""A diagnosis whose written file is loaded and diagnosed again: it is evaluated from the file alone."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from daq import FloatArray
from monitor.analysis.explanation import Explanation, explain
from tests.examiner.cases import N_BEFORE, Case
from tests.examiner.path import after, observation, stiffer, structure_of
from tests.examiner.signals import N_MODES, estimated, is_seen
from updater import Structure, build_model, dump_structure, parse_structure

_MIN_MOTION = 1e-3  # of the largest mode at the sensors: what moves less is not seen
_MIN_LIKENESS = 0.7  # MAC of a mode that is the same


@dataclass(frozen=True, kw_only=True)
class Loop:
    """A case diagnosed, and the written file evaluated by itself."""

    found: Explanation
    written: Structure | None  #: loaded from the text
    error: float | None = None  #: of the file's frequencies on the held-out windows, root mean square [%]
    true_error: float | None = None  #: of the same without measurement noise [%]
    again: Explanation | None = None  #: the file diagnosed against fresh windows


def closed_loop(case: Case, *, only: Sequence[str] = (), again_only: Sequence[str] = ()) -> Loop:
    """Diagnose a case, load the written file, and diagnose that against fresh windows."""
    random, state = np.random.default_rng((case.seed, 6)), case.done.before
    structure = stiffer(structure_of(case.cell), case.far) if case.built else structure_of(case.cell)
    before = None if case.built else observation(state, estimated(state, N_BEFORE, random, noise="law"))
    now, heldout = (after(case, random) for _ in range(2))
    found = explain(structure, before, now, heldout, only=only)
    if found.explained.extended is None:
        return Loop(found=found, written=None)
    written = parse_structure(dump_structure(found.explained.extended))
    reported = after(case, random, known=written)
    mean = found.sought.mean_of(heldout.modes)
    seen = is_seen(case.done.after, N_MODES)
    shape = case.done.after.claimed_shape(N_MODES)[seen]
    return Loop(
        found=found,
        written=written,
        error=file_error(written, mean.channels, np.exp(mean.log_frequency), mean.shape),
        true_error=file_error(
            written, case.done.after.channels, case.done.after.claimed_frequency(N_MODES)[seen], shape
        ),
        again=explain(written, None, reported, only=again_only),
    )


def file_error(structure: Structure, channels: tuple[str, ...], frequency: FloatArray, shape: FloatArray) -> float:
    """Return the root mean square error [%] of a structure's frequencies, paired by an assignment of this helper's own.

    Parameters
    ----------
    frequency, shape : (n,) [Hz] and (n, n_channels) measured
    """
    model = build_model(structure, shear_flexible=True, mass="consistent")
    modes = model.modes(min(60, model.n_dofs))
    rows = model.sensor_rows[[structure.channels.index(c) for c in channels]]
    at_sensors = (rows @ modes.shape).T
    length = np.linalg.norm(at_sensors, axis=1)
    moving = length > _MIN_MOTION * length.max()
    unit = at_sensors[moving] / length[moving, None]
    likeness = (shape / np.linalg.norm(shape, axis=1, keepdims=True) @ unit.T) ** 2
    apart = np.log(frequency[:, None] / modes.frequency[moving])
    measured, own = linear_sum_assignment(1 - likeness + 2 * np.abs(apart))
    same = likeness[measured, own] > _MIN_LIKENESS  # of a twist whose sensors are on the axis they see hardly any
    return 100 * float(np.sqrt(np.mean(apart[measured, own][same] ** 2)))
