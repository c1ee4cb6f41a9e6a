"""Layouts of files that measuring programs wrote: the origin of each layout is in the docstring of its test.

The files were read in public repositories; the numbers here are made. Names are those of the files where a rule depends
on them.
"""

from datetime import UTC, datetime, timedelta
from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from daq import DataError, DataOptions, read_data, read_measured
from daq.files import parse_sensitivity

G = 9.80665
DATA = np.random.default_rng(340).standard_normal((40, 2)).round(4)


def utc(text: str) -> int:
    return round(datetime.fromisoformat(text).replace(tzinfo=UTC).timestamp() * 1e6) * 1000


def test_catman_file_with_thirty_lines_of_channel_headers(tmp_path: Path) -> None:
    """Catman 4 (HBM): manpan-1/PySS, tests/test_data/experiment/init_sample_1_test_2.asc.

    Names and units are twenty lines above the rows; the lines between have a cell for each column.
    """
    head = [
        "HBM_CATMAN_DATAFILE_40\n\n2017-11-13\n11:24\nCHANNELS: 4\nSEPARATOR: 9\nMAXLINES: 40    \n",
        "Time DEVICE_1 (Sample rate 1) CH=1\tLoad CH=2\tTop CH=3\tFTG1 CH=10",
        "s\tkN\tm/s²\tµm/m",
        "\t".join(["2017-11-10-17:06"] * 4),
        "\t\t\t",
        "\t".join(["T0 =10.11.17 16:53:58"] * 4),
        "\t".join(["dt =20 ms"] * 4),
        "CH 0\tCH 1 - 1\tCH 1 - 2\tCH 2 - 1",
        "Not available ID=0\tDC 10V (AP801) ID=5506\tDC 10V (AP801) ID=5506\tSG Quarter bridges (AP814) ID=5512",
        "x1=0 y1=0;x2=0 y2=0\tx1=0 y1=0;x2=10 y2=100\tx1=0 y1=0;x2=10 y2=100\tx1=0 y1=0;x2=80000 y2=100",
        "         (Electr.)\tV IN     (Electr.)\tV IN     (Electr.)\tµm/m     (Electr.)",
        "0  Zero\t0 V-in Zero\t0 V-in Zero\t0.1076471 mV/V Zero",
        "Gage factor = 0\tGage factor = 0\tGage factor = 0\tGage factor = 2.125",
        "\t".join(["Sensor: None"] * 4),
        "\t".join(["Cable length correction Not available"] * 4) + "\n",
    ]
    rows = [f"{k / 50:.6f}\t{load}\t{top}\t0.1" for k, (load, top) in enumerate(DATA.tolist())]
    path = tmp_path / "test.asc"
    path.write_text("\r\n".join([*head, *rows]), encoding="latin-1")
    found = read_measured(path, DataOptions())
    assert [c.name for c in found.recording.channels] == ["Top CH=3"]
    np.testing.assert_allclose(found.recording.data[:, 0], DATA[:, 1], rtol=1e-12)
    assert (found.recording.rate, found.recording.start) == (50.0, utc("2017-11-10T16:53:58"))
    assert found.remarks[-1] == (
        "columns left out: Load CH=2 [kN] (no unit of motion), FTG1 CH=10 [µm/m] (no unit of motion)"
    )


LVM = """LabVIEW Measurement\t
Writer_Version\t{version}
Separator\tTab
Multi_Headings\tYes
X_Columns\t{columns}
Time_Pref\tAbsolute
Operator\tmt
Date\t2013/02/18
Time\t09:54:07,284627
***End_of_Header***\t
\t
"""


def labview(version: str, columns: str, names: str, **segment: str) -> str:
    """Return a file without its rows; `segment` has the values of two channels, which differ for units only."""
    between, point = ("\t\t", ".") if columns == "Multi" else ("\t", ",")
    labels = {"Channels": "2", "Samples": "4", "X_Dimension": "Time", "X0": f"0{point}0000000000000000E+0", **segment}
    order = ("Channels", "Samples", "Date", "Time", "Y_Unit_Label", "X_Dimension", "X0", "Delta_X")
    rows = [(label, labels[label].split("|")) for label in order]
    lines = [f"{label}\t{values[0]}{between}{'' if label == 'Channels' else values[-1]}\t" for label, values in rows]
    head = LVM.format(version=version, columns=columns)
    return "\n".join([head + lines[0], *lines[1:], "***End_of_Header***" + 2 * between, names, ""])


