"""Files of other programs, written by the libraries of the formats, and the test files that these libraries ship."""

import importlib.util
import re
import sys
from datetime import UTC, datetime
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import pyarrow as pa
import pymseed
import pytest
from asammdf import MDF, Signal
from nptdms import ChannelObject, RootObject, TdmsFile, TdmsWriter
from pyarrow import feather, parquet
from scipy.io import wavfile

from daq import Channel, DataError, DataOptions, Recording, export_recording, read_data, read_measured
from daq.files import FORMATS, parse_sensitivity

G = 9.80665
RATE, START = 200.0, 1_769_947_200 * 10**9  # 2026-02-01 12:00:00
DATA = np.random.default_rng(342).standard_normal((400, 3))
DATE = np.datetime64(START, "ns")


def packaged(package: str, *parts: str) -> Path:
    """Return a file of an installed package."""
    found = importlib.util.find_spec(package)
    assert found is not None
    assert found.origin is not None
    return Path(found.origin).parent.joinpath(*parts)


# --- TDMS -------------------------------------------------------------------------------------------------------------


def tdms(path: Path, *channels: ChannelObject) -> Path:
    with TdmsWriter(path) as writer:
        writer.write_segment([RootObject(), *channels])
    return path


def test_tdms_with_waveform_properties(tmp_path: Path) -> None:
    waveform = {"wf_increment": 1 / RATE, "wf_start_time": DATE, "unit_string": "g"}
    path = tdms(
        tmp_path / "beam.tdms",
        ChannelObject("acc", "left", DATA[:, 0], properties=waveform),
        ChannelObject("acc", "right", DATA[:, 1].astype(np.float32), properties=waveform),
        ChannelObject("acc", "text", ["a", "b"]),
        ChannelObject("slow", "wind", DATA[:40, 2], properties={"wf_increment": 1.0, "wf_start_time": DATE}),
    )
    found = read_measured(path, DataOptions())
    assert [c.name for c in found.recording.channels] == ["left", "right"]
    assert (found.recording.rate, found.recording.start, found.dated) == (RATE, START, True)
    np.testing.assert_allclose(found.recording.data, G * DATA[:, :2], rtol=1e-6)
    assert found.remarks == (
        "start of the file: 2026-02-01T12:00:00.000+00:00",
        "from the columns: left, right in g",
        "columns left out: wind (another rate)",
    )
    chosen = read_data(path, columns={"wind": "wind"})
    assert (chosen.rate, len(chosen.data)) == (1.0, 40)
    with pytest.raises(DataError, match=r"channel 'wind' has another rate, length or start than 'left \[g\]'"):
        read_data(path, columns={"wind": "w", "left": "l"})
    with pytest.raises(DataError, match="expected a channel 'north', found left"):
        read_data(path, columns={"north": "n"})


def test_tdms_with_a_channel_of_times_and_a_gap(tmp_path: Path) -> None:
    keep = np.r_[0:100, 150:400]
    t = (np.arange(400) / RATE)[keep]
    stamps = DATE + (t * 1e9).round().astype("timedelta64[ns]")
    for name, times, start in (("Time [s]", t, 0), ("time", stamps.astype("datetime64[us]"), START)):
        path = tdms(
            tmp_path / f"{start}.tdms", ChannelObject("a", name, times), ChannelObject("a", "left", DATA[keep, 0])
        )
        found = read_data(path)
        assert (found.rate, found.start) == (RATE, start)
        np.testing.assert_array_equal(found.data[keep, 0], DATA[keep, 0])
        assert np.isnan(found.data[100:150]).all()


@pytest.mark.parametrize(
    ("name", "rate", "start"),
    [
        ("big_endian.tdms", 1000.0, "1970-01-01T00:00:00"),  # states 1904, which is no start
        ("raw1.tdms", 50e3, "2016-12-15T22:35:21"),
        ("Digital_Input.tdms", 2000.0, "2012-07-09T23:58:24.593732"),
    ],
)
def test_tdms_files_of_the_library(name: str, rate: float, start: str) -> None:
    path = packaged("nptdms", "test", "data", name)
    found = read_measured(path, DataOptions(unit="m/s2")).recording
    assert found.rate == pytest.approx(rate, rel=1e-12)
    assert abs(found.start - int(np.datetime64(start, "ns").astype(np.int64))) < 1000
    channels = [channel for group in TdmsFile.read(path).groups() for channel in group.channels()]
    expected = np.column_stack([channel[:] for channel in channels if len(channel) == len(found.data)])
    np.testing.assert_array_equal(found.data, expected)


