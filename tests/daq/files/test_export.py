"""Files of measurements: their content is exported from the log unchanged, and every error names its line."""

import io
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis.extra import numpy as hnp
from scipy.io import savemat

from daq import (
    Channel,
    DataError,
    DataOptions,
    FloatArray,
    Gap,
    LogError,
    Recording,
    export_recording,
    load_recordings,
    read_data,
    read_measured,
    write_recording,
)

START = 1_767_225_600_000_000_000


def write_csv(path: Path, data: FloatArray, rate: float, *, delimiter: str = ",", decimals: int = 9) -> Path:
    """Write a table with times; NaN as an empty cell."""
    text = io.StringIO()
    text.write(delimiter.join(["t", *(f"c{i}" for i in range(data.shape[1]))]) + "\n")
    for k, row in enumerate(data):
        cells = [f"{k / rate:.{decimals}f}", *("" if np.isnan(x) else repr(float(x)) for x in row)]
        text.write(delimiter.join(cells) + "\n")
    path.write_text(text.getvalue(), encoding="utf-8")
    return path


def through_a_log(recording: Recording, path: Path) -> Recording:
    path.unlink(missing_ok=True)
    write_recording(path, recording)
    (found,) = load_recordings(path)
    return found


@given(
    hnp.arrays(np.float64, st.tuples(st.integers(2, 40), st.integers(1, 4)), elements=st.floats(-1e3, 1e3)),
    st.sampled_from([1.0, 51.2, 256.0, 300.0, 1000.0, 1024.0]),
    st.sampled_from([",", ";", "\t"]),
)
@example(np.full((2, 1), 5e-324), 1.0, ",")
def test_table_round_trip_through_log(
    tmp_path_factory: pytest.TempPathFactory, data: FloatArray, rate: float, delimiter: str
) -> None:
    folder = tmp_path_factory.mktemp("table")
    read = read_data(write_csv(folder / "data.csv", data, rate, delimiter=delimiter), start=START)
    np.testing.assert_array_equal(read.data, data)
    assert read.rate == rate
    found = through_a_log(read, folder / "log.mcap")
    # half a count; counts go up to 2^30 - 1, and are no smaller than the least normal number
    count = max(np.abs(data).max() / (2**30 - 1), np.finfo(float).tiny)
    np.testing.assert_allclose(found.data, data, rtol=0, atol=0.51 * count)
    assert (found.rate, found.start, found.channels, found.gaps) == (rate, START, read.channels, ())


def test_long_gap_is_kept_in_recording_of_whole_log(tmp_path: Path) -> None:
    values = np.full((300, 1), np.nan)
    values[[0, 200, 299]] = 1.0
    found = through_a_log(read_data(write_csv(tmp_path / "data.csv", values, 100.0)), tmp_path / "log.mcap")
    np.testing.assert_array_equal(np.isnan(found.data), np.isnan(values))


