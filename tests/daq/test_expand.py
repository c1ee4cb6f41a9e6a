"""A log for stock viewers: every scan at its own time, none made up, read by the tools of others."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from daq_helpers import START, make_block
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rrd_helpers import Rrd

from daq import EPSON_SCALE, Block, Flag, FloatArray, LogError, LogWriter, expand_log

DRIFT = 50e-6  # the device's clock is this much too fast
RESTART, GAP = 120, 160  # first blocks after a restart and after a gap
LATE = 2_000_000  # ns on top of what is least, at the most; drawn
LEAST = 1_000_000  # ns: what every arrival takes


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
                        "pair_index": last,
                        "counts": np.ascontiguousarray(block.counts[:, :n_axes]),
                        "pair_time": true_time(last) + LEAST + int(random.integers(LATE)),
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
    writer = LogWriter(folder / "log.mcap", {"site.toml": "x = 1"})
    for block in written:
        writer.write(block)
    writer.close()
    counts = expand_log(folder / "log.mcap", folder / "view.mcap")
    assert counts == {"beam": 5000, "bar": 5000}
    return folder / "view.mcap", written


def test_a_stock_reader_finds_every_scan_in_order_and_no_other(expanded: tuple[Path, list[Block]]) -> None:
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
        late = times - np.array([true_time(int(i)) for i in indices]) - LEAST
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


def test_rerun_plots_it(expanded: tuple[Path, list[Block]], tmp_path: Path) -> None:
    path, written = expanded
    rerun = Path(sys.executable).with_name("rerun")
    subprocess.run([rerun, "mcap", "convert", path, "-o", tmp_path / "view.rrd"], check=True, capture_output=True)
    found = Rrd(tmp_path / "view.rrd")
    assert found.entities("/view") == {"/view/beam", "/view/bar"}
    times, rows = found.rows("/view/bar", "Scalars:scalars", timeline="message_log_time")
    own: FloatArray = np.concatenate([b.counts for b in written if b.device == "bar"]) * EPSON_SCALE
    np.testing.assert_array_equal(np.array(rows), own)
    assert len(times) == len(own)


def test_a_log_without_a_scan_and_an_existing_file_are_refused(tmp_path: Path) -> None:
    LogWriter(tmp_path / "empty.mcap", {}).close()
    with pytest.raises(LogError, match=r"empty\.mcap: holds no scan to expand"):
        expand_log(tmp_path / "empty.mcap", tmp_path / "view.mcap")
    assert not (tmp_path / "view.mcap").exists()
    writer = LogWriter(tmp_path / "log.mcap", {})
    writer.write(make_block("a", 0))
    writer.close()
    with pytest.raises(LogError, match=r"log\.mcap: cannot be written: File exists"):
        expand_log(tmp_path / "log.mcap", tmp_path / "log.mcap")