@pytest.mark.parametrize(("unit", "per_second"), [("s", 1), ("ms", 1000), ("us", 10**6)])
def test_times_counted_from_1970_give_the_start_of_tdms_hdf5_and_parquet(
    tmp_path: Path, unit: str, per_second: int
) -> None:
    times = (START * 1e-9 + np.arange(400) / RATE) * per_second
    tables = [tmp_path / name for name in ("a.tdms", "a.h5", "a.parquet")]
    tdms(tables[0], ChannelObject("a", "time", times), ChannelObject("a", "left", DATA[:400, 0]))
    with h5py.File(tables[1], "w") as file:
        file["time"], file["left"] = times, DATA[:400, 0]
    pd.DataFrame({"time": times, "left": DATA[:400, 0]}).to_parquet(tables[2])
    for path in tables:
        found = read_measured(path, DataOptions(unit="m/s2"))
        assert abs(found.recording.start - START) < 2000, path  # a double of 1970's seconds has 0.24 us
        assert found.recording.rate == pytest.approx(RATE, rel=1e-6)
        assert f"times of 'time' are counted from 1970 in {unit}" in found.remarks
        np.testing.assert_array_equal(found.recording.data[:, 0], DATA[:400, 0])


# --- HDF5 -------------------------------------------------------------------------------------------------------------


def test_hdf5_with_attributes_at_any_place(tmp_path: Path) -> None:
    path = tmp_path / "beam.h5"
    with h5py.File(path, "w") as file:
        file.attrs["Sampling Frequency"] = RATE
        group = file.create_group("run1/acc")
        group.attrs["start_time"] = "2026-02-01T12:00:00"
        left = group.create_dataset("left", data=DATA[:, 0], compression="gzip")
        left.attrs["units"] = "mg"
        group.create_dataset("right", data=DATA[:, 1].astype(np.float32))
        file.create_dataset("run1/note", data="text")
        file.create_dataset("run2/left", data=DATA[:50, 2])
    found = read_measured(path, DataOptions())
    assert [c.name for c in found.recording.channels] == ["run1/acc/left", "right"]
    assert (found.recording.rate, found.recording.start) == (RATE, START)
    np.testing.assert_allclose(found.recording.data, DATA[:, :2] * [1e-3 * G, 1.0], rtol=1e-6)
    assert "columns left out: run2/left (another rate)" in found.remarks
    by_path = read_data(path, columns={"/run2/left": "left"})
    np.testing.assert_array_equal(by_path.data[:, 0], DATA[:50, 2])


def test_hdf5_with_a_matrix_and_sibling_datasets(tmp_path: Path) -> None:
    path = tmp_path / "beam.hdf5"
    with h5py.File(path, "w") as file:
        file["y"] = DATA
        file["dt"] = 1 / RATE
        file["names"] = ["a", "b", "c"]
    found = read_data(path)
    assert ([c.name for c in found.channels], found.rate) == (["a", "b", "c"], RATE)
    np.testing.assert_array_equal(found.data, DATA)
    with h5py.File(path, "w") as file:
        file["y"] = DATA.T
        file["time"] = np.arange(400) / RATE
    with pytest.raises(DataError, match=r"y: found \(3, 400\), .* give --transpose"):
        read_data(path)
    turned = read_measured(path, DataOptions(transposed=True)).recording
    assert ([c.name for c in turned.channels], turned.rate) == (["y_1", "y_2", "y_3"], RATE)
    np.testing.assert_array_equal(turned.data, DATA)


