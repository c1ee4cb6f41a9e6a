"""`import` and errors of its input."""

import tomllib
from pathlib import Path

import numpy as np
import pytest

from daq import Recording, load_recordings, read_attachments
from monitor.analysis.logs import log_recordings
from monitor.settings import load_settings
from tests.support.daq.can_buses import DBC_SITE, IMU
from tests.support.monitor.cli import Commands, assert_refused
from updater import t_structure_toml

SITE = """structure = "t_structure.toml"
[[device]]
name = "beam_left"
driver = "epson-uart"
port = "/dev/none"
rate = 100
channels = {z = "beam_left_z", y = "beam_left_y"}
"""


@pytest.fixture
def table(tmp_path: Path) -> Path:
    """Return a table of two sensors, 3 s at 100 Hz, with a gap of one; a site and a structure in the same folder."""
    data = np.random.default_rng(6).standard_normal((300, 2))
    rows = [f"{k / 100},{a!r},{b!r}" for k, (a, b) in enumerate(data.tolist())]
    rows[150] = "1.5,,1"
    (tmp_path / "data.csv").write_text("\n".join(["t,beam_left_y,beam_left_z", *rows]))
    (tmp_path / "t_structure.toml").write_text(t_structure_toml(), encoding="utf-8")
    (tmp_path / "site.toml").write_text(SITE, encoding="utf-8")
    return tmp_path / "data.csv"


def imported(path: Path) -> Recording:
    (found,) = log_recordings(path)
    return found


def test_import_prints_a_summary_of_the_written_log(modalwatch: Commands, table: Path, tmp_path: Path) -> None:
    done = modalwatch("import", table, "-o", tmp_path / "log.mcap", "--unit", "g", "--start", "2026-01-01T00:00:00Z")
    assert (done.code, done.err) == (0, "")
    values = np.genfromtxt(table, delimiter=",", skip_header=1)[:, 1:]
    least, most = sorted(9.80665 * np.nanstd(values, axis=0))
    level = f"rms {least:.2g} to {most:.2g} m/s2"
    assert done.out == f"{tmp_path}/log.mcap: 2 channels, 3 s at 100 Hz, 1 gap (1 sample), {level}\n"
    found = imported(tmp_path / "log.mcap")
    np.testing.assert_allclose(found.data, 9.80665 * values, rtol=0, atol=1e-7)
    assert found.start == 1_767_225_600_000_000_000
    assert list(read_attachments(tmp_path / "log.mcap")) == ["channels.json"]


def test_times_in_units_other_than_seconds(modalwatch: Commands, table: Path, tmp_path: Path) -> None:
    header, *rows = table.read_text().split("\n")
    rows = [f"{1e3 * float(row.partition(',')[0]):.0f},{row.partition(',')[2]}" for row in rows]
    table.write_text("\n".join([header, *rows]))
    log = tmp_path / "log.mcap"
    done = modalwatch("import", table, "-o", log)
    assert_refused(
        done, "data.csv: column 't': times in seconds would make 0.1 Hz", "--time-unit, as ms (100 Hz); s if"
    )
    assert not log.exists()
    done = modalwatch("import", table, "-o", log, "--time-unit", "ms")
    assert (done.code, done.err) == (0, "")
    assert ": 2 channels, 3 s at 100 Hz," in done.out
    assert done.out.splitlines()[1] == "times of 't' are in ms"
    table.write_text("\n".join([header.replace("t,", "Time (ms),"), *rows]))
    done = modalwatch("import", table, "-o", tmp_path / "headed.mcap")
    assert done.out.splitlines()[1] == "times of 'Time (ms)' are in ms"
    assert imported(tmp_path / "headed.mcap").rate == 100.0
    done = modalwatch("import", table, "-o", tmp_path / "asked.mcap", "--time-unit", "s")
    assert done.out.splitlines()[1] == "times of 'Time (ms)' are taken in s, by --time-unit, not in ms"
    assert ", 3000 s at 0.1 Hz," in done.out


