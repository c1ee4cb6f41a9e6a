"""Where a CAN node is."""

from dataclasses import dataclass

OURS = "slcan"  #: this name means the bus of `daq.can_bus`; any other one is opened by python-can


@dataclass(frozen=True, kw_only=True)
class CanAddress:
    """A node on a bus that python-can, or for "slcan" this package, can open."""

    interface: str  #: "slcan", "socketcan", "socketcand", "virtual", ...
    channel: str  #: as the interface calls it: a serial port, can0, ...
    node: int  #: CANopen id, 1 to 127
    bitrate: int = 1_000_000  #: [bit/s]

    def __post_init__(self) -> None:
        """Refuse an id that no node can have."""
        if not 1 <= self.node <= 127:
            raise ValueError(f"node: expected 1 to 127, found {self.node}")

    @property
    def bus(self) -> tuple[str, str]:
        """What nodes on one bus have in common."""
        return self.interface, self.channel

    def __str__(self) -> str:
        return f"{self.interface}:{self.channel} node {self.node}"