def test_matlab_7_3_file(tmp_path: Path) -> None:
    """As Matlab writes it: transposed arrays, texts as codes, names as references."""
    path = tmp_path / "beam.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        file.create_dataset("data", data=DATA.T).attrs["MATLAB_class"] = np.bytes_("double")
        file.create_dataset("fs", data=[[RATE]]).attrs["MATLAB_class"] = np.bytes_("double")
        texts = [np.array([[ord(c)] for c in name], np.uint16) for name in ("left", "right", "top")]
        cells = [file.create_dataset(f"#refs#/{k}", data=text).ref for k, text in enumerate(texts)]
        names = file.create_dataset("names", data=np.array([cells], h5py.ref_dtype))
        names.attrs["MATLAB_class"] = np.bytes_("cell")
    head = b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM"
    path.write_bytes(head + path.read_bytes()[128:])
    found = read_data(path)
    assert ([c.name for c in found.channels], found.rate) == (["left", "right", "top"], RATE)
    np.testing.assert_array_equal(found.data, DATA)


# --- Parquet and Arrow ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("ending", [".parquet", ".feather", ".arrow"])
@pytest.mark.parametrize("times", ["dates", "zone", "seconds", "none"])
def test_parquet_and_arrow_tables(tmp_path: Path, ending: str, times: str) -> None:
    path = tmp_path / f"beam{ending}"
    t = np.arange(400) / RATE
    stamps = DATE + (t * 1e9).round().astype("timedelta64[ns]")
    columns = {
        "dates": {"when": pa.array(stamps)},
        "zone": {"when": pa.array(stamps).cast(pa.timestamp("us", "UTC"))},
        "seconds": {"time [ms]": pa.array(1000 * t)},
        "none": {},
    }[times]
    left = [None if k == 7 else value for k, value in enumerate(DATA[:, 0].tolist())]
    table = pa.table({**columns, "left [g]": left, "right": DATA[:, 1], "state": ["ok"] * 400})
    if ending == ".parquet":
        parquet.write_table(table, path)
    elif ending == ".feather":
        feather.write_feather(table, path)
    else:
        with pa.ipc.new_stream(path, table.schema) as file:
            file.write_table(table, max_chunksize=150)
    found = read_measured(path, DataOptions(rate=RATE if times == "none" else None))
    assert [c.name for c in found.recording.channels] == ["left", "right"]
    assert found.recording.rate == RATE
    assert found.recording.start == (START if times in ("dates", "zone") else 0)
    assert np.isnan(found.recording.data[7, 0])
    np.testing.assert_allclose(
        np.delete(found.recording.data, 7, 0), np.delete(DATA[:, :2] * [G, 1.0], 7, 0), rtol=1e-12
    )
    assert found.remarks[-1] == "columns left out: state (string)"


def test_parquet_of_pandas_with_an_index_of_dates(tmp_path: Path) -> None:
    index = pd.DatetimeIndex(DATE + np.arange(400) * np.timedelta64(5, "ms"))
    pd.DataFrame(DATA, index=index, columns=["a", "b", "c"]).to_parquet(tmp_path / "beam.parquet")
    found = read_data(tmp_path / "beam.parquet")
    assert (found.rate, found.start) == (RATE, START)
    np.testing.assert_array_equal(found.data, DATA)


def test_parquet_file_of_the_library() -> None:
    """Diamonds: no signals of a structure, but numbers."""
    path = packaged("pyarrow", "tests", "data", "parquet", "v0.7.1.parquet")
    found = read_measured(path, DataOptions(rate=1.0, columns={"depth": "depth", "x": "x"}))
    frame = pd.read_parquet(path)
    np.testing.assert_array_equal(found.recording.data, frame[["depth", "x"]].to_numpy())


# --- MDF --------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("version", ["4.10", "3.30"])
def test_mdf_with_groups_of_two_rates(tmp_path: Path, version: str) -> None:
    t, slow = np.arange(400) / RATE, np.arange(20.0)
    mdf = MDF(version=version)
    mdf.start_time = datetime.fromtimestamp(START / 1e9, UTC)
    mdf.append([Signal(DATA[:, k], t, name=name, unit="g") for k, name in enumerate(("left", "right"))])
    mdf.append([Signal(DATA[:20, 2], slow, name="wind", unit="m/s")])
    mdf.append([Signal(DATA[:20, 2], slow**2, name="event", unit="m/s2")])
    path = mdf.save(tmp_path / "beam.mf4" if version == "4.10" else tmp_path / "beam.mdf")
    mdf.close()
    found = read_measured(Path(path), DataOptions())
    assert [c.name for c in found.recording.channels] == ["left", "right"]
    assert (found.recording.rate, found.recording.start) == (RATE, START)
    np.testing.assert_allclose(found.recording.data, G * DATA[:, :2], rtol=1e-12)
    assert found.remarks[-1] == "columns left out: wind [m/s] (another rate), event (no even times)"


