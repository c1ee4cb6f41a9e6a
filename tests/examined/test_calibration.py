"""Accuracy of a calibrated reference for specimens of another theory, with their welds."""

from dataclasses import replace

import numpy as np
import pytest

from tests.examiner.cases import N_BEFORE
from tests.examiner.models.specimen import draw_state
from tests.examiner.path import FRAME, observation
from tests.examiner.signals import estimated
from updater import Reference, learn_reference


def _learnt(seed: int) -> Reference:
    state = draw_state(seed)
    before = observation(state, estimated(state, N_BEFORE, np.random.default_rng(seed), noise="law"))
    return learn_reference(FRAME, before.estimates, before.tracks, before.lateness.delays)


def _off(reference: Reference) -> float:
    calibrated = np.log(reference.calibration.modes.frequency[reference.paired])
    return float(np.sqrt(np.mean((calibrated - reference.baseline.log_frequency) ** 2)))


@pytest.mark.thorough
def test_flexibility_reduction_by_welds_is_calibrated(monkeypatch: pytest.MonkeyPatch) -> None:
    """Half of the 0.2 % that calibration allows for a beam model remains, and half of the error without welds."""
    seeds = range(7000, 7006)
    welded = [_off(_learnt(seed)) for seed in seeds]
    monkeypatch.setattr("updater.structure.parameters._WELDED", 2e-3)  # no more than the fit starts with
    plain = [_off(_learnt(seed)) for seed in seeds]
    print([f"{100 * a:.3f} % {100 * b:.3f} %" for a, b in zip(welded, plain, strict=True)])
    assert max(welded) < 1e-3
    assert np.median(welded) < 0.5 * np.median(plain)


def test_frame_without_welds_has_no_calibrated_weld_effect() -> None:
    """Less than a fifth of that of a whole one, by two of the parameter's standard deviations."""
    state = draw_state(7010)
    frame = state.frame
    for bar in frame.bars:
        frame = frame.with_bar(bar.name, zones=tuple(z for z in bar.zones if z.bend1 == 1))
    bare = replace(state.of_frame(frame), drawn=state.drawn)
    before = observation(bare, estimated(bare, N_BEFORE, np.random.default_rng(7010), noise="law"))
    reference = learn_reference(FRAME, before.estimates, before.tracks, before.lateness.delays)
    (weld,) = (p for p in reference.calibration.parameters if p.name.startswith("weld"))
    assert weld.value < 2 * weld.std