def test_units_in_the_header(modalwatch: Commands, table: Path, tmp_path: Path) -> None:
    text = table.read_text()
    values = np.genfromtxt(table, delimiter=",", skip_header=1)[:, 1:]
    table.write_text(text.replace("beam_left_y,beam_left_z", "beam_left_y [g],beam_left_z (mm/s^2)"))
    done = modalwatch("import", table, "-o", tmp_path / "log.mcap", "--structure", tmp_path / "t_structure.toml")
    assert (done.code, done.err) == (0, "")
    assert done.out.splitlines()[1] == "from the columns: beam_left_y in g; beam_left_z in mm/s^2"
    np.testing.assert_allclose(imported(tmp_path / "log.mcap").data, [9.80665, 1e-3] * values, rtol=0, atol=1e-7)
    done = modalwatch("import", table, "-o", tmp_path / "hand.mcap", "--unit", "mg", "--scale", "2")
    assert done.out.splitlines()[1] == (
        "units of the columns: beam_left_y in g; beam_left_z in mm/s^2; overridden by --unit and --scale, "
        "0.0196133 m/s2 a unit"
    )
    np.testing.assert_allclose(imported(tmp_path / "hand.mcap").data, 0.0196133 * values, rtol=0, atol=1e-9)
    table.write_text(text.replace("beam_left_y,beam_left_z", "beam_left_y [m/s2],beam_left_z [V]"))
    done = modalwatch("import", table, "-o", tmp_path / "volts.mcap")
    assert_refused(
        done, table, "column 'beam_left_z [V]' is in V: give its sensitivity, as --sensitivity '100 mV/g' or"
    )
    assert not (tmp_path / "volts.mcap").exists()
    done = modalwatch("import", table, "-o", tmp_path / "sensed.mcap", "--sensitivity", "2 V/g")
    np.testing.assert_allclose(imported(tmp_path / "sensed.mcap").data, [1.0, 9.80665 / 2] * values, atol=1e-7)
    done = modalwatch("import", table, "-o", tmp_path / "volts.mcap", "--unit", "g", "--scale", "0.5")
    assert done.code == 0, done.err
    assert [c.name for c in imported(tmp_path / "volts.mcap").channels] == ["beam_left_y", "beam_left_z"]


def test_temperatures_of_a_table(modalwatch: Commands, table: Path, tmp_path: Path) -> None:
    header, *rows = table.read_text().split("\n")
    table.write_text("\n".join([f"{header},T (°C)", *(f"{row},{10 + k / 100:.2f}" for k, row in enumerate(rows))]))
    site, log = tmp_path / "site.toml", tmp_path / "log.mcap"
    done = modalwatch("import", table, "-o", log, "--site", site)
    assert (done.code, done.err) == (0, "")
    assert ": 2 channels, " in done.out
    assert done.out.splitlines()[1:] == ["temperature of the structure: 'T (°C)': 10 to 12.99 degC"]
    assert imported(log).temperature == pytest.approx(11.5, abs=0.2)  # a gap cuts its block in two
    site.write_text(SITE + '[temperature]\ncsv = "thermometer.txt"\n', encoding="utf-8")
    done = modalwatch("import", table, "-o", tmp_path / "other.mcap", "--site", site)
    assert done.out.splitlines()[2].startswith("note: [temperature] of "), done
    done = modalwatch("import", table, "-o", tmp_path / "none.mcap", "--temperature", "water")
    assert_refused(done, "has no column 'water' of temperatures, but beam_left_y, beam_left_z, T (°C)")


def test_import_selects_and_renames_columns(modalwatch: Commands, table: Path, tmp_path: Path) -> None:
    table.write_text(table.read_text().replace("t,beam_left_y,beam_left_z", "time,a=1,b"))
    options = ("--time", "time", "--column", "a=1=beam_left_y", "--column", "b=beam_left_z")
    done = modalwatch("import", table, "-o", tmp_path / "log.mcap", *options, "--site", tmp_path / "site.toml")
    assert done.code == 0, done.err
    assert [c.name for c in imported(tmp_path / "log.mcap").channels] == ["beam_left_y", "beam_left_z"]
    done = modalwatch("import", table, "-o", tmp_path / "one.mcap", "--time", "time", "--column", "b")
    assert done.code == 0, done.err
    assert [c.name for c in imported(tmp_path / "one.mcap").channels] == ["b"]


