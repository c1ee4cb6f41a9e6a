"""Residuals of channels predicted from the others: a state of the running monitor, which no log holds."""

from typing import Any

from pydantic import BaseModel, ConfigDict

from daq import Event

TOPIC_RESIDUALS = "/state/residuals"


class ChannelResiduals(BaseModel):
    """Residuals of one block of signals, a small part of a window."""

    model_config = ConfigDict(frozen=True, extra="ignore")

    time: int  #: end of the block [ns UTC]
    seconds: float  #: length of the block [s]
    ratio: dict[str, float]  #: channel -> rms residual over the learned one [-]
    deviation: dict[
        str, float
    ]  #: channel -> logarithm of the ratio over its standard deviation from block to block [-]
    limit: float  #: deviation above which the residual of a block is significant [-]

    @property
    def over(self) -> dict[str, float]:
        """Deviations above the limit, the largest first."""
        found = sorted(self.deviation.items(), key=lambda item: -item[1])
        return {channel: value for channel, value in found if value > self.limit}

    def event(self) -> Event:
        """Return the state as an item of the live view."""
        values: dict[str, Any] = self.model_dump()
        return Event(topic=TOPIC_RESIDUALS, time=self.time, payload=values)
