"""Tables and arrays that may be read in two ways: the certain one is taken, or the file is refused."""

from pathlib import Path

import numpy as np
import pytest

from daq import DataError, DataOptions, read_measured

DATA = np.random.default_rng(341).standard_normal((50, 2)).round(4)
ROWS = "".join(f"{k / 100:.2f},{a},{b}\n" for k, (a, b) in enumerate(DATA.tolist()))
UNTIMED = "".join(f"{a},{b}\n" for a, b in DATA.tolist())


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (f"time,a,b\n{ROWS}\nSummary of the run\ntime,peak\n0.1,0.99\n0.2,0.95\n0.3,0.97\n", "line 53: expected 3"),
        (f"time,a,b\n{ROWS}End of file\nTotal,50\nMean,0.1\n", "line 52: expected 3 cells, found 1"),
        (f"time,a,a\n{ROWS}", "line 1: the column name 'a' is given twice"),
        ("time,acc,time,acc\n" + "".join(f"{row},{row}\n" for row in ("0.00,1", "0.01,2")), "'acc' is given twice"),
    ],
)
def test_table_with_a_footer_or_repeated_names_is_refused(tmp_path: Path, text: str, says: str) -> None:
    path = tmp_path / "table.csv"
    path.write_text(text)
    with pytest.raises(DataError, match=says):
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
