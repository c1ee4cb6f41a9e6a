"""Axes of a device for the sensors at its place."""

from collections.abc import Sequence

from monitor.settings import AXES
from updater.structure import Sensor


def axis_channels(sensors: Sequence[Sensor]) -> dict[str, str]:
    """Return device axis -> channel: the axis along the sensor's direction if it is free, else the first free one."""
    found: dict[str, str] = {}
    oblique: list[Sensor] = []
    for sensor in sensors:
        along = max(range(3), key=lambda axis, sensor=sensor: abs(sensor.direction[axis]))  # type: ignore[misc]
        straight = sum(bool(part) for part in sensor.direction) == 1
        if straight and AXES[along] not in found:
            found[AXES[along]] = sensor.channel
        else:
            oblique.append(sensor)
    free = (axis for axis in AXES if axis not in found)
    found |= {next(free): sensor.channel for sensor in oblique}
    return dict(sorted(found.items()))
