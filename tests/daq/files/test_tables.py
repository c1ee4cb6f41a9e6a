"""Tables as other programs write them: preambles, no names, units, calibration, compression, foreign columns, dates."""

import gzip
import zipfile
from pathlib import Path

import numpy as np
import pytest

from daq import DataError, DataOptions, read_data, read_measured
from daq.files import Calibration, parse_sensitivity, parse_unit, read_calibration
from daq.files.columns.date_cells import month_of
from daq.files.columns.stated_start import StatedStart
from daq.files.tables.preamble import stated_start

G = 9.80665
DATA = np.random.default_rng(34).standard_normal((300, 2)).round(4)
START = 1_769_947_200 * 10**9  # 2026-02-01 12:00:00

LABVIEW = """LabVIEW Measurement
Writer_Version\t2
Separator\tTab
Decimal_Separator\t,
X_Columns\t{columns}
Date\t2026/02/01
Time\t17:18:18,938945770263671875
***End_of_Header***

Channels\t2
Samples\t300\t300
Date\t2026/02/01\t2026/02/01
Time\t17:18:18,938945\t17:18:18,938945
Y_Unit_Label\tg\tg
X_Dimension\tTime\tTime
X0\t0,0000000000000000E+0\t0,0000000000000000E+0
Delta_X\t0,010000\t0,010000
***End_of_Header***
X_Value\tleft\tright 1\tComment
"""
DASYLAB = """DASYLab - V 11.00.00
Worksheet name: beam
Recording date: 2/1/2026,  4:52:39 PM
Block length: 2
Delta: 1.0 sec.
Number of channels: 2
Date;Measurement time[hh:mm:ss];left [g];right [g];
"""
CATMAN = """HBM_CATMAN
File:\tbeam.txt
T0:\t01.02.2026 12:00:00

Channels:\t3

Zeit  1 - Standardmessrate\tleft\tright\tDMS 1
[s]\t[g]\t[m/s²]\t[µm/m]
"""


def comma(rows: np.ndarray) -> list[list[str]]:
    return [[f"{value:.4f}".replace(".", ",") for value in row] for row in rows.tolist()]


def test_labview_table_without_times_has_the_rate_of_its_preamble(tmp_path: Path) -> None:
    path = tmp_path / "beam.lvm"
    rows = ["\t" + "\t".join(row) for row in comma(DATA)]
    rows[0] += "\tbegin"  # a comment in the first row
    path.write_text(LABVIEW.format(columns="No") + "\n".join(rows))
    found = read_measured(path, DataOptions())
    assert [c.name for c in found.recording.channels] == ["left", "right 1"]
    np.testing.assert_allclose(found.recording.data, G * DATA, rtol=1e-12)
    assert found.recording.rate == 100.0
    assert found.remarks == (
        "from the columns: left, right 1 in g",
        "start time from line 12: 2026-02-01 17:18:18 UTC",
        "the table begins in line 19",
        "sampling rate of the preamble: 100 Hz",
        "columns left out: X_Value (empty)",
    )


@pytest.mark.parametrize(
    ("preamble", "order", "start"),
    [
        ("Messung Halle 3\nDatum: 01.02.2026\nAbtastrate: 256 Hz", None, "2026-02-01T00:00:00"),
        ("Date: 2026-02-01", None, "2026-02-01T00:00:00"),
        ("Datum;1.2.26\nUhrzeit;9:05:00", None, "2026-02-01T09:05:00"),
        ("Start Date/Time: 2/24/2026 3:07:09 PM", None, "2026-02-24T15:07:09"),
        ("Fecha: 24-02-2026 10:00", None, "2026-02-24T10:00:00"),
        ("Date de d\u00e9but: 01/02/2026", "dmy", "2026-02-01T00:00:00"),
        ('"Messbeginn:";"2026-02-01T12:00:00+01:00"', None, "2026-02-01T11:00:00"),
        ("# Date: 2026-02-01", None, "2026-02-01T00:00:00"),
        ("Date: Sun, 1 Feb 2026", None, "2026-02-01T00:00:00"),
        ("Start time: February 1, 2026 3:07:09 PM", None, "2026-02-01T15:07:09"),
        ("Datum;27. M\u00e4rz 2026\nUhrzeit;9:05:00", None, "2026-03-27T09:05:00"),
        ("Export date: 2026-02-01\nKalibrierung Datum: 2026-01-01\nMesszeit: 300 s", None, "1970-01-01T00:00:00"),
        ("Date de d\u00e9but: 01/02/2026", None, "1970-01-01T00:00:00"),
    ],
)
def test_start_is_that_of_the_preamble(tmp_path: Path, preamble: str, order: str | None, start: str) -> None:
    path = tmp_path / "beam.csv"
    rows = [";".join((f"{k / 256:.6f}".replace(".", ","), *row)) for k, row in enumerate(comma(DATA))]
    path.write_text(f"{preamble}\n\nZeit;left;right\n" + "\n".join(rows), encoding="utf-8")
    found = read_measured(path, DataOptions(date_order=order))
    assert str(np.datetime64(found.recording.start, "ns"))[:19] == start
    said = [remark for remark in found.remarks if "start" in remark]
    if start.startswith("1970"):
        assert not said or said[0].startswith("start date '01/02/2026' in line 1 not used")
    else:
        assert said[0].startswith("start time from line")
        assert said[0].endswith("midnight)") == start.endswith("00:00:00")
    assert found.dated == (not start.endswith("00:00:00"))
    given = read_measured(path, DataOptions(start=START)).recording
    assert given.start == START


