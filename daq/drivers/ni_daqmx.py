"""Analog inputs of National Instruments (NI-DAQmx), with the current of IEPE accelerometers.

Inputs of one chassis, or of one device, are read by one task: NI-DAQmx allows no second one. Its devices sample at the
same instants, and their scans have common numbers. A device that is opened later, or is lost, restarts the task.
"""

import time
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from importlib import import_module
from threading import Lock
from typing import Any

import numpy as np

from daq.drivers.base import DaqmxAddress, Scans, positive_rate
from daq.errors import DeviceLost, DriverError
from daq.types import DeviceIdentity, FloatArray

_GRAVITY = 9.80665  # m/s2 per g
_STEPS = 1 << 24  # per range: converters have 24 bits from -range to range
_RATE_TOLERANCE = 1e-5  # relative
_BUFFER_SECONDS = 10.0
_WAIT_SECONDS = 0.05  # of samples that one transfer has at least
_MOST_WAITING = 1000  # transfers of a device that nobody reads: the oldest are lost then, which its counter shows
_TIMEOUT_SECONDS = 1.0  # of samples that are in the buffer already


class NiDaqmx:
    """Driver of up to three inputs.

    Parameters
    ----------
    place : inputs with their sensors
    rate : scans per second [Hz], as the device has it

    Raises
    ------
    ValueError
        If the rate is not positive.
    """

    modulus = 1 << 31

    def __init__(self, place: DaqmxAddress, rate: float) -> None:
        self._place, self._rate = place, positive_rate(rate, str(place))
        self.scale = place.range_g * _GRAVITY / _STEPS
        self._task: _SharedTask | None = None
        self._member: _Member | None = None

    def open(self) -> DeviceIdentity:
        """Add the inputs to the task of their chassis."""
        self.close()
        with _errors(self._place, DriverError):
            device: Any = import_module("nidaqmx.system").Device(self._place.inputs[0].partition("/")[0])
            group = _group(device)
            serial = int(device.serial_num)
            identity = DeviceIdentity(product=str(device.product_type), serial=f"{serial:X}" if serial else "")
        task, member = _TASKS.setdefault(group, _SharedTask(group)), _Member(self._place)
        task.join(member, self._rate)
        self._task, self._member = task, member
        return identity

    def read(self) -> Scans:
        """Return the samples of one transfer, or none after a short wait."""
        if self._task is None or self._member is None:
            raise DeviceLost(str(self._place), "is not open")
        found = self._task.read(self._member)
        if found is None:
            time.sleep(_WAIT_SECONDS)
            found = _Chunk(first=0, data=np.empty((0, len(self._place.inputs))), time=0, clock="")
        return Scans(
            counts=np.round(found.data / self.scale).astype(np.int32),
            counter=np.arange(found.first, found.first + len(found.data), dtype=np.intp),
            temperature=float("nan"),
            bad_bytes=0,
            age=time.monotonic_ns() - found.time if len(found.data) else 0,
            clock=found.clock,
        )

    def close(self) -> None:
        """Take the inputs out of the task."""
        task, member = self._task, self._member
        self._task = self._member = None
        if task and member:
            task.leave(member)


@dataclass(frozen=True, eq=False, kw_only=True)
class _Chunk:
    """Samples of one transfer."""

    first: int  #: number of the first scan
    data: FloatArray  #: (n, n_axes) [m/s2]
    time: int  #: when it was read, of the monotonic clock [ns]
    clock: str


@dataclass(eq=False)
class _Member:
    """A device of a task, and its samples that were not taken yet."""

    place: DaqmxAddress
    waiting: deque[_Chunk] = field(default_factory=lambda: deque(maxlen=_MOST_WAITING))