def test_import_with_a_site_uses_its_devices(modalwatch: Commands, table: Path, tmp_path: Path) -> None:
    done = modalwatch("import", table, "-o", tmp_path / "log.mcap", "--site", tmp_path / "site.toml")
    assert done.code == 0, done.err
    found = imported(tmp_path / "log.mcap")
    assert [(c.name, c.device, c.axis) for c in found.channels] == [
        ("beam_left_y", "beam_left", 1),
        ("beam_left_z", "beam_left", 2),
    ]
    attached = read_attachments(tmp_path / "log.mcap")
    assert tomllib.loads(attached["site.toml"]) == tomllib.loads(SITE)
    assert attached["structure.toml"] == t_structure_toml()


def test_import_with_a_structure(modalwatch: Commands, table: Path, tmp_path: Path) -> None:
    structure = tmp_path / "t_structure.toml"
    done = modalwatch("import", table, "-o", tmp_path / "log.mcap", "--structure", structure)
    assert done.code == 0, done.err
    note = done.out.splitlines()[1]
    assert note.startswith("note: no column for col_037_x, ")
    assert note.endswith(f" of {structure}")
    assert "beam_left_y" not in note
    assert read_attachments(tmp_path / "log.mcap")["structure.toml"] == t_structure_toml()
    table.write_text("t,left\n0,1\n1,2\n")
    done = modalwatch("import", table, "-o", tmp_path / "other.mcap", "--structure", structure)
    assert_refused(done, table, "column 'left' is no sensor of", structure)
    assert not (tmp_path / "other.mcap").exists()
    table.write_text("t,Beam_left_y,beam_left_z\n0,1,1\n1,2,3\n")
    done = modalwatch("import", table, "-o", tmp_path / "other.mcap", "--structure", structure)
    assert "left out: Beam_left_y, did you mean 'beam_left_y'?" in " ".join(done.out.split())


def test_a_missing_unit_of_millimetres_is_noted(modalwatch: Commands, tmp_path: Path) -> None:
    values = np.random.default_rng(3).standard_normal((50, 2))
    notes = []
    for name, factor in (("m", 1.0), ("mm", 1000.0)):
        rows = [f"{k / 100},{a},{b}" for k, (a, b) in enumerate(factor * values)]
        (tmp_path / f"{name}.csv").write_text("\n".join(["t,a,b", *rows]))
        done = modalwatch("import", tmp_path / f"{name}.csv", "-o", tmp_path / f"{name}.mcap")
        assert done.code == 0
        notes.append("check the unit, such as --unit mm/s2" in " ".join(done.out.split()))
    assert notes == [False, True]


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (
            ("--unit", "parsec"),
            "--unit: expected one of m/s2, cm/s2, mm/s2, g, mg, ug, another unit of acceleration, velocity or "
            "displacement, V, mV or counts, found 'parsec'",
        ),
        (("--sensitivity", "100"), "--sensitivity: expected a sensitivity such as '100 mV/g'"),
        (("--calibration", "none.toml"), "none.toml: cannot be read: "),
        (("--columns", "t,a,a"), "--columns: expected different names, found t,a,a"),
        (("--columns", "t,a"), "data.csv: line 2: expected 2 columns as named, found 3"),
        (("--start", "yesterday"), "--start: expected a time as 2026-01-31T12:00:00Z, found 'yesterday'"),
        (("--start", "1066-10-14"), "--start: expected a time after 1970"),
        (("--column", "a=x", "--column", "b=x"), "--column: expected different names, found a=x, b=x"),
        (("--column", "left"), "data.csv: line 1: expected a column 'left', found t, beam_left_y, beam_left_z"),
        (
            ("--time", "zeit"),
            "data.csv: has no column 'zeit' of times, but t, beam_left_y, beam_left_z: give --time NAME or --rate",
        ),
        (("--rate", "10"), "data.csv: has a column 't' of times: leave out --rate"),
        (("--time-unit", "week"), "--time-unit: expected one of s, ms, us, ns, min, h, d, found 'week'"),
        (("--structure", "none.toml"), "none.toml: cannot be read: "),
    ],
)
def test_invalid_options_are_refused(
    modalwatch: Commands, table: Path, tmp_path: Path, options: tuple[str, ...], says: str
) -> None:
    assert_refused(modalwatch("import", table, "-o", tmp_path / "log.mcap", *options), says)
    assert not (tmp_path / "log.mcap").exists()


