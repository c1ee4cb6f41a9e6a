"""Heartbeat and emergencies of a CANopen node, on the master's side (CiA 301, 7.2.8.3 and 7.2.7).

Heartbeats show at once that a node has restarted or left its operational state. For a node whose scans are missing,
they show whether it is alive.
"""

import time
from collections import deque

import canopen
from canopen.emcy import EmcyError
from canopen.nmt import NMT_STATES

PERIOD_MS = 250  #: interval of heartbeats set in the node
PATIENCE = 1.0  #: s without one, four periods: they have the lowest priority of all frames on a bus
_BOOT_UP, _OPERATIONAL = 0, 5
_FULL_SECONDS = 2.0  # time without heartbeat, while scans arrive, before it is reported [s]


class HeartbeatConsumer:
    """Heartbeats of one node, from the time at which it was set operational.

    Frames come in the bus's thread, questions in the driver's.

    Parameters
    ----------
    node : sends a heartbeat every `PERIOD_MS`; it must be started next
    """

    def __init__(self, node: canopen.RemoteNode) -> None:
        self._states: deque[int] = deque(maxlen=16)  # states that were not processed yet
        self._warnings: deque[str] = deque(maxlen=16)
        self._last_heartbeat = self._scanned = time.monotonic()
        self._running = self._told = False
        node.nmt.add_heartbeat_callback(self._beat)
        node.emcy.add_callback(self._emergency)

    def _beat(self, state: int) -> None:
        self._last_heartbeat = time.monotonic()
        self._states.append(state)

    def _emergency(self, error: EmcyError) -> None:
        what = f"emergency {error.code:#06x}: {error.get_desc() or 'no description'}"
        self._warnings.append(f"{what} (register {error.register:#04x}, data {error.data.hex()})")

    def note_scans(self) -> None:
        """Note that scans have come just now."""
        self._scanned = time.monotonic()

    @property
    def alive(self) -> bool:
        """True if heartbeats arrive."""
        return time.monotonic() - self._last_heartbeat < PATIENCE

    @property
    def silence(self) -> float:
        """Time without a scan [s]."""
        return time.monotonic() - self._scanned

    def trouble(self) -> str:
        """Return why the node counts as lost, empty while it does not.

        Scans that come outweigh a heartbeat that does not: on a full bus it is the first that no longer gets through.
        """
        while self._states:
            state = self._states.popleft()
            if state == _BOOT_UP:
                return "it has restarted: its settings are lost"
            if self._running and state != _OPERATIONAL:
                return f"state of its heartbeat: {NMT_STATES.get(state, state)}, expected OPERATIONAL"
            self._running |= state == _OPERATIONAL  # a heartbeat sent before the start command may have another state
        quiet = time.monotonic() - max(self._last_heartbeat, self._scanned)
        return f"neither heartbeat nor scan for {PATIENCE:g} s" if quiet > PATIENCE else ""

    def warning(self) -> str:
        """Return a warning about a node that still sends scans, each once; empty if there is none."""
        if self._warnings:
            return self._warnings.popleft()
        late = time.monotonic() - self._last_heartbeat > _FULL_SECONDS
        news, self._told = late and not self._told, late
        if not news:
            return ""
        return (
            f"no heartbeat for {_FULL_SECONDS:g} s although scans arrive: the bus is overloaded, or has another master"
        )
