"""Series of modes of other programs: what a table and a MAT file hold is read, and every mistake is named."""

from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from daq import DaqError
from monitor.analysis.modal_table.series import read_series

TABLE = """\
time,f1 [Hz],f2 [Hz],f1_std [Hz],damping_1 [%],shape_1_left,shape_1_right,shape_2_left,shape_2_right,temperature [°C],by
2025-03-01T00:00,3.9,5.1,0.01,1.2,1,0.5,0.2,-1,8.5,Ada
2025-03-01T01:00,3.8,,0.02,1.4,2,1,,,,Bob
2025-03-01T02:00,,,,,,,,,9.5,Bob
2025-03-01T04:00,3.7,5.0,,,-2,-1,0.2,-1,,
"""


def written(folder: Path, text: str, name: str = "modes.csv") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def test_table_with_missing_modes(tmp_path: Path) -> None:
    series = read_series(written(tmp_path, TABLE))
    assert (series.channels, series.has_shapes, series.ignored) == (("left", "right"), True, ("by",))
    assert series.step == 3600
    np.testing.assert_array_equal(series.frequency, [[3.9, 5.1], [3.8, np.nan], [np.nan, np.nan], [3.7, 5.0]])
    np.testing.assert_allclose(series.damping[:2, 0], [0.012, 0.014])
    np.testing.assert_array_equal(series.temperature, [8.5, np.nan, 9.5, np.nan])
    windows = list(series.windows("series"))
    assert [window.problem for window in windows] == ["", "", "the row has no mode", ""]
    assert [window.recorded.end - window.recorded.start for window in windows] == [3600 * 10**9] * 4
    first, second, _, last = [window.modes.estimate if window.modes else None for window in windows]
    assert first
    assert second
    assert last
    assert first.start == np.datetime64("2025-03-01", "ns").astype(int)
    np.testing.assert_array_equal(first.frequency_std[0], 0.01)
    np.testing.assert_allclose(np.linalg.norm(first.shape, axis=1), 1)
    np.testing.assert_allclose(second.shape, last.shape[:1])  # a shape has no sign
    assert np.all(last.frequency_std > 0)
    assert np.all(last.damping > 0)


def test_frequencies_alone_are_named_by_their_columns(tmp_path: Path) -> None:
    rows = "\n".join(f"{k};{5 - 0.01 * k:.2f};{3 + 0.03 * (k % 2):.2f}".replace(".", ",") for k in range(5))
    series = read_series(written(tmp_path, f"time [h];f1;f2\n{rows}\n"))
    assert not series.has_shapes
    [first, *_] = series.windows("series")
    assert first.modes
    np.testing.assert_array_equal(first.modes.estimate.frequency, [3, 5])  # ascending, whatever the order of columns
    np.testing.assert_array_equal(first.modes.estimate.shape, [[0, 1], [1, 0]])
    # by the differences of successive rows: 1.4826 / sqrt(2) times their median
    np.testing.assert_allclose(series.frequency_std[0, 1] / 3, 1.0484 * np.log(3.03 / 3), rtol=1e-4)


def test_mat_file_holds_the_same(tmp_path: Path) -> None:
    table = read_series(written(tmp_path, TABLE))
    path = tmp_path / "modes.mat"
    arrays = {
        "datenum": 719529.0 + table.time / 86400,
        "frequency": table.frequency,
        "damping": table.damping,
        "shape": table.shape,
        "temperature": table.temperature,
        "channels": np.array(["left", "right"], dtype=object),
        "note": "from elsewhere",
    }
    savemat(path, arrays)
    found = read_series(path)
    assert (found.channels, found.ignored) == (("left", "right"), ("note",))
    for name in ("time", "frequency", "damping", "shape", "temperature"):
        np.testing.assert_allclose(getattr(found, name), getattr(table, name), rtol=1e-12)
    savemat(path, arrays | {"temperature": [1.0]})
    assert why(path) == f"{path}: temperature: expected 4 values, found 1"
    savemat(path, {"frequency": table.frequency, "time": [0.0, 1.0, 1.0, 2.0]})
    assert why(path) == f"{path}: time[2]: expected a time after that of the row before"


@pytest.mark.parametrize(
    ("heading", "cells", "expected"),
    [
        ("Wetter [°C]", ("8.5", "", "-3"), [8.5, np.nan, -3.0]),
        ("Temp [K]", ("273.15", "283.15", "293.15"), [0.0, 10.0, 20.0]),
        ("air", ("1", "2", "3"), [1.0, 2.0, 3.0]),
        ("deck [°F],sky [°C]", ("32,10", "50,", ","), [5.0, 10.0, np.nan]),  # the mean of all that are known
    ],
)
def test_columns_of_temperatures_are_those_of_all_tables(
    heading: str, cells: tuple[str, ...], expected: list[float], tmp_path: Path
) -> None:
    rows = "\n".join(f"{k},{cell},{3 + 0.01 * k}" for k, cell in enumerate(cells))
    series = read_series(written(tmp_path, f"time [h],{heading},f1\n{rows}\n"))
    np.testing.assert_allclose(series.temperature, expected, atol=1e-12)
    assert series.ignored == ()


def why(path: Path) -> str:
    with pytest.raises(DaqError) as caught:
        read_series(path)
    return str(caught.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("f1,f2\n1,2\n1,2\n", "expected a column 'time', found f1, f2"),
        ("time,f1\n1,2\n2,2\n", "column 'time': expected dates, or a unit in the name, as 'time [h]'"),
        ("time [h],f1\n1,2\n", "expected at least two rows, found 1"),
        ("time [h],f1\n1,2\n3,2\n2,2\n", "line 4: expected a time after that of the row before"),
        ("time [h],f1 [m]\n1,2\n3,2\n", "column f1 [m]: expected the unit Hz or kHz or rad/s, found m"),
        ("time [h],mode\n1,2\n3,2\n", "expected columns of frequencies, as 'f1 [Hz]', found time [h], mode"),
        ("time [h],f1,damping_2\n1,2,1\n3,2,1\n", "damping 2: there is no frequency of this mode"),
        ("time [h],f1,damping_1\n1,2,1.2\n3,2,1.2\n", "damping: expected ratios, found 1.2"),
        ("time [h],f1\n1,-2\n3,2\n", "row 1, mode 1: expected a frequency over 0, found -2"),
        ("time [h],f1,temperature\n1,2,280\n3,2,281\n", "column 'temperature': expected temperatures of -90 to 150"),
        ("time [h],f1\n1,2\n3,fast\n", "line 3, column 'f1': expected a number, found 'fast'"),
    ],
)
def test_errors_name_the_place(text: str, message: str, tmp_path: Path) -> None:
    path = written(tmp_path, text)
    assert why(path).startswith(f"{path}: ")
    assert message in why(path)