def test_labview_file_with_times_of_each_channel(tmp_path: Path) -> None:
    """LabVIEW 0.92: ladisk/lvm_read, data/no_decimal_separator.lvm and multi_time_column.lvm.

    There are fewer rows than lines of numbers in the preamble, and a file without its last lines is read.
    """
    segment = {"Date": "2016/12/13", "Time": "08:00:01,483999", "Y_Unit_Label": "g|Volts", "Delta_X": "0.000250"}
    text = labview("0.92", "Multi", "X_Value\tax\tX_Value\tay\tComment", **segment)
    rows = [f"{k * 2.5e-4:.6f}\t{a}\t{k * 2.5e-4:.6f}\t{b}" for k, (a, b) in enumerate(DATA[:4].tolist())]
    path = tmp_path / "beam.lvm"
    for n in (2, 4):
        path.write_text(text + "\n".join(rows[:n]) + "\n\n")
        found = read_measured(path, DataOptions(sensitivity=parse_sensitivity("100 mV/g")))
        assert [c.name for c in found.recording.channels] == ["ax", "ay"]
        np.testing.assert_allclose(found.recording.data, DATA[:n] * [G, 10 * G], rtol=1e-12)
        assert found.recording.rate == pytest.approx(4000.0)
        assert found.recording.start == utc("2016-12-13T08:00:01.483999")  # of the segment, not of the file
        assert found.remarks[-1] == "columns left out: X_Value (repeated)"


def test_labview_file_with_brackets_in_names_and_units_of_other_quantities(tmp_path: Path) -> None:
    """LabVIEW 2: ladisk/lvm_read, data/short.lvm."""
    segment = {
        "Date": "2013/02/19",
        "Time": "09:51:40,7271890640258789063",
        "Y_Unit_Label": "Newtons|m/s^2",
        "Delta_X": "3,906250E-5",
    }
    text = labview("2", "No", "X_Value\tExcitation (Trigger)\tResponse (Trigger)\tComment", **segment)
    path = tmp_path / "hit.lvm"
    path.write_text(text + "".join(f"\t{a}\t{b}\n".replace(".", ",") for a, b in DATA.tolist()))
    found = read_measured(path, DataOptions())
    assert [c.name for c in found.recording.channels] == ["Response (Trigger)"]
    np.testing.assert_allclose(found.recording.data[:, 0], DATA[:, 1], rtol=1e-12)
    assert found.recording.rate == pytest.approx(25600.0)
    assert found.recording.start == utc("2013-02-19T09:51:40.727189")


def test_sesame_file_has_the_unit_of_its_preamble(tmp_path: Path) -> None:
    """SESAME ASCII of a SARA recorder: jpvantassel/hvsrpy, test/data/input/saf/mt_20211122_133110.saf."""
    path = tmp_path / "mt.saf"
    counts = (1e4 * DATA).astype(int)
    path.write_text(
        "SESAME ASCII data format (saf) v. 1    (this line must not be modified)\nSAMP_FREQ = 50\nNDAT = 0000000040\n"
        "START_TIME = 2021 11 22 13 31 10.000\nSENSOR_TYPE = Acceleration\nRESPFILE =\n"
        "# The response file for the NS-channel is the following:\n#\nSTA_CODE = SRHV-02\nSTA_COORD_TYPE = 0\n"
        "UNITS = Counts\nCH0_ID = V\nCH1_ID = N\nSTA_X =\nSTA_Z = 0\n####--------------------------------\n"
        + "".join(f"{a} {b}\n" for a, b in counts.tolist())
    )
    with pytest.raises(DataError, match="column '1' is in Counts: give its sensitivity"):
        read_data(path)
    options = DataOptions(names=("V", "N"), sensitivity=parse_sensitivity("2000 counts/(m/s2)"))
    found = read_measured(path, options).recording
    assert (found.rate, found.start) == (50.0, utc("2021-11-22T13:31:10"))
    np.testing.assert_allclose(found.data, counts / 2000, rtol=1e-12)


PHONES = {
    # MbientLab: columns as read by several public programs; the second has the times in another form
    "epoc (ms),timestamp (+0100),elapsed (s),x-axis (g),y-axis (g)": "{ms},{iso},{s:.3f},{a},{b}",
    "time,seconds_elapsed,z,y": "{ns},{s:.6f},{a},{b}",  # Sensor Logger: AybarsCebi, TotalAcceleration.csv
    "Date;Timestamp;DeviceOrientation;AccelerationX;AccelerationY": "{iso};{epoch:.6f};faceUp;{a};{b}",  # SensorLog
    "Address\tChipTime\tax(g)\tay(g)\twx(deg/s)": "0x50\t{iso}\t{a}\t{b}\t0.0",  # WitMotion
    "": "{iso},{a},{b}",  # OmGui of Axivity
    "Fecha;Hora;a;b": "{day};{clock};{a};{b}",  # dates and times of day, called so in any language
    "count,a_x,a_y": "{k},{a},{b}",  # PLab-SI/PicoQuake, docs/acquisition_data.md
}


