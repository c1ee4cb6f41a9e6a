"""The firmware of examples/node: compiled, plugged into a pty, and read by the driver."""

import os
import shutil
import subprocess
import tty
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from daq import DeviceIdentity, FloatArray, IntArray, Scans, make_driver
from tests.support.daq.arduino_programs import compiled_program
from tests.support.daq.node_frames import MAIN, NODE, compiled

pytestmark = [
    pytest.mark.live,
    pytest.mark.skipif(not (shutil.which("cc") and shutil.which("g++")), reason="no C compiler"),
]
ALL = {"axes": [0, 1, 2]}
HELD = "-DNEVER_HELD_UP"  # a board has its processor for itself


@contextmanager
def plugged(program: Path) -> Iterator[str]:
    """Give the port of a program."""
    master, slave = os.openpty()
    tty.setraw(slave)
    with subprocess.Popen([program], stdin=master, stdout=master) as process:
        try:
            yield os.ttyname(slave)
        finally:
            process.kill()
            os.close(master)
            os.close(slave)


def read_node(program: Path, rate: float, n: int) -> tuple[DeviceIdentity, IntArray, FloatArray, list[Scans]]:
    """Return identity, counts (n, 3) and counters (n,) of a node, and the reads."""
    with plugged(program) as port:
        driver = make_driver("modalwatch-node", port, rate)
        identity = driver.open()
        reads = [driver.read()]
        while sum(len(scans.counts) for scans in reads) < n:
            reads.append(driver.read())
        driver.close()
    counts = np.concatenate([scans.counts for scans in reads])
    counter = np.concatenate([scans.counter for scans in reads]).astype(float)
    np.testing.assert_array_equal(counter, counter[0] + np.arange(len(counter)))
    assert sum(scans.bad_bytes for scans in reads) == 0
    return identity, counts, counter, reads


@pytest.mark.parametrize("kind", ["wire format", "adxl355"])
def test_driver_reads_a_node_that_sends_a_ramp(kind: str, tmp_path: Path) -> None:
    if kind == "adxl355":
        program, rate = compiled_program(NODE / "src" / "main.cpp", tmp_path, "-DSENSOR_ADXL355", HELD), 1000.0
        serial, scale, celsius = "N0000001", 9.80665 / 256_000, 25.0
    else:
        program, rate = compiled(tmp_path, MAIN), 800.0
        serial, scale, celsius = "C0000007", 3.8e-5, 21.5
    identity, counts, counter, reads = read_node(program, rate, 800)
    details = ALL | {"scale": float(np.float32(scale))}
    assert identity == DeviceIdentity(product="adxl355", serial=serial, details=details)
    k = counter.astype(np.int32)
    np.testing.assert_array_equal(counts, np.stack([k, -k, 3 * k], axis=1))
    assert {scans.temperature for scans in reads if len(scans.counts)} == {celsius}


def sinc(frequency: float) -> float:
    """Return the gain of the third-order sinc filter at a frequency [Hz]."""
    x = np.pi * frequency / 26_667
    return float(abs(np.sin(32 * x) / (32 * np.sin(x))) ** 3)


def test_wide_band_node_averages_without_aliasing(tmp_path: Path) -> None:
    """Offsets remain, 100 Hz is as the filter leaves it, and 900 Hz, which would appear at 67 Hz, is suppressed."""
    program = compiled_program(NODE / "src" / "main.cpp", tmp_path, "-DSENSOR_IIS3DWB", HELD)
    rate = 26_667 / 32
    identity, counts, _, _ = read_node(program, round(rate, 3), 700)
    assert identity.product == "iis3dwb"
    x, y, z = counts.T[:, 10:] / 32_768  # of the sensor; the filter has settled
    angle = 2 * np.pi * 100 / rate * np.arange(len(x))
    basis = np.stack([np.ones(len(x)), np.sin(angle), np.cos(angle)], axis=1)
    (offset, *waves), *_ = np.linalg.lstsq(basis, x)
    # rounding of the sensor: half a count, of which the average over more than 32 samples leaves less than 0.2
    assert offset == pytest.approx(1000, abs=0.2)
    assert np.hypot(*waves) == pytest.approx(500 * sinc(100), abs=0.2)
    assert sinc(100) == pytest.approx(0.93, abs=0.005)  # as documented
    assert sinc(200) == pytest.approx(0.75, abs=0.01)
    np.testing.assert_array_equal(y, -1000)
    assert np.abs(z).max() < 500 * sinc(900) + 0.5
