"""Tables of pandas as recordings: times, units, gaps, and errors that name column and row."""

import numpy as np
import pandas as pd
import pytest

from daq import DataError, Recording

START = 1767225600_000000000  # 2026-01-01
N, RATE = 200, 50.0
SIGNALS = np.random.default_rng(1).standard_normal((N, 2))
DATES = pd.date_range("2026-01-01", periods=N, freq="20ms")


def table(index: object = None) -> pd.DataFrame:
    return pd.DataFrame(SIGNALS, columns=["top_x", "top_y"], index=index)


@pytest.mark.parametrize(
    ("index", "start"),
    [
        (DATES, START),
        (DATES.tz_localize("UTC"), START),
        (DATES.tz_localize("UTC").tz_convert("Europe/Zurich"), START),
        (DATES.as_unit("us"), START),
        (pd.to_timedelta(np.arange(N) * 20, unit="ms"), 0),
        (pd.Index(3.0 + np.arange(N) / RATE), 0),
    ],
)
def test_index_gives_rate_and_start(index: pd.Index, start: int) -> None:
    found = Recording.from_dataframe(table(index))
    assert (found.rate, found.start) == (RATE, start)
    assert [channel.name for channel in found.channels] == ["top_x", "top_y"]
    np.testing.assert_array_equal(found.data, SIGNALS)


def test_table_without_times_needs_the_rate() -> None:
    for index in (None, pd.Index(np.full(N, 7.0))):
        found = Recording.from_dataframe(table(index), rate=25.0)
        assert (found.rate, found.start) == (25.0, 0)
    for dates in (DATES, DATES[:0]):
        with pytest.raises(DataError, match="index: holds times, leave out rate"):
            Recording.from_dataframe(table(DATES).reindex(dates), rate=25.0)


def test_units_are_given_or_in_the_names() -> None:
    np.testing.assert_allclose(Recording.from_dataframe(table(), rate=RATE, unit="g").data, 9.80665 * SIGNALS)
    named = table().set_axis(["top_x [mg]", "top_y"], axis=1)
    found = Recording.from_dataframe(named, rate=RATE)
    assert [channel.name for channel in found.channels] == ["top_x", "top_y"]
    np.testing.assert_allclose(found.data, SIGNALS * [9.80665e-3, 1.0])
    with pytest.raises(ValueError, match=r"unit: expected one of m/s2, .*found 'furlong'"):
        Recording.from_dataframe(table(), rate=RATE, unit="furlong")


def test_temperatures_are_no_channel() -> None:
    found = Recording.from_dataframe(table().assign(**{"temperature [degC]": 21.5}), rate=RATE)
    assert len(found.channels) == 2
    assert found.temperature == pytest.approx(21.5)


def test_missing_rows_and_cells_are_gaps() -> None:
    frame = table(DATES)
    frame.iloc[7, 1] = np.nan
    found = Recording.from_dataframe(frame.drop(frame.index[20:25]))
    expected = SIGNALS.copy()
    expected[7, 1] = np.nan
    expected[20:25] = np.nan
    np.testing.assert_array_equal(found.data, expected)
    assert {(gap.start, gap.stop) for gap in found.gaps} == {(7, 8), (20, 25)}


def test_nullable_and_integer_columns_are_numbers() -> None:
    frame = pd.DataFrame({"a": pd.array([1, None, 3], "Int64"), "b": [1, 2, 3]})
    np.testing.assert_array_equal(Recording.from_dataframe(frame, rate=1.0).data, [[1, 1], [np.nan, 2], [3, 3]])


@pytest.mark.parametrize("bad", ["x", np.inf, pd.Timestamp(0)])
def test_value_that_is_no_number_is_named_with_column_and_row(bad: object) -> None:
    frame = table().astype(object)
    frame.iloc[12, 1] = bad
    with pytest.raises(DataError, match="dataframe: column 'top_y', row 12: expected a number, found"):
        Recording.from_dataframe(frame, rate=RATE)


@pytest.mark.parametrize(
    ("frame", "message"),
    [
        (table(), "index: expected dates, time differences or seconds, found int64: give rate"),
        (table(DATES[::-1]), "index, row 1: the time does not increase"),
        (table(pd.DatetimeIndex([*DATES[:9], pd.NaT, *DATES[10:]])), "index, row 9: the time is missing"),
        (table(DATES).iloc[:1], "index, row 0: at least two times"),
        (table(DATES).iloc[:0], "index, row 0: at least two times"),
        (table().reset_index(names="t"), r"column 't': expected a channel, found times: use frame.set_index\('t'\)"),
        (table(DATES).set_axis(["a", "a"], axis=1), "expected columns of different names, found a, a"),
        (pd.DataFrame(index=DATES), "has no column of a channel, but none"),
        (table(DATES).assign(clock=DATES), "column 'clock': expected numbers, found datetime64"),
        (table(DATES) * 1j, "column 'top_x': expected numbers, found complex128"),
        (table(DATES) > 0, "column 'top_x': expected numbers, found bool"),
        (table(DATES).set_axis(["a [V]", "b"], axis=1), r"column 'a \[V\]' is in V: give its sensitivity"),
    ],
)
def test_error_names_what_is_wrong(frame: pd.DataFrame, message: str) -> None:
    with pytest.raises(DataError, match=f"^dataframe: {message}"):
        Recording.from_dataframe(frame)
