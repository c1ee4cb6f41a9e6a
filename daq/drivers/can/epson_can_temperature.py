"""Temperature of an M-A552, requested at intervals while it samples, without waiting for the reply.

It could send it with every scan (TPDO4), which four nodes at 1000 Hz leave no room for on a bus.
"""

import time

import canopen
from canopen.sdo.exceptions import SdoAbortedError

from daq.protocol import epson
from daq.protocol import epson_can as objects

PERIOD = 10.0  #: s between questions
_ASK, _ANSWER = 0x40, 0x43  # SDO commands: read an object; its four bytes


class Thermometer:
    """One node's temperature, from before it samples until it is let go.

    Answers come in the bus's thread, questions from the driver's.

    Parameters
    ----------
    node : queried at once, which takes the time of one reply

    Raises
    ------
    canopen.SdoCommunicationError
        If it does not answer.
    """

    def __init__(self, node: canopen.RemoteNode) -> None:
        self._node, self._due = node, time.monotonic() + PERIOD
        self.celsius = float("nan")  #: last temperature [degC], NaN if the node has no such object
        try:
            self._take(bytes(node.sdo.upload(*objects.TEMPERATURE)))
        except SdoAbortedError:
            self._due = float("inf")
        self._network = node.network
        self._network.subscribe(node.sdo.tx_cobid, self._hear)

    def ask_if_due(self) -> None:
        """Send a request if it is due; errors of the bus."""
        if time.monotonic() >= self._due:
            self._due = time.monotonic() + PERIOD
            self._network.send_message(self._node.sdo.rx_cobid, _message(_ASK).ljust(8, b"\0"))

    def _hear(self, _: int, data: bytearray, __: float) -> None:
        if data[:4] == _message(_ANSWER):
            self._take(bytes(data[4:8]))

    def _take(self, value: bytes) -> None:
        self.celsius = float(epson.temperature_celsius(int.from_bytes(value, "little", signed=True)))

    def close(self) -> None:
        """Stop receiving its frames."""
        self._network.unsubscribe(self._node.sdo.tx_cobid, self._hear)


def _message(command: int) -> bytes:
    index, subindex = objects.TEMPERATURE
    return bytes([command]) + index.to_bytes(2, "little") + bytes([subindex])
