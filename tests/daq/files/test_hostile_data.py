"""Files of measurements with sizes, times and values that cannot be meant, and arrays that lie on their side."""

import resource
import struct
import zipfile
import zlib
from pathlib import Path

import numpy as np
import pytest
import scipy.io

from daq import Channel, DataError, DataOptions, read_measured
from daq.files import LoggedSensor, import_can_log
from tests.support.daq.can_buses import IMU
from tests.support.daq.emulated_can import imu
from tests.support.monitor.cli import Commands, assert_refused

DATA = np.random.default_rng(0).standard_normal((200, 3))
MAX_KILOBYTES = 150_000  # that reading may take beyond what the tests have


@pytest.fixture
def commands(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Commands:
    return Commands(monkeypatch, capsys)


def test_wide_array_is_refused_without_transpose_option(commands: Commands, tmp_path: Path) -> None:
    path = tmp_path / "side.npz"
    np.savez(path, data=np.tile(DATA.T, 20), rate=100.0)
    done = commands("import", path, "-o", tmp_path / "a.mcap")
    assert_refused(done, path, "(3, 4000)", "4000 channels of 3 samples", "--transpose", "--no-transpose")
    assert commands("import", path, "-o", tmp_path / "a.mcap", "--transpose").code == 0
    turned = read_measured(path, DataOptions(transposed=True)).recording
    np.testing.assert_array_equal(turned.data, np.tile(DATA.T, 20).T)


@pytest.mark.parametrize("known", ["names", "times"])
def test_short_many_channel_record_with_names_or_times_is_read(tmp_path: Path, known: str) -> None:
    path = tmp_path / "short.npz"
    more = {"channels": [f"c{k}" for k in range(200)]} if known == "names" else {"t": np.arange(3) / 100}
    np.savez(path, data=DATA.T, **({"rate": 100.0} if known == "names" else {}), **more)  # type: ignore[arg-type]
    assert read_measured(path, DataOptions()).recording.data.shape == (3, 200)


def npy(shape: tuple[int, ...], content: bytes, dtype: str = "<f8") -> bytes:
    head = f"{{'descr': '{dtype}', 'fortran_order': False, 'shape': {shape}, }}".ljust(117).encode() + b"\n"
    return b"\x93NUMPY\x01\x00v\x00" + head + content


def archive(path: Path, **members: bytes) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        for name, content in members.items():
            file.writestr(f"{name}.npy", content)
    return path


def mat_bomb(path: Path) -> Path:
    scipy.io.savemat(path, {"data": np.zeros((3, 1))}, do_compression=True)
    packed = zlib.compress(struct.pack("<II", 14, 80 << 20) + bytes(80 << 20), 9)
    path.write_bytes(path.read_bytes()[:128] + struct.pack("<II", 15, len(packed)) + packed)
    return path


@pytest.mark.parametrize(("place", "message"), [(0, "unknown kind 0"), (8, "an array is of an unknown class")])
def test_damaged_elements_of_a_mat_file_are_refused(
    commands: Commands, tmp_path: Path, place: int, message: str
) -> None:
    """The kind of the numbers, at which scipy ends with a fault of memory, and the class of the array."""
    path = tmp_path / "a.mat"
    scipy.io.savemat(path, {"data": DATA, "rate": 100.0})
    content = bytearray(path.read_bytes())
    at = content.index(struct.pack("<II", 9, DATA.nbytes)) if place == 0 else 128 + 8 + 8
    content[at : at + 1] = b"\x00"
    path.write_bytes(bytes(content))
    assert_refused(commands("import", path, "-o", tmp_path / "a.mcap"), path, message)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda p: archive(p / "a.npz", data=npy((10**10,), b"")), "data.npy: (10000000000,) of float64 are"),
        (lambda p: archive(p / "a.npz", data=npy((10**5, 10**5), bytes(99))), "are 80000000000 bytes, found 99"),
        (lambda p: archive(p / "a.npz", data=npy((3,), b"", "<U100000000")), "data.npy: (3,)"),
        (lambda p: archive(p / "a.npz", data=npy((10 << 20,), bytes(80 << 20))), "bytes unpacked"),
        (lambda p: mat_bomb(p / "a.mat"), "bytes unpacked"),
    ],
)
def test_excessive_array_size_is_refused_without_using_memory(tmp_path: Path, make: object, message: str) -> None:
    path: Path = make(tmp_path)  # type: ignore[operator]
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(DataError) as refused:
        read_measured(path, DataOptions(rate=100.0))
    assert message in str(refused.value)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < MAX_KILOBYTES


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("time,a\n9999-12-31T23:59:58,1\n9999-12-31T23:59:59,2\n", "dates from 1970 to 2115"),
        ("t,a\n0,1e300\n1,2\n2,1\n", "column 'a': expected up to 1e+20 m/s2, found 1e+300"),
        (",".join(f"a{k}" for k in range(10_001)) + "\n1\n", "expected up to 10000 columns"),
    ],
)
def test_table_with_extreme_values_or_size_is_refused(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "a.csv"
    path.write_text(text)
    with pytest.raises(DataError) as refused:
        read_measured(path, DataOptions())
    assert message in str(refused.value)


def blf(container: bytes, stated: int = 100) -> bytes:
    head = struct.pack("<4sLBBBBBBBBQQLL8H8H", b"LOGG", 144, *bytes(8), 0, 0, 0, 0, *[0] * 16).ljust(144, b"\0")
    body = struct.pack("<H6xL4x", 2, stated) + zlib.compress(container, 9)
    return head + struct.pack("<4sHHLL", b"LOBJ", 16, 1, 16 + len(body), 10) + body


_ASC = b"date Thu Jan 1 00:00:00.000 2026\nbase hex  timestamps absolute\ninternal events logged\n"
_TRC = b";$FILEVERSION=2.1\n;$STARTTIME=46023.0\n;$COLUMNS=N,O,T,B,I,d,R,L,D\n"


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("zero.blf", blf(struct.pack("<4sHHLL", b"LOBJ", 16, 1, 0, 99) + bytes(64)), "object of 0 bytes"),
        ("long.log", b"(1767225600.0) can0 006#" + b"00" * 16 + b"\n", "16 bytes"),
        ("remote.log", b"(1767225600.0) can0 006#R67489\n", "67489 bytes"),
        ("wide.asc", _ASC + b" 0.5 1  9223372036854775808  Rx   d 2 01 3D\n", "29 bits, found 76"),
        ("less.trc", _TRC + b"      1         0.000 DT  1     0006 Rx -  -29    00 00\n", "-29 bytes"),
        ("odd.trc", _TRC + b" " + b"x" * 5000 + b"\n", "Failed to parse message"),
        ("late.log", b"(1e300) can0 006#0000\n", "are none of CAN"),
    ],
)
def test_crafted_can_log_is_refused_without_using_memory(
    tmp_path: Path, name: str, content: bytes, message: str
) -> None:
    assert_refused_without_using_memory(tmp_path / name, content, message)


def test_can_log_of_200_mib_in_few_bytes_is_refused_without_using_memory(tmp_path: Path) -> None:
    content = blf(bytes(200 << 20))
    assert_refused_without_using_memory(tmp_path / "bomb.blf", content, "expected up to 16777216 bytes uncompressed")


def assert_refused_without_using_memory(path: Path, content: bytes, message: str) -> None:
    path.write_bytes(content)
    sensor = LoggedSensor(device="imu", rate=400.0, sensor=imu(IMU))
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(DataError) as refused:
        import_can_log(path, path.parent / "out.mcap", [sensor], (Channel(name="deck", device="imu", axis=0),))
    assert message in str(refused.value)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < MAX_KILOBYTES