@pytest.mark.thorough
def test_errors_after_import_without_a_site_suggest_the_command(
    modalwatch: Commands, table: Path, tmp_path: Path
) -> None:
    log, site = tmp_path / "log.mcap", tmp_path / "site.toml"
    typed = "`modalwatch import DATA -o LOG.mcap --site SITE.toml`"
    assert modalwatch("import", table, "-o", log).code == 0
    assert_refused(modalwatch("replay", log), f"log.mcap: has no settings attached: give --site; {typed}")
    assert_refused(
        modalwatch("replay", log, "--site", site), "holds device 'import'; the settings have beam_left;", typed
    )
    played = SITE.replace("epson-uart", "replay").replace(
        'port = "/dev/none"', f'log = {{file = "{log}", device = "X"}}'
    )
    site.write_text(played.replace("X", "import").replace("z =", "a ="), encoding="utf-8")
    assert_refused(
        modalwatch("check", site), "channels: expected x, y, z, found a: more channels are more devices", typed
    )
    site.write_text(played.replace("X", "beam_left"), encoding="utf-8")
    done = modalwatch("check", site)
    assert done.code == 3
    assert f"has no scan of this device; there are import, import-2: {typed}" in done.err
    _, _, device = played.partition("[[device]]")
    again = "[[device]]" + device.replace("beam_left", "other").replace("other_", "col_037_")
    site.write_text(played + again, encoding="utf-8")
    assert_refused(modalwatch("check", site), "two are connected to", typed)
    site.write_text(played.replace("X", "beam_left").replace("log.mcap", "placed.mcap"), encoding="utf-8")
    done = modalwatch("import", table, "-o", tmp_path / "placed.mcap", "--site", site)
    assert done.code == 0, done.err
    checked = modalwatch("check", site).out
    assert "all devices answer" in checked
    assert "mean and rms per axis [m/s²]" in " ".join(checked.split())


