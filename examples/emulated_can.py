"""Two accelerometers on a CAN bus, from the wire to a log and back; no hardware is needed.

An emulated SLCAN adapter stands on a pty, two emulated Epson M-A552 on its bus; they are on one shaker, which moves
them by 20 Hz and 0.5 m/s2. The driver finds and configures them (CANopen), reads, and what it reads is logged.
"""

import tempfile
import threading
import time
from contextlib import ExitStack
from pathlib import Path

import numpy as np

from daq import (
    Block,
    CanAddress,
    Channel,
    DeviceReader,
    Event,
    IntArray,
    Item,
    McapWriter,
    SystemClock,
    load_recordings,
    make_driver,
    read_log,
)
from daq.drivers import EPSON_SCALE
from daq.emulator import EmulatedEpsonCan, EmulatedSlcan
from daq.log import CHANNELS, ChannelMap, WriterThread

rate, frequency, amplitude, seconds = 1000.0, 20.0, 0.5, 3.0


class Shaker:
    """What the devices measure: z of a table that moves as a sine of the time of day."""

    def start(self, time: int, rate: float) -> None:
        """Begin: scan k is taken at time + k / rate [ns UTC, Hz]."""
        self.begun, self.rate = 1e-9 * (time % 10**9), rate  # 20 Hz: whole periods a second

    def read(self, index: int, n: int) -> IntArray:
        """Return scans index .. index + n - 1 as counts (n, 3)."""
        t = self.begun + np.arange(index, index + n) / self.rate
        z = amplitude * np.sin(2 * np.pi * frequency * t)
        return np.round(z[:, None] * [0, 0, 1] / EPSON_SCALE).astype(np.int32)


clock = SystemClock()
nodes = [EmulatedEpsonCan(Shaker(), clock, node=k, serial_number=1000 + k) for k in (2, 3)]
adapter, stop = EmulatedSlcan(nodes), threading.Event()


def serve() -> None:
    """Be the hardware until told to stop."""
    while not stop.wait(0.004):
        adapter.serve()


hardware = threading.Thread(target=serve)
hardware.start()
names = {"left": 2, "right": 3}
channels = tuple(Channel(name=f"{name}_z", device=name, axis=2) for name in names)
seen: list[Item] = []
with tempfile.TemporaryDirectory() as folder, ExitStack() as stack:
    path = Path(folder) / "shaker.mcap"
    writer = McapWriter(path, {CHANNELS: ChannelMap(channels=channels, on_grid=False).to_json()})
    with WriterThread(writer, seen.append) as log:
        readers = []
        for name, node in names.items():
            address = CanAddress(interface="slcan", channel=adapter.port, node=node)
            readers.append(DeviceReader(name, make_driver("epson-can", address, rate), rate, clock, log.put))
            readers[-1].connect()
            readers[-1].start()
        time.sleep(seconds)
        for reader in readers:
            reader.stop()
        for reader in readers:
            reader.join()
    stop.set()
    hardware.join()
    adapter.close()
    items = list(read_log(path))
    (recording,) = load_recordings(path)

scans = {name: sum(i.n_scans for i in items if isinstance(i, Block) and i.device == name) for name in names}
gaps = [item.payload for item in items if isinstance(item, Event) and item.topic == "/event/gap"]
rms = np.nanstd(recording.data, axis=0)
line = np.exp(-2j * np.pi * frequency * np.arange(len(recording.data)) / rate) @ recording.data
late = -float(np.angle(line[0] / line[1])) / (2 * np.pi * frequency)
print(f"scans {scans}, gaps {gaps}")
print(f"rms {rms[0]:.4f} and {rms[1]:.4f} m/s2, exactly {amplitude / np.sqrt(2):.4f}")
print(f"left is later than right by {1e3 * late:.2f} ms, from the arrival times")
