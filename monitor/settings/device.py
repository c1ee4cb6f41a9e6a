"""[[device]] and [[sensor]]: connection of a device, positions of channels."""

from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from daq import CanAddress, DbcAddress, DbcSensor, LogAddress
from daq.drivers import CanPlace, DaqmxAddress, LineFormat, TextAddress, can_interfaces
from daq.log import HOW_TO_PLACE
from monitor.settings.section import Positive, Section
from updater.quantities import Vector

AXES = ("x", "y", "z")


_Input = Annotated[str, Field(pattern=r"^[^/,:\s]+/ai\d+$")]


def _known_interface(interface: str) -> str:
    if interface not in (known := can_interfaces()):
        raise ValueError(f"expected one of {', '.join(known)}")
    return interface


class CanSettings(Section):
    """CAN bus of a device, instead of `port`."""

    interface: Annotated[str, AfterValidator(_known_interface), Field(examples=["slcan"])]
    """`slcan` for an adapter on a serial port, or an interface of python-can: `socketcan`, `socketcand`, .."""
    channel: Annotated[str, Field(examples=["/dev/serial/by-id/usb-CAN_adapter-if00"])]
    """Serial port of the adapter, or `can0`, .."""
    node: Annotated[Annotated[int, Field(ge=1, le=127)] | None, Field(examples=[3])] = None
    """CANopen node id, 1 to 127. A device on a bus has this or `[device.dbc]`."""
    bitrate: Annotated[int, Field(gt=0)] = 1_000_000
    """Bit rate of the bus [bit/s]; the same for all its devices."""
    sync: Annotated[Literal["producer", "consumer"] | None, Field(examples=["consumer"])] = None
    """CANopen SYNC: `"producer"` for one node, `"consumer"` for the others. All then sample at the same instant."""


class DbcSettings(Section):
    """Signals of a device in a DBC file, in addition to `can`."""

    file: Annotated[str, Field(examples=["imu.dbc"])]
    """DBC file that describes the frames of the device."""
    signals: Annotated[dict[Literal["x", "y", "z"], str], Field(examples=[{"x": "accX", "y": "accY", "z": "accZ"}])]
    """`{x = "accX", ..}`: device axis -> SIGNAL or MESSAGE.SIGNAL."""
    counter: Annotated[str, Field(examples=["Counter"])]
    """Signal that counts scans."""
    scale: Annotated[Positive | None, Field(examples=[0.01])] = None
    """Acceleration per unit of the signals [m/s2]. Default: from their unit in the DBC file."""
    temperature: Annotated[str | None, Field(examples=["Temperature"])] = None
    """Signal of the temperature [degC]."""
    order: Annotated[tuple[str, ...], Field(examples=[["ACC_X", "ACC_Y", "ACC_Z"]])] = ()
    """Messages of a scan in the order in which they are sent. Default: by rising identifier."""

    @model_validator(mode="after")
    def _axes(self) -> Self:
        if set(self.signals) != set(AXES[: len(self.signals)]) or not self.signals:
            raise ValueError("signals: expected those of x, of x and y, or of x, y and z")
        return self

    @property
    def sensor(self) -> DbcSensor:
        """The sensor that is meant."""
        signals = tuple(signal for _, signal in sorted(self.signals.items()))
        rest = self.model_dump(include={"counter", "scale", "temperature", "order"})
        return DbcSensor(file=Path(self.file), signals=signals, **rest)


class TextSettings(Section):
    """Lines of text that a device sends, in addition to `port`."""

    columns: Annotated[tuple[str, ...], Field(examples=[["counter", "time_ms", "x", "y", "z"]])]
    """Numbers of a line: `counter`, `time_s`, `time_ms`, `time_us`, `x`, `y`, `z`, `temperature`; `-`: not used."""
    unit: Annotated[str | None, Field(examples=["g"])] = None
    """Unit of x, y and z: `m/s2`, `cm/s2`, `mm/s2`, `g` or `mg`. Expected if `scale` is not given."""
    scale: Annotated[Positive | None, Field(examples=[0.0006])] = None
    """Acceleration per count [m/s2], if x, y and z are whole numbers without a unit."""
    decimal_comma: bool = False
    """The decimal sign is a comma; numbers are separated by semicolons, blanks or tabs."""
    counter_bits: int = 32
    """Bits of the counter: 8, 16 or 32."""
    baud: Annotated[int, Field(gt=0)] = 115_200
    """Baud rate of the serial port [bit/s]."""

    @model_validator(mode="after")
    def _valid(self) -> Self:
        _ = self.form
        return self

    @property
    def form(self) -> LineFormat:
        """Format of the lines."""
        return LineFormat(**self.model_dump(exclude={"baud"}))


