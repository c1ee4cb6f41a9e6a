"""Programs of microcontrollers in examples/: run on this machine, plugged into a pty, and read by the driver."""

import os
import shutil
import signal
import subprocess
import sys
import time
import tty
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from daq import DeviceIdentity, make_driver
from daq.drivers import LineFormat, TextAddress
from tests.support.daq.arduino_programs import compiled_program

pytestmark = pytest.mark.live

ROOT = Path(__file__).parents[4]
SUPPORT = ROOT / "tests" / "support" / "daq"
SKETCH = ROOT / "examples" / "arduino" / "adxl355_text" / "adxl355_text.ino"
MICROPYTHON = ROOT / "examples" / "micropython" / "adxl355_text.py"
#: as the programs state it
FORM = LineFormat(columns=("counter", "x", "y", "z"), scale=3.83072e-5)
RATE = 125.0


def read_program(command: Sequence[str | Path]) -> None:
    """Read what a program sends: scan k is (k, -k, 3 k), none is missing; then keep it from reading its sensor."""
    master, slave = os.openpty()
    tty.setraw(slave)
    with subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=master) as process:
        driver = make_driver("serial-text", TextAddress(port=os.ttyname(slave), form=FORM), RATE)
        try:
            assert driver.open() == DeviceIdentity(product="text lines", details={"columns": "counter x y z"})
            reads = [driver.read()]
            while sum(len(scans.counts) for scans in reads) < RATE / 2:
                reads.append(driver.read())
            process.send_signal(signal.SIGSTOP)
            time.sleep(0.6)  # of which its memory holds 0.26 s
            process.send_signal(signal.SIGCONT)
            after, end = [driver.read()], time.monotonic() + 1.5
            while time.monotonic() < end:
                after.append(driver.read())
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
    k = np.concatenate([scans.counts[:, 0] for scans in after])
    assert k[-1] - counter[-1] - len(k) > 0.2 * RATE  # lost
    # It counts what it lost by its clock: to a scan at either end of the pause; a busy machine may add pauses.
    assert np.abs(np.concatenate([scans.counter for scans in after]) - k).max() <= 8


def test_documented_scale_is_that_of_the_data_sheet() -> None:
    """3.9 ug per count: 256 000 counts per g."""
    assert FORM.scale == pytest.approx(9.80665 / 256_000, rel=1e-5)
    for program in (SKETCH, MICROPYTHON):
        assert f"scale = {FORM.scale:.5e}".replace("e-05", "e-5") in program.read_text(encoding="utf-8")


@pytest.mark.skipif(shutil.which("g++") is None, reason="no C++ compiler")
def test_driver_reads_the_arduino_sketch(tmp_path: Path) -> None:
    read_program([compiled_program(SKETCH, tmp_path)])


def test_driver_reads_the_micropython_program() -> None:
    """By CPython with a stand-in for the modules of the board."""
    read_program([sys.executable, SUPPORT / "micropython_board.py", MICROPYTHON])