# --- miniSEED ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("kind", ["i", "f"])
def test_miniseed_with_a_gap(tmp_path: Path, version: int, kind: str) -> None:
    path = tmp_path / "beam.mseed"
    samples = (1000 * DATA).astype(np.int32 if kind == "i" else np.float32)
    traces = pymseed.MS3TraceList()
    for k, axis in enumerate("ENZ"):
        for begin, end in ((0, 150), (200, 400)):
            traces.add_data(
                f"FDSN:AM_R7FA5_00_E_N_{axis}",
                samples[begin:end, k].copy(),
                kind,
                RATE,
                starttime=START + round(begin / RATE * 1e9),
            )
    encoding = pymseed.DataEncoding.STEIM2 if kind == "i" else pymseed.DataEncoding.FLOAT32
    traces.to_file(path, encoding=encoding, format_version=version)
    if kind == "i":
        with pytest.raises(DataError, match=r"column 'ENE \[counts\]' is in counts: give its sensitivity"):
            read_data(path)
    sensitivity = parse_sensitivity("1000 counts/(m/s2)") if kind == "i" else None
    found = read_measured(path, DataOptions(sensitivity=sensitivity, factor=None if kind == "i" else 1e-3)).recording
    assert [c.name for c in found.channels] == ["ENE", "ENN", "ENZ"]
    assert (found.rate, found.start) == (RATE, START)
    assert np.isnan(found.data[150:200]).all()
    kept = np.r_[0:150, 200:400]
    np.testing.assert_allclose(found.data[kept], samples[kept] / 1000, rtol=1e-6)
    assert len(found.gaps) == 1


# --- WAV --------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("dtype", "full"), [(np.int16, 1 << 15), (np.int32, 1 << 31), (np.uint8, 128), (np.float32, 1)]
)
def test_wav_is_a_share_of_full_scale(tmp_path: Path, dtype: type, full: int) -> None:
    shares = np.clip(DATA[:, :2] / 5, -0.99, 0.99)
    numbers: np.ndarray = (shares * full + (128 if dtype is np.uint8 else 0)).astype(dtype)
    wavfile.write(tmp_path / "beam.wav", int(RATE), numbers)
    found = read_measured(tmp_path / "beam.wav", DataOptions(unit="g", factor=2.0)).recording
    assert (found.rate, [c.name for c in found.channels]) == (RATE, ["ch1", "ch2"])
    np.testing.assert_allclose(found.data, 2 * G * shares, atol=2 * G * max(1 / full, 1e-6))


@pytest.mark.parametrize(
    ("name", "rate", "channels"),
    [
        ("test-8000Hz-le-3ch-5S-24bit.wav", 8000, 3),
        ("test-44100Hz-2ch-32bit-float-be.wav", 44100, 2),
        ("test-8000Hz-le-3ch-5S-24bit-rf64.wav", 8000, 3),
    ],
)
def test_wav_files_of_scipy(name: str, rate: int, channels: int) -> None:
    path = packaged("scipy", "io", "tests", "data", name)
    found = read_data(path)
    assert (found.rate, found.data.shape[1]) == (rate, channels)
    assert np.abs(found.data).max() <= 1


# --- all formats ------------------------------------------------------------------------------------------------------

ENDINGS = [ending for known in FORMATS for ending in known.endings]
CONTENTS = (b"", b"t,a\n0,1\n", bytes(2000), b"TDSm" + b"\xff" * 99, b"RIFF\xff\xff\xff\xffWAVE", b"MDF     " * 99)
WRITTEN = [ending for known in FORMATS if known.writes for ending in known.endings]


