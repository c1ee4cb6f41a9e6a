"""A recorded log as recordings: devices with clocks of their own, outages, ends that do not meet."""

from pathlib import Path

import numpy as np
import pytest

from daq import (
    Assembler,
    Block,
    Channel,
    Event,
    Flag,
    FloatArray,
    Item,
    LogError,
    McapWriter,
    Recording,
    load_recordings,
    read_log,
    write_recording,
)
from tests.support.daq.blocks import START

CHANNELS = (Channel(name="a_x", device="a", axis=0), Channel(name="b_y", device="b", axis=1))
RATE, SCALE = 200.0, 1e-6  # Hz; m/s2 per count
TONE = 11.0  # Hz, of 1 m/s2
KERNEL = 1e-4  # of the amplitude, -80 dB


def motion(seconds: FloatArray) -> FloatArray:
    return np.asarray(np.sin(2 * np.pi * TONE * seconds))


def blocks(
    device: str, begin: float, end: float, *, ppm: float = 0.0, origin: float = 0.0, restarted: bool = False
) -> list[Block]:
    """Return the data of a device from `begin` to `end` [s after START], in blocks of half a second.

    Its scan k is at `origin` + k / (rate (1 + ppm)); blocks arrive promptly.
    """
    found: list[Block] = []
    rate = RATE * (1 + ppm * 1e-6)
    for first in range(round((begin - origin) * RATE), round((end - origin) * RATE), 100):
        taken = origin + np.arange(first, first + 100) / rate
        counts = np.rint(motion(taken) / SCALE).astype(np.int32)
        found.append(
            Block(
                device=device,
                rate=RATE,
                first_index=first,
                counts=np.stack([counts, counts, counts], axis=1),
                scale=SCALE,
                arrival_index=first + 99,
                arrival_time=START + round(float(taken[-1]) * 1e9),
                temperature=20.0,
                flags=Flag.RESTARTED if restarted and not found else Flag.NONE,
            )
        )
    return found


def written(path: Path, *items: Item) -> Path:
    """Write items in the order of their times."""
    writer = McapWriter(path, {})
    for item in sorted(items, key=lambda i: i.arrival_time if isinstance(i, Block) else i.time):
        writer.write(item)
    writer.close()
    return path


def seconds(recording: Recording) -> FloatArray:
    """Return the times of the samples [s after START]."""
    return np.asarray((recording.start - START) * 1e-9 + np.arange(len(recording.data)) / recording.rate)


def errors(recording: Recording) -> FloatArray:
    """Return how far each sample is off the motion [m/s2], NaN in gaps."""
    return np.asarray(np.abs(recording.data - motion(seconds(recording))[:, None]))


@pytest.fixture
def two(tmp_path: Path) -> Path:
    a = blocks("a", 0, 200, ppm=50.0)
    return written(tmp_path / "log.mcap", *a, *blocks("b", 0.7, 198.2, ppm=-80.0, origin=0.2137))


def test_whole_log_is_resampled_to_one_grid_within_kernel_error(two: Path) -> None:
    (found,) = load_recordings(two, channels=CHANNELS)
    time = seconds(found)
    assert (time[0], time[-1]) == (pytest.approx(0.8, abs=0.2), pytest.approx(198.1, abs=0.2))
    # a drift is believed from 30 s on; what it costs the first piece of a minute: 80 ppm of 30 s at most at its start
    settled = errors(found)[60 * 200 :]
    assert np.nanmax(settled) < 1.5 * KERNEL
    assert np.isfinite(found.data).all()
    assert found.temperature == pytest.approx(20.0)


def test_windows_equal_those_of_the_assembler(two: Path) -> None:
    target = Assembler(CHANNELS, {"a": RATE, "b": RATE}, window_seconds=12.5, step_seconds=12.5)
    expected = [window for item in read_log(two) if isinstance(item, Block) for window in target.push(item)]
    found = list(load_recordings(two, window_seconds=12.5, channels=CHANNELS))
    assert len(found) == len(expected) == 15
    for one, other in zip(found, expected, strict=True):
        assert one.start == other.start
        np.testing.assert_array_equal(one.data, other.data)