def test_labview_table_with_times(tmp_path: Path) -> None:
    path = tmp_path / "beam.lvm"
    rows = ["\t".join([f"{k / 200:.6f}".replace(".", ","), *row]) for k, row in enumerate(comma(DATA))]
    path.write_text(LABVIEW.format(columns="One") + "\n".join(rows))
    found = read_data(path)
    assert found.rate == 200.0
    np.testing.assert_allclose(found.data, G * DATA, rtol=1e-12)


def test_dasylab_table_has_dates_in_two_columns(tmp_path: Path) -> None:
    path = tmp_path / "beam.csv"
    rows = [
        f"02/01/2026;{(11 + k // 3600) % 12 or 12}:{k // 60 % 60:02d}:{k % 60:02d} {'AM' if k < 3600 else 'PM'};"
        + ";".join(row)
        + ";"
        for k, row in enumerate(comma(DATA), 3500)
    ]
    path.write_text(DASYLAB + "\n".join(rows))
    found = read_measured(path, DataOptions(date_order="mdy"))
    assert found.recording.rate == 1.0
    assert found.recording.start == START - 100 * 10**9
    np.testing.assert_allclose(found.recording.data, G * DATA, rtol=1e-12)
    with pytest.raises(DataError, match=r"line 8, column 'Date': .* give --date-order dmy or mdy"):
        read_data(path)


def test_catman_table_has_a_line_of_units(tmp_path: Path) -> None:
    path = tmp_path / "beam.txt"
    rows = ["\t".join([f"{k / 200:.5f}".replace(".", ","), *row, "3,4"]) for k, row in enumerate(comma(DATA))]
    path.write_text(CATMAN + "\n".join(rows), encoding="cp1252")
    found = read_measured(path, DataOptions())
    assert [c.name for c in found.recording.channels] == ["left", "right"]
    np.testing.assert_allclose(found.recording.data, DATA * [G, 1.0], rtol=1e-12)
    assert found.recording.rate == 200.0
    assert found.remarks[-1] == "columns left out: DMS 1 [µm/m] (no unit of motion)"


@pytest.mark.parametrize("form", ["{:.2f} {:.4f} {:.4f}", "{:.2f},{:.4f},{:.4f}", "{:.2f}\t{:.4f}\t{:.4f}"])
def test_table_without_names(tmp_path: Path, form: str) -> None:
    path = tmp_path / "beam.txt"
    rows = [form.format(k / 100, *row) for k, row in enumerate(DATA.tolist())]
    path.write_text("\n".join(rows))
    named = read_data(path, names=("t", "left", "right [mg]"))
    assert ([c.name for c in named.channels], named.rate) == (["left", "right"], 100.0)
    np.testing.assert_allclose(named.data, DATA * [1.0, 1e-3 * G], rtol=1e-12)
    numbered = read_data(path, time="1", columns={"3": "right"})
    assert ([c.name for c in numbered.channels], numbered.rate) == (["right"], 100.0)
    np.testing.assert_array_equal(numbered.data[:, 0], DATA[:, 1])
    with pytest.raises(DataError, match="but 1, 2, 3: give --time NAME or --rate, and --columns to name them"):
        read_data(path)
    with pytest.raises(DataError, match="line 1: expected 2 columns as named, found 3"):
        read_data(path, names=("t", "left"))
    path.write_text("# made by numpy\n# t left right\n" + "\n".join(rows).replace(",", " "))
    assert [c.name for c in read_data(path).channels] == ["left", "right"]