@pytest.mark.parametrize("names", PHONES)
def test_times_of_telephones_and_loggers(tmp_path: Path, names: str) -> None:
    """Times since 1970, dates in any column, and counters; each line of the table above names its origin."""
    began = datetime(2024, 4, 21, 15, 54, 46, tzinfo=UTC)
    lines = [names] if names else []
    if names.startswith("count"):
        lines.insert(0, "# PLab PicoQuake Data\n# Config: data_rate = 50.0 Hz, filter = 488 Hz, acc_range = 4 g")
    for k, (a, b) in enumerate(DATA.tolist()):
        moment = began + timedelta(seconds=k / 50)
        us = round(moment.timestamp() * 1e6)
        iso = moment.replace(tzinfo=None).isoformat(timespec="milliseconds")
        day, clock = f"{moment:%d.%m.%Y}", f"{moment:%H:%M:%S.%f}"
        values = {
            "day": day,
            "clock": clock,
            "ms": us // 1000,
            "ns": 1000 * us,
            "epoch": us / 1e6,
            "iso": iso,
            "s": k / 50,
            "k": k + 1,
        }
        lines.append(PHONES[names].format(**values, a=a, b=b))
    path = tmp_path / "phone.csv"
    path.write_text("\n".join(lines))
    found = read_measured(path, DataOptions()).recording
    assert len(found.channels) == 2
    assert found.rate == pytest.approx(50.0, rel=1e-6)
    np.testing.assert_allclose(found.data, DATA * (G if "(g)" in names else 1.0), rtol=1e-12)
    if not names.startswith("count"):
        assert found.start == pytest.approx(began.timestamp() * 1e9, abs=1e3)


@pytest.mark.parametrize(
    "content",
    [
        {"shm01a": DATA, "Fs": 200.0},  # a matrix of any name, as in the IASC-ASCE benchmark
        {"Dat": {"Data": DATA, "SampleRate": 200.0, "Date": "2020"}},  # a structure
        {"test": {"info": {"dt": 1 / 200}, "acc": DATA}, "floor": np.arange(3.0)},
    ],
)
def test_matlab_files_of_data_sets(tmp_path: Path, content: dict[str, object]) -> None:
    """Forms in which public programs read data sets: the arrays have any name, or are fields of a structure."""
    path = tmp_path / "set.mat"
    savemat(path, content)
    found = read_measured(path, DataOptions())
    np.testing.assert_array_equal(found.recording.data, DATA)
    assert found.recording.rate == pytest.approx(200.0)
    assert found.remarks[0].startswith("channels of the array ")


def test_structure_in_a_file_of_matlab_7_3(tmp_path: Path) -> None:
    path = tmp_path / "set.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        group = file.create_group("Dat")
        group.attrs["MATLAB_class"] = np.bytes_("struct")
        group["Data"], group["SampleRate"] = DATA.T, 200.0
        file.create_group("#refs#")["a"] = np.arange(5.0)
    with path.open("r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")
    found = read_data(path)
    np.testing.assert_array_equal(found.data, DATA)
    assert found.rate == 200.0


@pytest.mark.parametrize(
    ("encoding", "unit", "factor"), [("utf-8", "m/s²", 1), ("latin-1", "m/s²", 1), ("utf-8", "g", G)]
)
def test_universal_file_of_catman_has_units_in_labels(tmp_path: Path, encoding: str, unit: str, factor: float) -> None:
    """Catman (HBM): ladisk/pyuff, data/time-history-not-all-columns-filled.uff: general data, no dataset 164."""
    values = [f"{value:13.5E}" for value in DATA[:13, 0]]
    rows = ["".join(values[k : k + 6]) for k in range(0, 13, 6)]
    lines = [
        *("    -1", "    58", f"1x : {unit}", "UFF58 file created by HBM catman", "30-Apr-20 19:12:52", "NONE", "NONE"),
        "    1         0    0         0 NONE               0   0 NONE               0   0",
        "         2        13         1 0.00000E+000 5.00000E-005 0.00000E+000",
        "        17    0    0    0 Time                 s",
        f"         1    0    0    0 1x                   {unit}",
        *("         0    0    0    0 NONE                 NONE",) * 2,
        *rows,
        "    -1",
    ]
    path = tmp_path / "beam.uff"
    path.write_text("".join(f"{line:80}\n" for line in lines), encoding=encoding)
    found = read_data(path)
    np.testing.assert_allclose(found.data[:, 0], factor * DATA[:13, 0], rtol=1e-5)
    assert (found.rate, found.start) == (20000.0, utc("2020-04-30T19:12:52"))