def test_temporary_device_loss_leaves_a_gap(tmp_path: Path) -> None:
    lost = Event(topic="/event/device_failed", time=START + 91 * 10**9, payload={"device": "b"})
    back = blocks("b", 120.5, 180, restarted=True)
    path = written(tmp_path / "log.mcap", *blocks("a", 0, 180), *blocks("b", 0, 90), lost, *back)
    (found,) = load_recordings(path, channels=CHANNELS)
    (gap,) = found.gaps
    assert gap.device == "b"
    assert seconds(found)[[gap.start, gap.stop]] == pytest.approx([90.0, 120.5], abs=0.1)  # 16 scans each
    assert np.isfinite(found.data[:, 0]).all()
    assert np.nanmax(errors(found)) < 1.5 * KERNEL
    assert found.duration == pytest.approx(180, abs=0.3)


def test_log_with_long_outage_can_only_be_read_in_windows(tmp_path: Path) -> None:
    lost = Event(topic="/event/device_failed", time=START + 31 * 10**9, payload={"device": "a"})
    path = written(tmp_path / "log.mcap", *blocks("a", 0, 30), lost, *blocks("a", 7200, 7230, restarted=True))
    with pytest.raises(LogError, match=r"log\.mcap: is \d+ times as long as what it holds: give a window"):
        list(load_recordings(path, channels=CHANNELS[:1]))
    windows = list(load_recordings(path, window_seconds=10.0, channels=CHANNELS[:1]))
    assert 5 <= len(windows) <= 8


def test_permanent_device_loss_does_not_end_the_recording(tmp_path: Path) -> None:
    lost = Event(topic="/event/device_failed", time=START + 41 * 10**9, payload={"device": "b"})
    path = written(tmp_path / "log.mcap", *blocks("a", 0, 100), *blocks("b", 0, 40), lost)
    (found,) = load_recordings(path, channels=CHANNELS)
    assert found.duration == pytest.approx(100, abs=0.3)
    assert np.isfinite(found.data[:, 0]).all()
    assert np.isnan(found.data[round(41 * RATE) :, 1]).all()


def test_channel_of_silent_device_has_no_samples(tmp_path: Path) -> None:
    path = written(tmp_path / "log.mcap", *blocks("a", 0, 20))
    (found,) = load_recordings(path, channels=CHANNELS)
    assert np.isnan(found.data[:, 1]).all()
    assert found.duration == pytest.approx(20, abs=0.3)
    assert np.nanmax(errors(found)) < 1.5 * KERNEL


def test_log_shorter_than_window_gives_one_shorter_window(tmp_path: Path) -> None:
    path = written(tmp_path / "log.mcap", *blocks("a", 0, 7), *blocks("b", 0, 7))
    (found,) = load_recordings(path, window_seconds=600.0, channels=CHANNELS)
    assert found.duration == pytest.approx(7, abs=0.3)
    assert np.isfinite(found.data).all()


def test_log_of_one_second_is_a_recording(tmp_path: Path) -> None:
    path = written(tmp_path / "log.mcap", *blocks("a", 0, 1), *blocks("b", 0, 1))
    (found,) = load_recordings(path, channels=CHANNELS)
    assert 0.5 < found.duration < 1.0


def imported(path: Path, names: str, start: int) -> Path:
    """Write a log of 10 s with a channel map."""
    channels = tuple(Channel(name=name, device="d", axis=axis) for axis, name in enumerate(names))
    data = np.random.default_rng(start).standard_normal((1000, len(names)))
    write_recording(path, Recording(channels=channels, data=data, rate=100.0, start=START + start * 10**9))
    return path


def test_several_logs_and_folders_are_read_one_after_the_other(tmp_path: Path) -> None:
    (tmp_path / "folder").mkdir()
    first, second = (
        imported(tmp_path / "folder" / "1.mcap", "ab", 0),
        imported(tmp_path / "folder" / "2.mcap", "ab", 60),
    )
    third = imported(tmp_path / "3.mcap", "ab", 120)
    expected = [START, START + 60 * 10**9, START + 120 * 10**9]
    for logs in ([first, second, third], [tmp_path / "folder", third], [str(tmp_path / "folder"), str(third)]):
        assert [found.start for found in load_recordings(logs)] == expected
    assert [found.start for found in load_recordings(str(tmp_path / "folder"))] == expected[:2]
    assert len(list(load_recordings(tmp_path / "folder", window_seconds=5.0))) == 4


def test_logs_with_different_channels_are_refused(tmp_path: Path) -> None:
    first, other = imported(tmp_path / "1.mcap", "ab", 0), imported(tmp_path / "2.mcap", "ac", 60)
    with pytest.raises(LogError, match=r"2\.mcap: expected the same channels in all logs, found others: b, c"):
        list(load_recordings([first, other]))
    (tmp_path / "empty").mkdir()
    with pytest.raises(LogError, match="holds no log"):
        list(load_recordings(tmp_path / "empty"))