@given(st.data())
def test_missing_table_values_are_gaps_in_the_recording(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    missing = data.draw(hnp.arrays(np.bool_, st.tuples(st.integers(2, 300), st.integers(1, 3))))
    missing[0, 0] = missing[-1, 0] = False  # else the recording is shorter, rightly
    values = np.where(missing, np.nan, np.random.default_rng(1).standard_normal(missing.shape))
    folder = tmp_path_factory.mktemp("gaps")
    read = read_data(write_csv(folder / "data.csv", values, 100.0))
    found = through_a_log(read, folder / "log.mcap")
    np.testing.assert_array_equal(np.isnan(found.data), missing)
    assert found.gaps == read.gaps


def test_missing_rows_become_a_gap(tmp_path: Path) -> None:
    path = write_csv(tmp_path / "data.csv", np.random.default_rng(2).standard_normal((100, 2)), 50.0)
    lines = path.read_text().splitlines()
    path.write_text("\n".join(lines[:31] + lines[61:]))  # line 32 is sample 30
    found = through_a_log(read_data(path), tmp_path / "log.mcap")
    assert found.gaps == (Gap(device="import", start=30, stop=60),)
    assert len(found.data) == 100


def test_rounded_times_give_the_exact_rate(tmp_path: Path) -> None:
    data = np.random.default_rng(3).standard_normal((5000, 1))
    assert read_data(write_csv(tmp_path / "data.csv", data, 1024.0, decimals=4)).rate == 1024.0


def test_comments_quotes_and_decimal_commas_are_read(tmp_path: Path) -> None:
    path = tmp_path / "data.csv"
    path.write_text('\ufeff# made by hand\n\n"t"; "left x" ;b\n0,00;1,5;NaN\n# amid\n0,01;-2,5;\n0,02;3;4e-3\n')
    found = read_data(path)
    assert [c.name for c in found.channels] == ["left x", "b"]
    assert [c.device for c in found.channels] == ["import", "import-2"]  # they lack different samples
    np.testing.assert_array_equal(found.data, [[1.5, np.nan], [-2.5, np.nan], [3, 4e-3]])
    assert found.rate == 100.0


@pytest.mark.parametrize("rate", [None, 4.0])
def test_only_chosen_columns_are_read(tmp_path: Path, rate: float | None) -> None:
    path = tmp_path / "data.csv"
    path.write_text("Time (s),note,acc 1,,acc 2\n0,start,1,,2\n0.25,,3,,\n0.5,x,5,,6\n")
    found = read_data(path, rate=rate, time="Time (s)", columns={"acc 2": "right", "acc 1": "left"})
    assert [c.name for c in found.channels] == ["left", "right"]
    np.testing.assert_array_equal(found.data, [[1, 2], [3, np.nan], [5, 6]])
    assert found.rate == 4.0


@pytest.mark.parametrize("name", ["t", "time", "Time", "TIME [s]", "t (s)", "Time (sec)"])
def test_time_column_is_recognized_by_usual_names(tmp_path: Path, name: str) -> None:
    path = tmp_path / "data.csv"
    path.write_text(f"left;{name}\n1;0\n2;0,5\n3;1,0\n")
    found = read_data(path)
    assert ([c.name for c in found.channels], found.rate) == (["left"], 2.0)
    assert read_data(path, columns={"left": "x"}).rate == 2.0
    with pytest.raises(DataError, match="of times: leave out --rate"):
        read_data(path, rate=2.0)
    np.savez(tmp_path / "data.npz", **{"data": np.ones((3, 2)), name: np.arange(3) / 2})  # type: ignore[arg-type]
    assert read_data(tmp_path / "data.npz").rate == 2.0


@pytest.mark.parametrize(
    ("name", "given", "rate"),
    [
        ("time [ms]", None, 500.0),
        ("Time (msec)", None, 500.0),
        ("t_ms", None, 500.0),
        ("t / us", None, 5e5),
        ("T [µs]", None, 5e5),
        ("time in minutes", None, 1 / 120),
        ("t [s]", None, 0.5),
        ("t", "ms", 500.0),
        ("t", "s", 0.5),
        ("t [s]", "ms", 500.0),
    ],
)
def test_time_unit_is_applied(tmp_path: Path, name: str, given: str | None, rate: float) -> None:
    path = tmp_path / "data.csv"
    path.write_text(f"{name},left\n0,1\n2,2\n4,3\n")
    found = read_data(path, time_unit=given)
    assert [c.name for c in found.channels] == ["left"]
    assert found.rate == pytest.approx(rate, rel=1e-5)
    np.savez(tmp_path / "data.npz", **{"data": np.ones((3, 2)), name: np.arange(3) * 2.0})  # type: ignore[arg-type]
    assert read_data(tmp_path / "data.npz", time_unit=given).rate == pytest.approx(rate, rel=1e-5)


@pytest.mark.parametrize(
    ("unit", "worth"),
    [
        *(("[g]", 9.80665), ("(mg)", 9.80665e-3), ("[G]", 9.80665), ("( µg )", 9.80665e-6), ("[gal]", 1e-2)),
        *(("[m/s2]", 1.0), ("[m/s^2]", 1.0), ("(m/s²)", 1.0), ("[mm/s**2]", 1e-3), ("[m s-2]", 1.0), ("", 1.0)),
    ],
)
def test_channel_unit_is_applied(tmp_path: Path, unit: str, worth: float) -> None:
    path = tmp_path / "data.csv"
    path.write_text(f"t,left {unit},right [m/s2]\n0,1,1\n0.5,-2,1\n")
    found = read_data(path)
    assert [c.name for c in found.channels] == ["left", "right"]
    np.testing.assert_allclose(found.data, [[worth, 1], [-2 * worth, 1]], rtol=1e-12)
    np.testing.assert_array_equal(read_data(path, factor=2.0).data, [[2, 2], [-4, 2]])
    np.savez(tmp_path / "data.npz", data=[[1.0], [2.0]], rate=1.0, channels=[f"left {unit}"])
    np.testing.assert_allclose(read_data(tmp_path / "data.npz").data[:, 0], [worth, 2 * worth], rtol=1e-12)


def test_columns_are_chosen_with_or_without_unit_in_name(tmp_path: Path) -> None:
    path = tmp_path / "data.csv"
    path.write_text("t,a [g],b (mg),c (left),c (right)\n0,1,1,1,1\n0.5,2,2,2,2\n")
    for columns, names in (
        ({"b": "b", "a": "top"}, ["top", "b"]),
        ({"b (mg)": "foot", "a [g]": "a [g]"}, ["a", "foot"]),
    ):
        assert [c.name for c in read_data(path, columns=columns).channels] == names
    with pytest.raises(DataError, match=r"expected different columns, found a, a \[g\]"):
        read_data(path, columns={"a": "x", "a [g]": "y"})
    found = read_measured(path, DataOptions())
    assert [c.name for c in found.recording.channels] == ["a", "b"]
    assert found.remarks[1] == "columns left out: c (left) (no unit of motion), c (right) (no unit of motion)"
    with pytest.raises(
        DataError, match=r"column 'c \(left\)': expected the unit m/s2, .*, found 'left': give the unit"
    ):
        read_data(path, columns={"c (left)": "c"})
    whole = ["a", "b", "c (left)", "c (right)"]
    assert [c.name for c in read_data(path, factor=1.0).channels] == whole


def test_velocity_unit_is_applied(tmp_path: Path) -> None:
    path, t = tmp_path / "data.csv", np.arange(400) / 100
    rows = [f"{a!r},{a!r}" for a in np.sin(20 * t).tolist()]
    path.write_text("\n".join(["v [mm/s],a", *rows]))
    found = read_data(path, rate=100.0, velocities=["v"]).data[100:-100, 0]
    np.testing.assert_allclose(found, 0.02 * np.cos(20 * t[100:-100]), atol=1e-4)
    by_unit = read_measured(path, DataOptions(rate=100.0))
    np.testing.assert_array_equal(by_unit.recording.data[100:-100, 0], found)
    assert by_unit.remarks[1] == "differentiated once: v"
    path.write_text("\n".join(["v [g],a", *rows]))
    with pytest.raises(DataError, match=r"column 'v \[g\]': expected the unit m/s, cm/s, mm/s, um/s, found 'g'"):
        read_data(path, rate=100.0, velocities=["v"])


@pytest.mark.parametrize(
    ("name", "cells", "celsius"),
    [
        ("temperature [C]", (20, 21), (20, 21)),
        ("T (°C)", (20, 21), (20, 21)),
        ("Temp", (-5, 0), (-5, 0)),
        ("temp_C", (-5, 0), (-5, 0)),
        ("temperature_deck", (-5, 0), (-5, 0)),
        ("deck [K]", (273.15, 300), (0, 26.85)),
        ("deck (°F)", (32, 212), (0, 100)),
    ],
)
@pytest.mark.parametrize("columns", [None, {"a": "left"}])
def test_temperature_column_is_not_a_channel(
    tmp_path: Path, name: str, cells: tuple[float, float], celsius: tuple[float, float], columns: dict[str, str] | None
) -> None:
    path = tmp_path / "data.csv"
    path.write_text(f"t,{name},a\n0,{cells[0]},1\n1,{cells[1]},2\n")
    found = read_measured(path, DataOptions(columns=columns))
    assert [c.name for c in found.recording.channels] == ["a" if columns is None else "left"]
    np.testing.assert_array_equal(found.recording.data[:, 0], [1, 2])
    np.testing.assert_allclose(found.temperature, celsius, atol=1e-9)
    assert found.recording.temperature == pytest.approx(np.mean(celsius))
    low, high = min(celsius), max(celsius)
    assert found.remarks == (f"temperature of the structure: {name!r}: {low:.4g} to {high:.4g} degC",)


def test_requested_temperature_column_is_used(tmp_path: Path) -> None:
    path = tmp_path / "data.csv"
    path.write_text("t,a,air [C],steel [C],th1\n0,1,10,20,30\n1,1,12,20,30\n")
    found = read_measured(path, DataOptions(columns={"a": "a"}))
    np.testing.assert_array_equal(found.temperature, [15, 16])
    assert found.remarks == ("temperature of the structure: 'air [C]', 'steel [C]', their mean: 15 to 16 degC",)
    for asked, expected in (("steel", 20), ("air [C]", 11), ("th1", 30)):
        one = read_measured(path, DataOptions(temperature=asked, columns={"a": "a"})).recording
        assert (one.temperature, [c.name for c in one.channels]) == (expected, ["a"])
    assert [c.name for c in read_data(path, temperature="th1").channels] == ["a"]
    assert [c.name for c in read_data(path).channels] == ["a", "th1"]
    with pytest.raises(DataError, match="has no column 'water' of temperatures, but a, air"):
        read_data(path, temperature="water")
    with pytest.raises(DataError, match=r"column 'air \[C\]': expected the unit m/s2"):
        read_data(path, columns={"air [C]": "a"})
    path.write_text("t,a [g],b [g]\n0,1,2\n1,1,2\n")
    with pytest.raises(DataError, match=r"column 'b \[g\]': expected a unit of temperatures, .*, found 'g'"):
        read_data(path, temperature="b")


@pytest.mark.thorough
def test_sparse_temperature_readings_are_interpolated_to_windows(tmp_path: Path) -> None:
    path, out = tmp_path / "data.csv", tmp_path / "log.mcap"
    rows = [f"{k},1,{'' if k % 600 else 10 + k / 600}" for k in range(6001)]
    rows += [f"{k},1," for k in range(6001, 9001)]
    path.write_text("\n".join(["t,a,T [C]", *rows]))
    found = read_measured(path, DataOptions())
    assert found.recording.gaps == ()
    write_recording(out, found.recording, temperature=found.temperature)
    windows = [window.temperature for window in load_recordings(out, window_seconds=1000.0)]
    np.testing.assert_allclose(windows[:6], 10 + (np.arange(6) * 1000 + 500) / 600, atol=0.05)
    assert windows[6] == pytest.approx(20, abs=1e-3)
    assert np.isnan(windows[8])  # farther than half an hour from the last reading


@pytest.mark.parametrize(
    ("delimiter", "name", "form", "start"),
    [
        (",", "timestamp", "2026-01-01T00:00:{:09.6f}Z", START),
        (",", "Time", "2026-01-01 00:00:{:06.3f}", START),
        (",", "Date/Time", "2026-01-01 01:00:{:06.3f}+01:00", START),
        ("\t", "datetime", "2025-12-31T23:59:{:06.3f}", START - 60_000_000_000),
        (",", "time", "31.12.2025 23:59:{:06.3f}", START - 60_000_000_000),
        (",", "Date", "2026-01-01 00:00:{:06.3f}", START),
    ],
)
def test_dates_are_accepted_as_times(tmp_path: Path, delimiter: str, name: str, form: str, start: int) -> None:
    path = tmp_path / "data.csv"
    rows = [(form.format(k / 200), str(k), "note") for k in range(2000) if k not in (700, 701)]
    text = "\n".join(delimiter.join(row) for row in [(name, "left", "note"), *rows])
    path.write_text(text if delimiter == "," else text.replace(".", ","))
    found = read_measured(path, DataOptions(columns={"left": "left"}))
    assert (found.recording.start, found.recording.rate) == (start, 200.0)
    assert found.recording.gaps == (Gap(device="import", start=700, stop=702),)
    (remark,) = found.remarks
    assert remark.startswith(f"times of {name!r} are dates, UTC where they state no zone: the first is 202")
    assert read_data(path, columns={"left": "left"}, start=5).start == 5
    path.write_text(path.read_text().replace(rows[1500][0].replace(".", "," if delimiter == "\t" else "."), "noon"))
    message = f"line 1502, column '{name}': expected a time as 2026-01-31T12:00:00.005, found 'noon'"
    with pytest.raises(DataError, match=message):
        read_data(path, columns={"left": "left"})


@pytest.mark.parametrize(
    ("delimiter", "head", "cells", "options"),
    [
        (",", "date,time,left", "2026-01-01,00:00:{:06.3f},{}", {}),
        (";", "Datum;left;Time", "1.1.2026;{1};0:00:{0:06.3f}", {}),
        ("\t", "Date [UTC]\tclock\tleft", "2026-01-01\t01:00:{:06.3f}+01:00\t{}", {"time": "clock"}),
        (",", "date,time,left", "2026-01-01,00:00:{:06.3f},{}", {"columns": {"left": "left"}}),
    ],
)
def test_date_and_time_in_separate_columns_are_combined(
    tmp_path: Path, delimiter: str, head: str, cells: str, options: dict[str, Any]
) -> None:
    path = tmp_path / "data.csv"
    text = "\n".join([head, *(cells.format(k / 200, k) for k in range(2000) if k != 700)])
    path.write_text(text.replace("00.", "00,") if delimiter == ";" else text)
    found = read_measured(path, DataOptions(**options))
    assert (found.recording.start, found.recording.rate) == (START, 200.0)
    assert [channel.name for channel in found.recording.channels] == ["left"]
    assert found.recording.gaps == (Gap(device="import", start=700, stop=701),)
    assert "are dates, UTC where they state no zone: the first is 2026-01-01T00:00:00.000+00:00" in found.remarks[0]


def test_midnight_in_separate_date_and_time_columns_is_no_gap(tmp_path: Path) -> None:
    path = tmp_path / "data.csv"
    rows = [
        f"2026-01-0{1 if k < 50 else 2},{'23:59:59' if k < 50 else '00:00:00'}.{k % 50 * 2:02d},{k}" for k in range(100)
    ]
    path.write_text("\n".join(["date,time,left", *rows]))
    found = read_data(path)
    assert (found.rate, found.gaps, found.start) == (50.0, (), START + 86_399 * 10**9)


def test_error_for_invalid_date_states_its_line(tmp_path: Path) -> None:
    path = tmp_path / "data.csv"
    good = "date,time,a\n2026-01-01,00:00:00,1\n2026-01-01,00:00:01,1\n"
    for row, message in (
        ("2026-01-32,00:00:02,1", "line 4, column 'date': expected a date as 2026-01-31, found '2026-01-32'"),
        ("2026-01-01,24:61:02,1", "line 4, column 'time': expected a time of day as 12:00:00.005, found '24:61:02'"),
        (",00:00:02,1", "line 4: the time is missing"),
    ):
        path.write_text(good + row)
        with pytest.raises(DataError, match=message):
            read_data(path)


def test_date_column_is_left_out_if_times_are_seconds(tmp_path: Path) -> None:
    path = tmp_path / "data.csv"
    path.write_text("date,time,a\n2026-01-01,0,1\n2026-01-01,1,2\n")
    assert read_data(path, columns={"a": "a"}).rate == 1.0
    found = read_measured(path, DataOptions())
    assert [c.name for c in found.recording.channels] == ["a"]
    assert found.remarks == ("columns left out: date (dates)",)


def test_column_named_t_is_preferred_as_time_column(tmp_path: Path) -> None:
    path = tmp_path / "data.csv"
    path.write_text("t_s,t\n5,0\n6,0.5\n8,1\n")
    found = read_data(path)
    assert ([c.name for c in found.channels], found.rate) == (["t_s"], 2.0)
    with pytest.raises(ValueError, match="time_unit: expected one of s, ms, us, ns, min, h, d, found 'week'"):
        read_data(path, time_unit="week")


def test_column_t_is_data_if_another_column_is_time(tmp_path: Path) -> None:
    path = tmp_path / "data.csv"
    path.write_text("T,time [s],left\n20,0,1\n20,0.5,2\n20,1,3\n")
    found = read_data(path)
    assert ([c.name for c in found.channels], found.rate) == (["T", "left"], 2.0)


def test_first_date_is_reported_with_exact_milliseconds(tmp_path: Path) -> None:
    """Some of these thousandths of a second lie under their numbers as floats do, some over."""
    path = tmp_path / "data.csv"
    for ms in range(40):
        first = f"2026-01-31T12:00:00.{ms:03d}"
        path.write_text(f"time,left\n{first},1\n2026-01-31T12:00:01.{ms:03d},2\n2026-01-31T12:00:02.{ms:03d},2\n")
        found = read_measured(path, DataOptions())
        assert found.recording.start == START + (30 * 86400 + 43200) * 10**9 + ms * 10**6
        assert found.remarks[0].endswith(f"the first is {first}+00:00")


def test_duplicate_channel_names_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "data.csv"
    path.write_text("t,a [g],y\n0,1,2\n1,1,2\n2,2,1\n")
    with pytest.raises(DataError, match="expected channels of different names, found a, a"):
        read_data(path, columns={"a [g]": "a [g]", "y": "a"})


def test_only_chosen_array_channels_are_read(tmp_path: Path) -> None:
    path = tmp_path / "data.npz"
    np.savez(path, data=np.arange(12.0).reshape(4, 3), seconds=np.arange(4) / 2)
    found = read_data(path, time="seconds", columns={"ch3": "top", "ch1": "foot"})
    assert [c.name for c in found.channels] == ["foot", "top"]
    np.testing.assert_array_equal(found.data, np.arange(12.0).reshape(4, 3)[:, [0, 2]])
    assert found.rate == 2.0
    with pytest.raises(DataError, match=r"data\.npz: expected a channel 'ch4', found ch1, ch2, ch3"):
        read_data(path, time="seconds", columns={"ch4": "x"})


def test_invalid_column_choice_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "data.csv"
    path.write_text("t,a,b,b\n0,1,2,3\n1,x,2,3\n")
    for columns, message in (
        ({"c": "c"}, "line 1: expected a column 'c', found t, a, b, b"),
        ({"b": "b"}, "line 1: the column name 'b' is given twice"),
        ({"a": "a"}, "line 3, column 'a': expected a number, found 'x'"),
    ):
        with pytest.raises(DataError, match=rf"data\.csv: {message}"):
            read_data(path, columns=columns)
    with pytest.raises(ValueError, match="columns: expected different names, found z, z"):
        read_data(path, columns={"a": "z", "b": "z"})


def test_factor_and_start_time_are_applied(tmp_path: Path) -> None:
    path = tmp_path / "data.csv"
    path.write_text("a\n1\n2\n")
    found = read_data(path, rate=2.0, factor=9.80665, start=START)
    np.testing.assert_array_equal(found.data[:, 0], [9.80665, 19.6133])
    assert (found.start, found.rate, found.duration) == (START, 2.0, 1.0)


@pytest.mark.parametrize("ending", ["npz", "mat"])
def test_arrays_are_read_from_npz_and_mat_files(tmp_path: Path, ending: str) -> None:
    path, data = tmp_path / f"data.{ending}", np.random.default_rng(4).standard_normal((50, 2))
    names = np.array(["left_x", "b"])
    if ending == "npz":
        np.savez(path, data=data, rate=25.0, channels=names)
    else:
        savemat(path, {"data": data, "rate": 25.0, "channels": names})
    found = read_data(path)
    assert found.channels == (
        Channel(name="left_x", device="import", axis=0),
        Channel(name="b", device="import", axis=1),
    )
    np.testing.assert_array_equal(found.data, data)
    assert found.rate == 25.0


@pytest.mark.parametrize("ending", ["csv", "npz", "mat"])
def test_exported_recording_is_imported_unchanged(tmp_path: Path, ending: str) -> None:
    data = np.random.default_rng(7).standard_normal((500, 3))
    data[100:120, 1] = np.nan
    devices = ("import", "import-2", "import")
    names = zip(("a, b", "é", "c"), devices, (0, 0, 1), strict=True)
    channels = tuple(Channel(name=name, device=device, axis=axis) for name, device, axis in names)
    path = tmp_path / f"data.{ending}"
    export_recording(path, Recording(channels=channels, data=data, rate=51.2, start=START))
    found = read_data(path, start=START)
    assert (found.channels, found.rate) == (channels, 51.2)
    assert found.gaps == (Gap(device="import-2", start=100, stop=120),)
    np.testing.assert_allclose(found.data, data, rtol=1e-8 if ending == "csv" else 0)
    with pytest.raises(DataError, match=rf"data\.{ending}: cannot be written: File exists"):
        export_recording(path, found)


@pytest.mark.parametrize("n", [1, 3])
def test_exported_universal_file_is_imported_unchanged(tmp_path: Path, n: int) -> None:
    data = np.random.default_rng(8).standard_normal((500, n))
    channels = tuple(Channel(name=name, device="import", axis=k) for k, name in enumerate(("a b", "é", "c")[:n]))
    path, recording = tmp_path / "data.uff", Recording(channels=channels, data=data, rate=51.2, start=START)
    export_recording(path, recording)
    found = read_data(path, start=START)
    assert found.channels == channels
    assert found.rate == pytest.approx(51.2, rel=5e-6)  # the format prints the interval with six digits
    np.testing.assert_allclose(found.data, data, atol=1e-11)  # and values with twelve
    with pytest.raises(DataError, match=r"data\.uff: cannot be written: File exists"):
        export_recording(path, recording)
    data[100:120, 0] = np.nan
    with pytest.raises(DataError, match=r"gap\.uff: cannot hold a gap: 20 samples are missing"):
        export_recording(tmp_path / "gap.uff", recording)
    assert not (tmp_path / "gap.uff").exists()


@pytest.mark.parametrize("ending", ["npz", "mat"])
def test_vectors_of_each_axis_are_channels_and_one_vector_is_one_channel(tmp_path: Path, ending: str) -> None:
    vectors = dict(zip("xyz", np.random.default_rng(9).standard_normal((3, 400)), strict=True))
    for names in ("xyz", "xy", "y"):
        path = tmp_path / f"{names}.{ending}"
        arrays = {"fs": 100.0, **{name: vectors[name] for name in names}}
        if ending == "mat":
            savemat(path, arrays)
        else:
            np.savez(path, **arrays)
        found = read_data(path)
        assert [channel.name for channel in found.channels] == (list(names) if len(names) > 1 else ["ch1"])
        np.testing.assert_array_equal(found.data.T, [vectors[name] for name in names])


def test_one_array_per_channel_with_time_array_is_read(tmp_path: Path) -> None:
    path = tmp_path / "data.npz"
    np.savez(path, t=np.arange(6) / 8, left=np.arange(6.0), right=np.ones(6))
    found = read_data(path)
    assert [c.name for c in found.channels] == ["left", "right"]
    assert found.rate == 8.0


TABLES = {
    "quote": ('",', "holds no numbers|has no column"),
    "empty": ("", "is empty: expected a line with the columns' names"),
    "no names": ("0,1\n1,2\n", "has no column of times, .* but 1, 2: give --time NAME or --rate"),
    "no rows": ("t,a\n", "holds no numbers"),
    "no channel": ("t\n1\n2\n", "has no column of a channel, but t"),
    "warmth alone": ("t,temperature\n1,2\n2,2\n", "has no column of a channel, but t, temperature"),
    "hot": ("t,a,temperature\n0,1,20\n1,1,293\n", "column 'temperature': expected temperatures of -90 to 150 degC, fo"),
    "no time": (
        "a,b\n1,2\n",
        r"has no column of times, as 't' or 'time \[ms\]', but a, b: give --time NAME or --rate",
    ),
    "unit of no time": ("time [g],b\n1,2\n", r"has no column of times, .* but time \[g\], b: give --time NAME"),
    "milliseconds": (
        "t,a\n0,1\n10,1\n20,1\n",
        r"column 't': times in seconds would make 0.1 Hz, which no log of a structure has: "
        r"give their unit by --time-unit, as ms \(100 Hz\); s if it is right",
    ),
    "microseconds": ("t,a\n0,1\n1000,1\n2000,1\n", r"column 't': .* as ms \(1 Hz\) or us \(1000 Hz\);"),
    "days": ("t,a\n0,1\n1e-7,1\n2e-7,1\n", r"column 't': .* 1e\+07 Hz, .* as h \(2777.78 Hz\) or d \(115.741 Hz\);"),
    "doubtful times": (
        "time,a\n01/02/2026 12:00:00,1\n",
        "line 2, column 'time': '01/02/2026 12:00:00' may have the day or the month first: give --date-order dmy",
    ),
    "doubtful dates": (
        "Date,Time,a\n01/02/2026,12:00:00,1\n",
        "line 2, column 'Date': '01/02/2026' may have the day or the month first",
    ),
    "no such date": (
        "time,a\n2026-02-28 12:00:00,1\n2026-02-29 12:00:00,1\n",
        r"line 3, column 'time': expected a time as 2026-01-31T12:00:00\.005, found '2026-02-29 12:00:00'",
    ),
    "times called otherwise": ("Moment,a\n0.5,1\n", "has no column of times, .* but Moment, a: give --time"),
    "no first date": ("time,a\n,1\n2026-01-31T12:00:00,1\n2026-01-31T12:00:01,1\n", "line 2: the time is missing"),
    "name twice": ("t,a,a\n0,1,2\n", "line 1: the column name 'a' is given twice"),
    "word": ("t,a\n0,1\n# c\n1,x1\n", "line 4, column 'a': expected a number, found 'x1'"),
    "infinite": ("t,a\n0,1\n1,inf\n", "line 3, column 'a': expected a number, found 'inf'"),
    "short row": ("t,a\n0,1\n1\n", "line 3: expected 2 cells, found 1"),
    "long row": ("t,a\n0,1\n1,2,3\n", "line 3: expected 2 cells, found 3"),
    "backwards": ("t,a\n0,1\n1,1\n0.5,1\n", "line 4: the time does not increase"),
    "no such time": ("t,a\n0,1\n,1\n2,1\n", "line 3: the time is missing"),
    "endless time": ("t,a\n0,1\n1e308,1\n", "line 3: the time is missing, or no number of seconds"),
    "tiny steps": ("t,a\n0,1\n1e-300,1\n2e-300,1\n", "line 3: the time does not increase"),
    "one row": ("t,a\n0,1\n", "line 2: at least two times are needed"),
    "years later": ("t,a\n0,1\n0.01,1\n0.02,1\n1e9,1\n", "line 5: t = 1e\\+09 s is 99999999998 periods after"),
    "long cell": ("t,a\n0,1\n1," + "1" * 140_000 + "x\n", "line 3: field larger than field limit"),
    "jitter": (
        "t,a\n" + "".join(f"{k / 100 + 0.003 * (k == 7):.4f},1\n" for k in range(20)),
        "line 9: t = 0.073 s is 0.3 periods off an even grid of 100 Hz",
    ),
}


@pytest.mark.parametrize(("text", "message"), TABLES.values(), ids=list(TABLES))
def test_invalid_table_is_refused(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "data.csv"
    path.write_text(text)
    with pytest.raises(DataError, match=rf"data\.csv: {message}") as found:
        read_data(path)
    assert found.value.path == path


PIECES = ["t", "a", "0", "1", "1e9", "-2", "nan", ",", ",", ";", "\t", "\n", "\n", '"', "#", " "]


@given(st.one_of(st.text(max_size=200), st.lists(st.sampled_from(PIECES)).map("".join)), st.sampled_from([None, 10.0]))
def test_arbitrary_text_is_read_or_refused(
    tmp_path_factory: pytest.TempPathFactory, text: str, rate: float | None
) -> None:
    path = tmp_path_factory.mktemp("any") / "data.csv"
    path.write_text(text, encoding="utf-8", newline="")
    with suppress(DataError):  # and nothing else
        found = read_data(path, rate=rate)
        assert found.rate > 0
        assert not np.isinf(found.data).any()


def test_table_in_another_encoding_is_read(tmp_path: Path) -> None:
    path, text = tmp_path / "data.csv", "t;Brücke [m/s²];T (°C)\n0;1,5;20\n1;2,5;21\n"
    found = []
    for encoding in ("cp1252", "utf-8", "utf-8-sig", "utf-16"):
        path.write_text(text, encoding=encoding)
        found.append(read_measured(path, DataOptions()))
    for one in found:
        assert [c.name for c in one.recording.channels] == ["Brücke"]
        np.testing.assert_array_equal(one.recording.data[:, 0], [1.5, 2.5])
        assert one.recording.temperature == 20.5
    path.write_text(text, encoding="utf-16-le")
    with pytest.raises(DataError, match=r"data\.csv: line 1: is no text in UTF-8 or Latin-1"):
        read_data(path)


def test_column_names_with_unit_like_endings_are_reported(tmp_path: Path) -> None:
    path = tmp_path / "data.csv"
    path.write_text("t,ax_g,deck y_mg,z,temperature_C\n0,1,1,1,20\n1,2,2,2,20\n")
    found = read_measured(path, DataOptions())
    assert [c.name for c in found.recording.channels] == ["ax_g", "deck y_mg", "z"]
    assert found.remarks[0] == "ax_g, deck y_mg in m/s2: if a name ends in its unit give --unit"
    assert len(read_measured(path, DataOptions(factor=9.8)).remarks) == 1


def test_missing_or_binary_table_file_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "data.csv"
    with pytest.raises(DataError, match=r"data\.csv: cannot be read: No such file"):
        read_data(path)
    path.write_bytes(b"\x89MCAP\xff\xfe")
    with pytest.raises(DataError, match=r"data\.csv: line 1: is no text in UTF-8 or Latin-1"):
        read_data(path)


ARRAYS: dict[str, tuple[dict[str, object], str]] = {
    "no rate": ({"data": np.ones((5, 2))}, "has neither 'rate' nor 't'"),
    "rate": ({"data": np.ones((5, 2)), "rate": -1.0}, "rate: expected a positive number"),
    "shape": ({"data": np.ones((5, 2, 2)), "rate": 1.0}, "data: expected \\(n_samples, n_channels\\)"),
    "words": ({"data": np.array([["a", "b"]]), "rate": 1.0}, "data: expected numbers"),
    "infinite": ({"data": np.array([[np.inf, 1]]), "rate": 1.0}, "data: expected finite numbers"),
    "names": ({"data": np.ones((5, 2)), "rate": 1.0, "channels": ["a"]}, "channels: expected 2 different names"),
    "lengths": ({"a": np.ones(5), "b": np.ones(6), "rate": 1.0}, r"expected 'data' or one array .* a channel, found a"),
    "times": ({"data": np.ones((5, 2)), "t": np.arange(4.0)}, "t: expected 5 times, found 4"),
    "times so called": ({"data": np.ones((5, 2)), "Time": np.arange(4.0)}, "Time: expected 5 times, found 4"),
    "jitter": ({"data": np.ones((9, 2)), "t": np.arange(9) + 0.25 * np.eye(9)[4]}, r"t\[4\]: t = 4.25 s"),
}


@pytest.mark.parametrize(("arrays", "message"), ARRAYS.values(), ids=list(ARRAYS))
def test_invalid_arrays_are_refused(tmp_path: Path, arrays: dict[str, object], message: str) -> None:
    path = tmp_path / "data.npz"
    np.savez(path, **arrays)  # type: ignore[arg-type]
    with pytest.raises(DataError, match=rf"data\.npz: {message}"):
        read_data(path)


def test_matlab_7_3_file_without_its_package_or_damaged(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "data.mat"
    path.write_bytes(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM" + bytes(384) + b"\x89HDF\r\n\x1a\n")
    with pytest.raises(DataError, match=r"data\.mat: holds no arrays: "):
        read_data(path)
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(DataError, match=r"data\.mat: is a Matlab 7.3 file, which needs h5py: save it with -v7, or pip"):
        read_data(path)


@pytest.mark.parametrize("name", ["data.npz", "data.mat"])
@pytest.mark.parametrize("content", [b"", b"no arrays at all, only text", b"PK\x03\x04 cut"])
def test_file_without_arrays_is_refused(tmp_path: Path, name: str, content: bytes) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(DataError, match=rf"{name}: holds no arrays"):
        read_data(tmp_path / name, rate=1.0)


def test_log_is_split_into_windows(tmp_path: Path) -> None:
    data = np.random.default_rng(5).standard_normal((1000, 3))
    channels = tuple(Channel(name=n, device="d", axis=i) for i, n in enumerate("xyz"))
    write_recording(tmp_path / "log.mcap", Recording(channels=channels, data=data, rate=100.0, start=START))
    found = list(load_recordings(tmp_path / "log.mcap", window_seconds=3.0))
    assert [w.start - START for w in found] == [0, 3_000_000_000, 6_000_000_000]
    np.testing.assert_allclose(np.concatenate([w.data for w in found]), data[:900], rtol=0, atol=1e-8)
    assert [len(w.data) for w in load_recordings(tmp_path / "log.mcap", window_seconds=30.0)] == [1000]


def test_channel_without_scans_is_kept_as_a_gap(tmp_path: Path) -> None:
    data = np.column_stack([np.arange(300.0), np.full(300, np.nan)])
    channels = (Channel(name="a", device="d", axis=0), Channel(name="b", device="e", axis=0))
    found = through_a_log(Recording(channels=channels, data=data, rate=100.0, start=START), tmp_path / "log.mcap")
    assert np.isnan(found.data[:, 1]).all()
    np.testing.assert_allclose(found.data[:, 0], data[:, 0], rtol=0, atol=1e-6)
    assert found.gaps == (Gap(device="e", start=0, stop=300),)
    (other,) = load_recordings(tmp_path / "log.mcap", channels=channels[:1])
    assert other.channels == channels[:1]
    with pytest.raises(LogError, match=r"log\.mcap: holds no scan of e"):
        list(load_recordings(tmp_path / "log.mcap", channels=channels[1:]))


@pytest.mark.parametrize("window", [0.0, -1.0, float("nan")])
def test_nonpositive_window_length_is_refused(tmp_path: Path, window: float) -> None:
    with pytest.raises(ValueError, match="window_seconds: expected a positive number"):
        list(load_recordings(tmp_path / "log.mcap", window_seconds=window))


def test_two_channels_on_one_axis_are_refused(tmp_path: Path) -> None:
    channels = (Channel(name="a", device="d", axis=1), Channel(name="b", device="d", axis=1))
    with pytest.raises(ValueError, match="channels: expected one for axis 1 of d, found more"):
        write_recording(tmp_path / "log.mcap", Recording(channels=channels, data=np.ones((2, 2)), rate=1.0, start=0))
    assert not (tmp_path / "log.mcap").exists()
