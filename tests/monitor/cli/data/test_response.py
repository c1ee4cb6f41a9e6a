"""`response`: motion and stresses where there is no sensor, of logs of an independent specimen."""

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from daq import Channel, FloatArray, load_recordings, write_recording
from monitor.analysis.explanation import reference_of
from monitor.analysis.logs import log_channels
from monitor.analysis.observation import observe, without_delays
from tests.support.monitor.cli import Commands, assert_refused
from tests.support.snippets import code_blocks, run_cells
from tests.support.updater.unmeasured_points import UnmeasuredPoints, unmeasured_points
from updater import parse_structure, t_structure_toml
from updater.validation import Fibre, Point, ResponseModel

SEED = 6
STRESSED = Fibre(member="column", distance=0.1, y=0.02, z=0.02)


@pytest.fixture(scope="module")
def case() -> UnmeasuredPoints:
    print(f"seed {SEED}")
    return unmeasured_points("frame", SEED, fibres=[STRESSED])


@pytest.fixture(scope="module")
def folder(case: UnmeasuredPoints, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with structure.toml, before.mcap, now.mcap and the truth of the latter."""
    folder = tmp_path_factory.mktemp("response")
    (folder / "structure.toml").write_text(t_structure_toml(), encoding="utf-8")
    before, _ = case.raw_record(100.0, 1)
    now, truth = case.raw_record(40.0, 2)
    write_recording(folder / "before.mcap", before)
    write_recording(folder / "now.mcap", now)
    np.save(folder / "truth.npy", truth)
    return folder


def in_band(truth: FloatArray, band: tuple[float, float]) -> FloatArray:
    return np.asarray(sosfiltfilt(butter(4, band, "bandpass", fs=1000.0, output="sos"), truth, axis=0))


def test_motion_and_stress_are_within_their_deviations(
    modalwatch: Commands, case: UnmeasuredPoints, folder: Path
) -> None:
    point = case.points[0]
    assert isinstance(point, Point)
    place = f"column:{point.at[2]:g}:{'xyz'[point.axis]}"
    done = modalwatch(
        "response", folder / "structure.toml", folder / "now.mcap", "--reference", folder / "before.mcap",
        "--at", place, "--at", f"{place}:displacement", "--stress", "column:0.1", "--stress", "crossbeam:0.3",
        "-o", folder / "signals.csv", "--json", folder / "response.json",
    )  # fmt: skip
    assert (done.code, done.err) == (0, ""), done
    found = json.loads((folder / "response.json").read_text())
    truth = in_band(np.load(folder / "truth.npy"), found["band"])[3000:-3000]
    acceleration, displacement = found["motions"]
    for own, exact in ((acceleration["rms"], truth[:, 0]), (found["sections"][0]["rms"], truth[:, -1])):
        # the error adds to the square of the signal, and its share of the square is small
        assert abs(own["value"] - exact.std()) < 2 * own["std"]
        assert own["std"] < 0.2 * own["value"]
    assert (displacement["rms"]["unit"], acceleration["axis"]) == ("m", place[-1])
    section = found["sections"][0]
    assert (section["member"], section["distance"]) == ("column", 0.1)
    assert [abs(value) for value in section["fibre"]] == [0.02, 0.02]
    assert section["damage_per_year"] == 0  # a thousandth of a MPa
    assert "column at 0.1 m" in done.out
    assert "> 10000" in done.out
    with (folder / "signals.csv").open(encoding="utf-8") as file:
        rows = [row for row in csv.reader(file) if not row[0].startswith("#")]
    assert len(rows[0]) == 1 + 2 + 4 + 4
    signal = np.array([float(row[1] or "nan") for row in rows[1:]])
    assert np.nanstd(signal) == pytest.approx(acceleration["rms"]["value"], rel=1e-6)


def test_sensors_are_predicted_from_the_other_places(modalwatch: Commands, folder: Path) -> None:
    done = modalwatch(
        "response", folder / "structure.toml", folder / "now.mcap", "--reference", folder / "before.mcap",
        "--predict-sensors", "-o", folder / "sensors.csv", "--json", folder / "sensors.json",
    )  # fmt: skip
    assert (done.code, done.err) == (0, ""), done
    sensors = json.loads((folder / "sensors.json").read_text())["sensors"]
    assert len(sensors) == 12
    assert np.mean([own["within_two"] for own in sensors]) > 0.8  # one specimen: all samples share errors of shape
    assert np.median([own["error"] / own["rms"] for own in sensors]) < 0.25
    assert "within 2 deviations" in done.out
    assert "24 signals" in done.out
    with (folder / "sensors.csv").open(encoding="utf-8") as file:
        names, *rows = [row for row in csv.reader(file) if not row[0].startswith("#")]
    own = sensors[0]
    measured, predicted = (
        np.array([float(row[names.index(name)] or "nan") for row in rows])
        for name in (own["channel"], f"{own['channel']} predicted")
    )
    assert np.sqrt(np.nanmean((predicted - measured) ** 2)) == pytest.approx(own["error"], rel=1e-6)


@pytest.mark.thorough
def test_gap_of_a_sensor_leaves_its_other_samples(modalwatch: Commands, case: UnmeasuredPoints, tmp_path: Path) -> None:
    """One place has a device of its own; its gap of 0.4 s is none of the others."""
    (tmp_path / "structure.toml").write_text(t_structure_toml(), encoding="utf-8")
    for name, seconds, seed in (("before", 100.0, 1), ("whole", 40.0, 2), ("gap", 40.0, 2)):
        record, _ = case.raw_record(seconds, seed)
        place = record.channels[0].name.rpartition("_")[0]
        own = [channel.name.startswith(place) for channel in record.channels]
        channels = [replace(c, device="own") if k else c for c, k in zip(record.channels, own, strict=True)]
        data = record.data.copy()
        if name == "gap":
            data[15_000:15_400, own] = np.nan
        write_recording(tmp_path / f"{name}.mcap", replace(record, channels=tuple(channels), data=data))
    found = {}
    for name in ("whole", "gap"):
        done = modalwatch(
            "response", tmp_path / "structure.toml", tmp_path / f"{name}.mcap",
            "--reference", tmp_path / "before.mcap", "--predict-sensors", "--json", tmp_path / f"{name}.json",
        )  # fmt: skip
        assert (done.code, done.err) == (0, ""), done
        text = (tmp_path / f"{name}.json").read_text()
        assert "NaN" not in text
        assert "nan" not in done.out
        found[name] = json.loads(text)["sensors"]
    assert [own["channel"] for own in found["gap"]] == [own["channel"] for own in found["whole"]]
    for own, whole in zip(found["gap"], found["whole"], strict=True):
        for key in ("rms", "error", "std"):  # some 4 % of the samples are missing, with the time to settle
            assert own[key] == pytest.approx(whole[key], rel=0.04)
        assert own["std"] == whole["std"] or not own["channel"].startswith(place)  # its prediction does not use it


def test_snippet_of_the_page_runs(case: UnmeasuredPoints) -> None:
    (code,) = code_blocks(Path(__file__).parents[4] / "docs" / "howto" / "data" / "response.md")
    signals = {"recording": case.record(30.0, 1)[0], "later": case.record(20.0, 2)[0]}
    names = run_cells([code], reference=case.reference, structure=parse_structure(t_structure_toml()), **signals)
    assert names["damage"] == 0
    assert max(one.largest for one in names["cycles"]) < 1e6
    assert len(names["cycles"]) == 4


def test_life_of_a_loud_vibration_is_finite(modalwatch: Commands, case: UnmeasuredPoints, folder: Path) -> None:
    """Signals 30,000 times as large, some 50 MPa rms: less damage than if all ranges were the largest."""
    loud = folder / "loud.mcap"
    now, _ = case.raw_record(40.0, 2)
    if not loud.exists():
        write_recording(loud, replace(now, data=3e4 * now.data))
    done = modalwatch(
        "response", folder / "structure.toml", loud, "--reference", folder / "before.mcap", "--stress", "column:0.1",
        "--detail", 80, "--json", folder / "loud.json",
    )  # fmt: skip
    assert done.code == 0, done
    (section,) = json.loads((folder / "loud.json").read_text())["sections"]
    low, high = section["damage_per_year_range"]
    assert 0 < low < section["damage_per_year"] < high
    largest, equivalent = section["largest_range"], section["equivalent_range"]["value"]
    assert largest > equivalent > section["rms"]["value"]
    most = section["cycles_per_hour"] * 24 * 365.25 * (largest / section["category"]) ** 3 / 2e6
    assert section["damage_per_year"] < most
    assert "detail category 80 of EN 1993-1-9" in done.out


def test_axes_that_were_recorded_but_not_analysed_are_within_the_deviations() -> None:
    """The recorded rig, over its wire protocols: devices at both ends of the crossbeam measured along it, too.

    Its clocks ran ten times as fast as the host's, whose delays vary by 0.1 to 0.2 ms there. The record is fixed: 99 %
    are within two deviations (a normal distribution: 95 %), the median error is 12 % of the signal.
    """
    log = Path(__file__).parents[4] / "replay_data" / "t_frame_added_mass.mcap"
    used = log_channels(log)
    unused = tuple(Channel(name=f"{end}_x", device=f"beam_{end}", axis=0) for end in ("left", "right"))
    whole = list(load_recordings(log, window_seconds=20.0, channels=(*used, *unused)))[:6]  # before the mass
    n = len(used)
    measured = [replace(one, channels=used, data=one.data[:, :n]) for one in whole]
    structure = parse_structure(t_structure_toml())
    observation = observe(measured[:5])
    assert observation.sample
    model = ResponseModel.learn(reference_of(structure, observation), observation.sample)
    removed = model.reference.delays.seconds
    ends = [Point(at=(x, 0.0, 1.48), axis=0) for x in (-0.4, 0.4)]
    within, relative = [], []
    for one, signals in zip(whole, measured, strict=True):
        found = model.estimate(without_delays(signals, removed, {}), ends)
        truth = without_delays(replace(one, channels=unused, data=one.data[:, n:]), removed, {})
        settled = np.isfinite(found.recording.data[:, 0])
        exact = sosfiltfilt(
            butter(4, found.band, "bandpass", fs=one.rate, output="sos"), np.nan_to_num(truth.data), axis=0
        )[settled]
        error = found.recording.data[settled] - exact
        within.append((np.abs(error) < 2 * found.std).mean(0))
        relative.append(error.std(0) / exact.std(0))
    assert np.mean(within) > 0.9
    assert np.median(relative) < 0.2


@pytest.mark.parametrize(
    ("options", "reported"),
    [
        ((), "--at, --stress, --predict-sensors: expected a place, a section or sensors, found none"),
        (("--at", "column:0.3"), "--at: expected MEMBER:DISTANCE:AXIS[:displacement|velocity|acceleration]"),
        (("--at", "column:0.3:x:speed"), "--at: expected MEMBER:DISTANCE:AXIS"),
        (("--at", "column:0.3:x:velocity:x"), "--at: expected MEMBER:DISTANCE:AXIS"),
        (("--at", "mast:0.3:x"), "--at: no member is named 'mast'; there are column, crossbeam"),
        (("--stress", "column:2"), "--stress: column: expected a distance of 0 to 1.48 m, found '2'"),
        (("--stress", "column"), "--stress: column: expected a distance of 0 to 1.48 m, found ''"),
        (("--stress", "column:1", "--detail", 0), "--detail: expected a positive range in MPa, found 0"),
    ],
)
def test_invalid_requests_are_refused(
    modalwatch: Commands, folder: Path, options: tuple[object, ...], reported: str
) -> None:
    paths = folder / "structure.toml", folder / "now.mcap", "--reference", folder / "before.mcap"
    assert_refused(modalwatch("response", *paths, *options), reported)


def test_log_without_a_channel_of_the_reference_is_refused(
    modalwatch: Commands, case: UnmeasuredPoints, folder: Path, tmp_path: Path
) -> None:
    now, _ = case.raw_record(10.0, 2)
    write_recording(tmp_path / "less.mcap", replace(now, channels=now.channels[1:], data=now.data[:, 1:]))
    paths = folder / "structure.toml", tmp_path / "less.mcap", "--reference", folder / "before.mcap"
    done = modalwatch("response", *paths, "--at", "column:0.3:x")
    missing = f"recording: channel {now.channels[0].name!r} of the reference is missing"
    assert f"left out: {missing}" in done.out
    assert_refused(done, f"less.mcap: no window can be estimated: {missing}")


def test_section_without_an_edge_is_refused(modalwatch: Commands, folder: Path, tmp_path: Path) -> None:
    text = "".join(line for line in t_structure_toml().splitlines(keepends=True) if not line.startswith("edge"))
    (tmp_path / "bare.toml").write_text(text, encoding="utf-8")
    paths = tmp_path / "bare.toml", folder / "now.mcap", "--reference", folder / "before.mcap"
    done = modalwatch("response", *paths, "--stress", "column:0.1")
    assert_refused(done, "--stress: section of column: stresses need the shape of its section, or its edge")
