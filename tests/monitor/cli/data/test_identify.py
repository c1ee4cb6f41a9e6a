"""`identify`: the modes of a simulated chain are found in its log, and invalid requests are reported."""

import json
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import pyuff
from PIL import Image

from daq import Channel, Recording, write_recording
from daq.notebook import number_text
from oma import IdentificationError, ModalEstimate, mac
from oma.windows import identify_windows
from tests.support.monitor.cli import Commands, assert_refused
from tests.support.oma.structures import chain, simulate
from updater import t_structure_toml
from updater.modal_data import fuse

CHAIN = chain(4, first=2.0, damping=0.01)
RATE = 40.0  # Hz; modes at 2.0, 5.8, 8.8 and 10.8 Hz


@pytest.fixture(scope="module")
def ambient() -> Recording:
    channels = tuple(Channel(name=name, device="d", axis=i) for i, name in enumerate(CHAIN.channels))
    return replace(simulate(CHAIN, 600.0, RATE, seed=21), channels=channels)


@pytest.fixture(scope="module")
def log(ambient: Recording, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("identify") / "chain.mcap"
    write_recording(path, ambient)
    return path


def windows_of(recording: Recording, seconds: float) -> list[Recording]:
    n = round(seconds * recording.rate)
    starts = range(0, len(recording.data) - n + 1, n)
    return [
        replace(recording, data=recording.data[k : k + n], start=recording.start + round(k / recording.rate * 1e9))
        for k in starts
    ]


def test_identify_writes_modes_as_json(modalwatch: Commands, log: Path, tmp_path: Path) -> None:
    done = modalwatch("identify", log, "--window", 150, "--json", tmp_path / "modes.json")
    assert (done.code, done.err) == (0, "")
    assert "chain.mcap: 4 windows of 150 s" in done.out
    found = json.loads((tmp_path / "modes.json").read_text())
    assert set(found) == {"modes", "harmonics", "channels", "window", "method"}
    assert found["channels"] == dict.fromkeys(CHAIN.channels, "ok")
    assert (found["window"]["end"] - found["window"]["start"], found["window"]["rate"]) == (600 * 10**9, RATE)
    assert (found["method"]["name"], found["method"]["windows"]) == ("ssi-data", 4)
    assert [mode["id"] for mode in found["modes"]] == [1, 2, 3, 4]
    for mode, frequency, shape in zip(found["modes"], CHAIN.frequency, CHAIN.shapes, strict=True):
        assert set(mode) == {"id", "frequency", "damping", "shape", "shape_std", "quality"}
        assert abs(mode["frequency"]["value"] - frequency) < 4 * mode["frequency"]["std"]
        assert abs(mode["damping"]["value"] - 0.01) < 4 * mode["damping"]["std"]
        assert number_text(**mode["frequency"]).partition(" ")[0] in done.out
        measured = np.array([complex(*mode["shape"][name]) for name in CHAIN.channels])
        assert mac(measured, shape.astype(complex)) > 0.99  # 5 % noise on each channel leaves about 0.999
        assert set(mode["shape_std"]) == set(CHAIN.channels)


def test_single_channel_gives_frequencies_without_shapes(
    modalwatch: Commands, ambient: Recording, tmp_path: Path
) -> None:
    write_recording(tmp_path / "one.mcap", replace(ambient, channels=ambient.channels[3:], data=ambient.data[:, 3:]))
    done = modalwatch("identify", tmp_path / "one.mcap", "--json", tmp_path / "modes.json")
    assert (done.code, done.err) == (0, "")
    found = json.loads((tmp_path / "modes.json").read_text())
    frequency = [mode["frequency"]["value"] for mode in found["modes"]]
    np.testing.assert_allclose(frequency, CHAIN.frequency, rtol=5e-3)
    assert done.out.count(" - ") == 2 * len(frequency)  # MPC and MPD
    assert found["window"]["band"] == pytest.approx([100 / 600, 0.48 * RATE])
    assert "band: 0.1667 to 19.2 Hz (0.48 of the rate)" in done.out


def test_modes_are_drawn(modalwatch: Commands, log: Path, tmp_path: Path) -> None:
    done = modalwatch("identify", log, "--window", 200, "--picture", tmp_path / "modes.png")
    assert (done.code, done.err) == (0, "")
    colours = np.asarray(Image.open(tmp_path / "modes.png").convert("RGB")).astype(int)
    red, blue = ((np.abs(colours - colour).sum(axis=2) < 60) for colour in ((0xC6, 0x28, 0x28), (0x15, 0x65, 0xC0)))
    lines = np.flatnonzero(red.sum(axis=0) > 300)  # columns of pixels that a mode's line runs down
    marked = lines[np.diff(lines, prepend=-9) > 1]
    # equal steps in frequency are equal steps in the picture, to a pixel or two
    np.testing.assert_allclose(
        np.diff(marked) / np.ptp(marked), np.diff(CHAIN.frequency) / np.ptp(CHAIN.frequency), atol=0.01
    )
    assert blue[600:].sum() > 5000  # bars of the shapes


@pytest.mark.thorough
def test_shapes_are_drawn_at_the_positions_of_a_site(modalwatch: Commands, log: Path, tmp_path: Path) -> None:
    """The chain is upright: each mass is a node of the universal file, which its channel moves in x."""
    site = tmp_path / "site.toml"
    devices = [
        f'[[device]]\nname = "d{k}"\ndriver = "epson-uart"\nport = "/dev/{k}"\nchannels = {{x = "{name}"}}\n'
        f'[[sensor]]\nchannel = "{name}"\nat = [0, 0, {k}]\ndirection = [1, 0, 0]\n'
        for k, name in enumerate(CHAIN.channels, 1)
    ]
    site.write_text("".join(devices) + "[analysis]\nwindow_seconds = 300\n", encoding="utf-8")
    done = modalwatch("identify", log, "--site", site, "--out", tmp_path / "out", "--animate", tmp_path / "modes.gif")
    assert (done.code, done.err) == (0, "")
    assert "2 windows of 300 s" in done.out
    header, nodes, *others = pyuff.UFF(str(tmp_path / "out" / "modes.unv")).read_sets()
    assert (header["type"], header["program"]) == (151, "modalwatch")
    assert (list(nodes["node_nums"]), list(nodes["z"])) == ([1, 2, 3, 4], [1, 2, 3, 4])
    assert [list(one["nodes"]) for one in others if one["type"] == 82] == [[1, 2], [2, 3], [3, 4]]
    assert sum(one["type"] == 55 for one in others) == 4
    with Image.open(tmp_path / "modes.gif") as picture:
        assert getattr(picture, "n_frames", 1) > 12
    site.write_text(site.read_text().replace("mass_", "weight_"), encoding="utf-8")
    assert_refused(
        modalwatch("identify", log, "--site", site), "--site", "sensor: expected a channel of the log, mass_1, mass_2"
    )
    assert_refused(modalwatch("identify", log, "--animate", tmp_path / "no.gif"), "--animate", "a site with [[sensor]]")


def test_more_windows_reduce_the_standard_deviation(ambient: Recording) -> None:
    windows = identify_windows(windows_of(ambient, 100.0))
    fused = fuse(windows.estimates)
    assert len(windows.estimates) == 6
    stated = np.median([e.frequency_std[:4] for e in windows.estimates if e.n_modes == 4], axis=0)
    factor = max(1.0, fused.scatter or 0.0)
    # the mean of n windows has 1/sqrt(n) of a window's deviation; windows differ in theirs by some 20 %
    np.testing.assert_allclose(fused.estimate.frequency_std, factor * stated / np.sqrt(fused.n), rtol=0.4)
    assert (np.abs(fused.estimate.frequency - CHAIN.frequency) < 4 * fused.estimate.frequency_std).all()
    np.testing.assert_allclose(np.linalg.norm(fused.estimate.shape, axis=1), 1.0)


def only(estimate: ModalEstimate, modes: list[int]) -> ModalEstimate:
    names = ("frequency", "frequency_std", "damping", "damping_std", "shape", "shape_std", "support", "law_ratio")
    return replace(estimate, **{name: getattr(estimate, name)[modes] for name in names})


def test_mode_missing_in_some_windows_is_kept(ambient: Recording) -> None:
    estimates = list(identify_windows(windows_of(ambient, 120.0)).estimates)
    assert [e.n_modes for e in estimates] == [4] * 5
    lacking = [only(estimates[0], [0, 2, 3]), only(estimates[1], [0, 1, 3]), only(estimates[2], [0, 1, 3])]
    fused = fuse([*lacking, *estimates[3:]])  # mode 2 is in 4 of 5 windows, mode 3 in 3 of 5: too few
    assert fused.n.tolist() == [5, 4, 5]
    found = fused.estimate
    assert (np.abs(found.frequency - CHAIN.frequency[[0, 1, 3]]) < 4 * found.frequency_std).all()
    assert fuse([lacking[0], *estimates[1:]]).n.tolist() == [5, 4, 5, 5]
    three = [lacking[0], *[only(e, [1, 2, 3]) for e in estimates[1:]]]
    assert fuse(three).n.tolist() == [4, 5, 5]


@pytest.mark.thorough
@pytest.mark.parametrize("first_seed", [100])
def test_fused_standard_deviations_match_the_actual_errors(first_seed: int) -> None:
    z = []
    for seed in range(first_seed, first_seed + 12):
        estimate = fuse(identify_windows(windows_of(simulate(CHAIN, 600.0, RATE, seed), 150.0)).estimates).estimate
        assert estimate.n_modes == 4, seed
        z.append((estimate.frequency - CHAIN.frequency) / estimate.frequency_std)
        z.append((estimate.damping - 0.01) / estimate.damping_std)
    # of 96 normal values the root mean square is 1 +- 0.07; damping carries a bias of up to 0.35
    assert 0.78 < np.sqrt(np.mean(np.square(z))) < 1.25
    assert np.mean(np.abs(z) < 2) > 0.88  # 0.95 +- 0.022


def constant(value: float, scatter: float, n: int) -> list[ModalEstimate]:
    """Return estimates of one mode with a given scatter and a stated deviation of 0.01 Hz."""
    steps = np.tile([-1.0, 1.0], n)[:n] * scatter
    one = np.array([0.01])
    return [
        ModalEstimate(
            channels=("a", "b"),
            frequency=np.array([value + step]),
            frequency_std=one,
            damping=one,
            damping_std=one,
            shape=np.array([[0.8 + 0.0j, 0.6j]]) * (-1) ** k,
            shape_std=np.full((1, 2), 0.01),
            support=np.ones(1),
            law_ratio=np.ones(1),
            start=k,
            end=k + 1,
        )
        for k, step in enumerate(steps)
    ]


@pytest.mark.parametrize(("scatter", "factor"), [(0.0, 1.0), (0.04, 4.0 * np.sqrt(8 / 7))])
def test_excess_scatter_of_windows_increases_the_fused_deviation(scatter: float, factor: float) -> None:
    fused = fuse(constant(10.0, scatter, 8))
    # in terms of log frequency, whose mean is 8e-6 lower
    assert fused.estimate.frequency[0] == pytest.approx(10.0, abs=1e-3)
    assert fused.estimate.frequency_std[0] == pytest.approx(factor * 0.01 / np.sqrt(8), rel=0.01)
    assert (fused.estimate.start, fused.estimate.end, fused.n.tolist()) == (0, 8, [8])
    assert mac(fused.estimate.shape[0], np.array([0.8, 0.6j])) == pytest.approx(1.0)


def test_mode_in_too_few_windows_is_rejected(ambient: Recording) -> None:
    with pytest.raises(IdentificationError, match="no mode is identified in 70% of the 2 windows"):
        fuse([*constant(10.0, 0.0, 1), *constant(20.0, 0.0, 1)])
    with pytest.raises(IdentificationError, match="of the 0 windows"):
        fuse([])


def test_constant_channels_and_harmonics_are_reported(modalwatch: Commands, ambient: Recording, tmp_path: Path) -> None:
    data = ambient.data.copy()
    data[:, 3] = 0.5
    time = np.arange(len(data)) / RATE
    data[:, :3] += 20 * np.sin(2 * np.pi * 7.0 * time)[:, None] * np.std(ambient.data)
    data[:6000, 2] = 0.0  # the first of four windows
    write_recording(tmp_path / "log.mcap", replace(ambient, data=data))
    done = modalwatch("identify", tmp_path / "log.mcap", "--window", 150, "--json", tmp_path / "modes.json")
    assert done.code == 0, done.err
    found = json.loads((tmp_path / "modes.json").read_text())
    states = {"mass_1": "ok", "mass_2": "ok", "mass_3": "constant (in 1 of 4 windows)", "mass_4": "constant"}
    assert found["channels"] == states
    assert "channel mass_4: constant" in done.out
    assert found["harmonics"] == [pytest.approx(7.0, rel=1e-3)]
    assert "tones, no modes: 7.00" in done.out
    assert set(found["modes"][0]["shape"]) == {"mass_1", "mass_2", "mass_3"}


def small_log(path: Path, data: np.ndarray[tuple[int, int], np.dtype[np.float64]], names: str = "ab") -> Path:
    channels = tuple(Channel(name=name, device="d", axis=i) for i, name in enumerate(names))
    write_recording(path, Recording(channels=channels, data=data, rate=RATE, start=0))
    return path


def test_invalid_identify_requests_are_refused(modalwatch: Commands, ambient: Recording, tmp_path: Path) -> None:
    log = tmp_path / "chain.mcap"
    write_recording(log, replace(ambient, data=ambient.data[:2400]))
    noise = np.random.default_rng(21).standard_normal((8000, 2))
    short = small_log(tmp_path / "short.mcap", noise[:50])
    dead = small_log(tmp_path / "dead.mcap", noise * [1, 0])
    white = small_log(tmp_path / "white.mcap", noise)
    none, frame = tmp_path / "none.mcap", tmp_path / "frame.toml"
    frame.write_text(t_structure_toml(), encoding="utf-8")
    for arguments, says in (
        ((short,), (short, "recording of 1.25 s is too short: at least ")),
        ((dead,), (dead, "1 usable channels, 2 needed (b: constant)")),
        ((white,), (white, "no resonance is visible")),
        ((none,), (none, "cannot be read: No such file")),
        ((log, white), (white, f"expected the channels of {log}; only one of the two has a, b, mass_1")),
        ((log, "--method", "fdb"), ("--method: expected one of ssi-data, ", ", fsdd, found 'fdb'")),
        ((log, "--band", 3, 2), ("--band: expected 0 < low < high, found 3 2",)),
        ((log, "--band", 1, 30), (log, "band: expected 0 < low < high <= 20.0 Hz")),
        ((log, "--json", tmp_path / "none" / "x"), ("--json: ", tmp_path / "none" / "x", "cannot be written")),
        ((log, "--picture", tmp_path / "x.sketch"), ("--picture: ", tmp_path / "x.sketch", "cannot be written")),
        ((log, "--animate", tmp_path / "x.mp4"), ("--animate: expected a name that ends with .html or .gif",)),
        ((log, "--animate", tmp_path / "x.gif"), ("--animate: expected a structure", "(--structure)")),
        ((log, "--structure", frame), (frame, "the structure has no sensor for channel 'mass_1'")),
        ((log, "--structure", tmp_path / "none.toml"), (tmp_path / "none.toml", "cannot be read")),
    ):
        assert_refused(modalwatch("identify", *arguments), *says)


@pytest.mark.thorough
def test_modes_are_compared_with_the_structure(modalwatch: Commands, tmp_path: Path) -> None:
    path = Path(__file__).parents[4] / "replay_data" / "t_frame_added_mass.mcap"
    files = ("--json", tmp_path / "modes.json", "--animate", tmp_path / "m.html")
    done = modalwatch("identify", path, "--window", 30, *files)
    assert done.code == 0, done.err
    modes = json.loads((tmp_path / "modes.json").read_text())["modes"]
    assert (tmp_path / "m.html").read_text(encoding="utf-8").count("<canvas role=") == len(modes)
    assert " model " in done.out
    paired = [m for m in modes if "model" in m["quality"]]
    assert len(paired) >= 4
    for mode in paired:  # the rig's frame is softer than the file says, by some per cent, and carries a body
        assert 0.85 < mode["frequency"]["value"] / mode["quality"]["model"]["frequency"] < 1.0
        assert mode["quality"]["model"]["mac"] > 0.9


REAL = os.environ.get("MODALWATCH_REAL_DATA")
PUBLISHED = (1.2283, 1.4358, 2.1000, 4.0175, 4.7704, 6.6824, 7.6157, 9.6653, 12.1663, 12.5979, 13.8545)  # Hz


@pytest.mark.skipif(not REAL, reason="MODALWATCH_REAL_DATA names no folder")
def test_a_measured_steel_frame_has_its_published_frequencies(modalwatch: Commands, tmp_path: Path) -> None:
    data = Path(REAL or "") / "weimar-steel-frame" / "measurement_01.npz"
    assert modalwatch("import", data, "-o", tmp_path / "log.mcap").code == 0
    done = modalwatch("identify", tmp_path / "log.mcap", "--band", 1, 15, "--json", tmp_path / "modes.json")
    assert done.code == 0, done.err
    modes = json.loads((tmp_path / "modes.json").read_text())["modes"]
    found = np.array([m["frequency"]["value"] for m in modes])
    std = np.array([m["frequency"]["std"] for m in modes])
    nearest = np.abs(found[:, None] - np.array(PUBLISHED)).argmin(axis=0)
    # published: mean over 15 setups, which differ by up to 0.011 Hz
    assert (np.abs(found[nearest] - PUBLISHED) < 4 * np.hypot(std[nearest], 0.011)).all()
    assert len(set(nearest)) == len(PUBLISHED)


@pytest.mark.usefixtures("undrawn")
def test_logs_of_setups_are_merged(modalwatch: Commands, tmp_path: Path) -> None:
    tower, logs = chain(6, first=1.5, damping=0.01), []
    for k, moved in enumerate(((0, 1), (2, 3))):
        place = [5, *moved]  # the topmost mass keeps its sensor
        channels = tuple(Channel(name=tower.channels[i], device="d", axis=a) for a, i in enumerate(place))
        whole = simulate(tower, 400.0, 40.0, seed=40 + k)
        logs.append(tmp_path / f"setup_{k + 1}.mcap")
        write_recording(logs[-1], replace(whole, channels=channels, data=whole.data[:, place]))
    done = modalwatch("identify", *logs, "--reference-sensor", "mass_6", "--out", tmp_path / "out")
    assert (done.code, done.err) == (0, "")
    assert "setup_1.mcap, setup_2.mcap: 2 set-ups" in done.out.replace("\n", " ")
    found = json.loads((tmp_path / "out" / "modes.json").read_text())
    names = ["mass_6", "mass_1", "mass_2", "mass_3", "mass_4"]
    place = [tower.channels.index(name) for name in names]
    assert found["channels"] == dict.fromkeys([*names[:3], *names[3:]], "ok")
    assert len(found["modes"]) == 6
    for mode, frequency, shape in zip(found["modes"], tower.frequency, tower.shapes, strict=True):
        assert abs(mode["frequency"]["value"] - frequency) < 4 * mode["frequency"]["std"]
        measured = np.array([complex(*mode["shape"][name]) for name in names])
        assert mac(measured, shape[place].astype(complex)) > 0.99
        assert mode["quality"]["windows"] == 2
    for arguments, says in (
        (
            (logs[0], "--reference-sensor", "mass_6"),
            ("--reference-sensor: expected the logs of two set-ups or more, found 1",),
        ),
        ((*logs, "--reference-sensor", "mass_1"), (logs[1], "set-up 2: expected the references mass_1, lacks mass_1")),
        (logs, (logs[1], "expected the channels of")),
    ):
        assert_refused(modalwatch("identify", *arguments), *says)
