"""NI-DAQmx without hardware: a simulated C library below the Python layer of the library."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
from nidaqmx._base_interpreter import BaseInterpreter
from nidaqmx.errors import DaqError

from daq import FloatArray, IndexArray
from daq.drivers import ni_daqmx


@dataclass
class FakeTask:
    """A task of the runtime: its channels, and samples by the clock of the host."""

    channels: dict[str, tuple[Any, ...]] = field(default_factory=dict)
    rate: float = 0.0
    started: float = 0.0
    taken: int = 0


class Runtime(BaseInterpreter):  # type: ignore[misc]  # the library has no types
    """Stand-in for the runtime of a chassis with two modules; the k-th of their inputs reads (n + 1000 k) / 64 m/s2."""

    def __init__(self) -> None:
        self.tasks: dict[int, FakeTask] = {}
        self.coupling: dict[str, int] = {}
        self.unplugged = False
        self.most = 0  # tasks that were started at the same time

    def create_task(self, _: str) -> tuple[int, bool]:
        handle = len(self.tasks) + 1
        self.tasks[handle] = FakeTask()
        return handle, True

    def clear_task(self, handle: int) -> None:
        self.tasks[handle] = FakeTask()

    def start_task(self, handle: int) -> None:
        self.tasks[handle].started = time.monotonic()
        self.most = max(self.most, sum(task.started > 0 for task in self.tasks.values()))

    def create_ai_accel_chan(self, handle: int, name: str, _: str, *settings: Any) -> None:
        if self.unplugged or not name.startswith(("cDAQ1Mod1/ai", "cDAQ1Mod2/ai")):
            raise DaqError("Device identifier is invalid.\nDevice Specified: x", -200220)
        self.tasks[handle].channels[name] = settings

    def set_chan_attribute_int32(self, _: int, name: str, attribute: int, value: int) -> None:
        assert attribute == 0x64  # AI.Coupling
        self.coupling[name] = value

    def cfg_samp_clk_timing(self, handle: int, rate: float, *_: Any) -> None:
        self.tasks[handle].rate = 51200 / round(51200 / rate)  # as a delta-sigma module has them

    def get_timing_attribute_double(self, handle: int, attribute: int) -> float:
        assert attribute == 0x1344  # SampClk.Rate
        return self.tasks[handle].rate

    def get_read_attribute_uint32(self, handle: int, attribute: int) -> int:
        if attribute == 0x217B:  # NumChans
            return len(self.tasks[handle].channels)
        assert attribute == 0x1223  # AvailSampPerChan
        if self.unplugged:
            raise DaqError("The device was removed.", -200710)
        task = self.tasks[handle]
        return int((time.monotonic() - task.started) * task.rate) - task.taken

    def get_task_attribute_uint32(self, handle: int, _: int) -> int:
        return len(self.tasks[handle].channels)

    def get_task_attribute_string(self, handle: int, _: int) -> str:
        return ", ".join(self.tasks[handle].channels)

    def get_read_attribute_string(self, handle: int, _: int) -> str:
        return ", ".join(self.tasks[handle].channels)

    def read_analog_f64(self, handle: int, n: int, _: float, __: int, data: Any) -> tuple[Any, int]:
        task = self.tasks[handle]
        inputs = [3 * int(name[8]) - 3 + int(name[-1]) for name in task.channels]
        data[:] = self.signal(task.taken + np.arange(n), np.array(inputs)[:, None])
        task.taken += n
        return data, n

    def signal(self, number: IndexArray, channel: IndexArray) -> FloatArray:
        """Return samples [m/s2] by their numbers (n,) and those of inputs (k, 1)."""
        return np.asarray((number + 1000 * channel) / 64)

    def get_device_attribute_string(self, name: str, attribute: int) -> str:
        if attribute == 0x29B7:  # CompactDAQ.ChassisDevName
            return "cDAQ1"
        return {0x0631: "NI 9234", 0x231E: f"{name}/ai0, {name}/ai1, {name}/ai2, {name}/ai3"}[attribute]

    def get_device_attribute_uint32(self, _: str, __: int) -> int:
        return 0x1A2B3C

    def get_system_info_attribute_string(self, _: int) -> str:
        return "cDAQ1Mod1, cDAQ1Mod2"


Runtime.__abstractmethods__ = frozenset()  # the other 370 functions are not called


class Ramp(Runtime):
    """The n-th sample of the inputs is n, -n and 3 n times a scale [m/s2]."""

    def __init__(self, scale: float) -> None:
        super().__init__()
        self._scale = scale

    def signal(self, number: IndexArray, channel: IndexArray) -> FloatArray:
        return np.asarray(self._scale * number * np.array([1, -1, 3])[channel])


@contextmanager
def installed(runtime: Runtime) -> Iterator[Runtime]:
    """Let the library call a simulated one; the tasks of the process are forgotten before and after."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("nidaqmx.utils._select_interpreter", lambda *_, **__: runtime)
        patch.setattr(ni_daqmx, "_TASKS", {})
        yield runtime
