"""Blocks as a device hands them on, and recordings on one time grid."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from enum import IntFlag
from functools import reduce
from math import ceil
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from daq.notebook import html_table, utc_text

if TYPE_CHECKING:
    import pandas

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int32]
IndexArray = npt.NDArray[np.intp]
BoolArray = npt.NDArray[np.bool_]
ComplexArray = npt.NDArray[np.complex128]
_ROUNDING = 1e-3  # scans


class Flag(IntFlag):
    """Known faults of a block."""

    NONE = 0
    AFTER_GAP = 1  #: scans are missing between the previous block and this one
    BAD_FRAMES = 2  #: damaged frames were dropped while this block was read
    RESTARTED = 4  #: first block after the device was (re)connected; its index has a new origin


@dataclass(frozen=True, eq=False, init=False)
class Block:
    """Consecutive scans of one device, as the driver read them and as the log stores them."""

    device: str
    rate: float  #: nominal scans per second [Hz], by the device's own clock
    first_index: int  #: unwrapped number of the first scan since the device's first connection, or of `clock` [-]
    counts: IntArray  #: (n_scans, n_axes) raw counts [-], no scan missing inside
    scale: float  #: m/s2 per count
    arrival_index: int  #: the (counter, host time) pair: this scan ...
    arrival_time: int  #: ... had arrived at this host time [ns UTC]
    temperature: float  #: temperature of the device [degC], NaN if it has no sensor
    flags: Flag = Flag.NONE
    clock: str = ""  #: clock of the indices, if devices share it: one index is one instant for all of them

    def __init__(  # logs have many blocks: that of a frozen dataclass sets one field after another, in twice the time
        self,
        *,
        device: str,
        rate: float,
        first_index: int,
        counts: IntArray,
        scale: float,
        arrival_index: int,
        arrival_time: int,
        temperature: float,
        flags: Flag = Flag.NONE,
        clock: str = "",
    ) -> None:
        """Refuse invalid values."""
        if counts.ndim != 2 or counts.dtype != np.int32:
            raise ValueError(
                f"counts of {device}: expected int32 (n_scans, n_axes), found {counts.dtype} {counts.shape}"
            )
        vars(self).update(
            device=device,
            rate=rate,
            first_index=first_index,
            counts=counts,
            scale=scale,
            arrival_index=arrival_index,
            arrival_time=arrival_time,
            temperature=float(np.float32(temperature)),  # as the log stores it
            flags=flags,
            clock=clock,
        )

    @property
    def n_scans(self) -> int:
        """Number of scans in the block."""
        return len(self.counts)

    @property
    def end_index(self) -> int:
        """Number of the scan after the last one."""
        return self.first_index + len(self.counts)

    def time_of(self, index: int) -> int:
        """Return the time of a scan by the block's own pair [ns UTC]."""
        return self.arrival_time + round((index - self.arrival_index) / self.rate * 1e9)

    def within(self, start: int, stop: int) -> "Block | None":
        """Return the block with its scans from `start` up to `stop` [ns UTC] alone; None if there are none."""
        first, end = max(self._index_from(start), self.first_index), min(self._index_from(stop), self.end_index)
        if first >= end:
            return None
        if end - first == self.n_scans:
            return self
        counts = self.counts[first - self.first_index : end - self.first_index]
        return replace(self, first_index=first, counts=counts)

    def _index_from(self, time: int) -> int:
        """Return the first scan at or after a time [ns UTC]; times of scans are rounded to ns."""
        return self.arrival_index + ceil((time - self.arrival_time) * 1e-9 * self.rate - _ROUNDING)


@dataclass(frozen=True, kw_only=True)
class Channel:
    """One analysed signal: an axis of a device and the name of the sensor place it measures."""

    name: str
    device: str
    axis: int  #: 0, 1, 2 = x, y, z of the device


@dataclass(frozen=True, kw_only=True)
class Gap:
    """Missing samples of one device inside a recording."""

    device: str
    start: int  #: first missing sample of the recording's grid
    stop: int  #: sample after the last missing one


