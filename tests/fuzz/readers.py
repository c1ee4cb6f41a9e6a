"""Readers of files from elsewhere, each with sound files to mutate and the command that reads them."""

import gzip
import json
import shutil
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache, partial
from importlib import import_module
from io import BytesIO
from pathlib import Path
from random import Random
from typing import Any
from zipfile import ZipFile

import can
import h5py
import numpy as np
from asammdf import MDF, Signal
from nptdms import ChannelObject, RootObject, TdmsWriter
from pymseed import MS3TraceList
from scipy.io import hb_write, mmwrite, savemat, wavfile
from scipy.sparse import csc_array

from daq import Channel, Event, McapWriter, Recording, export_recording, write_recording
from daq.drivers import LineFormat
from daq.drivers.serial.text_lines import ScanNumbers
from daq.files import header_set, read_geometry
from daq.log import repair_folder
from daq.protocol.raspberry_shake import CHANNELS, ShakeDecoder, encode_packet
from daq.protocol.text_line import TextDecoder
from daq.timing.resampling import StampCount
from monitor.analysis.modal_table.series import read_series
from monitor.analysis.modal_table.table import read_table
from monitor.cli.main import _run
from monitor.cli.options import explain
from monitor.rig import World, load_scenario
from monitor.rig.process import load_rig_structure
from monitor.service.operator_commands import Inbox
from monitor.settings import parse_settings
from monitor.watch.memory import recall
from tests.fuzz.mutations import (
    Mutation,
    crafted_mcap,
    crafted_npz,
    mutated_archive,
    mutated_blf,
    mutated_bytes,
    mutated_json,
    mutated_mcap,
    mutated_text,
)
from tests.support.daq.responses import COHERENCE, MULTIPLE, frequency_response, write_sets
from tests.support.nastran_files import binary_output4, dmig, sparse_output4
from updater import Matrices, build_model, parse_structure, save_matrices

_MODULES = (
    *("new.external_file", "data.structure.detectability", "data.importing.measurements", "data.importing.can_traffic"),
    *("data.identify.identification", "data.log_views", "logs.summary", "logs.conversion", "logs.repetition"),
    *("site.site_check", "site.monitoring", "operation.service_unit"),
)
for _module in _MODULES:
    import_module(f"monitor.cli.{_module}")  # which commands import when they run: once, not in each case

