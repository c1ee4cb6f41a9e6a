"""Innovations of the modes: a state of the running monitor, of which the log has significant ones alone."""

from typing import Any

from pydantic import BaseModel, ConfigDict

from daq import Event

TOPIC_INNOVATIONS = "/state/innovations"


class ModeInnovations(BaseModel):
    """Power of the Kalman filter's innovations about each mode, over one block of signals."""

    model_config = ConfigDict(frozen=True, extra="ignore")

    time: int  #: end of the block [ns UTC]
    seconds: float  #: length of the block [s]
    level: float  #: rms of all innovations over that of the learned record [-]
    mode: list[int]  #: numbers of the measured modes of the reference
    frequency: list[float]  #: of these modes [Hz]
    deviation: list[float]  #: power about each mode over that of all innovations, in standard deviations of calm blocks
    limit: float  #: deviation above which a block is significant [-]

    @property
    def largest(self) -> tuple[float, float]:
        """Largest deviation, and the frequency of its mode [Hz]."""
        return max(zip(self.deviation, self.frequency, strict=True))

    @property
    def over(self) -> bool:
        """True if the largest deviation is above the limit."""
        return self.largest[0] > self.limit

    def event(self) -> Event:
        """Return the state as an item of the live view."""
        values: dict[str, Any] = self.model_dump()
        return Event(topic=TOPIC_INNOVATIONS, time=self.time, payload=values)
