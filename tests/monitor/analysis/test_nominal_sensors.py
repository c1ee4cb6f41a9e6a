"""Faults of the measuring chain named without a reference, together with errors of the file; extended, none is left."""

import numpy as np
import pytest

from monitor.analysis.explanation import explain
from monitor.analysis.observation import follow
from tests.examiner.cases import N_AFTER, draw
from tests.examiner.path import FRAME, observation
from tests.examiner.signals import estimated
from tests.support.thorough import few_of
from updater import dump_structure, parse_structure


@pytest.mark.parametrize(("cell", "seed"), few_of([("sensor_delay", 600), ("sensor_polarity", 600)]))
def test_sensor_fault_is_identified_and_corrected_without_a_reference(cell: str, seed: int) -> None:
    """The truth is another model: the fault, and the errors of the file; then fresh windows contain nothing more."""
    case = draw(cell, seed)
    random = np.random.default_rng(seed)
    state = case.done.after
    (hidden,) = case.done.hidden
    found = explain(FRAME, None, observation(state, estimated(state, N_AFTER, random, noise="law"))).explained
    assert found.diagnosis.verdict == "explained"
    named = {c.cause: c for c in found.diagnosis.causes}
    assert set(named) in ({cell, "support_stiffness"}, {cell, "model_parameters"})
    where = named[cell].where
    assert where is not None
    assert where.channels == hidden.channels
    for name, value in hidden.parameters.items():
        assert abs(named[cell].parameters[name].value - value) < 5e-5  # s
    assert found.extended is not None
    extended = parse_structure(dump_structure(found.extended))
    fresh = observation(state, estimated(state, N_AFTER, random, noise="law"))
    devices = {s.channel: s.device for s in state.sensors}
    seen = [(e.start, state.temperature, 0.01) for e in fresh.windows.estimates]
    again = follow(fresh.windows, devices, seen, None, extended.delays)
    corrected = explain(extended, None, again, only=(cell, "support_stiffness", "model_parameters")).explained
    assert corrected.diagnosis.verdict == "nothing_to_explain"
