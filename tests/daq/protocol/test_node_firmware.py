"""The firmware of docs/howto/rig/node.md: compiled, plugged into a pty, and read by the driver."""

import os
import shutil
import subprocess
import tty
from pathlib import Path

import numpy as np
import pytest

from daq import DeviceIdentity, make_driver
from tests.support.daq.node_frames import MAIN, compiled

pytestmark = [
    pytest.mark.live,
    pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler"),
]


def test_driver_reads_node_with_documented_firmware(tmp_path: Path) -> None:
    program = compiled(tmp_path, MAIN)
    master, slave = os.openpty()
    tty.setraw(slave)
    with subprocess.Popen([program], stdin=master, stdout=master) as process:
        driver = make_driver("modalwatch-node", os.ttyname(slave), 800.0)
        try:
            assert driver.open() == DeviceIdentity(
                product="adxl355",
                serial="C0000007",
                details={"axes": [0, 1, 2], "scale": float(np.float32(3.8e-5))},
            )
            reads = [driver.read()]
            while sum(len(scans.counts) for scans in reads) < 800:  # a second's
                reads.append(driver.read())
            driver.close()
        finally:
            process.kill()
            os.close(master)
            os.close(slave)
    counts = np.concatenate([scans.counts for scans in reads])
    counter = np.concatenate([scans.counter for scans in reads])
    k = counter[0] + np.arange(len(counter), dtype=np.int32)
    np.testing.assert_array_equal(counter, k)
    np.testing.assert_array_equal(counts, np.stack([k, -k, 3 * k], axis=1))
    assert sum(scans.bad_bytes for scans in reads) == 0
    assert {scans.temperature for scans in reads if len(scans.counts)} == {21.5}
