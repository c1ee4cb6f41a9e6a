"""The preview in the archive: low-passed, timed as its scans, read by stock tools, skipped by ours."""

import itertools
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from daq import Block, FloatArray, read_log, repair_log
from daq.log import RotatingWriter, Rotation
from daq.log.format.preview import View
from tests.support.daq.blocks import START, contents, make_block
from tests.support.monitor.rrd_reader import Rrd

RATE, VIEW_RATE, EVERY = 1000.0, 50.0, 20
SCALE = 1e-6
HALF = 180  # scans on each side that the low-pass takes
PASSED, STOPPED = 8.0, 470.0  # Hz; what is stopped would be seen at 20 Hz
GAP = 4000, 4100  # scans that are missing
THROUGH = 3e-3  # of a low-pass of 60 dB: ripple and rest together, three times


def motion(index: FloatArray) -> FloatArray:
    """Return the motion (n, 3) [m/s2]."""
    return np.stack([np.sin(2 * np.pi * PASSED * index / RATE + axis) for axis in range(3)], axis=1)


def block(device: str, first: int, n: int, n_axes: int) -> Block:
    index = np.arange(first, first + n, dtype=float)
    fast = np.sin(2 * np.pi * STOPPED * index / RATE)[:, None]
    counts = np.rint((motion(index) + fast) / SCALE).astype(np.int32)[:, :n_axes]
    base = make_block(device, first, n=n)
    return Block(**{**vars(base), "counts": np.ascontiguousarray(counts), "scale": SCALE})


def blocks() -> list[Block]:
    """Return 10 s of two devices, of three axes and of one, in blocks of several lengths."""
    found, first = [], 0
    for n in [200, 7, 413, 180] * 13:
        found += [block(name, first, n, n_axes) for name, n_axes in (("beam", 3), ("bar", 1))]
        first += n
        if first == GAP[0]:
            first += GAP[1] - GAP[0]
    return found


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("view")
    recorder = RotatingWriter(folder, {"site.toml": "x = 1"}, START, Rotation(), view_rate=VIEW_RATE)
    for k, item in enumerate(blocks()):
        recorder.write(item)
        if k % 4 == 0:
            recorder.flush()
    recorder.close()
    return recorder.paths[0]


def shown(log: Path, device: str) -> tuple[FloatArray, FloatArray]:
    """Return index and values (n, n_axes) of a device's view, as a stock reader finds it."""
    with log.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        found = list(reader.iter_decoded_messages(topics=[f"/view/{device}"], log_time_order=False))
    index = np.array([m.message.log_time - START for m in found]) * 1e-9 * RATE
    values = [getattr(m.decoded_message, "data", None) or _vector(m.decoded_message) for m in found]
    return index, np.array(values, float)


def _vector(message: object) -> list[float]:
    vector = message.linear_acceleration  # type: ignore[attr-defined]
    return [vector.x, vector.y, vector.z]


@pytest.mark.parametrize("device", ["beam", "bar"])
def test_preview_is_low_passed_without_time_shift(log: Path, device: str) -> None:
    index, values = shown(log, device)
    np.testing.assert_allclose(index, np.rint(index), atol=1e-3)  # times of scans
    np.testing.assert_array_equal(np.rint(index) % EVERY, 0)
    np.testing.assert_allclose(values, motion(index)[:, : values.shape[1]], atol=THROUGH)


def test_preview_samples_appear_once_and_none_in_gaps(log: Path) -> None:
    index, _ = shown(log, "beam")
    end = blocks()[-1].end_index
    whole = [(HALF, GAP[0] - HALF), (GAP[1] + HALF, end - HALF)]
    first = [np.arange(-(-a // EVERY) * EVERY, b, EVERY) for a, b in whole]
    np.testing.assert_array_equal(np.rint(index), np.concatenate(first))


def test_log_reader_skips_preview_and_repair_keeps_it(log: Path, tmp_path: Path) -> None:
    assert contents(read_log(log)) == contents(blocks())
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(log.read_bytes()[: log.stat().st_size // 2])
    repair_log(cut)
    found = contents(read_log(cut))
    assert found == contents(blocks())[: len(found)]
    assert len(shown(cut, "beam")[0]) > 100


def test_rerun_reads_preview_of_unconverted_log(log: Path, tmp_path: Path) -> None:
    rerun = Path(sys.executable).with_name("rerun")
    subprocess.run([rerun, "mcap", "convert", log, "-o", tmp_path / "log.rrd"], check=True, capture_output=True)
    found = Rrd(tmp_path / "log.rrd")
    assert found.entities("/view") == {"/view/beam", "/view/bar"}
    _, rows = found.rows("/view/bar", "Scalars:scalars", timeline="message_log_time")
    np.testing.assert_array_equal(np.ravel(rows), np.ravel(shown(log, "bar")[1]))


def test_preview_of_slow_device_is_not_decimated() -> None:
    slow = make_block("slow", 0, n=30)
    view = View(VIEW_RATE).add(Block(**{**vars(slow), "rate": 40.0}))
    assert len(view) == 30
    assert all(a.time < b.time for a, b in itertools.pairwise(view))


def test_preview_filter_restarts_when_block_indices_jump_back() -> None:
    view = View(VIEW_RATE)
    before = [message for k in range(10) for message in view.add(make_block("a", 250 * k))]
    again = [message for k in range(8, 12) for message in view.add(make_block("a", 250 * k))]
    assert len(before) == len(range(HALF, 2500 - HALF, EVERY))
    assert len(again) == len(range(-(-(2000 + HALF) // EVERY) * EVERY, 3000 - HALF, EVERY))


def test_preview_times_are_equal_for_devices_on_shared_clock() -> None:
    view, random = View(VIEW_RATE), np.random.default_rng(1)
    times: dict[str, list[int]] = {"a": [], "b": []}
    for first in range(0, 20_000, 250):
        for name, found in times.items():
            base = make_block(name, first)
            late = int(random.integers(3_000_000))
            found += [m.time for m in view.add(replace(base, clock="SYNC", arrival_time=base.arrival_time + late))]
    assert times["a"] == times["b"]
    assert len(times["a"]) > 900