def test_import_creates_a_new_site_that_can_be_monitored(
    modalwatch: Commands, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Four channels are two devices: from a table to a watch in two commands, and a third after an edit."""
    names = ["beam_left_y", "beam_left_z", "beam_right_y", "beam_right_z"]
    random = np.random.default_rng(12)
    table, structure, log = tmp_path / "data.csv", tmp_path / "t.toml", tmp_path / "logs" / "log.mcap"
    log.parent.mkdir()
    rows = [",".join(f"{value:.5f}" for value in (k / 200, *random.normal(size=4))) for k in range(4000)]
    table.write_text("\n".join([",".join(["t", *names]), *rows]))
    structure.write_text(t_structure_toml(), encoding="utf-8")
    site = tmp_path / "sites" / "site.toml"
    asked = ("import", table, "-o", log, "--new-site", site)
    assert_refused(modalwatch(*asked, "--site", site), "--new-site: expected no --site with it")
    assert_refused(modalwatch(*asked, "--structure", structure), "site.toml: cannot be written: No such file")
    site.parent.mkdir()
    log.write_text("precious")
    assert_refused(modalwatch(*asked, "--structure", structure), "log.mcap exists: give another name, or --force")
    assert not site.exists()  # of a log that is none: the same command is to go once that is seen to
    log.unlink()
    done = modalwatch(*asked, "--structure", structure)
    assert done.code == 0, done.err
    assert f"written: {site}, to be edited" in done.out
    assert "the baseline takes 14400 s (24 windows of 600 s), but the log has 20 s" in done.out
    settings = load_settings(site)
    assert [(d.name, d.rate, list(d.channels.values())) for d in settings.device] == [
        ("logger-1", 200.0, names[:3]),
        ("logger-2", 200.0, names[3:]),
    ]
    assert "all devices answer" in modalwatch("check", site).out
    assert "no whole window of 600 s" in modalwatch("replay", log).out
    site.write_text(site.read_text().replace("window_seconds = 600.0", "window_seconds = 10.0"), encoding="utf-8")
    watched, short = tmp_path / "watched.mcap", ("--set", "analysis.window_seconds=6.5")
    assert "window   1 learning none of" in modalwatch("replay", log, "--site", site).out
    assert_refused(modalwatch("report", log), "holds no results", "`modalwatch replay LOG -o WATCHED.mcap` analyses it")
    done = modalwatch("replay", log, *short, "-o", watched)
    assert done.code == 0, done.err
    assert f"written: {watched}" in done.out
    assert "window   2 learning none of" in done.out
    assert "the same as live, to the last digit" in modalwatch("replay", watched).out
    assert modalwatch("report", watched).code == 0
    assert "no end record" not in watched.with_suffix(".html").read_text(encoding="utf-8")
    assert_refused(modalwatch("replay", log, "-o", watched), "watched.mcap exists: give another name, or --force")
    assert_refused(modalwatch("replay", log, "--set", "analysis.overlap=x"), "--set analysis.overlap", "found 'x'")
    other = ("import", table, "-o", tmp_path / "other.mcap", "--new-site", site, "--structure", structure)
    assert_refused(modalwatch(*other), "site.toml exists: give another name, or --force")


def test_data_inconsistent_with_the_site_is_refused(modalwatch: Commands, table: Path, tmp_path: Path) -> None:
    site, text = tmp_path / "site.toml", table.read_text()
    for old, new, says in (
        ("beam_left_z", "left", "has no column 'beam_left_z', which"),
        ("beam_left_z\n", "beam_left_z,x\n", "line 2: expected 4 cells, found 3"),
    ):
        table.write_text(text.replace(old, new))
        assert_refused(modalwatch("import", table, "-o", tmp_path / "log.mcap", "--site", site), table, says)
    table.write_text(text)
    site.write_text(SITE.replace("rate = 100", "rate = 200"))
    done = modalwatch("import", table, "-o", tmp_path / "log.mcap", "--site", site)
    assert_refused(done, "has 100 samples per second, device beam_left of", "200")
    site.write_text(SITE.replace(', y = "beam_left_y"', ""))
    done = modalwatch("import", table, "-o", tmp_path / "log.mcap", "--site", site)
    assert done.code == 0
    assert done.out.splitlines()[-1] == f"note: columns of no sensor of {site}, left out: beam_left_y"
    assert [c.name for c in imported(tmp_path / "log.mcap").channels] == ["beam_left_z"]


def test_channels_without_a_signal_are_reported(modalwatch: Commands, table: Path, tmp_path: Path) -> None:
    rows = [f"{k / 100},{a},{1e-5 * a},2.5," for k, a in enumerate(np.random.default_rng(1).standard_normal(300))]
    table.write_text("\n".join(["t,a,small,flat,none,b", *(f"{row},{k % 7}" for k, row in enumerate(rows))]))
    done = modalwatch("import", table, "-o", tmp_path / "log.mcap")
    notes = [line for line in done.out.splitlines() if line.startswith("note: ")]
    assert notes[1:] == [
        "note: flat is constant (2.5 m/s2): the sensor is dead or not connected",
        "note: none has no sample",
    ]
    assert notes[0].startswith("note: small has an rms of ")


def test_a_log_is_never_overwritten(modalwatch: Commands, table: Path, tmp_path: Path) -> None:
    (tmp_path / "log.mcap").write_text("precious")
    assert_refused(
        modalwatch("import", table, "-o", tmp_path / "log.mcap"), "log.mcap exists: give another name, or --force"
    )
    assert (tmp_path / "log.mcap").read_text() == "precious"
    assert modalwatch("import", table, "-o", tmp_path / "log.mcap", "--force").code == 0
    assert (tmp_path / "log.mcap").stat().st_size > 100


def test_channels_of_a_recorded_log_are_read_from_its_settings() -> None:
    path = Path(__file__).parents[4] / "replay_data" / "t_frame_added_mass.mcap"
    windows = list(log_recordings(path, 20.0))
    (whole,) = log_recordings(path)
    assert len(whole.channels) == 12
    assert {len(w.data) for w in windows} == {20 * 500}
    # the clocks are known better at the end of 60 s than of 20 s, by microseconds
    assert abs(whole.start - windows[0].start) < 1e6
    assert whole.duration > 20 * len(windows)
    assert np.isfinite(whole.data).mean() > 0.999


def test_log_without_a_valid_channel_map_is_refused(tmp_path: Path) -> None:
    from daq import LogError, McapWriter

    McapWriter(tmp_path / "log.mcap", {}).close()
    for read in (log_recordings, load_recordings):
        with pytest.raises(LogError, match=r"has no channel map(: the sensors| and no settings: the sensors)"):
            list(read(tmp_path / "log.mcap"))
    McapWriter(tmp_path / "bad.mcap", {"channels.json": "[1]"}).close()
    with pytest.raises(LogError, match=r"channels\.json: expected channels and on_grid, found '\[1\]'"):
        list(load_recordings(tmp_path / "bad.mcap"))


CAN_SITE = DBC_SITE.replace("PORT", "/dev/none").replace("rate = 1000", "rate = 100").replace('"beam_left"', '"imu"')


@pytest.fixture
def traffic(tmp_path: Path) -> Path:
    """Return candump's file of a sensor, 3 s at 100 Hz, one scan lost, which costs the one before it; a site."""
    lines = [
        f"({1767225600 + k / 100 + late:.6f}) can0 {frame}"
        for k in range(300)
        if k != 150
        for late, frame in ((0, f"006#{k:04X}"), (1e-4, f"034#{k:04X}0100{256 - k % 256:04X}"))
    ]
    (tmp_path / "bus.log").write_text("\n".join(lines) + "\n")
    (tmp_path / "imu.dbc").write_text(IMU.read_text())
    (tmp_path / "t_structure.toml").write_text(t_structure_toml(), encoding="utf-8")
    (tmp_path / "site.toml").write_text(CAN_SITE)
    return tmp_path / "bus.log"


def test_can_log_is_imported_with_a_site_or_a_dbc_file(modalwatch: Commands, traffic: Path, tmp_path: Path) -> None:
    out = tmp_path / "log.mcap"
    done = modalwatch("import", traffic, "-o", out, "--site", tmp_path / "site.toml")
    assert (done.code, done.err) == (0, "")
    assert done.out == f"{out}: imu: 297 scans, 2 missing, 2.98 s\n"
    assert [c.name for c in imported(out).channels] == ["beam_left_y", "beam_left_z"]
    assert "imu.dbc" in read_attachments(out)["site.toml"]
    one = tmp_path / "one.mcap"
    options = ("--dbc", tmp_path / "imu.dbc", "--counter", "Counter", "--rate", 100, "--column", "accY=deck")
    done = modalwatch("import", traffic, "-o", one, *options, "--start", "2026-03-01T00:00:00Z")
    assert (done.code, done.err) == (0, "")
    found = imported(one)
    np.testing.assert_allclose(found.data[~np.isnan(found.data)], 1.0, rtol=1e-3)
    assert abs(found.start - 1_772_323_200_000_000_000) < 1e9


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ((), "--dbc: expected --site, or --dbc with --counter, --rate and --column SIGNAL[=SENSOR]"),
        (("--site", "SITE", "--unit", "g"), "--unit: not for a CAN log"),
        (("--dbc", "DBC", "--counter", "Counter", "--rate", 100, "--column", "accQ"), "has no signal 'accQ', did you"),
        (
            ("--dbc", "DBC", "--counter", "Counter", "--rate", 50, "--column", "accX"),
            "import: expected 50 scans per second",
        ),
        (("--site", "SITE", "--structure", "NONE"), "NONE"),
    ],
)
def test_import_of_can_log_refuses_invalid_options(
    modalwatch: Commands, traffic: Path, tmp_path: Path, options: tuple[object, ...], says: str
) -> None:
    places = {"SITE": tmp_path / "site.toml", "DBC": tmp_path / "imu.dbc"}
    words = [places.get(str(word), word) for word in options]
    assert_refused(modalwatch("import", traffic, "-o", tmp_path / "log.mcap", *words), says)
    assert not (tmp_path / "log.mcap").exists()