def test_foreign_columns_are_left_out_with_a_remark(tmp_path: Path) -> None:
    path = tmp_path / "beam.csv"
    rows = [f"{k},{k / 100},{a},ok,{k},5,{'hit' if k == 200 else ''}" for k, a in enumerate(DATA[:, 0].tolist())]
    path.write_text("\n".join([",time [s],left,status,force [kN],humidity [%],event", *rows]))
    found = read_measured(path, DataOptions())
    assert [c.name for c in found.recording.channels] == ["left"]
    united = [f"{one} (no unit of motion)" for one in ("force [kN]", "humidity [%]")]
    left = ", ".join(["without a name: 1, status (text), event (text)", *united])
    assert found.remarks == (f"columns left out: {left}",)


@pytest.mark.parametrize(
    ("text", "quantity", "factor"),
    [
        *(("m/s²", "acceleration", 1.0), ("ft/s^2", "acceleration", 0.3048), ("mGal", "acceleration", 1e-5)),
        *(("in/s", "velocity", 0.0254), ("nm/s", "velocity", 1e-9), ("km/h", "velocity", 1 / 3.6)),
        *(("µm", "displacement", 1e-6), ("inch", "displacement", 0.0254), ("mV", "voltage", 1e-3)),
        ("counts", "counts", 1.0),
    ],
)
def test_unit_in_any_notation(text: str, quantity: str, factor: float) -> None:
    found = parse_unit(text)
    assert found is not None
    assert found.quantity == quantity
    assert found.factor == pytest.approx(factor, rel=1e-15)


@pytest.mark.parametrize(
    ("sensitivity", "unit", "motion"),
    [
        *(("100 mV/g", "mV", G / 100), ("0.1V/g", "V", G / 0.1), ("10.2 mV/(m/s2)", "V", 1000 / 10.2)),
        *(("1.02e1 mV/ms-2", "uV", 1e-3 / 10.2), ("16384 counts/g", None, G / 16384), ("-100 mV/g", "mV", -G / 100)),
    ],
)
def test_sensitivity_converts_voltages_to_motion(
    tmp_path: Path, sensitivity: str, unit: str | None, motion: float
) -> None:
    path = tmp_path / "beam.csv"
    path.write_text("t,left\n0,1\n0.5,-2\n")
    found = read_measured(path, DataOptions(unit=unit, sensitivity=parse_sensitivity(sensitivity)))
    np.testing.assert_allclose(found.recording.data[:, 0], [motion, -2 * motion], rtol=1e-12)


@pytest.mark.parametrize(
    "text", ["", "100", "100 mV", "mV/g", "0 mV/g", "100 g/mV", "1e999 mV/g", "100 mV/K", "1.2.3 V/g"]
)
def test_text_that_is_no_sensitivity_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="expected a sensitivity"):
        parse_sensitivity(text)


def test_calibration_of_each_channel(tmp_path: Path) -> None:
    path, file = tmp_path / "beam.csv", tmp_path / "calibration.toml"
    path.write_text(
        "\n".join(["t,left [V],right [mg]", *(f"{k / 100},{a},{b}" for k, (a, b) in enumerate(DATA.tolist()))])
    )
    file.write_text('[left]\nsensitivity = "500 mV/g"\noffset = 2.5\n[right]\nscale = -1.02\n[other]\nunit = "mm/s"\n')
    calibration = read_calibration(file)
    assert calibration["other"] == Calibration(unit="mm/s")
    found = read_measured(path, DataOptions(calibration=calibration))
    expected = np.column_stack([(DATA[:, 0] - 2.5) / 0.5 * G, -1.02e-3 * G * DATA[:, 1]])
    np.testing.assert_allclose(found.recording.data, expected, rtol=1e-12)
    assert "calibrated: left, right; no column for the calibration of other" in found.remarks
    with pytest.raises(DataError, match=r"column 'left \[V\]' is in V: give its sensitivity, as --sensitivity"):
        read_data(path)
    with pytest.raises(DataError, match=r"column 'left \[V\]': its sensitivity needs the unit counts, found 'V'"):
        read_measured(path, DataOptions(sensitivity=parse_sensitivity("9 counts/g")))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("left = 3", r"left: expected a table \[left\] with unit, sensitivity, scale, offset, found 3"),
        ("[left]\ngain = 3", "left.gain: expected one of unit, sensitivity, scale, offset"),
        ("[left]\nscale = 0", "left.scale: expected a number other than 0"),
        ("[left]\nscale = true", "left.scale: expected a finite number, found True"),
        ("[left]\noffset = nan", "left.offset: expected a finite number, found nan"),
        ('[left]\nunit = "parsec"', "left.unit: expected a unit as .*, found 'parsec'"),
        ('[left]\nsensitivity = "100"', "left.sensitivity: expected a sensitivity such as"),
        ("[left", "is no TOML"),
        ("[left]\nunit = mg", 'is no TOML: Invalid value .*: a text needs quotes: "mg"'),
    ],
)
def test_invalid_calibration_is_named(tmp_path: Path, text: str, message: str) -> None:
    file = tmp_path / "calibration.toml"
    file.write_text(text)
    with pytest.raises(DataError, match=rf"calibration\.toml: {message}"):
        read_calibration(file)


