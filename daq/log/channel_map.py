"""Map from device axes to sensor channels, stored in a log so that the log can be read alone."""

import json
from dataclasses import asdict, dataclass
from pathlib import Path

from daq.bounded_text import parse_json
from daq.errors import LogError
from daq.types import Channel

_MAX_AXES = 10_000  # of a device: an imported file may be one
CHANNELS = "channels.json"  #: name of the attachment


@dataclass(frozen=True, kw_only=True)
class ChannelMap:
    """The channels of a log."""

    channels: tuple[Channel, ...]
    on_grid: bool  #: scans of all devices lie on one time grid, as those of an imported file

    def to_json(self) -> str:
        """Return the text that is attached to a log."""
        return json.dumps({"channels": [asdict(c) for c in self.channels], "on_grid": self.on_grid}, indent=1)


def _channel(entry: dict[str, object]) -> Channel:
    name, device, axis = entry["name"], entry["device"], entry["axis"]
    if not (isinstance(name, str) and isinstance(device, str) and isinstance(axis, int) and 0 <= axis < _MAX_AXES):
        raise ValueError("a channel has a name, a device and an axis")
    return Channel(name=name, device=device, axis=axis)


def parse_channel_map(text: str, path: Path) -> ChannelMap:
    """Read a channel map from the text attached to the log at `path`.

    Raises
    ------
    LogError
        If it is not a channel map.
    """
    try:
        content = parse_json(text)
        channels = tuple(_channel(entry) for entry in content["channels"])
        if len({channel.name for channel in channels}) < len(channels):
            raise ValueError("each channel has a name of its own")
        return ChannelMap(channels=channels, on_grid=bool(content["on_grid"]))
    except (ValueError, TypeError, KeyError) as error:
        raise LogError(path, f"{CHANNELS}: expected channels and on_grid, found {text!r:.80}") from error
