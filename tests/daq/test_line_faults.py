"""Serial devices on poor lines: babble, wrong and lost bytes, an adapter that hands on every 16 ms."""

import numpy as np
import pytest
from can_helpers import serving
from emulated_ports import Ramp

from daq import EmulatedEpson, EmulatedNode, LineFaults, SystemClock, make_driver
from daq.emulator.line_faults import FaultyLine
from daq.emulator.serial_port import SerialEmulator

RATE = 1000.0
POOR = LineFaults(flipped=2e-3, lost=1e-3, babble=500, latency=0.016, seed=3)


def poor(name: str) -> SerialEmulator:
    """Return the device of a driver, on a line that harms one frame in fourteen."""
    if name == "epson-uart":
        return EmulatedEpson(Ramp(), SystemClock(), serial_number="E", faults=POOR)
    return EmulatedNode(Ramp(), SystemClock(), serial_number="E", faults=POOR)


@pytest.mark.live
@pytest.mark.parametrize("name", ["epson-uart", "modalwatch-node"])
def test_poor_line_costs_the_frames_it_harms_and_nothing_false_is_read(name: str) -> None:
    device = poor(name)
    with serving(device.serve):
        driver = make_driver(name, device.port, RATE)
        driver.open()
        reads = [driver.read()]
        while sum(len(scans.counts) for scans in reads) < 400:
            reads.append(driver.read())
        harmed = device.line.harmed
        driver.close()
    device.close()
    counts = np.concatenate([scans.counts for scans in reads])
    counter = np.concatenate([scans.counter for scans in reads])
    k = counts[:, 0]
    np.testing.assert_array_equal(counts, np.stack([k, -k, 3 * k], axis=1))
    np.testing.assert_array_equal(np.diff(counter), np.diff(k))
    missing = int(k[-1] - k[0]) + 1 - len(k)
    assert 0 < missing <= 2 * harmed  # a lost end of a frame takes the next one with it
    assert sum(scans.bad_bytes for scans in reads) > 20 * missing
    # Handed on every 16 ms, not byte by byte: reads bring many scans, unless the machine was held up.
    assert np.median([len(scans.counts) for scans in reads if len(scans.counts)]) >= 10


def test_as_many_bytes_are_harmed_as_are_said() -> None:
    line, n = FaultyLine(LineFaults(flipped=0.01, lost=0.02, seed=1)), 100_000
    arrived = line.carried(bytes(n))
    # five deviations of binomial counts: 0.02 n, and 0.01 n of those that arrive
    assert n - len(arrived) == pytest.approx(2000, abs=5 * 45)
    assert len(arrived) - arrived.count(0) == pytest.approx(980, abs=5 * 32)
    assert line.harmed == pytest.approx(2980, abs=5 * 55)


@pytest.mark.parametrize("wrong", [{"flipped": -0.1}, {"lost": 1.5}, {"babble": -1}, {"latency": -1.0}])
def test_faults_that_cannot_be_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=f"{next(iter(wrong))}.*: expected "):
        LineFaults(**wrong)  # type: ignore[arg-type]