@dataclass(frozen=True, eq=False, kw_only=True)
class Recording:
    """Signals of all channels on one time grid."""

    channels: tuple[Channel, ...]
    data: FloatArray  #: (n_samples, n_channels) acceleration [m/s2], NaN where a gap is
    rate: float  #: samples per second [Hz]
    start: int  #: time of the first sample [ns UTC]
    temperature: float = float("nan")  #: mean over the devices [degC], NaN if none has a sensor
    gaps: tuple[Gap, ...] = ()

    def __post_init__(self) -> None:
        """Check that shapes agree."""
        if self.data.ndim != 2 or self.data.shape[1] != len(self.channels):
            raise ValueError(f"data: expected (n_samples, {len(self.channels)}), found {self.data.shape}")
        if not self.rate > 0:
            raise ValueError(f"rate: expected a positive number of Hz, found {self.rate}")

    @classmethod
    def from_dataframe(
        cls, frame: "pandas.DataFrame", *, rate: float | None = None, unit: str | None = None
    ) -> "Recording":
        """Return a table of pandas as a recording: each column is a channel, the index is the time.

        Parameters
        ----------
        frame : (n_samples, n_channels); its index holds dates (UTC where they state no zone), time differences or
            seconds; missing rows and NaN are gaps. A column of temperatures, as `temperature [degC]`, is the
            recording's temperature and no channel
        rate : samples per second [Hz], for a table without times; numbers in its index are then not used
        unit : unit of all channels, such as `g`. Default: by the names of the columns, as `top_x [mg]`, else m/s2

        Raises
        ------
        DataError
            Naming the column and the row of a value that is no number, or the row of a time that is not on an even
            grid; also if there is no channel, or two columns have the same name.
        ValueError
            If the rate is not positive, or the unit unknown.
        """
        from daq.files.dataframe import read_dataframe  # the readers of files import this type, not the reverse

        return read_dataframe(frame, rate=rate, unit=unit)

    def __repr__(self) -> str:
        return f"Recording({len(self.channels)} channels, {self.duration:.4g} s at {self.rate:g} Hz)"

    def _repr_html_(self) -> str:
        """Return a table of the channels, for notebooks."""
        missing, total = np.isnan(self.data), max(len(self.data), 1)
        n = np.maximum((~missing).sum(0), 1)
        mean = np.where(missing, 0.0, self.data).sum(0) / n
        deviation = np.sqrt((np.where(missing, 0.0, self.data - mean) ** 2).sum(0) / n)
        rows = [
            (channel.name, channel.device, f"{std:.3g}", f"{share:.2g}")
            for channel, std, share in zip(self.channels, deviation, 100 * missing.sum(0) / total, strict=True)
        ]
        caption = f"{self.duration:.4g} s at {self.rate:g} Hz from {utc_text(self.start)}"
        return html_table(caption, ("channel", "device", "standard deviation [m/s²]", "missing [%]"), rows)

    @property
    def duration(self) -> float:
        """Length [s]."""
        return len(self.data) / self.rate

    @property
    def end(self) -> int:
        """Time after the last sample [ns UTC]."""
        return self.start + round(self.duration * 1e9)


def find_gaps(channels: tuple[Channel, ...], data: FloatArray) -> tuple[Gap, ...]:
    """Return the stretches in which a device lacks a sample of any of its channels; data (n_samples, n_channels)."""
    with np.errstate(over="ignore", invalid="ignore"):
        may_lack = np.isnan(data.sum())  # also where infinite samples have both signs
    return tuple(_find_gaps(channels, np.isnan(data))) if may_lack else ()


def _find_gaps(channels: tuple[Channel, ...], missing: npt.NDArray[np.bool_]) -> Iterator[Gap]:
    for device in dict.fromkeys(channel.device for channel in channels):
        own = [k for k, channel in enumerate(channels) if channel.device == device]
        lacking = reduce(np.logical_or, (missing[:, k] for k in own))  # column by column: one may be contiguous
        if not lacking.any():
            continue
        edges = np.flatnonzero(np.diff(np.r_[False, lacking, False].astype(np.int8)))
        for start, stop in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
            yield Gap(device=device, start=start, stop=stop)


@dataclass(frozen=True, kw_only=True)
class DeviceIdentity:
    """Properties of a device that stay the same; another identity at the same address is another device."""

    product: str
    serial: str = ""  #: serial number, empty if the device has none
    hardware: str = ""
    version: str = ""  #: of its firmware
    details: Mapping[str, Any] = field(default_factory=dict)  #: JSON values of one kind of device: baud rate, axes, ..

    def payload(self) -> dict[str, Any]:
        """Return the known properties as JSON values."""
        named = {"product": self.product, "hardware": self.hardware, "version": self.version, "serial": self.serial}
        return {name: value for name, value in named.items() if value} | dict(self.details)

    def __str__(self) -> str:
        return " ".join(filter(None, (self.product, self.serial)))


@dataclass(frozen=True, eq=False, kw_only=True)
class Event:
    """Any item that is not a block, required for replay."""

    topic: str
    time: int  #: [ns UTC]
    payload: dict[str, Any]  #: JSON values


Item = Block | Event
