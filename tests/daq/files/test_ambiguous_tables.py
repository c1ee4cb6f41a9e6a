"""Tables and arrays that may be read in two ways: the certain one is taken, or the file is refused."""

from pathlib import Path

import numpy as np
import pytest

from daq import DataError, DataOptions, read_measured

DATA = np.random.default_rng(341).standard_normal((50, 2)).round(4)
ROWS = "".join(f"{k / 100:.2f},{a},{b}\n" for k, (a, b) in enumerate(DATA.tolist()))
UNTIMED = "".join(f"{a},{b}\n" for a, b in DATA.tolist())


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (f"time,a,b\n{ROWS}\nSummary of the run\ntime,peak\n0.1,0.99\n0.2,0.95\n0.3,0.97\n", "line 53: expected 3"),
        (f"time,a,b\n{ROWS}End of file\nTotal,50\nMean,0.1\n", "line 52: expected 3 cells, found 1"),
        (f"time,a,a\n{ROWS}", "line 1: the column name 'a' is given twice"),
        ("time,acc,time,acc\n" + "".join(f"{row},{row}\n" for row in ("0.00,1", "0.01,2")), "'acc' is given twice"),
    ],
)
def test_table_with_a_footer_or_repeated_names_is_refused(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "table.csv"
    path.write_text(text)
    with pytest.raises(DataError, match=message):
        read_measured(path, DataOptions())


@pytest.mark.parametrize(
    ("text", "names", "rate"),
    [
        (f"Duration,Range,Filter\ns,g,Hz\ntime,x,y\n{ROWS}", ["x", "y"], 100.0),
        (f"Filter: output rate = 50 Hz low pass\nSampling rate: 200 Hz\nx,y\n{UNTIMED}", ["x", "y"], 200.0),
        (f"Sampling rate: 200 Hz\nx:,y\n{UNTIMED}", ["x:", "y"], 200.0),
    ],
)
def test_line_before_the_rows_names_them(tmp_path: Path, text: str, names: list[str], rate: float) -> None:
    """A line of names farther up, with units after it, and a rate within a line are of other quantities."""
    path = tmp_path / "table.csv"
    path.write_text(text)
    found = read_measured(path, DataOptions()).recording
    assert [c.name for c in found.channels] == names
    np.testing.assert_array_equal(found.data, DATA)
    assert found.rate == pytest.approx(rate)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("time,a\n" + "".join(f"{10 * k + 10**9},1\n" for k in range(9)), r"make 0\.1 Hz, .*as ms \(100 Hz\)"),
        ("t,a\n" + "".join(f"{10_000 * k + 1_500_000_000},1\n" for k in range(9)), r"0\.0001 Hz, .*as us \(100 Hz\)"),
        ("t,a\n" + "".join(f"{10**7 * k + 10**12},1\n" for k in range(9)), r"1e-07 Hz, .*as ns \(100 Hz\)"),
        (
            "Date: 2024-06-01\ntime,made,a\n10:00:00,2020-05-05,1\n10:00:01,2020-05-05,2\n",
            "expected a number, or a time",
        ),
    ],
)
def test_times_that_may_be_since_1970_or_not_are_refused(tmp_path: Path, text: str, message: str) -> None:
    """Times since the start of a computer may be dates in another unit, where the rate is not plausible."""
    path = tmp_path / "table.csv"
    path.write_text(text)
    with pytest.raises(DataError, match=message):
        read_measured(path, DataOptions())


