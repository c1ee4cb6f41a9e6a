"""`import` of the tables of a logger that begins a new one every few minutes: one log."""

import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from daq import Channel, DataError, DataOptions, FloatArray, Recording, load_recordings, read_measured
from daq.files import Measured, differentiated, in_order, read_in_order
from monitor.cli.data.importing.measurements import level
from monitor.settings import load_settings
from tests.support.monitor.cli import Commands, assert_refused
from updater import t_structure_toml

RATE, ROWS = 100, 500
NAMES = ("beam_left_y", "beam_left_z")
DATA = np.random.default_rng(31).standard_normal((2000, 2)).round(4)


def write(path: Path, first: int, data: FloatArray, late: float = 0.0, names: tuple[str, ...] = NAMES) -> Path:
    """Write rows of a record that began at midnight; `late` ms."""
    rows = [
        f"2026-01-01 00:00:{(first + k) / RATE + late * 1e-3:09.6f},{','.join(map(str, row))},{20 + first / 100}"
        for k, row in enumerate(data.tolist())
    ]
    path.write_text("\n".join([f"time,{','.join(names)},T [C]", *rows]))
    return path


@pytest.fixture
def tables(tmp_path: Path) -> list[Path]:
    """Return three tables of 5 s that follow each other, and a fourth after 5 s of nothing, half a sample late."""
    parts = [(k, DATA[k : k + ROWS]) for k in (0, 500, 1000)]
    paths = [write(tmp_path / f"{k:04d}.csv", k, data) for k, data in parts]
    paths.append(write(tmp_path / "late.csv", 2000, DATA[1500:], late=4.0))
    (tmp_path / "structure.toml").write_text(t_structure_toml(), encoding="utf-8")
    return paths


def test_consecutive_tables_become_one_log(modalwatch: Commands, tables: list[Path], tmp_path: Path) -> None:
    log = tmp_path / "log.mcap"
    done = modalwatch("import", *reversed(tables), "-o", log)
    assert (done.code, done.err) == (0, "")
    reported = done.out.splitlines()
    assert reported[0].startswith(f"{log}: 2 channels, 20 s at 100 Hz, 0 gaps (0 samples), rms ")
    assert reported[1] == (
        "4 files by their dates, 1 pauses between them, the longest 5 s; their mean temperatures: 20 to 40 degC"
    )
    assert reported[2].endswith("the first is 2026-01-01T00:00:00.000+00:00")
    (found,) = load_recordings(log)
    assert (found.rate, len(found.data)) == (RATE, 2500)
    np.testing.assert_allclose(found.data[:1500], DATA[:1500], atol=1e-6)
    assert np.isnan(found.data[1500:2000]).all()
    np.testing.assert_allclose(found.data[2000:], DATA[1500:], atol=1e-6)
    (gap,) = found.gaps
    assert (gap.start, gap.stop) == (1500, 2000)


def test_windows_span_consecutive_files(modalwatch: Commands, tables: list[Path], tmp_path: Path) -> None:
    log, site = tmp_path / "log.mcap", tmp_path / "site.toml"
    done = modalwatch("import", *tables[:3], "-o", log, "--structure", tmp_path / "structure.toml", "--new-site", site)
    assert (done.code, done.err) == (0, "")
    assert "the log has 15 s" in done.out
    windows = list(load_recordings(log, window_seconds=7.5))
    assert [len(window.data) for window in windows] == [750, 750]
    np.testing.assert_allclose(np.concatenate([window.data for window in windows]), DATA[:1500], atol=1e-6)
    assert [window.temperature for window in windows] == pytest.approx(
        [20 + 5 / 3, 30 - 5 / 3], abs=0.3
    )  # a block goes to both windows
    assert modalwatch("import", *tables[:3], "-o", tmp_path / "again.mcap", "--site", site).code == 0


@pytest.mark.thorough
def test_window_length_of_a_new_site_fits_intermittent_records(
    modalwatch: Commands, tables: list[Path], tmp_path: Path
) -> None:
    log, site = tmp_path / "log.mcap", tmp_path / "site.toml"
    asked = ("import", tables[0], tables[3], "-o", log, "--structure", tmp_path / "structure.toml", "--new-site", site)
    done = modalwatch(*asked)
    assert done.code == 0, done.err
    assert f"the logger pauses: window_seconds = 4.6 in {site}" in done.out
    assert load_settings(site).analysis.window_seconds == 4.6
    replayed = modalwatch("replay", log, "--site", site).out
    assert "window   2 learning" in replayed
    assert "window   3" not in replayed
    assert "0 of 2 windows gave modes; are records shorter than a window of 4.6 s" in replayed


def test_channel_with_a_gap_in_one_file_becomes_a_separate_device(tables: list[Path], tmp_path: Path) -> None:
    holed = DATA[500:1000].copy()
    holed[7, 1] = np.nan
    write(tables[1], 500, holed)
    found = in_order([(path, read_measured(path, DataOptions())) for path in tables])
    assert {tuple(c.device for c in part.recording.channels) for part in found} == {("import", "import-2")}
    assert [[gap.device for gap in part.recording.gaps] for part in found] == [[], ["import-2"], [], []]