def test_displacements_are_differentiated_twice(tmp_path: Path) -> None:
    """Of a sine, within twice the relative error of 1e-4 that the differentiator has above 0.05 of the rate."""
    path, rate, omega = tmp_path / "beam.csv", 200.0, 2 * np.pi * 20
    t = np.arange(600) / rate
    path.write_text("\n".join(["top [mm]", *(f"{x!r}" for x in np.sin(omega * t).tolist())]))
    found = read_measured(path, DataOptions(rate=rate))
    assert "differentiated twice: top" in found.remarks
    expected = -1e-3 * omega**2 * np.sin(omega * t)
    inner = slice(64, -64)
    np.testing.assert_allclose(found.recording.data[inner, 0], expected[inner], atol=2e-4 * 1e-3 * omega**2)
    assert np.isnan(found.recording.data[:64]).all()


def test_compressed_tables_and_single_arrays(tmp_path: Path) -> None:
    text = "\n".join(["t,left,right", *(f"{k / 100},{a},{b}" for k, (a, b) in enumerate(DATA.tolist()))])
    (tmp_path / "beam.csv.gz").write_bytes(gzip.compress(text.encode()))
    with zipfile.ZipFile(tmp_path / "beam.zip", "w") as archive:
        archive.writestr("folder/beam.csv", text)
    np.save(tmp_path / "beam.npy", DATA)
    for name, rate in (("beam.csv.gz", None), ("beam.zip", None), ("beam.npy", 100.0)):
        found = read_data(tmp_path / name, rate=rate)
        assert found.rate == 100.0
        np.testing.assert_array_equal(found.data, DATA)
    with zipfile.ZipFile(tmp_path / "beam.zip", "a") as archive:
        archive.writestr("other.csv", text)
    with pytest.raises(DataError, match=r"beam\.zip: expected an archive of one table, found 2 files: folder/beam"):
        read_data(tmp_path / "beam.zip")
    (tmp_path / "cut.csv.gz").write_bytes((tmp_path / "beam.csv.gz").read_bytes()[:500])
    with pytest.raises(DataError, match=r"cut\.csv\.gz: is damaged: "):
        read_data(tmp_path / "cut.csv.gz")
    (tmp_path / "bomb.csv.gz").write_bytes(gzip.compress(b"t,a\n" + b"0" * (70 << 20), 9))
    with pytest.raises(DataError, match="table: expected up to 64000000 bytes unpacked"):
        read_data(tmp_path / "bomb.csv.gz")


@pytest.mark.parametrize(
    ("form", "order"),
    [
        ("01.02.2026 12:00:{:02d},{:03d}", None),
        ("01.02.26 12:00:{:02d},{:03d}", None),
        ("2026/02/01 12:00:{:02d},{:03d}", None),
        ("01/02/2026 12:00:{:02d}.{:03d}", "dmy"),
        ("2/1/2026 12:00:{:02d}.{:03d} PM", "mdy"),
        ("02/01/2026, 12:00:{:02d}.{:03d} pm", "mdy"),
        ("1 Feb 2026 12:00:{:02d}.{:03d}", None),
        ("1. Feb. 2026 12:00:{:02d},{:03d}", None),
        ("01-FEB-26 12:00:{:02d}.{:03d} PM", None),
        ("1 de febrero de 2026 12:00:{:02d},{:03d}", None),
        ("1er f\u00e9vr. 2026, 12:00:{:02d}.{:03d}", None),
        ("Feb 1, 2026, 12:00:{:02d}.{:03d} PM", None),
        ("Sunday, February 1, 2026 12:00:{:02d}.{:03d}", None),
        ("Sun Feb  1 12:00:{:02d}.{:03d} 2026", None),
        ("2026\u5e742\u67081\u65e5 12:00:{:02d}.{:03d}", None),
    ],
)
def test_dates_of_other_countries(tmp_path: Path, form: str, order: str | None) -> None:
    path = tmp_path / "beam.csv"
    rows = [f"{form.format(k // 100, 10 * (k % 100))};{a}" for k, a in enumerate(DATA[:, 0].tolist())]
    path.write_text("\n".join(["Time;left", *rows]))
    found = read_data(path, date_order=order)
    assert (found.start, found.rate) == (START, 100.0)
    np.testing.assert_array_equal(found.data[:, 0], DATA[:, 0])


