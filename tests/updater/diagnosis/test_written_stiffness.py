"""The stated stiffness of a foot moved by two causes is the written one."""

import pytest

from tests.support.updater.reference_frame import t_frame
from updater.diagnosis import Cause
from updater.diagnosis.naming import as_written
from updater.quantities import Quantity, Where


def reported(name: str) -> Cause:
    where = Where(member=None, position=(0.0, 0.0, 0.0), position_std=0.0, region=(), channels=())
    stiffness = {"stiffness_rz": Quantity(value=8e5, std=4e4, unit="N m/rad")}
    return Cause(cause=name, probability=0.9, where=where, parameters=stiffness)


def test_foot_stiffness_is_reported_as_written_to_the_file() -> None:
    frame = t_frame()
    [foot] = frame.support
    softer = foot.model_copy(update={"fixed": ("x", "y", "z", "rx", "ry"), "stiffness": {"rz": 6e5}})
    found = as_written(reported("support_stiffness"), frame.model_copy(update={"support": (softer,)}), frame)
    assert found.parameters["stiffness_rz"].value == 6e5
    assert found.parameters["stiffness_rz"].std == pytest.approx(4e4 * (6 / 8) ** 2)


def test_other_cause_is_reported_unchanged() -> None:
    assert as_written(reported("support_spring"), t_frame(), t_frame()) == reported("support_spring")
