"""The temperature that windows are judged by where a site has a thermometer of its own: a function of the log.

Only one thermometer is used at a time: the step between two would look like a change of the structure. If it fails, the
devices' own thermometers replace it, corrected for their earlier difference.
"""

import math
from collections.abc import Sequence
from typing import Protocol

import numpy as np

from daq import Event

TOPIC_TEMPERATURE = "/measured/temperature"
_FORGET = 0.05  # share of a window in the difference to the devices' thermometers


def reading(time: int, celsius: float, source: str) -> Event:
    """Return a reading as it is in the log."""
    return Event(topic=TOPIC_TEMPERATURE, time=time, payload={"celsius": celsius, "source": source})


class TimedTemperature(Protocol):
    """A recording, or the conditions of a window."""

    @property
    def start(self) -> int:
        """[ns UTC]."""

    @property
    def end(self) -> int:
        """[ns UTC]."""

    @property
    def temperature(self) -> float:
        """Mean over the devices [degC]."""


class SiteTemperature:
    """Readings so far, and the temperature of windows.

    Parameters
    ----------
    stale_minutes : age beyond which a reading is not used for a window
    offset : of the thermometer against the devices' mean, of the run before [K]; NaN if not known
    """

    def __init__(self, stale_minutes: float, offset: float = math.nan) -> None:
        self._stale = round(stale_minutes * 60e9)
        self._readings: list[tuple[int, float]] = []  # time [ns UTC] and temperature [degC]
        self.offset = offset  #: its difference from the devices' mean, averaged over the last windows [K]

    @property
    def readings(self) -> tuple[tuple[int, float], ...]:
        """Times [ns UTC] and temperatures [degC] that a window may still use."""
        return tuple(self._readings)

    def restore(self, readings: Sequence[tuple[int, float]]) -> None:
        """Continue with readings of before."""
        self._readings = list(readings)

    def take(self, event: Event) -> None:
        """Process an item of the log."""
        if event.topic == TOPIC_TEMPERATURE:
            self._readings.append((event.time, float(event.payload.get("celsius", "nan"))))

    def of(self, recording: TimedTemperature) -> float:
        """Return the temperature of a window [degC], NaN if it is unknown; windows in their order.

        The mean of the readings within the window; without one, the last before it that is not stale.
        """
        known = [(t, c) for t, c in self._readings if t <= recording.end]
        within = [c for t, c in known if t >= recording.start]
        oldest = recording.start - self._stale
        self._readings = [(t, c) for t, c in self._readings if t >= oldest]
        if within or (known and max(known)[0] >= oldest):
            found = float(np.mean(within)) if within else max(known)[1]
            apart = found - recording.temperature
            if math.isfinite(apart):
                self.offset = apart if math.isnan(self.offset) else self.offset + _FORGET * (apart - self.offset)
            return found
        return recording.temperature + self.offset