class _SharedTask:
    """Task of all open devices of a chassis during the life of the process.

    Numbers of scans continue by the clock of the host when the task restarts; `clock` has another name then.

    Parameters
    ----------
    name : of the chassis or device
    """

    def __init__(self, name: str) -> None:
        self._name, self._lock = name, Lock()
        self._members: list[_Member] = []
        self._task: Any = None  # of nidaqmx, started
        self._rate = 0.0
        self._starts = 0
        self._number, self._last = 0, 0.0  # next scan; when the last samples were read [s of the monotonic clock]

    def join(self, member: _Member, rate: float) -> None:
        """Add a device; the inputs are checked before the task of the others is stopped.

        Raises
        ------
        DriverError
            If the inputs cannot be read in this way, one is another device's, or the rate is not that of the others.
        """
        with self._lock:
            taken = [name for other in self._members for name in other.place.inputs if name in member.place.inputs]
            if taken:
                raise DriverError(str(member.place), f"{taken[0]} is in use by another device")
            if self._members and rate != self._rate:
                message = f"rate: expected {self._rate:g} Hz, as the other devices of {self._name}, found {rate:g}"
                raise DriverError(str(member.place), message)
            with _errors(member.place, DriverError):
                trial = _task([member], rate)
                try:
                    actual = float(trial.timing.samp_clk_rate)
                finally:
                    trial.close()
            if abs(actual / rate - 1) > _RATE_TOLERANCE:
                message = f"rate: expected {actual:.10g} Hz, the nearest one of the device, found {rate:.10g}"
                raise DriverError(str(member.place), message)
            self._stop()
            self._rate = rate
            self._members.append(member)

    def leave(self, member: _Member) -> None:
        """Remove a device; the task restarts without it."""
        with self._lock:
            self._members.remove(member)
            self._stop()

    def read(self, member: _Member) -> _Chunk | None:
        """Return the next samples of a device; None if there are none yet.

        Raises
        ------
        DeviceLost
            If the task cannot be started, or has failed.
        """
        with self._lock:
            if not member.waiting:
                try:
                    with _errors(member.place, DeviceLost):
                        self._fetch()
                except BaseException:
                    self._stop()
                    raise
            return member.waiting.popleft() if member.waiting else None

    def _fetch(self) -> None:
        """Read the samples in the buffer, if they are some, and hand each device its own."""
        if self._task is None:
            self._start()
        n = min(int(self._task.in_stream.avail_samp_per_chan), round(self._rate) + 1)
        if n < max(1, round(_WAIT_SECONDS * self._rate)):
            return
        inputs = [name for member in self._members for name in member.place.inputs]
        data = np.empty((len(inputs), n))
        readers = import_module("nidaqmx.stream_readers")
        readers.AnalogMultiChannelReader(self._task.in_stream).read_many_sample(data, n, _TIMEOUT_SECONDS)
        now, clock = time.monotonic_ns(), f"{self._name} {self._starts}"
        column = 0
        for member in self._members:
            own = data[column : column + len(member.place.inputs)].T
            column += len(member.place.inputs)
            member.waiting.append(_Chunk(first=self._number, data=own, time=now, clock=clock))
        self._number += n
        self._last = 1e-9 * now

    def _start(self) -> None:
        task = _task(self._members, self._rate)
        try:
            task.start()
        except BaseException:
            task.close()
            raise
        if self._starts:
            self._number += max(1, round((time.monotonic() - self._last) * self._rate))
        self._task, self._starts, self._last = task, self._starts + 1, time.monotonic()

    def _stop(self) -> None:
        task, self._task = self._task, None
        if task is not None:
            with _suppressed():
                task.close()


_TASKS: dict[str, _SharedTask] = {}  # by chassis: a reload continues the numbers


def _task(members: list[_Member], rate: float) -> Any:  # noqa: ANN401 - a task of nidaqmx, which has no types
    """Return a task of the inputs of devices that is not started."""
    nidaqmx, constants = import_module("nidaqmx"), import_module("nidaqmx.constants")
    task = nidaqmx.Task()
    try:
        for member in members:
            _add_inputs(task, member.place, constants)
        task.timing.cfg_samp_clk_timing(
            rate,
            sample_mode=constants.AcquisitionType.CONTINUOUS,
            samps_per_chan=max(1000, round(_BUFFER_SECONDS * rate)),
        )
    except BaseException:
        task.close()
        raise
    return task


def _add_inputs(task: Any, place: DaqmxAddress, constants: Any) -> None:  # noqa: ANN401
    source = constants.ExcitationSource
    for name, sensitivity in zip(place.inputs, place.sensitivity, strict=True):
        channel = task.ai_channels.add_ai_accel_chan(
            name,
            min_val=-place.range_g * _GRAVITY,
            max_val=place.range_g * _GRAVITY,
            units=constants.AccelUnits.METERS_PER_SECOND_SQUARED,
            sensitivity=sensitivity,
            sensitivity_units=constants.AccelSensitivityUnits.MILLIVOLTS_PER_G,
            current_excit_source=source.INTERNAL if place.excitation else source.NONE,
            current_excit_val=1e-3 * place.excitation,
        )
        if place.excitation:
            channel.ai_coupling = constants.Coupling.AC  # the voltage that the current needs is no signal


def _group(device: Any) -> str:  # noqa: ANN401
    """Return the chassis of a module, or the device itself: what has one task."""
    try:
        return str(device.compact_daq_chassis_device.name) or str(device.name)
    except import_module("nidaqmx.errors").DaqError:  # it is no module of a chassis
        return str(device.name)


@contextmanager
def _errors(place: DaqmxAddress | str, kind: type[DriverError]) -> Iterator[None]:
    """Turn errors of the library into errors of a driver."""
    try:
        errors = import_module("nidaqmx.errors")
    except ImportError as error:
        raise DriverError(str(place), "needs `pip install 'modalwatch[nidaqmx]'`") from error
    try:
        yield
    except (errors.DaqNotFoundError, errors.DaqNotSupportedError) as error:
        raise DriverError(str(place), "needs the NI-DAQmx runtime of National Instruments on this machine") from error
    except errors.Error as error:
        raise kind(str(place), " ".join(str(error).split())) from error


@contextmanager
def _suppressed() -> Iterator[None]:
    """Ignore errors of a task that is closed: the device may be unplugged."""
    try:
        yield
    except import_module("nidaqmx.errors").Error:
        return


def daqmx_devices() -> list[tuple[str, str, list[str]]]:
    """Return name, product and analog inputs of each device of NI-DAQmx; none without its runtime."""
    try:
        with _errors("NI-DAQmx", DriverError):
            devices = import_module("nidaqmx.system").System.local().devices
            found = [(d.name, d.product_type, [c.name for c in d.ai_physical_chans]) for d in devices]
    except DriverError:
        return []
    return [one for one in found if one[2]]
