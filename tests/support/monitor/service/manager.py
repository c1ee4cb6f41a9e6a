"""The service manager's side of sd_notify."""

import socket
import threading
import time


class Listener:
    """Receives datagrams at a socket.

    Parameters
    ----------
    path : of the socket
    """

    def __init__(self, path: str) -> None:
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.socket.bind(path)
        self.reported: list[str] = []
        threading.Thread(target=self._listen, daemon=True).start()

    def _listen(self) -> None:
        """Take datagrams at once, as systemd does: a full socket would block the sender."""
        while not self.reported or self.reported[-1] != "STOPPING=1":
            self.reported.append(self.socket.recv(4096).decode())
        self.socket.close()

    def received(self, text: str, seconds: float) -> bool:
        """Return whether a datagram with this beginning arrives within a time."""
        end = time.monotonic() + seconds
        while time.monotonic() < end and not any(reported.startswith(text) for reported in tuple(self.reported)):
            time.sleep(0.01)
        return any(reported.startswith(text) for reported in self.reported)
