"""Origin of an exported recording: the devices of its channels and its start, as its file states them."""

import json
from dataclasses import dataclass
from pathlib import Path

from daq.bounded_text import parse_json
from daq.errors import DataError
from daq.types import Channel

_MAX_AXES = 1000  # per device
_MAX_START = 1 << 62  # ns: times after it fit into 64 bits too


@dataclass(frozen=True, kw_only=True)
class Origin:
    """Devices, axes and start that an exported file states."""

    start: int  #: time of the first sample [ns UTC]
    channels: tuple[Channel, ...]  #: channels of all signals

    @property
    def text(self) -> str:
        """One line of JSON, which `parse_origin` reads."""
        places = {channel.name: [channel.device, channel.axis] for channel in self.channels}
        return json.dumps({"start": self.start, "channels": places})

    @property
    def remark(self) -> str:
        """Sentence for the user."""
        devices = dict.fromkeys(channel.device for channel in self.channels)
        return f"devices and start as exported: {', '.join(devices)}"

    def channel(self, name: str) -> Channel | None:
        """Return the channel of a column, None for a column that was not exported."""
        return next((channel for channel in self.channels if channel.name == name), None)


def parse_origin(text: str, path: Path) -> Origin:
    """Read the origin that the file at `path` states.

    Raises
    ------
    DataError
        If it is not an origin.
    """
    try:
        content = parse_json(text)
        channels = tuple(
            Channel(name=name, device=str(device), axis=int(axis))
            for name, (device, axis) in content["channels"].items()
        )
        places = {(channel.device, channel.axis) for channel in channels}
        if not channels or len(places) < len(channels) or not all(0 <= axis < _MAX_AXES for _, axis in places):
            raise ValueError("each channel has an axis of its own")
        if not all(channel.device for channel in channels):
            raise ValueError("each device has a name")
        start = int(content["start"])
        if not 0 <= start < _MAX_START:
            raise ValueError("the start is a time since 1970")
        return Origin(start=start, channels=channels)
    except (ValueError, OverflowError, TypeError, KeyError, AttributeError) as error:
        raise DataError(path, f"origin: expected start and channels, found {text!r:.80}") from error
