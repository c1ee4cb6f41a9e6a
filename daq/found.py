"""Devices found at a port."""

from dataclasses import dataclass
from typing import Any

from daq.can_address import CanAddress


@dataclass(frozen=True, kw_only=True)
class Found:
    """A device that answered."""

    driver: str
    place: str | CanAddress
    identity: dict[str, Any]
    rate: float = 1000.0  #: scans a second that it can [Hz]
    axes: tuple[int, ...] = (0, 1, 2)  #: that it measures


@dataclass(frozen=True, kw_only=True)
class PortAnswer:
    """Result of the search at a port."""

    who: str  #: for people
    devices: tuple[Found, ...]  #: none behind an adapter whose bus is silent
