"""Sensors as mounted, and known corrections of their channels."""

from collections.abc import Collection
from functools import lru_cache
from typing import Literal, Self

import numpy as np
from pydantic import model_validator

from daq import FloatArray
from daq.bounded_text import meant
from updater.structure.base import Entry, Number, Vector


class Sensor(Entry):
    """A single-axis accelerometer channel."""

    channel: str
    at: Vector  #: [m]
    direction: Vector
    gain: Number = 1.0  #: reading of the channel over the true value [-]

    @model_validator(mode="after")
    def _has_direction(self) -> Self:
        if not any(self.direction):
            raise ValueError("the direction is zero")
        return self

    def corrected(self, correction: "Correction | None") -> "Sensor":
        """Return the sensor as logs have it: under the channel that carries it, with all of its gain."""
        if correction is None:
            return self
        gain = self.gain * correction.gain * correction.sign
        return self.model_copy(update={"channel": correction.channel or self.channel, "gain": gain})


def no_sensor_text(channel: str, known: Collection[str], where: object) -> str:
    """Return the error for a channel that is no sensor of a structure, with the nearest one and all of them.

    Parameters
    ----------
    channel : its name
    known : channels of the structure
    where : structure, or its file
    """
    return f"{channel!r} is no sensor of {where}{meant(channel, known)}; there are {', '.join(known)}"


class Correction(Entry):
    """Correction of the signal of a sensor's channel; the entry of the sensor stays as mounted."""

    #: reading of the channel over the expected one, in addition to the sensor's own gain; 0: no signal [-]
    gain: Number = 1.0
    sign: Literal[1, -1] = 1  #: -1 where plus and minus are exchanged
    delay: Number = 0.0  #: delay of the channel [s]
    channel: str | None = None  #: channel of the sensor in logs, if it differs from its name


@lru_cache(maxsize=4096)
def sensor_axes(direction: Vector) -> FloatArray:
    """Return unit vectors (3, 3): along a sensor's direction, and two across it that complete a right-handed set.

    The first across is the global axis that follows the one which the direction is nearest to (y for x, z for y, x for
    z), made square to it: for a sensor along an axis, the other two in their cycle.
    """
    along = np.asarray(direction, float) / np.linalg.norm(direction)
    first = np.eye(3)[(int(np.argmax(np.abs(along))) + 1) % 3]
    first = first - (first @ along) * along
    first /= np.linalg.norm(first)
    axes = np.array([along, first, np.cross(along, first)])
    axes.flags.writeable = False
    return axes