class DaqmxSettings(Section):
    """Analog inputs of National Instruments, instead of `port`. Requires `modalwatch[nidaqmx]` and NI-DAQmx."""

    inputs: Annotated[dict[Literal["x", "y", "z"], _Input], Field(examples=[{"x": "cDAQ1Mod1/ai0"}])]
    """`{x = "cDAQ1Mod1/ai0", ..}`: device axis -> physical channel."""
    sensitivity: Annotated[dict[Literal["x", "y", "z"], Positive], Field(examples=[{"x": 100.2}])]
    """`{x = 100.2, ..}`: sensitivity of the sensor at each input [mV/g]."""
    range_g: Annotated[Positive, Field(examples=[50.0])]
    """Largest acceleration [g]: an input of 5 V with a sensor of 100 mV/g has 50."""
    excitation_ma: Annotated[float, Field(ge=0, le=100)] = 4.0
    """Constant current for IEPE sensors [mA]; the inputs are then AC coupled. 0: none."""

    @model_validator(mode="after")
    def _axes(self) -> Self:
        if set(self.inputs) != set(AXES[: len(self.inputs)]) or not self.inputs:
            raise ValueError("inputs: expected those of x, of x and y, or of x, y and z")
        if set(self.sensitivity) != set(self.inputs):
            raise ValueError("sensitivity: expected the axes of `inputs`")
        if len(set(self.inputs.values())) < len(self.inputs):
            raise ValueError("inputs: expected different inputs")
        return self

    @property
    def address(self) -> DaqmxAddress:
        """The same for the driver."""
        axes = sorted(self.inputs)
        return DaqmxAddress(
            inputs=tuple(self.inputs[axis] for axis in axes),
            sensitivity=tuple(self.sensitivity[axis] for axis in axes),
            range_g=self.range_g,
            excitation=self.excitation_ma,
        )


class LogSettings(Section):
    """Recorded device to be played again by the driver `replay`, instead of `port`."""

    file: Annotated[str, Field(examples=["log"])]
    """Log, or folder of log files, that the driver `replay` plays."""
    device: Annotated[str, Field(examples=["beam_left"])]
    """Name of the device in that log."""


