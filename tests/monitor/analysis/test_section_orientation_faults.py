"""The test for exchanged sections as an optional part of an error or a table."""

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from monitor.analysis.explanation import _errors_of_state
from monitor.analysis.observation import Observation
from monitor.cli.data.identify.identification import exchanged_in
from monitor.errors import StateError
from oma import ModalEstimate
from tests.support.updater.reference_frame import t_frame
from updater import PairingError
from updater.validation import ModelModes


def test_fault_in_the_test_of_sections_keeps_the_error_of_the_modes(caplog: pytest.LogCaptureFixture) -> None:
    without_modes = cast(Observation, SimpleNamespace())
    with (
        pytest.raises(StateError, match=r"^only 2 of the modes$"),
        _errors_of_state("current", t_frame(), without_modes),
    ):
        raise PairingError("only 2 of the modes")
    assert "the test of the sections' orientation is left out: AttributeError" in caplog.text


@pytest.mark.parametrize("n_below", [0, 2])
def test_sections_are_not_tested_by_fewer_than_three_modes(n_below: int, caplog: pytest.LogCaptureFixture) -> None:
    model = cast(ModelModes, SimpleNamespace(structure=t_frame()))
    estimate = cast(ModalEstimate, SimpleNamespace(frequency=np.r_[np.arange(n_below) + 10.0, 46.0, 47.0, 48.0]))
    assert exchanged_in(model, estimate, 100.0) is None
    assert not caplog.text
