"""A log for stock viewers: every scan at its own time, none made up, read by the tools of others."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from daq import Block, Flag, FloatArray, IndexArray, LogError, McapWriter
from daq.drivers import EPSON_SCALE
from daq.files import expand_log
from tests.support.daq.blocks import START, make_block, write_log
from tests.support.monitor.rrd_reader import Rrd

DRIFT = 50e-6  # the device's clock is this much too fast
RESTART, GAP = 120, 160  # first blocks after a restart and after a gap
LATE = 2_000_000  # ns on top of what is least, at the most; drawn
MIN = 1_000_000  # ns: what every arrival takes


def blocks(seed: int) -> list[Block]:
    """Return 50 s of two devices at 100 Hz, three axes and one; a restart after 5 s of silence, a gap of 100 scans."""
    random = np.random.default_rng(seed)
    made = []
    for k in range(200):
        first = 25 * k + (500 if k >= RESTART else 0) + (100 if k >= GAP else 0)
        last = first + 24
        for name, n_axes in (("beam", 3), ("bar", 1)):
            block = make_block(name, first, n=25, seed=seed)
            made.append(
                Block(
                    **{
                        **vars(block),
                        "rate": 100.0,
                        "arrival_index": last,
                        "counts": np.ascontiguousarray(block.counts[:, :n_axes]),
                        "arrival_time": true_time(last) + MIN + int(random.integers(LATE)),
                        "flags": Flag.RESTARTED if k in {0, RESTART} else Flag.NONE,
                    }
                )
            )
    return made


def true_time(index: int) -> int:
    return START + round(index * 1e7 / (1 + DRIFT))


@pytest.fixture(scope="module", params=[3])
def expanded(tmp_path_factory: pytest.TempPathFactory, request: pytest.FixtureRequest) -> tuple[Path, list[Block]]:
    folder = tmp_path_factory.mktemp("expand")
    written = blocks(request.param)
    writer = McapWriter(folder / "log.mcap", {"site.toml": "x = 1"})
    for block in written:
        writer.write(block)
    writer.close()
    counts = expand_log(folder / "log.mcap", folder / "view.mcap")
    assert counts == {"beam": 5000, "bar": 5000}
    return folder / "view.mcap", written


def test_stock_mcap_reader_finds_all_scans_in_order(expanded: tuple[Path, list[Block]]) -> None:
    path, written = expanded
    for device, values in (("beam", _acceleration), ("bar", _data)):
        with path.open("rb") as file:
            reader = make_reader(file, decoder_factories=[DecoderFactory()])
            found = list(reader.iter_decoded_messages(topics=[f"/view/{device}"], log_time_order=False))
            attached = {a.name: a.data for a in reader.iter_attachments()}
        own = [block for block in written if block.device == device]
        expected = np.concatenate([block.counts * block.scale for block in own])
        np.testing.assert_array_equal([values(m.decoded_message) for m in found], expected)
        times = np.array([m.message.log_time for m in found])
        assert (np.diff(times) > 0).all()
        indices = np.concatenate([np.arange(block.first_index, block.end_index) for block in own])
        late = times - np.array([true_time(int(i)) for i in indices]) - MIN
        # Of the arrivals of a second (4) the earliest is 0.4 ms late in the mean; the envelope takes the least of all.
        # Before 30 s no drift is believed: 50 ppm of 30 s are 1.5 ms.
        assert np.abs(late).max() < LATE
        assert attached == {"site.toml": b"x = 1"}


def _acceleration(message: object) -> list[float]:
    vector = message.linear_acceleration  # type: ignore[attr-defined]
    assert message.header.frame_id == "beam"  # type: ignore[attr-defined]
    assert message.orientation_covariance[0] == message.angular_velocity_covariance[0] == -1.0  # type: ignore[attr-defined]
    return [vector.x, vector.y, vector.z]


def _data(message: object) -> list[float]:
    return list(message.data)  # type: ignore[attr-defined]


def test_rerun_reads_the_expanded_log(expanded: tuple[Path, list[Block]], tmp_path: Path) -> None:
    path, written = expanded
    rerun = Path(sys.executable).with_name("rerun")
    subprocess.run([rerun, "mcap", "convert", path, "-o", tmp_path / "view.rrd"], check=True, capture_output=True)
    found = Rrd(tmp_path / "view.rrd")
    assert found.entities("/view") == {"/view/beam", "/view/bar"}
    times, rows = found.rows("/view/bar", "Scalars:scalars", timeline="message_log_time")
    own: FloatArray = np.concatenate([b.counts for b in written if b.device == "bar"]) * EPSON_SCALE
    np.testing.assert_array_equal(np.array(rows), own)
    assert len(times) == len(own)


def test_log_without_scans_or_existing_output_file_is_refused(tmp_path: Path) -> None:
    McapWriter(tmp_path / "empty.mcap", {}).close()
    with pytest.raises(LogError, match=r"empty\.mcap: holds no scan to expand"):
        expand_log(tmp_path / "empty.mcap", tmp_path / "view.mcap")
    assert not (tmp_path / "view.mcap").exists()
    writer = McapWriter(tmp_path / "log.mcap", {})
    writer.write(make_block("a", 0))
    writer.close()
    with pytest.raises(LogError, match=r"log\.mcap: cannot be written: File exists"):
        expand_log(tmp_path / "log.mcap", tmp_path / "log.mcap")


def shared(clock: str, seed: int = 5) -> list[Block]:
    """Return 40 s of two devices whose indices share one clock, or have their own, in the order of arrival."""
    random = np.random.default_rng(seed)
    found = []
    for first in range(0, 4000, 25):
        for name, length in (("a", 25), ("b", 25)):
            last = first + length - 1
            arrived = true_time(last) + MIN + int(random.integers(LATE)) + (first % 100 == 75) * 40_000_000
            block = make_block(name, first, n=length)
            found.append(replace(block, rate=100.0, arrival_index=last, arrival_time=arrived, clock=clock))
    return found


def times_of(path: Path, device: str) -> IndexArray:
    with path.open("rb") as file:
        messages = make_reader(file).iter_messages(topics=[f"/view/{device}"], log_time_order=False)
        return np.array([message.log_time for _, _, message in messages])


@pytest.mark.parametrize(("clock", "one"), [("SYNC of a bus 1", True), ("", False)])
def test_simultaneous_scans_on_shared_clock_have_equal_times(tmp_path: Path, clock: str, one: bool) -> None:
    expand_log(write_log(tmp_path / "log.mcap", shared(clock)), tmp_path / "view.mcap")
    a, b = (times_of(tmp_path / "view.mcap", device) for device in "ab")
    assert (a == b).all() == one
    assert np.abs(a - b).max() < LATE
    assert (np.diff(a) > 0).all()


def test_recovered_device_is_again_on_the_shared_clock(tmp_path: Path) -> None:
    blocks = [b for b in shared("SYNC of a bus 1") if b.device == "a" or not 1000 <= b.first_index < 2200]
    back = next(k for k, b in enumerate(blocks) if b.device == "b" and b.first_index >= 2200)
    blocks[back] = replace(blocks[back], flags=Flag.RESTARTED)
    expand_log(write_log(tmp_path / "log.mcap", blocks), tmp_path / "view.mcap")
    a, b = (times_of(tmp_path / "view.mcap", device) for device in "ab")
    np.testing.assert_array_equal(b, np.concatenate([a[:1000], a[2200:]]))


def test_known_device_delays_are_subtracted_from_times(tmp_path: Path) -> None:
    log = write_log(tmp_path / "log.mcap", shared("SYNC of a bus 1"))
    expand_log(log, tmp_path / "view.mcap")
    expand_log(log, tmp_path / "known.mcap", {"b": 3.25e-3})
    for device, late in (("a", 0), ("b", 3_250_000)):
        before, after = (times_of(tmp_path / f"{name}.mcap", device) for name in ("view", "known"))
        np.testing.assert_array_equal(before - after, late)