@pytest.mark.parametrize("ending", WRITTEN)
def test_exported_file_is_imported_with_devices_and_start(tmp_path: Path, ending: str) -> None:
    channels = tuple(Channel(name=name, device=f"imu{k // 2}", axis=k % 2) for k, name in enumerate("abc"))
    recording = Recording(channels=channels, data=DATA, rate=RATE, start=START + 123)
    path = tmp_path / f"beam{ending}"
    export_recording(path, recording)
    found = read_data(path)
    assert (found.channels, found.start) == (channels, START + 123)
    assert found.rate == pytest.approx(RATE, rel=1e-9)
    np.testing.assert_allclose(found.data, DATA, rtol=1e-10)
    with pytest.raises(DataError, match="cannot be written: File exists"):
        export_recording(path, recording)


@pytest.mark.parametrize("known", [known for known in FORMATS if not known.writes], ids=lambda known: known.name)
def test_export_to_a_format_that_is_only_read_is_refused(tmp_path: Path, known: object) -> None:
    path = tmp_path / f"beam{known.endings[0]}"  # type: ignore[attr-defined]
    recording = Recording(channels=(Channel(name="a", device="d", axis=0),), data=DATA[:, :1], rate=RATE, start=0)
    with pytest.raises(DataError, match=r"cannot be written; \.csv, \.txt, \.npz, \.mat, \.uff, .*\.parquet, .* can"):
        export_recording(path, recording)
    assert not path.exists()


def test_export_with_an_unknown_ending_is_refused(tmp_path: Path) -> None:
    recording = Recording(channels=(Channel(name="a", device="d", axis=0),), data=DATA[:, :1], rate=RATE, start=0)
    for path, found in ((tmp_path / "beam.xyz", ".xyz"), (tmp_path / "beam", "no ending")):
        with pytest.raises(DataError, match=rf"{found} cannot be written; \.csv"):
            export_recording(path, recording)
        assert not path.exists()


@pytest.mark.parametrize("ending", ENDINGS)
def test_file_of_another_format_is_refused(tmp_path: Path, ending: str) -> None:
    path = tmp_path / f"beam{ending}"
    for content in CONTENTS:
        path.write_bytes(content)
        with pytest.raises(DataError, match=rf"beam\{ending}: ") as found:
            read_data(path, rate=1.0)
        assert "\n" not in str(found.value)
    with pytest.raises(DataError, match=rf"none\{ending}: cannot be read: No such file or directory"):
        read_data(tmp_path / f"none{ending}")


@pytest.mark.parametrize("known", [known for known in FORMATS if known.package], ids=lambda known: known.name)
def test_missing_package_is_named(tmp_path: Path, known: object, monkeypatch: pytest.MonkeyPatch) -> None:
    names = {"npTDMS": "nptdms"}
    package, module, ending = known.package, known.module, known.endings[0]  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, names.get(package, package), None)
    monkeypatch.delitem(sys.modules, f"daq.files.formats.{module}", raising=False)
    path = tmp_path / f"beam{ending}"
    path.write_bytes(b"")
    with pytest.raises(DataError) as found:
        read_data(path)
    expected = f"needs {package}, which is not installed: pip install 'modalwatch[formats]'"
    assert str(found.value).endswith(expected)


def test_documented_formats_are_those_that_are_read_and_written() -> None:
    """Ending by ending: the package, and whether files are written."""
    page = (Path(__file__).parents[3] / "docs" / "reference" / "formats.md").read_text(encoding="utf-8")
    documented: dict[str, tuple[set[str], bool]] = {}
    for row in (line.split("|")[1:-1] for line in page.splitlines() if line.count("|") == 7):
        for ending in re.findall(r"`(\.\w+)`", row[1]):
            packages, written = documented.get(ending, (set(), False))
            more = row[3].strip() == "yes" or ending in row[3]
            documented[ending] = packages | set(row[2].split()), written or more
    of_tables_and_traffic = {".gz", ".zip", ".log", ".blf", ".asc", ".trc"}
    own = {"mat": {"h5py"}}  # of version 7.3 only
    assert {ending: found for ending, found in documented.items() if ending not in of_tables_and_traffic} == {
        ending: ({known.package} if known.package else own.get(ending[1:], set()), known.writes)
        for known in FORMATS
        for ending in known.endings
    }
