"""Status messages to systemd: started, status, watchdog (sd_notify, one datagram each).

References
----------
sd_notify(3), "Notes": the protocol; it takes no library.
"""

import os
import socket
import time
from collections.abc import Mapping
from dataclasses import dataclass

_FLOW_SECONDS = 10.0  # without data, or without the log being written, after which the watchdog is not fed


class ServiceManager:
    """Messages to the service manager that started this process; none without one.

    Parameters
    ----------
    environment : of the process: NOTIFY_SOCKET, WATCHDOG_USEC, WATCHDOG_PID
    """

    def __init__(self, environment: Mapping[str, str] | None = None) -> None:
        environment = os.environ if environment is None else environment
        path = environment.get("NOTIFY_SOCKET", "")
        self._address = "\0" + path[1:] if path.startswith("@") else path
        ours = environment.get("WATCHDOG_PID", str(os.getpid())) == str(os.getpid())
        period = environment.get("WATCHDOG_USEC", "")
        self._every = int(period) / 4e6 if period.isdigit() and ours else None  # s
        self._due = 0.0

    def ready(self) -> None:
        """Report that everything has started, or restarted after `reloading`."""
        self._say("READY=1")

    def reloading(self) -> None:
        """Report that settings are being read again."""
        self._say(f"RELOADING=1\nMONOTONIC_USEC={time.clock_gettime_ns(time.CLOCK_MONOTONIC) // 1000}")

    def stopping(self) -> None:
        """Report that the monitor is ending."""
        self._say("STOPPING=1")

    def status(self, text: str) -> None:
        """Send a status line, which `systemctl status` shows."""
        self._say(f"STATUS={text.splitlines()[0] if text else ''}")

    def feed(self, signs: "SignsOfLife") -> None:
        """Report to the watchdog a few times per period, unless a part has stopped."""
        now = time.monotonic()
        if self._every is None or now < self._due or signs.standing:
            return
        self._due = now + self._every
        self._say("WATCHDOG=1")

    def _say(self, text: str) -> None:
        """Send one datagram; a manager that is not there any more is none of our business."""
        if not self._address:
            return
        try:
            with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC) as line:
                line.settimeout(0.1)  # a manager that does not receive must not block
                line.sendto(text.encode(), self._address)
        except OSError:
            return


@dataclass(frozen=True, kw_only=True)
class SignsOfLife:
    """Signs that distinguish a run that works from one that only exists; ages in s."""

    data: float  #: time since a block of any device was logged
    disk: float  #: time since the log's thread completed a disk operation
    losing: bool  #: whether scans are lost, because the disk is not writable and memory is full

    @property
    def standing(self) -> str | None:
        """Part that is stuck, so that a restart may help; None if all parts progress.

        A disk that is not writable is no reason for a restart as long as memory keeps the data: a restart would lose
        them.
        """
        if self.data > _FLOW_SECONDS:
            return f"no data for {self.data:.0f} s"
        if self.disk > _FLOW_SECONDS:
            return f"the log has not been written for {self.disk:.0f} s"
        return "the disk is not writable, and the memory buffer is full" if self.losing else None
