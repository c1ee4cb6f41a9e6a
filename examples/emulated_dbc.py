"""A CAN sensor that only a DBC file describes, on a bus that loses frames; no hardware is needed.

An emulated SLCAN adapter stands on a pty; the sensor of imu.dbc on its bus sends a counter and an acceleration frame a
scan, of which one in two hundred is lost. What is missing is counted by its counter, to the scan.
"""

import threading
import time
from pathlib import Path

import numpy as np

from daq import Block, DbcAddress, DbcSensor, DeviceReader, Event, IntArray, Item, SystemClock, make_driver
from daq.emulator import EmulatedDbc, EmulatedSlcan

rate, frequency, amplitude, seconds = 400.0, 20.0, 3.0, 1.5
file = Path(__file__).parent / "imu.dbc"
sensor = DbcSensor(file=file, signals=("accX", "accY", "accZ"), counter="Counter", temperature="Temp")


class Shaker:
    """What the sensor measures: z moves as a sine; a count is 2^-8 m/s2, as the file says."""

    def start(self, time: int, rate: float) -> None:
        """Begin: scan k is taken at time + k / rate [ns UTC, Hz]."""
        self.rate = rate

    def read(self, index: int, n: int) -> IntArray:
        """Return scans index .. index + n - 1 as counts (n, 3)."""
        z = amplitude * np.sin(2 * np.pi * frequency * np.arange(index, index + n) / self.rate)
        return np.asarray(np.round(z[:, None] * [0, 0, 256]), np.int32)


clock, stop = SystemClock(), threading.Event()
adapter = EmulatedSlcan([EmulatedDbc(Shaker(), clock, sensor, rate=rate, lost=0.005)])


def serve() -> None:
    """Be the hardware until told to stop."""
    while not stop.wait(0.004):
        adapter.serve()


hardware = threading.Thread(target=serve)
hardware.start()
items: list[Item] = []
address = DbcAddress(interface="slcan", channel=adapter.port, sensor=sensor)
reader = DeviceReader("imu", make_driver("can-dbc", address, rate), rate, clock, items.append)
reader.connect()
reader.start()
time.sleep(seconds)
reader.stop()
reader.join()
stop.set()
hardware.join()
adapter.close()

blocks = [item for item in items if isinstance(item, Block)]
missing = sum(item.payload["missing"] for item in items if isinstance(item, Event) and item.topic == "/event/gap")
scans = sum(block.n_scans for block in blocks)
index = np.concatenate([np.arange(block.first_index, block.end_index) for block in blocks])
z = np.concatenate([block.counts[:, 2] * block.scale for block in blocks])
basis = np.exp(2j * np.pi * frequency * index / rate)  # each scan at its own place, whatever is missing
found = np.linalg.lstsq(np.stack([basis.real, basis.imag], axis=1), z, rcond=None)[0]
print(f"{scans} scans, {missing} missing")
print(f"amplitude {np.hypot(*found):.3f} m/s2, exactly {amplitude:.3f}")