_ROOT = Path(__file__).parents[2]
_PORTAL = (_ROOT / "examples" / "portal_frame.toml").read_bytes()
_DBC = (_ROOT / "examples" / "imu.dbc").read_bytes()
_OSCILLATOR = b"""
[[oscillator]]
at = [1.5, 0.0, 2.0]
direction = [0, 0, 1]
mass = 2.0
frequency = 12.0

[sensors.left_x]
gain = 1.02
delay = 0.001

[recorder]
clock = 1.0001

[updating]
fixed = ["*.J"]
"""
_FRAME = b"""name = "frame"
material.steel = {youngs_modulus = 210e9, shear_modulus = 81e9, density = 7850}
section.bar = {area = 1e-4, second_moment = [8e-10, 8e-10], torsion_constant = 1.4e-9, shear_factor = 0.83}

[[member]]
name = "post"
from = [0, 0, 0]
to = [0, 0, 1.0]
material = "steel"
section = "bar"
elements = 6

[[support]]
at = [0, 0, 0]
fixed = ["x", "y", "z", "rx", "ry", "rz"]

[[body]]
at = [0, 0, 1.0]
mass = 0.2

[[sensor]]
channel = "a"
at = [0, 0, 0.5]
direction = [1, 0, 0]

[[sensor]]
channel = "b"
at = [0, 0, 1.0]
direction = [1, 0, 0]

[[sensor]]
channel = "c"
at = [0, 0, 1.0]
direction = [0, 1, 0]
"""
_SITE = b"""structure = "structure.toml"
state = "state"

[[device]]
name = "imu"
driver = "epson-uart"
port = "/dev/modalwatch-none"
rate = 1000
delay_ms = 1.5
channels = {x = "a", y = "b", z = "c"}

[recorder]
folder = "log"
chunk_seconds = 0.25
rotate_mb = 512.0
rotate_minutes = 60.0
keep_days = 365.0
keep_gb = 500.0
min_free_gb = 1.0
view_rate = 50.0

[analysis]
window_seconds = 600.0
overlap = 0.5
band = [5.0, 400.0]
baseline_windows = 24
baseline_windows_max = 144

[alarm]
false_alarms_per_year = 1.0
hold_windows = 2
clear_windows = 2
clear_below = 0.8
latched = false
cooldown_minutes = 60.0
flapping_changes = 6
flapping_hours = 24.0
trend = "report"
self_test_days = 7.0
self_test_percent = 2.0

[history]
keep_events = 100000

[[notify]]
command = ["true"]
headers = {X-Site = "frame"}
events = ["alarm", "trouble"]
template = "{{ notice.site }}: {{ notice.text }}"
max_per_hour = 12
heartbeat_minutes = 5.0
timeout_seconds = 10.0

[web]
bind = "127.0.0.1"
port = 18765

[temperature]
csv = "weather.csv"
column = "temperature"
stale_minutes = 60.0
"""
_SCENARIO = b"""structure = "structure.toml"
seed = 1
rate = 100.0
duration = 10.0

[truth]
stiffness_factor = 0.99
density_factor = 1.01
foot_flexibility = [0.002, 0.003, 0.0]
joint_flexibility = [0.0, 0.0, 0.0]
damping = [0.02, 0.02, 0.02, 0.02, 0.02, 0.02, 0.02, 0.02]
gain_scatter = 0.005
noise_density = 2e-6
force_density = 5e-9
forces_per_member = 3

[[device]]
name = "imu"
at = [0.0, 0.0, 0.5]
clock_error = 1e-5
delay = 0.001
node = 3

[[event]]
at = 5.0
body = {at = [0.0, 0.0, 1.0], mass = 0.2}
"""
_GAINS = ((0.3, 1.0, 0.02), (1.0, -0.9, 0.01), (0.1, 0.2, 1.0))  # of three channels in three modes
_TABLE = b"""frequency [Hz],damping [%],frequency_std,a,b,c,temperature,rms
11.2,0.5,0.01,0.3,1.0,0.02,20.5,0.01
70.1,0.6,0.02,1.0,-0.9,0.01,20.5,0.01
71.9,0.7,0.02,0.02,0.01,1.0,20.5,0.01
"""
_SERIES = b"time [h],f1 [Hz],f1_std,damping_1 [%],shape_1_a,shape_1_b,f2 [Hz],temperature [degC]\n" + b"".join(
    b"%d,%.4f,0.01,0.5,0.3,1.0,%s,%.1f\n" % (k, 11 + 0.01 * np.sin(k), b"" if k % 7 == 0 else b"70.12", 20 + k % 5)
    for k in range(60)
)
_BODIES = b"""structure = "structure.toml"
most = 1

[[body]]
name = "L1"
mass = 0.005
mass_std = 0.0005
change = "removed"

[[record]]
name = "layout 1"
at = [[0, 0, 0.5]]
before = [5.735, 5.736, 41.22, 41.23]
after = [5.81, 5.811, 41.3, 41.31]
before_std = [0.01, 0.01, 0.04, 0.04]
"""
_CSV = b"date;time [s];a [mg];b [m/s2];temperature\n" + b"".join(
    b"31.01.2026;%.2f;%.3f;%.4f;20,5\n" % (k / 100, np.sin(0.7 * k), np.cos(0.3 * k)) for k in range(200)
)
_DATED = b"time,a,b\n" + b"".join(
    b"2026-01-31T00:00:%02d.%02d,%.4f,%.4f\n" % (k // 100, k % 100, np.sin(0.7 * k), np.cos(0.3 * k))
    for k in range(200)
)
_NEXT = _DATED.replace(b"T00:00:", b"T00:01:")
_LABVIEW = (
    b"LabVIEW Measurement\nSeparator\tTab\nX_Columns\tNo\n***End_of_Header***\n\nChannels\t2\nY_Unit_Label\tg\tmm\n"
    b"X0\t0,0\t0,0\nDelta_X\t0,010000\t0,010000\n***End_of_Header***\nX_Value\ta\tb\tComment\n"
) + b"".join(b"\t%.4f\t%.4f\n" % (np.sin(0.7 * k), np.cos(0.3 * k)) for k in range(200)).replace(b".", b",")
_DASYLAB = b"DASYLab - V 11.00.00\nDelta: 1.0 sec.\nDate;Measurement time[hh:mm:ss];a [g];b [lb];\n" + b"".join(
    b"02/13/2026;4:%02d:%02d PM;%.4f;0,5;\n" % (k // 60, k % 60, np.sin(0.7 * k)) for k in range(200)
)
_NUMBERS = b"".join(b"%.2f %.4f %.4f\n" % (k / 100, np.sin(0.7 * k), np.cos(0.3 * k)) for k in range(200))
_NUMBERS_NAMED = b"t a b\n" + _NUMBERS
_COLUMNS = ("counter", "time_ms", "x", "y", "-")
_LINES = b"".join(b"%d,%d,%.4f,%.4f,%.2f\r\n" % (k, 10 * k, np.sin(0.7 * k), np.cos(0.3 * k), 20) for k in range(200))
_SHAKE = b"".join(
    encode_packet(name, 1_767_225_600 + k / 4, np.arange(25, dtype=np.int32)) for k in range(20) for name in CHANNELS
)
_CALIBRATION = b'[a]\nunit = "mV"\nsensitivity = "100 mV/g"\noffset = 0.1\n[b]\nunit = "mm/s"\nscale = -1.5\n'


@dataclass(frozen=True, kw_only=True)
class Seed:
    """A sound file, and how it is mutated."""

    content: bytes
    mutate: Mutation
    suffix: str = ""  #: of the file; the reader's unless given


@dataclass(frozen=True, kw_only=True)
class Reader:
    """Reader of one kind of file."""

    suffix: str
    seeds: Callable[[], tuple[Seed, ...]]
    read: Callable[[Path, Random], int]  #: file -> exit code
    beside: Mapping[str, bytes]  #: files that are in the folder too


def command(*arguments: object) -> int:
    """Run a command in this process; return its exit code."""
    sys.argv = ["modalwatch", *map(str, arguments)]
    return _run()


def _guarded(function: Callable[[Path], object], path: Path) -> int:
    """Call a function as a command would; return the exit code."""
    try:
        function(path)
    except Exception as error:  # noqa: BLE001 - as the command line does
        return explain(error, debug=False)
    return 0


# --- commands ---------------------------------------------------------------------------------------------------------


def _structure(path: Path, random: Random) -> int:
    more = random.choice(((), (), ("--parameters",), ("--target-mass", "50g"), ("--picture", path.parent / "p.png")))
    return command("structure", path, *more)


def _site(path: Path, random: Random) -> int:
    if random.random() < 0.5:
        return command("settings", path)
    return command("check", path)


def _matrices(path: Path, random: Random) -> int:
    """Read a structure with the matrices in the file, for a picture or a list, which takes a quarter of the time."""
    own = b'material = "steel"\nsection = "bar"\nelements = 6'
    member = _FRAME[: _FRAME.index(b"[[body]]")].replace(own, b"")
    sensors = _FRAME[_FRAME.index(b"[[sensor]]") :]
    names = [f"external.matrices = {str(path)!r}\n", "external.group.part = {}\n"]
    if path.suffix == ".csv":
        sound = path.with_name("sound.npz")
        sound.write_bytes(_matrices_content())
        kind = "faces" if path.read_bytes()[:1] == b"a" else "dofs"
        names = [f"external.{name} = {str(sound)!r}\n" for name in ("stiffness", "mass", "dofs") if name != kind]
        names.append(f"external.{kind} = {str(path)!r}\n")
    elif path.suffix == ".mtx":
        dofs = path.with_name("dofs.csv")
        dofs.write_bytes((_scratch() / "dofs.csv").read_bytes())
        names = [f"external.{name} = {str(path)!r}\n" for name in ("stiffness", "mass")]
        names.append(f"external.dofs = {str(dofs)!r}\n")
    structure = path.with_name("external.toml")
    structure.write_bytes("".join(names).encode() + member + sensors)
    return command("structure", structure, *random.choice(((), ("--parameters",))))


def _scenario(path: Path, _: Random) -> int:
    def read(path: Path) -> None:
        scenario = load_scenario(path)
        World(load_rig_structure(path, scenario), scenario).motion(0, 100, 0)

    return _guarded(read, path)


def _sensor_lines(path: Path, random: Random) -> int:
    """Read what a port or a network would bring, in pieces."""
    form = LineFormat(columns=random.choice((_COLUMNS, _COLUMNS[1:])), unit="g", counter_bits=random.choice((8, 32)))

    def read(path: Path) -> None:
        lines, numbers, datagrams = TextDecoder(form), ScanNumbers(form, 100.0), ShakeDecoder()
        stamps, data = StampCount(100.0), path.read_bytes()
        for start in range(0, len(data), size := random.randint(1, 3000)):
            numbers.evaluate(lines.feed(data[start : start + size]))
            stamps.numbers(datagrams.feed(data[start : start + size]).time)

    return _guarded(read, path)


def _modal_table(path: Path, random: Random) -> int:
    if path.suffix == ".uff" and random.random() < 0.5:
        return _guarded(read_geometry, path) or command("identify", path, "--json", path.with_name("modes.json"))
    return _guarded(lambda path: read_table(parse_structure(_FRAME.decode()), path), path)


def _import(path: Path, random: Random, *options: object) -> int:
    out = path.parent / "out.mcap"
    code = command("import", path, "-o", out, *options)
    return command("log", "info", out) if code == 0 and random.random() < 0.2 else code


def _csv(path: Path, random: Random) -> int:
    """Import a table, perhaps with one that follows it."""
    return _import(path, random, *random.choice(((), (path.with_name("next.csv"),))))


def _table(path: Path, random: Random) -> int:
    if path.suffix == ".toml":
        return _import(path.with_name("data.csv"), random, "--calibration", path)
    more = ((), (), ("--columns", "t,a,b"), ("--rate", "100"), ("--high-pass", "1", "--resample", "40"))
    return _import(path, random, *random.choice(more))


def _format(path: Path, random: Random) -> int:
    return _import(path, random, *(("--unit", "g") if path.suffix in (".mseed", ".wav") else ()))


def _series(path: Path, _: Random) -> int:
    return _guarded(read_series, path)


def _bodies(path: Path, _: Random) -> int:
    return command("bodies", path, "--json", path.with_name("found.json"))


def _arrays(path: Path, random: Random) -> int:
    return _import(
        path, random, *random.choice(((), (), ("--rate", "100"), ("--structure", path.with_name("structure.toml"))))
    )


def _can_log(path: Path, random: Random) -> int:
    rate = ("--rate", "400", "--counter", "Counter", "--column", "accX=a", "--column", "accY=b")
    return _import(path, random, "--dbc", path.with_name("imu.dbc"), *rate)


def _dbc(path: Path, random: Random) -> int:
    rate = ("--rate", "400", "--counter", "Counter", "--column", "accX=a", "--column", "accY=b")
    return _import(path.with_name("bus.log"), random, "--dbc", path, *rate)


def _log(path: Path, random: Random) -> int:
    kind = random.choice((0, 0, 1, 1, 2, 3, 3, 4, 4, 5, 6, 7))  # a replay starts a process
    folder = path.parent
    if kind == 0:
        return command("log", "info", path, "--json", folder / "info.json")
    if kind == 1:
        return command("log", "export", path, "-o", folder / "out.npz")
    if kind == 2:
        return command("log", "expand", path, "-o", folder / "view.mcap")
    if kind == 3:
        shutil.copy(path, folder / "copy.mcap")
        return command("repair", folder / "copy.mcap")
    if kind == 4:
        (folder / "logs").mkdir(exist_ok=True)
        shutil.copy(path, folder / "logs" / "a.mcap")
        return _guarded(lambda _: print("\n".join(repair_folder(folder / "logs"))), path)
    if kind == 5:
        return command("report", path, "-o", folder / "report.html")
    if kind == 6:
        return command("replay", path, *(("--site", folder / "site.toml") if random.random() < 0.5 else ()))
    return command("identify", path, "--window", "5")


def _state(path: Path, _: Random) -> int:
    def read(path: Path) -> None:
        state = path.parent / "state"
        (state / "inbox").mkdir(parents=True)
        shutil.copy(path, state / "memory.json")
        shutil.copy(path, state / "status.json")
        shutil.copy(path, state / "inbox" / "0.json")
        structure = parse_structure(_FRAME.decode())
        recall(state, structure, parse_settings(_SITE.decode()))
        print(list(Inbox(state).taken()))

    code = _guarded(read, path)
    return code or command("health", path.with_name("site.toml"))


# --- sound files ------------------------------------------------------------------------------------------------------


def _texts(*contents: bytes) -> tuple[Seed, ...]:
    return tuple(Seed(content=content, mutate=mutated_text) for content in contents)


@cache
def _recording() -> Recording:
    """Return 20 s of three channels at 100 Hz."""
    random = np.random.default_rng(1)
    channels = tuple(Channel(name=name, device="imu", axis=axis) for axis, name in enumerate("abc"))
    data = random.standard_normal((2000, 3))
    for k in range(2, 2000):  # three resonances
        data[k] += 1.9 * np.cos([0.7, 1.4, 2.0]) * data[k - 1] - 0.96 * data[k - 2]
    return Recording(channels=channels, data=data, rate=100.0, start=1_767_225_600 * 10**9)


@cache
def _exported(suffix: str) -> bytes:
    path = _scratch() / f"data{suffix}"
    export_recording(path, _recording())
    return path.read_bytes()


@cache
def _scratch() -> Path:
    import atexit
    import tempfile

    folder = Path(tempfile.mkdtemp(prefix="fuzz-"))
    atexit.register(partial(shutil.rmtree, folder, ignore_errors=True))
    return folder


def _zipped(content: bytes) -> bytes:
    file = BytesIO()
    with ZipFile(file, "w") as archive:
        archive.writestr("data.txt", content)
    return file.getvalue()


def _table_seeds() -> tuple[Seed, ...]:
    packed = gzip.compress(_NUMBERS, mtime=0)
    return (
        *_texts(_LABVIEW, _DASYLAB, _NUMBERS),
        Seed(content=_DASYLAB, mutate=mutated_text, suffix=".asc"),
        Seed(content=packed, mutate=mutated_bytes, suffix=".gz"),
        Seed(content=_zipped(_NUMBERS), mutate=mutated_bytes, suffix=".zip"),
        Seed(content=_CALIBRATION, mutate=mutated_text, suffix=".toml"),
    )


def _array() -> bytes:
    file = BytesIO()
    np.save(file, _recording().data[:300])
    return file.getvalue()


def _array_seeds() -> tuple[Seed, ...]:
    return (
        Seed(content=b"", mutate=crafted_npz),
        *(Seed(content=_exported(s), mutate=mutated_bytes, suffix=s) for s in (".npz", ".mat")),
        Seed(content=_array(), mutate=mutated_bytes, suffix=".npy"),
        Seed(content=_foreign(".mat"), mutate=mutated_bytes, suffix=".mat"),
        Seed(content=_plain_mat(data=_recording().data[:50], rate=100.0), mutate=mutated_bytes, suffix=".mat"),
    )


@cache
def _foreign(suffix: str) -> bytes:
    """Return a file as the library of its format writes it."""
    path, data = _scratch() / f"foreign{suffix}", _recording().data[:300]
    if suffix == "times.tdms":
        times = np.datetime64(_recording().start, "ns") + np.arange(300) * np.timedelta64(10, "ms")
        with TdmsWriter(path) as writer:
            columns = (("time", times), *zip("abc", data.T, strict=True))
            writer.write_segment([ChannelObject("group", name, column) for name, column in columns])
    elif suffix == ".tdms":
        waveform = {"wf_increment": 0.01, "wf_start_time": np.datetime64(_recording().start, "ns"), "unit_string": "g"}
        with TdmsWriter(path) as writer:
            channels = [ChannelObject("group", n, data[:, k], properties=waveform) for k, n in enumerate("abc")]
            writer.write_segment([RootObject(), *channels])
    elif suffix == ".wav":
        wavfile.write(path, 100, (1000 * data).astype(np.int16))
    elif suffix == ".mseed":
        traces = MS3TraceList()
        for axis, column in zip("ENZ", (1000 * data).astype(np.int32).T, strict=True):
            traces.add_data(f"FDSN:AM_R7FA5_00_E_N_{axis}", column.copy(), "i", 100.0, starttime=_recording().start)
        traces.to_file(path, max_record_length=512)
    elif suffix == ".mf4":
        with MDF() as mdf:
            t = np.arange(300) / 100
            mdf.append([Signal(data[:, k], t, name=name, unit="g") for k, name in enumerate("abc")])
            mdf.save(path)
    elif suffix == ".mat":  # version 7.3: HDF5 behind a text of 512 bytes
        with h5py.File(path, "w", userblock_size=512) as file:
            for name, values in (("rate", np.array([[100.0]])), *zip("abc", data.T[:, None], strict=True)):
                file.create_dataset(name, data=values).attrs["MATLAB_class"] = np.bytes_("double")
        content = path.read_bytes()
        return b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM" + content[128:]
    else:
        return _exported(suffix)
    return path.read_bytes()


_NODES = {"type": 15, "node_nums": [1, 2, 3], "x": [0.0, 1.0, 2.0], "y": [0.0] * 3, "z": [0.0] * 3}
_TRACE = {"type": 82, "trace_num": 1, "nodes": np.array([1, 2, 3]), "id": "line", "color": 0}


@cache
def _responses() -> bytes:
    """Return frequency responses with three resonances as a universal file."""
    path, line = _scratch() / "responses.uff", np.arange(1, 161) * 0.5
    modes = np.array([1 / (f**2 - line**2 + 0.04j * f * line) for f in (11, 40, 71)])
    values, sets = np.array(_GAINS) @ modes, list[Any]()
    place: Any = {"rsp_node": 0, "rsp_dir": 0, "ref_node": 1}
    for name, value in zip("abc", values, strict=True):
        sets.append(frequency_response(value, line, id1=name, ordinate_spec_data_type=8, **place))
        sets.append(frequency_response(np.full(160, 0.9), line, id1=name, **place | COHERENCE))
    sets.append(frequency_response(np.full(160, 0.8), line, id1="a", rsp_node=0, rsp_dir=0, **MULTIPLE))
    write_sets(path, [header_set("a test"), _NODES, _TRACE, *sets])
    return path.read_bytes()


def _format_seeds() -> tuple[Seed, ...]:
    endings = (".tdms", "times.tdms", ".wav", ".mseed", ".mf4", ".h5", ".parquet", ".arrow")
    return tuple(
        Seed(content=_foreign(ending), mutate=mutated_bytes, suffix=Path(f"x{ending}").suffix) for ending in endings
    )


@cache
def _matrices_content() -> bytes:
    path = _scratch() / "matrices.npz"
    model = build_model(parse_structure(_FRAME.decode()), shear_flexible=True, mass="consistent")
    matrices = Matrices(
        stiffness=model.stiffness,
        mass=model.mass,
        nodes=model.nodes,
        dofs=model.dofs,
        groups={"part": 0.5 * model.stiffness},
        faces=np.array([[0, 1, 2, -1], [3, 4, 5, 6]], np.int32),
    )
    save_matrices(path, matrices)
    mmwrite(_scratch() / "k.mtx", model.stiffness, symmetry="symmetric")
    save_matrices(_scratch(), matrices)
    return path.read_bytes()


def _matrix_seeds() -> tuple[Seed, ...]:
    content = _matrices_content()
    tables = ((_scratch() / name).read_bytes() for name in ("dofs.csv", "faces.csv"))
    return (
        Seed(content=content, mutate=mutated_archive),
        Seed(content=content, mutate=mutated_bytes),
        *(Seed(content=table, mutate=mutated_text, suffix=".csv") for table in tables),
        Seed(content=(_scratch() / "k.mtx").read_bytes(), mutate=mutated_text, suffix=".mtx"),
    )


@cache
def _program_files() -> dict[str, bytes]:
    """Return a chain of three nodes in the formats of other programs, by the endings of their files."""
    stiffness = np.kron(np.array([[2.0, -1.0], [-1.0, 1.0]]), np.diag([3e4, 2e4, 1e4]))
    pairs = [(i, j, stiffness[i, j]) for i in range(6) for j in range(i + 1)]
    hb_write(_scratch() / "k.matrix", csc_array(stiffness))
    places = [(0, 0.0), (1, 0.5), (2, 1.0)]
    dense = ["      18      18       6       2KGG     1P,3E23.16"]
    for column in range(18):
        own = [2e4 * float(column == i) for i in range(18)]
        dense += [f"{column + 1:8d}       1      18"]
        dense += ["".join(f"{value:23.16E}" for value in own[k : k + 3]) for k in range(0, 18, 3)]
    texts = {
        ".sti": "\n".join(f"{j + 1} {i + 1} {value:.13e}" for i, j, value in pairs),
        ".mtx": "\n".join(f"{2 + i // 3},{1 + i % 3}, {2 + j // 3},{1 + j % 3}, {v:.15e}" for i, j, v in pairs),
        ".dof": "\n".join(f"{node}.{axis}" for node in (2, 3) for axis in (1, 2, 3)),
        ".mapping": "\n".join(f"{i + 1:12d}{2 + i // 3:12d}   {('UX', 'UY', 'UZ')[i % 3]}" for i in range(6)),
        ".inp": "*NODE\n" + "\n".join(f"{n + 1}, {x}, 0, 0" for n, x in places) + "\n*ELEMENT, TYPE=S3\n1, 1, 2, 3",
        ".bdf": "\n".join(f"GRID    {n + 1:8d}       1{x:8.3f}{0.0:8.3f}{0.0:8.3f}{2:8d}" for n, x in places)
        + "\nCORD2R,1,,0.,0.,0.,0.,0.,1.\n+,1.,0.,0.\nCORD2C,2,1,0.,0.,-1.,0.,0.,1.\n+,1.,0.,0.",
        ".frd": "    2C                             3\n"
        + "\n".join(f" -1{n + 1:10d}{x:12.5E}{0.0:12.5E}{0.0:12.5E}" for n, x in places)
        + "\n -3",
        ".pch": dmig({"KAAX": stiffness, "MAAX": np.eye(6)}, [(node, axis) for node in (2, 3) for axis in (1, 2, 3)]),
        ".op4": "\n".join([*dense, "      19       1       1", " 1.0000000000000000E+00"]),
    }
    matrix = (_scratch() / "k.matrix").read_bytes().replace(b"RUA", b"RSA", 1)
    return {ending: text.encode() for ending, text in texts.items()} | {".matrix": matrix}


def _program_seeds() -> tuple[Seed, ...]:
    both = {"MGG": np.eye(18), "KGG": np.diag(np.arange(18) % 5.0)}
    sparse = [sparse_output4(both, large=large).encode() for large in (False, True)]
    binary = [
        binary_output4(both),
        binary_output4(both, order=">", word=8, form="large"),
        binary_output4(both, single=True, form="sparse"),
    ]
    return (
        *(Seed(content=c, mutate=mutated_text, suffix=ending) for ending, c in _program_files().items()),
        *(Seed(content=content, mutate=mutated_text, suffix=".op4") for content in sparse),
        *(Seed(content=content, mutate=mutated_bytes, suffix=".op4") for content in binary),
    )


def _program(path: Path, random: Random) -> int:
    """Read the matrices of another program, of which one file is mutated."""
    files = {}
    for ending, content in _program_files().items():
        files[ending] = path if path.suffix == ending else path.with_name(f"sound{ending}")
        if path.suffix != ending:
            files[ending].write_bytes(content)
    matrix = {".mapping": ".matrix", ".bdf": ".op4"}.get(path.suffix, path.suffix)
    matrix = matrix if matrix in (".sti", ".mtx", ".op4", ".pch", ".matrix") else ".sti"
    nodes = ".bdf" if matrix in (".op4", ".pch") else {".frd": ".frd"}.get(path.suffix, ".inp")
    names = {".matrix": ("--rows", files[".mapping"]), ".sti": ("--rows", files[".dof"])}.get(matrix, ())
    more = random.choice(
        ((), ("--group", f"a={files[matrix]}"), ("--doubled", f"a={files[matrix]}", "--file-unit", "mm"))
    )
    out = ("-o", path.with_name("external.toml"))
    return command("new", "external", files[matrix], files[matrix], "--nodes", files[nodes], *names, *more, *out)


def _uff_seeds() -> tuple[Seed, ...]:
    content = _exported(".uff")
    lines = content.splitlines(keepends=True)
    short = b"".join(lines)
    return (Seed(content=short, mutate=mutated_text), Seed(content=short, mutate=mutated_bytes))


@cache
def _traffic(suffix: str) -> bytes:
    path = _scratch() / f"bus{suffix}"
    with can.Logger(path) as logger:
        for k in range(400):
            stamp = 1767225600.0 + k / 400
            for number, data in ((0x006, f"{k:04x}"), (0x034, f"{k:04x}{100 * k:08x}")):
                content = bytes.fromhex(data)
                logger(can.Message(timestamp=stamp, arbitration_id=number, data=content, is_extended_id=False))
    return path.read_bytes()


def _can_seeds() -> tuple[Seed, ...]:
    return (
        *(Seed(content=_traffic(s), mutate=mutated_text, suffix=s) for s in (".log", ".asc", ".trc")),
        Seed(content=_traffic(".blf"), mutate=mutated_blf, suffix=".blf"),
    )


@cache
def _series_mat() -> bytes:
    """Return a series of modes as arrays of Matlab."""
    k = np.arange(60)
    frequency = np.array([11.2, 70.1]) + 0.01 * np.sin(k)[:, None]
    arrays = {
        "datenum": 739_000 + k / 24,
        "frequency": np.where(k[:, None] % 7 == [[0, 8]], np.nan, frequency),
        "damping": np.full((60, 2), 0.005),
        "shape": np.tile(np.array(_GAINS)[:2], (60, 1, 1)),
        "channels": np.array(["a", "b", "c"], object),
        "temperature": 20 + k % 5,
    }
    return _plain_mat(**arrays)


def _plain_mat(**arrays: object) -> bytes:
    """Return a MAT file without compression and without the time of writing, in which every byte matters."""
    file = BytesIO()
    savemat(file, arrays)  # type: ignore[arg-type]  # the stubs know no open files
    return b"MATLAB 5.0 MAT-file".ljust(116) + file.getvalue()[116:]


@cache
def _log_content() -> bytes:
    path = _scratch() / "log.mcap"
    write_recording(path, _recording(), {"site.toml": _SITE.decode(), "structure.toml": _FRAME.decode()})
    return path.read_bytes()


@cache
def _event_log() -> bytes:
    path = _scratch() / "events.mcap"
    writer = McapWriter(path, {"site.toml": _SITE.decode()})
    for k in range(8):
        writer.write(Event(topic="/event/gap", time=k, payload={"device": "imu", "missing": k, "exact": True}))
    writer.close()
    return path.read_bytes()


def _log_seeds() -> tuple[Seed, ...]:
    return (
        Seed(content=_log_content(), mutate=mutated_mcap),
        Seed(content=_event_log(), mutate=mutated_mcap),
        Seed(content=b"", mutate=crafted_mcap),
        Seed(content=b"", mutate=crafted_mcap),
    )


def _state_seeds() -> tuple[Seed, ...]:
    memory = json.dumps({"modalwatch": 8, "sha256": "0" * 64}).encode() + b"\n" + b"{}"
    status = {"time": 1, "state": "normal", "devices": {"imu": {"rate": 1000.0}}, "problems": [], "windows": 3}
    reported = {"kind": "accept", "by": "ada", "cause": "new pump", "alarm": 1}
    return (
        Seed(content=memory, mutate=mutated_text),
        Seed(content=json.dumps(status).encode(), mutate=mutated_json),
        Seed(content=json.dumps(reported).encode(), mutate=mutated_json),
    )


_MODES = json.dumps(
    {
        "modes": [
            {
                "id": k,
                "frequency": {"value": f, "std": 0.01},
                "damping": {"value": 0.01, "std": 0.001},
                "shape": {"a": [0.5, 0.0], "b": [1.0, 0.01], "c": [0.1 * k, 0.0]},
                "shape_std": {"a": 0.01, "b": 0.01, "c": 0.01},
            }
            for k, f in enumerate((11.2, 70.1, 71.9))
        ]
    }
).encode()

_TOML = {"structure.toml": _FRAME}
READERS = {
    "structure": Reader(
        suffix=".toml", seeds=lambda: _texts(_FRAME, _PORTAL + _OSCILLATOR), read=_structure, beside={}
    ),
    "matrices": Reader(suffix=".npz", seeds=_matrix_seeds, read=_matrices, beside={"frame.toml": _FRAME}),
    "programs": Reader(suffix=".sti", seeds=_program_seeds, read=_program, beside={}),
    "site": Reader(suffix=".toml", seeds=lambda: _texts(_SITE), read=_site, beside=_TOML),
    "scenario": Reader(suffix=".toml", seeds=lambda: _texts(_SCENARIO), read=_scenario, beside=_TOML),
    "modal-table": Reader(
        suffix=".csv",
        seeds=lambda: (
            *_texts(_TABLE),
            Seed(content=_MODES, mutate=mutated_json, suffix=".json"),
            Seed(content=_responses(), mutate=mutated_text, suffix=".uff"),
        ),
        read=_modal_table,
        beside={},
    ),
    "series": Reader(
        suffix=".csv",
        seeds=lambda: (*_texts(_SERIES), Seed(content=_series_mat(), mutate=mutated_bytes, suffix=".mat")),
        read=_series,
        beside={},
    ),
    "bodies": Reader(suffix=".toml", seeds=lambda: _texts(_BODIES), read=_bodies, beside=_TOML),
    "csv": Reader(suffix=".csv", seeds=lambda: _texts(_CSV, _DATED), read=_csv, beside={"next.csv": _NEXT}),
    "table": Reader(suffix=".txt", seeds=_table_seeds, read=_table, beside={"data.csv": _NUMBERS_NAMED}),
    "arrays": Reader(suffix=".npz", seeds=_array_seeds, read=_arrays, beside=_TOML),
    "formats": Reader(suffix=".tdms", seeds=_format_seeds, read=_format, beside={}),
    "universal": Reader(suffix=".uff", seeds=_uff_seeds, read=_import, beside={}),
    "can-log": Reader(suffix=".log", seeds=_can_seeds, read=_can_log, beside={"imu.dbc": _DBC}),
    "dbc": Reader(suffix=".dbc", seeds=lambda: _texts(_DBC), read=_dbc, beside={}),
    "lines": Reader(suffix=".txt", seeds=lambda: _texts(_LINES, _SHAKE), read=_sensor_lines, beside={}),
    "log": Reader(suffix=".mcap", seeds=_log_seeds, read=_log, beside={**_TOML, "site.toml": _SITE}),
    "state": Reader(suffix=".json", seeds=_state_seeds, read=_state, beside={**_TOML, "site.toml": _SITE}),
}


def case(reader: str, number: int, folder: Path) -> tuple[Path, Random]:
    """Write the file of a numbered case, and the files that belong to it, into an empty folder."""
    random = Random(f"{reader} {number}")
    seed = random.choice(READERS[reader].seeds())
    return write_case(reader, seed, seed.mutate(seed.content, random), folder), random


def write_case(reader: str, seed: Seed, content: bytes, folder: Path) -> Path:
    """Write a file with a content, and the files that belong to it, into an empty folder; return its path."""
    kind = READERS[reader]
    path = folder / f"case{seed.suffix or kind.suffix}"
    path.write_bytes(content)
    for name, other in kind.beside.items():
        (folder / name).write_bytes(other)
    if reader == "dbc":
        (folder / "bus.log").write_bytes(_traffic(".log"))
    return path