@pytest.mark.parametrize(
    ("names", "month"),
    [
        ("Jan jan. enero GEN Stycznia", 1),
        ("mar M\u00e4rz mars mrt. Mar\u00e7o maart", 3),
        ("may mai mag. mei maj", 5),
        ("jun juin giu", 6),
        ("jul juil. lug", 7),
        ("ao\u00fbt ago sierpnia", 8),
        ("out. ott okt pa\u017adziernika", 10),
        ("dic D\u00e9c. dez des gru", 12),
        ("jui ma Mode Channel", None),
    ],
)
def test_month_names_of_many_languages(names: str, month: int | None) -> None:
    assert [month_of(name.rstrip(".")) for name in names.split()] == [month] * len(names.split())


def test_order_of_day_and_month_follows_from_a_day_after_the_twelfth(tmp_path: Path) -> None:
    path = tmp_path / "beam.csv"
    for days, start in (("12/01 13/01", "2026-01-12"), ("01/12 01/13", "2026-01-12")):
        rows = [f"{day}/2026 {hour}:00:00,1" for day in days.split() for hour in range(24)]
        path.write_text("\n".join(["time,left", *rows]))
        found = read_data(path)
        assert found.start == int(np.datetime64(start, "ns").astype(np.int64))
        assert found.rate == pytest.approx(1 / 3600, rel=1e-5)


def test_high_pass_and_resampling(tmp_path: Path) -> None:
    """A sine in the pass band keeps its phase and amplitude, one at a quarter of the cut-off is removed (-96 dB)."""
    path, t = tmp_path / "beam.npz", np.arange(8000) / 400.0
    fast, slow = np.sin(2 * np.pi * 7.3 * t), 5 * np.sin(2 * np.pi * 0.25 * t)
    data = (fast + slow + 3)[:, None].copy()
    data[3000:3010] = np.nan
    np.savez(path, data=data, rate=400.0)
    found = read_measured(path, DataOptions(high_pass=1.0, resample=100.0)).recording
    assert found.rate == 100.0
    known = np.flatnonzero(np.isfinite(found.data[:, 0]))
    assert len(known) == 2000 - 2 * 10 - 23  # ten samples at each end and around the gap
    inner = [k for k in known.tolist() if 300 < k < 450 or 1050 < k < 1700]  # three periods of the cut-off off the ends
    np.testing.assert_allclose(found.data[inner, 0], fast[::4][inner], atol=2e-3)  # ripple of the resampler: 1.8e-3
    with pytest.raises(DataError, match="--high-pass: expected less than half the rate of 400 Hz"):
        read_measured(path, DataOptions(high_pass=200.0))
    with pytest.raises(DataError, match="--resample: expected at most the rate of 400 Hz"):
        read_measured(path, DataOptions(resample=500.0))


@pytest.mark.parametrize(
    ("offset", "value", "reason"),
    [(8, 1, "password required"), (10, 99, "compression method is not supported")],
    ids=["encrypted", "unknown compression"],
)
def test_archive_that_cannot_be_unpacked_is_refused(tmp_path: Path, offset: int, value: int, reason: str) -> None:
    """Encryption and the kind of compression are stated in the directory of the archive, which is edited here."""
    path = tmp_path / "beam.zip"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("beam.csv", "t,a\n0,1\n1,2\n")
    content = bytearray(path.read_bytes())
    content[content.index(b"PK\x01\x02") + offset] = value
    path.write_bytes(content)
    with pytest.raises(DataError, match=rf"beam\.zip: is damaged: .*{reason}"):
        read_data(path)


def test_start_with_its_date_is_used_after_a_line_with_a_date_alone() -> None:
    lines = [(1, "Test date: 2026-05-04"), (2, "Start time: 2026-05-04 10:00:00")]
    assert stated_start(lines, None) == StatedStart(time=1_777_888_800 * 10**9, place="line 2", with_clock=True)
