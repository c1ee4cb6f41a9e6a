"""Comparison of a structure's sensors with the measured channels."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial import KDTree

from daq import Channel, read_attachments
from monitor.analysis.logs import log_channels, log_held, log_rate
from monitor.settings import Settings, load_settings, parse_attached
from oma.preparation import PASS, TOP
from updater import Structure

_SAME_PLACE = 1e-3  # m
_SAME_WAY = 0.999  # cosine of the angle between two directions


@dataclass(frozen=True, kw_only=True)
class ChannelCheck:
    """Sensors and channels without a counterpart."""

    path: Path  #: settings or log
    n_channels: int
    highest: float  #: highest frequency of identified modes [Hz]
    seconds: float | None  #: length of a log's data without pauses; None if there are none, and for settings
    without_sensor: tuple[str, ...]  #: channels that are no sensor of the structure
    without_channel: tuple[str, ...]  #: sensors that nothing measures

    @property
    def good(self) -> bool:
        """True if every sensor has its channel and every channel its sensor."""
        return not (self.without_sensor or self.without_channel)


def check_channels(structure: Structure, path: Path) -> ChannelCheck:
    """Set a structure's sensors against the channels of SITE.toml or of a log.

    Raises
    ------
    SettingsError, LogError
        If the file cannot be read or has no channels.
    """
    of_site = path.suffix == ".toml"
    channels, highest, seconds = (*_of_settings(load_settings(path)), None) if of_site else _of_log(path)
    names = tuple(channel.name for channel in channels)
    return ChannelCheck(
        path=path,
        n_channels=len(names),
        highest=highest,
        seconds=seconds,
        without_sensor=tuple(n for n in names if n not in structure.channels),
        without_channel=tuple(n for n in structure.channels if n not in names),
    )


def _of_settings(settings: Settings) -> tuple[tuple[Channel, ...], float]:
    rate, band = min(device.rate for device in settings.device), settings.analysis.band
    return settings.channels, min(TOP * rate, band[1]) if band else PASS * rate  # a device may have a filter


def _of_log(path: Path) -> tuple[tuple[Channel, ...], float, float | None]:
    """Return the same of a log, and the length of its data; one that was imported without a site has one rate."""
    channels, attached = log_channels(path), read_attachments(path)
    seconds = log_held(path).seconds or None  # without pauses
    if "site.toml" not in attached:
        return channels, PASS * log_rate(path), seconds
    return channels, _of_settings(parse_attached(attached["site.toml"], f"{path}: site.toml"))[1], seconds


def measured_only(structure: Structure, check: ChannelCheck) -> Structure:
    """Return the structure with only the sensors that something measures."""
    both = zip(structure.sensor, structure.corrected_sensors, strict=True)
    kept = tuple(sensor for sensor, corrected in both if corrected.channel not in check.without_channel)
    corrections = {s.channel: c for s in kept if (c := structure.sensors.get(s.channel))}
    return structure.model_copy(update={"sensor": kept, "sensors": corrections})


def twins(structure: Structure) -> list[tuple[str, str]]:
    """Return the pairs of sensors that measure the same motion, at one place along one line."""
    sensors = structure.corrected_sensors
    if len(sensors) < 2:
        return []
    near = KDTree([s.at for s in sensors]).query_pairs(_SAME_PLACE, output_type="ndarray")
    way = np.array([s.direction for s in sensors])
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    same = near[np.abs((way[near[:, 0]] * way[near[:, 1]]).sum(1)) > _SAME_WAY]
    return [(sensors[a].channel, sensors[b].channel) for a, b in sorted(same.tolist())]