class DeviceSettings(Section):
    """One accelerometer. Repeat the section for each."""

    name: Annotated[str, Field(examples=["beam_left"], pattern=r"^[\w.-]{1,64}$")]
    """Unique name of each `[[device]]`: letters, digits, `_`, `-` and `.`."""
    driver: Annotated[str, Field(examples=["epson-uart"])]
    """Name of the driver."""
    port: Annotated[str | None, Field(examples=["/dev/serial/by-id/usb-FTDI_A352-if00-port0"])] = None
    """Serial port, best by `/dev/serial/by-id/`, or `tcp://..`, `udp://..`. Else `can`, `daqmx` or `log` is given."""
    can: CanSettings | None = None
    dbc: DbcSettings | None = None
    text: TextSettings | None = None
    daqmx: DaqmxSettings | None = None
    log: LogSettings | None = None
    rate: Annotated[float, Field(ge=1e-3, le=1e6)] = 1000.0
    """Sampling rate [scans per second]."""
    delay_ms: Annotated[Annotated[float, Field(ge=0, le=1000)] | None, Field(examples=[1.5])] = None
    """Group delay of the device [ms], subtracted from its time stamps. Default: the driver's value."""
    channels: Annotated[dict[Literal["x", "y", "z"], str], Field(examples=[{"y": "beam_left_y", "z": "beam_left_z"}])]
    """Device axis = sensor of the structure. Other axes are recorded but not analysed."""

    @model_validator(mode="before")
    @classmethod
    def _three_axes(cls, given: object) -> object:
        """Extend the message on missing axes for replayed logs, whose devices may have been columns of a file."""
        if isinstance(given, dict) and "log" in given and isinstance(channels := given.get("channels"), dict):
            more = [str(axis) for axis in channels if axis not in AXES]
            if more:
                raise ValueError(
                    f"channels: expected {', '.join(AXES)}, found {', '.join(more)}: more channels are more devices; "
                    f"{HOW_TO_PLACE}"
                )
        return given

    @model_validator(mode="after")
    def _one_place(self) -> Self:
        found = [name for name in ("port", "can", "daqmx", "log") if getattr(self, name) is not None]
        if len(found) != 1:
            raise ValueError(f"expected one of `port`, `can`, `daqmx` and `log`, found {' and '.join(found) or 'none'}")
        if self.dbc is not None and self.can is None:
            raise ValueError(f"expected `can` with `dbc`, found `{found[0]}`")
        if self.text is not None and self.port is None:
            raise ValueError(f"expected `port` with `text`, found `{found[0]}`")
        if self.can is not None and (self.can.node is None) == (self.dbc is None):
            raise ValueError(f"expected one of `can.node` and `dbc`, found {'none' if self.dbc is None else 'both'}")
        if self.can is not None and self.can.sync and self.dbc is not None:
            raise ValueError("can.sync: not possible with `dbc`: such a sensor samples by its own clock")
        if self.delay_ms is not None and self.log is not None:
            raise ValueError("delay_ms: the times of a log have been corrected when it was recorded")
        return self

    @model_validator(mode="after")
    def _axes_that_are_sent(self) -> Self:
        for axis in self.channels:
            if self.dbc is not None and axis not in self.dbc.signals:
                raise ValueError(f"channels: axis {axis} is none of `dbc.signals`, {', '.join(self.dbc.signals)}")
            if self.daqmx is not None and axis not in self.daqmx.inputs:
                raise ValueError(f"channels: axis {axis} is none of `daqmx.inputs`, {', '.join(self.daqmx.inputs)}")
            if self.text is not None and axis not in self.text.columns:
                raise ValueError(f"channels: axis {axis} is none of `text.columns`, {', '.join(self.text.columns)}")
        return self

    @property
    def delay(self) -> float | None:
        """Delay of a scan after the motion [s]; None for the driver's value."""
        return None if self.delay_ms is None else 1e-3 * self.delay_ms

    @property
    def waits_for_sync(self) -> bool:
        """True if it samples only once another device has been opened."""
        return self.can is not None and self.can.sync == "consumer"

    @property
    def place(self) -> str | CanPlace | TextAddress | LogAddress | DaqmxAddress:
        """Connection of the device."""
        if self.log is not None:
            return LogAddress(path=Path(self.log.file), device=self.log.device)
        if self.daqmx is not None:
            return self.daqmx.address
        if self.text is not None:
            return TextAddress(port=self.port or "", form=self.text.form, baud=self.text.baud)
        if self.can is None:
            return self.port or ""
        bus = self.can.model_dump(exclude={"node", "sync"})
        if self.dbc is not None:
            return DbcAddress(**bus, sensor=self.dbc.sensor)
        return CanAddress(**bus, node=self.can.node or 0, sync=self.can.sync)


def _not_zero(direction: Vector) -> Vector:
    if not any(direction):
        raise ValueError("expected a direction, found [0, 0, 0]")
    return direction


class SensorSettings(Section):
    """Position of a channel, as in a structure file: mode shapes are drawn there. Not used with `structure`."""

    channel: Annotated[str, Field(examples=["beam_left_y"])]
    """Name of the channel, as in `channels` of a device."""
    at: Annotated[Vector, Field(examples=[[0.0, 0.0, 0.9]])]
    """Position x, y, z [m]; z is up."""
    direction: Annotated[Vector, AfterValidator(_not_zero), Field(examples=[[0.0, 1.0, 0.0]])]
    """Direction of positive values, along x, y, z; of any length."""