def test_unit_of_times_since_1970_is_reported(tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    path.write_text("time,a\n" + "".join(f"{10 * k + 1_700_000_000_000},1\n" for k in range(9)))
    found = read_measured(path, DataOptions())
    assert "times of 'time' are counted from 1970 in ms" in found.remarks
    assert (found.recording.rate, found.recording.start) == (100.0, 1_700_000_000 * 10**9)


@pytest.mark.parametrize(
    ("names", "row"),
    [("lag [s],a", "{k},{a}"), ("clock,a", "10:00:{k:02d},{a}"), ("when,a", "2024-01-01 10:00:00,{a}")],
)
def test_stated_rate_goes_before_columns_that_may_be_times(tmp_path: Path, names: str, row: str) -> None:
    path = tmp_path / "table.csv"
    rows = "".join(row.format(k=k, a=a) + "\n" for k, (a, _) in enumerate(DATA.tolist()))
    path.write_text(f"Sampling rate: 100 Hz\n{names}\n{rows}")
    found = read_measured(path, DataOptions()).recording
    assert ([c.name for c in found.channels], found.rate) == (["a"], 100.0)


@pytest.mark.parametrize("name", ["second_floor", "temps", "N", "no", "lifetime", "temporal_x"])
def test_channels_with_parts_of_names_of_times_are_kept(tmp_path: Path, name: str) -> None:
    path = tmp_path / "table.csv"
    path.write_text(f"time,{name},a\n" + "".join(f"{k / 100:.2f},{k},{a}\n" for k, (a, _) in enumerate(DATA.tolist())))
    assert [c.name for c in read_measured(path, DataOptions()).recording.channels] == [name, "a"]


def test_units_of_lengths_before_a_table_are_not_those_of_the_columns(tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    path.write_text(f"Coordinates x,y,z\nUnits: m\ntime,a,b\n{ROWS}")
    found = read_measured(path, DataOptions())
    np.testing.assert_array_equal(found.recording.data, DATA)
    assert "unit 'm' in line 2 not used: give --unit if it is that of the columns" in found.remarks
    path.write_text(f"Coordinates x,y,z\nUnits: m\nUnit: mm/s2\ntime,a,b\n{ROWS}")
    found = read_measured(path, DataOptions())
    np.testing.assert_allclose(found.recording.data, DATA / 1000, rtol=1e-12)
    assert found.remarks[0] == "from line 3: a, b in mm/s2"


@pytest.mark.parametrize("second", ["Date: 2019-03-03", "Date: 2025-03-03", "Date: 2019-03-03\nTime: 09:00:00"])
def test_date_of_a_calibration_is_not_the_start(tmp_path: Path, second: str) -> None:
    path = tmp_path / "table.csv"
    path.write_text(f"Date: 2024-06-01\nTime: 10:00:00\n[Calibration]\n{second}\ntime,a,b\n{ROWS}")
    assert read_measured(path, DataOptions()).recording.start == 1_717_236_000 * 10**9


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({"north": DATA[:, 0], "fs": 100.0, "positions": np.arange(36.0).reshape(12, 3)}, "positions .12, 3."),
        ({"t": np.arange(50) / 100, "acc": DATA, "extra": DATA[:, 0]}, "extra .50,."),
        ({"a": DATA[:, 0], "sampling_time": 60.0}, "neither 'rate' nor 't'"),
        ({"a": DATA[:, 0], "dt": 60.0}, "neither 'rate' nor 't'"),
    ],
)
def test_arrays_that_may_not_be_the_samples_or_their_step_are_refused(
    tmp_path: Path, content: dict[str, np.ndarray], message: str
) -> None:
    np.savez(tmp_path / "set.npz", **content)  # type: ignore[arg-type]
    with pytest.raises(DataError, match=message):
        read_measured(tmp_path / "set.npz", DataOptions())


def test_rates_of_each_channel_and_arrays_that_are_left_out(tmp_path: Path) -> None:
    np.savez(tmp_path / "set.npz", acc=DATA, rate=np.array([100.0, 100.0]), floors=np.arange(3.0))
    found = read_measured(tmp_path / "set.npz", DataOptions())
    np.testing.assert_array_equal(found.recording.data, DATA)
    assert found.recording.rate == 100.0
    assert found.remarks == ("channels of the array 'acc'", "columns left out: floors (3,)")
