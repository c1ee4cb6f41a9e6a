"""A change brings two modes together, and one of them is identified twice."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from monitor.watch.baseline.learned_baseline import LearnedBaseline
from oma import ModalEstimate
from tests.support.updater.frames import t_frame, t_truth, unmoved
from updater import learn_reference, locate_mass


def once_more(estimate: ModalEstimate) -> ModalEstimate:
    """Return modes with the third one in place of the fourth, too, its shape less certain."""
    columns = {}
    for name in ("frequency", "frequency_std", "shape", "shape_std"):
        columns[name] = getattr(estimate, name).copy()
        columns[name][3] = columns[name][2] * (2.0 if name == "shape_std" else 1.0)
    return replace(estimate, **columns)


def test_mean_of_windows_has_a_mode_once() -> None:
    truth = t_truth(3)
    model = truth.model()
    before, now = (truth.windows(model.modes(8), model.sensor_rows, n, seed) for n, seed in ((8, 1), (4, 2)))
    reference = learn_reference(t_frame(), before, unmoved(8))
    modes = SimpleNamespace(mean=reference.baseline, scatter=reference.scatter)
    learned: Any = SimpleNamespace(modes=modes, modes_of=lambda estimate: np.arange(estimate.n_modes))
    windows: list[Any] = [SimpleNamespace(synchronized=once_more(estimate)) for estimate in now]
    mean = LearnedBaseline.mean_of(learned, windows)
    assert np.flatnonzero(np.isnan(mean.log_frequency)).tolist() == [3]
    assert locate_mass(reference, mean).mass_std > 0  # it refuses one mode on two tracks
