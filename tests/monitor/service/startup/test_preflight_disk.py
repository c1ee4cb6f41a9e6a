"""Prediction of disk usage by `check`."""

from pathlib import Path

import numpy as np
import pytest

from daq import Block, McapWriter
from daq.drivers import EPSON_SCALE
from monitor.service.startup.preflight import BYTES_A_SCAN, disk_plan
from monitor.settings import parse_settings

SITE = """structure = "s.toml"
[[device]]
name = "a"
driver = "epson-uart"
port = "/dev/a"
channels = {x = "a_x"}
[[device]]
name = "b"
driver = "epson-uart"
port = "/dev/b"
rate = 500
channels = {x = "b_x"}
[recorder]
"""
DAY = "0.57 to 1.2 GB per day; "  # 1500 scans/s, 86400 s, 4.4 to 9.2 bytes


@pytest.mark.parametrize(
    ("recorder", "free", "says"),
    [
        ("", 101e9, "room for 84 to 175 days, then the oldest files are deleted"),
        ("min_free_gb = 0", 100e9, "room for 84 to 175 days, then the disk is full"),
        ("min_free_gb = 0\nkeep_gb = 10", 100e9, "room for 8.4 to 18 days, then the oldest files are deleted"),
        ("keep_gb = 500", 11e9, "room for 8.4 to 18 days, then the oldest files are deleted"),
        ("keep_days = 30", 101e9, "the last 30 days are kept"),
        ("keep_days = 300", 101e9, "room for 84 to 175 days, then the oldest files are deleted"),
        ("min_free_gb = 2", 1e9, "less than recorder.min_free_gb = 2 is free now"),
    ],
)
def test_plan_states_the_recording_time_until_the_disk_limit(recorder: str, free: float, says: str) -> None:
    assert disk_plan(parse_settings(SITE + recorder), free) == DAY + says


@pytest.mark.parametrize(("rms", "most"), [(0.0, BYTES_A_SCAN[0]), (10e-3 * 9.80665 / EPSON_SCALE, BYTES_A_SCAN[1])])
def test_log_size_agrees_with_the_plan(tmp_path: Path, rms: float, most: float) -> None:
    """White motion over a sensor's own noise (72 counts), five seconds of two devices."""
    random = np.random.default_rng(1)
    writer = McapWriter(tmp_path / "log.mcap", {})
    for k in range(25):
        for name in ("a", "b"):
            counts = np.rint(random.normal(0, np.hypot(72, rms), (200, 3))).astype(np.int32)
            writer.write(
                Block(
                    device=name,
                    rate=1000.0,
                    first_index=200 * k,
                    counts=counts,
                    scale=EPSON_SCALE,
                    arrival_index=200 * k,
                    arrival_time=200_000_000 * k,
                    temperature=21.0,
                )
            )
        writer.flush()
    writer.close()
    size = (tmp_path / "log.mcap").stat().st_size / (25 * 200 * 2)
    assert 0.85 * most < size < 1.15 * most  # half as many devices share a chunk, and the file's ends weigh more
