"""Frequency responses of universal files, with coherences and headers: read and written."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyuff

from daq import DataError, FloatArray
from daq.files import FrequencyResponses, Header, header_set, read_header, read_responses, write_responses
from tests.support.daq.responses import COHERENCE, MULTIPLE, frequency_response, write_sets

LINE: FloatArray = np.linspace(0.5, 100.0, 200)
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


def test_mobilities_with_an_exponential_window_have_the_derivative_of_the_window(tmp_path: Path) -> None:
    """The spectrum of exp(-t / T) v'(t) is (1 / T + i omega) times that of exp(-t / T) v(t), for v(0) = 0."""
    t = np.arange(4000) / 1000
    velocity, window = t * np.exp(-2 * t) * np.sin(60 * t), np.exp(-t / 0.5)
    rate = np.exp(-2 * t) * ((1 - 2 * t) * np.sin(60 * t) + 60 * t * np.cos(60 * t))
    mobility, exact = (np.fft.rfft(window * x)[1:201] for x in (velocity, rate))
    path = universal(tmp_path / "frf.uff", response(mobility, 1, motion=11, line=np.arange(1, 201) * 0.25))
    found = read_responses(path, 0.5).response[:, 0, 0]
    # sums of 1 ms in place of integrals: the error is that of the values at the ends, 60 t dt^2 / 12 and smaller
    np.testing.assert_allclose(found, exact, atol=1e-3 * np.abs(exact).max())
    without = read_responses(path).response[:, 0, 0]
    assert np.abs(without - exact).max() > 0.02 * np.abs(exact).max()


def test_coherences_are_those_of_their_responses(tmp_path: Path) -> None:
    """A response without one has NaN; a coherence of another place is passed over."""
    coherence = np.linspace(0, 1, 200)
    sets = [response(VALUES[:, k], k + 1) for k in (0, 1)]
    sets += [response(coherence, node, **COHERENCE) for node in (2, 9)]
    found = read_responses(universal(tmp_path / "frf.uff", *sets)).coherence
    assert found is not None
    np.testing.assert_allclose(found[:, 1, 0], coherence, atol=1e-5)
    assert np.isnan(found[:, 0, 0]).all()
    assert read_responses(universal(tmp_path / "none.uff", *sets[:2])).coherence is None


def test_multiple_coherence_of_an_output_takes_the_place_of_those_of_its_responses(tmp_path: Path) -> None:
    """With responses 3 and 4 and a multiple coherence of 0.8 the noise is 0.25 of 25: 9 of 15.25 and 16 of 22.25."""
    ones, sets = np.ones(200), list[Any]()
    for node in (1, 2):
        sets += [response((3.0 + 0j) * ones, node, force=7), response(4j * ones, node, force=8)]
        sets += [response(0.5 * ones, node, force=force, **COHERENCE) for force in (7, 8)]
    sets.append(frequency_response(0.8 * ones, LINE, rsp_node=2, **MULTIPLE))
    found = read_responses(write_sets(tmp_path / "frf.uff", sets)).coherence
    assert found is not None
    np.testing.assert_allclose(found[:, 0], 0.5)
    np.testing.assert_allclose(found[:, 1], np.array([9 / 15.25, 16 / 22.25]) * ones[:, None], rtol=1e-6)
    sets = [sets[0], frequency_response(0.8 * ones, LINE, rsp_node=1, **MULTIPLE)]
    found = read_responses(write_sets(tmp_path / "one.uff", sets)).coherence
    assert found is not None
    np.testing.assert_allclose(found, 0.8, rtol=1e-6)


def test_responses_are_read_as_written(tmp_path: Path) -> None:
    names = ("12_-z", "left"), ("3_x", "top of the wall")
    values = np.asarray(np.random.default_rng(5).standard_normal((200, 2, 2, 2)) @ [1, 1j], np.complex128)
    coherence = np.random.default_rng(6).uniform(size=values.shape)
    coherence[:, 0, 1] = np.nan
    written = FrequencyResponses(
        frequency=LINE, response=values, outputs=names[0], inputs=names[1], coherence=coherence
    )
    write_responses(tmp_path / "out.unv", written, header_set("a test", model="b.uff"))
    found = read_responses(tmp_path / "out.unv")
    assert (found.outputs, found.inputs) == names
    np.testing.assert_allclose(found.response, values, rtol=1e-11)
    assert found.coherence is not None
    np.testing.assert_allclose(found.coherence, coherence, rtol=1e-11)
    with pytest.raises(DataError, match=r"none.*out\.unv: cannot be written"):
        write_responses(tmp_path / "none" / "out.unv", written, header_set("a test"))


def test_header_is_read_with_its_fields(tmp_path: Path) -> None:
    """As another program has it; records that are not filled in are empty."""
    header = header_set("hammer test", "NONE") | {"program": "LMS Test.Lab", "date_file_written": "29-Jan-16"}
    found = read_header(universal(tmp_path / "a.uff", header, response(VALUES[:, 0], 1)))
    assert isinstance(found, Header)
    assert (found.model, found.description, found.program) == ("", "hammer test", "LMS Test.Lab")
    assert found.written.startswith("29-Jan-16 ")
    assert found.text == f"hammer test, LMS Test.Lab, {found.written}"
    assert read_header(universal(tmp_path / "b.uff", response(VALUES[:, 0], 1))) is None


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
    ("sets", "message"),
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
        (
            [response(VALUES[:, 0], 1), response(np.linspace(0, 1.2, 200), 1, **COHERENCE)],
            "dataset 2: expected 200 coherences from 0 to 1",
        ),
        ([response(VALUES[:, 0], 1) | {"func_type": 1}], "holds no frequency response"),
    ],
)
def test_inconsistent_responses_are_refused(tmp_path: Path, sets: Any, message: str) -> None:
    with pytest.raises(DataError, match=rf"frf\.uff: {message}"):
        read_responses(universal(tmp_path / "frf.uff", *sets))
