"""Frequency responses of universal files."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyuff

from daq import DataError
from daq.files import read_responses
from tests.support.daq.responses import frequency_response

LINE = np.arange(1, 201) * 0.5
VALUES = np.random.default_rng(58).standard_normal((200, 2, 2)) @ [1, 1j]


def response(values: Any, node: int, *, force: int = 7, motion: int = 12, line: Any = LINE, **more: Any) -> Any:
    places = {"rsp_node": node, "ref_node": force, "ref_dir": -3, "ordinate_spec_data_type": motion}
    return frequency_response(values, line, **places | more)


def universal(path: Path, *sets: Any) -> Path:
    pyuff.UFF(str(path)).write_sets(list(sets), "overwrite")
    return path


def test_receptances_and_mobilities_become_accelerances(tmp_path: Path) -> None:
    omega = 2j * np.pi * LINE
    path = universal(
        tmp_path / "frf.uff",
        response(VALUES[:, 0] / omega**2, 1, motion=8),
        response(VALUES[:, 1] / omega, 2, motion=11),
    )
    found = read_responses(path)
    assert (found.outputs, found.inputs) == (("1_x", "2_x"), ("7_-z",))
    np.testing.assert_allclose(found.frequency, LINE, rtol=1e-6)
    np.testing.assert_allclose(found.response[:, :, 0], VALUES, rtol=1e-5)


def test_several_forces_and_names_of_id_lines(tmp_path: Path) -> None:
    sets = [response(VALUES[:, k], 0, force=f, id1=name) for f in (1, 2) for k, name in enumerate(("left", "top"))]
    found = read_responses(universal(tmp_path / "frf.uff", *sets))
    assert (found.outputs, found.inputs) == (("left", "top"), ("1_-z", "2_-z"))
    assert found.response.shape == (200, 2, 2)


def test_units_of_length_force_and_gravity_are_converted(tmp_path: Path) -> None:
    """Millimetres and millinewtons: accelerances of mm/s2/mN are those of m/s2/N."""
    units = {"type": 164, "units_code": 5, "length": 1000.0, "force": 1000.0, "temp": 1.0, "temp_offset": 273.15}
    sets = [response(VALUES[:, 0], 1), response(VALUES[:, 1], 2, ordinate_axis_units_lab="g")]
    found = read_responses(universal(tmp_path / "frf.uff", units, *sets))
    np.testing.assert_allclose(found.response[:, 0, 0], VALUES[:, 0], rtol=1e-5)
    np.testing.assert_allclose(found.response[:, 1, 0], 9.80665e3 * VALUES[:, 1], rtol=1e-5)


def test_hammer_that_moves_has_its_responses_by_reciprocity(tmp_path: Path) -> None:
    sets = [response(VALUES[:, 0], 1, force=7), response(VALUES[:, 1], 1, force=8)]
    found = read_responses(universal(tmp_path / "frf.uff", *sets)).by_reciprocity
    assert (found.outputs, found.inputs) == (("7_-z", "8_-z"), ("1_x",))
    np.testing.assert_allclose(found.response[:, 1, 0], VALUES[:, 1], rtol=1e-5)


@pytest.mark.parametrize(
    ("sets", "says"),
    [
        ([response(VALUES[:, 0], 1), response(VALUES[:, 0], 1)], "dataset 2: the response of 1_x to 7_-z is in the fi"),
        (
            [response(VALUES[:, 0], 1), response(VALUES[:100, 0], 2, line=LINE[:100])],
            "dataset 2: expected the lines of",
        ),
        (
            [response(VALUES[:, 0], 1), response(VALUES[:, 0], 2, force=8)],
            "holds no response of 1_x to a force at 8_-z",
        ),
        ([response(VALUES[:, 0], 1, motion=15)], "dataset 1: expected motion per force, found data of type 15 per 13"),
        ([response(VALUES[:, 0], 1) | {"func_type": 1}], "holds no frequency response"),
    ],
)
def test_inconsistent_responses_are_refused(tmp_path: Path, sets: Any, says: str) -> None:
    with pytest.raises(DataError, match=rf"frf\.uff: {says}"):
        read_responses(universal(tmp_path / "frf.uff", *sets))
