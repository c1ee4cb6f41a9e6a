"""The assembler beyond alignment: outages, bounds, accuracy of its kernel."""

from collections.abc import Iterator

import numpy as np
import pytest

from daq import Assembler, Block, Channel, Event, Flag, Recording
from daq.timing.interpolation import half_taps, interpolate
from tests.support.daq.blocks import START

CHANNELS = (Channel(name="a_x", device="a", axis=0),)


def blocks(begin: float, seconds: float, *, restarted: bool = False) -> Iterator[Block]:
    """Yield blocks of 0.25 s of a device that starts `begin` after START [s]; counts are indices."""
    first = round(begin * 1000)
    for index in range(first, first + round(seconds * 1000), 250):
        yield Block(
            device="a", rate=1000.0, first_index=index, counts=np.arange(index, index + 250, dtype=np.int32)[:, None],
            scale=1.0, arrival_index=index + 249, arrival_time=START + (index + 249) * 1_000_000, temperature=20.0,
            flags=Flag.RESTARTED if restarted and index == first else Flag.NONE,
        )  # fmt: skip


def lost(seconds: float, device: str = "a") -> Event:
    return Event(topic="/event/device_failed", time=START + round(seconds * 1e9), payload={"device": device})


def windows(target: Assembler, *items: Block | Event) -> list[Recording]:
    pushed = (target.push(item) if isinstance(item, Block) else target.push_event(item) for item in items)
    return [recording for some in pushed for recording in some]


def assembler() -> Assembler:
    return Assembler(CHANNELS, {"a": 1000.0}, window_seconds=4.0, step_seconds=2.0)


def test_long_outage_gives_no_windows() -> None:
    target = assembler()
    found = windows(target, *blocks(0, 12), lost(14), *blocks(36_000, 12, restarted=True))
    begins = np.array([(w.start - START) * 1e-9 for w in found])
    assert np.all((begins < 12) | (begins > 35_996))
    again = begins[begins > 35_000]
    assert again[0] == pytest.approx(36_000 + 0.016, abs=2e-3)  # where the kernel has all it needs
    np.testing.assert_allclose(np.diff(again), 2.0, rtol=0, atol=1e-6)
    assert np.count_nonzero(begins < 12) == 6  # 0 .. 8 s, and that which holds the last 2 s
    assert all(np.isfinite(w.data).any() for w in found)


def test_signal_times_are_correct_before_and_after_outage() -> None:
    for window in windows(assembler(), *blocks(0, 12), lost(14), *blocks(20, 12, restarted=True)):
        time = (window.start - START) * 1e-6 + np.arange(len(window.data))  # ms: what the counts say
        there = np.isfinite(window.data[:, 0])
        np.testing.assert_allclose(window.data[there, 0], time[there], rtol=0, atol=0.01)
        assert [(g.start, g.stop) for g in window.gaps] == runs(~there)


def test_each_record_of_intermittent_logger_gives_a_full_window() -> None:
    begins = (0, 11.25, 30.5, 36.75, 59.0)
    target = Assembler(CHANNELS, {"a": 1000.0}, window_seconds=3.9, step_seconds=3.9)
    items = [block for begin in begins for block in blocks(begin, 4.0)]
    found = windows(target, *items)
    np.testing.assert_allclose([(w.start - START) * 1e-9 for w in found], begins, rtol=0, atol=0.02)
    assert all(np.isfinite(w.data).mean() > 0.99 for w in found)


def runs(mask: np.ndarray[tuple[int], np.dtype[np.bool_]]) -> list[tuple[int, int]]:
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask, [0]]).astype(int)))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]


def test_event_of_unknown_device_is_ignored() -> None:
    target = assembler()
    assert len(windows(target, *blocks(0, 6), lost(6, "stranger"), *blocks(6, 6))) == 4


def test_assembler_buffers_no_more_than_one_window() -> None:
    target = assembler()
    for block in blocks(0, 120):
        list(target.push(block))
        held = [len(r) for device in target._devices.values() for s in device._stretches for r in s.runs]
        assert sum(held) <= 4 * 4 + 3  # a window, and the blocks that its edges cut


@pytest.mark.parametrize("frequency", [3.0, 50.0, 271.0, 350.0, 400.0])
def test_interpolation_error_of_tones_is_below_minus_80_db(frequency: float) -> None:
    random = np.random.default_rng(0)
    signal = np.exp(2j * np.pi * frequency / 1000 * np.arange(4000))
    first, step = 16 + random.uniform(), 1 + random.uniform(-1e-4, 1e-4)
    found = interpolate(np.column_stack([signal.real, signal.imag]), first, step, 3900) @ [1, 1j]
    position = first + step * np.arange(3900)
    assert np.abs(found - np.exp(2j * np.pi * frequency / 1000 * position)).max() < 1e-4


def test_faster_scans_are_low_passed_to_the_grid() -> None:
    step = 1.85
    position = 100 + step * np.arange(2000)
    signal = np.sin(2 * np.pi * np.outer(np.arange(4000), [0.15, 0.2, 0.3, 0.4]))
    found = interpolate(signal, 100, step, 2000, 0.5)
    assert half_taps(0.5) == 32
    np.testing.assert_allclose(found[:, :2], np.sin(2 * np.pi * np.outer(position, [0.15, 0.2])), atol=1e-4)
    assert np.abs(found[:, 2:]).max() < 1e-4