def test_incompatible_files_are_refused(modalwatch: Commands, tables: list[Path], tmp_path: Path) -> None:
    log, other, late = tmp_path / "log.mcap", tmp_path / "other.csv", tmp_path / "late.csv"
    late.write_text(late.read_text().replace("beam_left_z", "z"))
    write(other, 1200, DATA[:ROWS])
    slow = [f"2026-01-01 00:01:{k / 50:06.3f},1,2,20" for k in range(ROWS)]
    (tmp_path / "slow.csv").write_text("\n".join([f"time,{','.join(NAMES)},T [C]", *slow]))
    (tmp_path / "bare.csv").write_text("t,beam_left_y,beam_left_z\n0,1,2\n0.01,2,1\n0.02,1,1\n")
    for wrong, says in (
        ("other.csv", "other.csv: begins 3 s before"),
        ("0000.csv", "0000.csv: begins 5 s before"),
        ("late.csv", "only one of them has beam_left_z, z"),
        ("slow.csv", "slow.csv: has 50 samples per second, "),
        ("bare.csv", "bare.csv: states no dates"),
    ):
        assert_refused(modalwatch("import", *tables[:3], tmp_path / wrong, "-o", log), says)
    assert_refused(modalwatch("import", *tables, "-o", log, "--start", "2026-01-01"), "--start: not of 4 files")
    assert_refused(modalwatch("import", "a.log", "b.log", "-o", log), "expected one file of CAN traffic, found 2")
    assert not log.exists()


def test_drift_between_two_logger_clocks_loses_no_samples(tmp_path: Path) -> None:
    """Its converter is slower or faster than its clock at the beginning of a table: no sample lost, none invented."""
    for drift in (4.0, -4.0):  # ms, of a period of 10 ms, a table
        paths = [
            write(tmp_path / f"{k}.csv", 100 * k, DATA[100 * k : 100 * k + 100], late=50 + drift * k) for k in range(9)
        ]
        found = in_order([(path, read_measured(path, DataOptions())) for path in paths])
        starts = [round((part.recording.start - found[0].recording.start) * 1e-9 * RATE) for part in found]
        assert starts == list(range(0, 900, 100))


@pytest.mark.parametrize("short", [10, 200])
@pytest.mark.parametrize("first", [True, False])
def test_short_file_uses_the_sampling_rate_of_the_others(tmp_path: Path, short: int, first: bool) -> None:
    """Dates to the millisecond give 128.6 Hz for ten samples of 128 Hz, and 127.999 for two hundred that come first."""
    lengths = [short, 2000, 2000] if first else [2000, 2000, short]
    files, done = [], 0
    for number, length in enumerate(lengths):
        path = tmp_path / f"{number}.csv"
        times = ((done + k) / 128 for k in range(length))
        rows = (f"2026-01-01 00:{int(t // 60):02d}:{t % 60:06.3f},{number}" for t in times)
        path.write_text("\n".join(["time,a", *rows]))
        files.append((path, read_measured(path, DataOptions())))
        done += length
    found = [part.recording for part in in_order(files)]
    assert {one.rate for one in found} == {128}
    starts = [round((one.start - found[0].start) * 1e-9 * 128) for one in found]
    assert starts == [0, lengths[0], lengths[0] + lengths[1]]


@pytest.mark.parametrize("drift", [3, 200])
def test_only_a_small_overlap_of_files_is_accepted(drift: int) -> None:
    """Three milliseconds a minute, 50 parts in a million, are three samples of 1000 Hz; 200 are files that overlap."""
    channels = (Channel(name="a", device="import", axis=0),)
    files = []
    for number in range(3):
        start = 10**18 + number * (60_000 - drift) * 10**6
        recording = Recording(channels=channels, data=np.ones((60_000, 1)), rate=1000.0, start=start)
        measured = Measured(recording=recording, temperature=np.full(60_000, np.nan), remarks=(), dated=True)
        files.append((Path(f"{number}.csv"), measured))
    if drift > 3:
        with pytest.raises(DataError, match=r"1\.csv: begins 0\.2 s before 0\.csv ends"):
            in_order(files)
    else:
        starts = [part.recording.start - 10**18 for part in in_order(files)]
        assert starts == [0, 60 * 10**9, 120 * 10**9]


def test_many_files_are_not_copied_in_memory() -> None:
    """The times of the files and their motion take a few more columns, not a second copy of all."""
    channels = tuple(Channel(name=name, device="import", axis=k) for k, name in enumerate("abcdefghijkl"))
    files = []
    for number in range(10):
        data = np.random.default_rng(number).standard_normal((4000, 12))
        recording = Recording(channels=channels, data=data, rate=1000.0, start=10**18 + 4 * 10**9 * number)
        measured = Measured(recording=recording, temperature=np.full(4000, np.nan), remarks=(), dated=True)
        files.append((Path(f"{number}.csv"), measured))
    tracemalloc.start()
    try:
        assert level([part.recording for part in in_order(files)]) == ", rms 0.99 to 1 m/s2"
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 40_000 * 12 * 8 / 2


def test_velocities_are_differentiated_across_files(modalwatch: Commands, tables: list[Path], tmp_path: Path) -> None:
    """Of a record the derivative lacks 32 samples at both ends; where files meet it lacks none."""
    options = DataOptions(velocities=("beam_left_z",))
    parts = [part.recording for part in read_in_order(tables, options)]
    assert [np.flatnonzero(np.isnan(part.data[:, 1])).tolist() for part in parts] == [
        [*range(32)],
        [],
        [*range(468, 500)],
        [*range(32), *range(468, 500)],
    ]
    whole = differentiated(
        Recording(channels=parts[0].channels, data=DATA[:1500], rate=RATE, start=0), options.velocities
    )
    np.testing.assert_allclose(np.concatenate([part.data for part in parts[:3]]), whole.data, atol=1e-9)
    wrong = modalwatch("import", *tables, "-o", tmp_path / "log.mcap", "--velocity", "z")
    assert_refused(wrong, "--velocity: ", "found 'z'")
