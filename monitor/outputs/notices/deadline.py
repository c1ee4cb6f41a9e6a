"""One time limit for a whole delivery, from the look-up of a name to the end of the answer."""

import contextlib
import os
import socket
import threading
import time
from collections.abc import Callable

_GRACE_SECONDS = 0.25  # for work to end after its connections are closed
_MAX_ABANDONED = 8  # deliveries that neither end nor let themselves be closed, such as a look-up of a name


class Deadline:
    """Time limit of one delivery; parts of it register functions that abort them.

    Time limits of sockets restart with every byte: a server that sends one byte per second never exceeds them.

    Parameters
    ----------
    seconds : from now [s]
    """

    def __init__(self, seconds: float) -> None:
        self.seconds, self._end = seconds, time.monotonic() + seconds
        self._lock = threading.Lock()
        self._closers: list[Callable[[], None]] = []
        self._over = False

    @property
    def remaining(self) -> float:
        """Time left [s]."""
        return max(0.0, self._end - time.monotonic())

    def on_expiry(self, close: Callable[[], None]) -> None:
        """Have something called once the time is over; at once if it is."""
        with self._lock:
            self._closers.append(close)
            over = self._over
        if over:
            close()

    def watch(self, number: int) -> None:
        """Have a connection, by its file number, shut down once the time is over, whatever layer reads from it then."""
        own = socket.socket(fileno=os.dup(number))  # outlives the wrapping of the socket by TLS
        self.on_expiry(lambda: _shut(own))

    def expire(self) -> None:
        """Cut short all that is registered, and all that will be."""
        with self._lock:
            self._over, closers = True, list(self._closers)
        for close in closers:
            close()


def _shut(connection: socket.socket) -> None:
    with connection, contextlib.suppress(OSError):
        connection.shutdown(socket.SHUT_RDWR)


class DeadlineRunner:
    """Runs deliveries one after the other, each in a thread that is abandoned when its time is over."""

    def __init__(self) -> None:
        self._abandoned: list[threading.Thread] = []

    def run(self, seconds: float, work: Callable[[Deadline], None]) -> None:
        """Do work within a time.

        Parameters
        ----------
        seconds : for all of it [s]
        work : raises its failure

        Raises
        ------
        TimeoutError
            If it has not ended by then; it may still be executed.
        """
        self._abandoned = [thread for thread in self._abandoned if thread.is_alive()]
        if len(self._abandoned) >= _MAX_ABANDONED:
            raise TimeoutError(f"{len(self._abandoned)} earlier deliveries have not ended")
        raised: list[BaseException | None] = []
        deadline = Deadline(seconds)

        def attempt() -> None:
            try:
                work(deadline)
            except BaseException as error:  # noqa: BLE001 - raised again where it is waited for
                raised.append(error)
            else:
                raised.append(None)

        thread = threading.Thread(target=attempt, name="delivery", daemon=True)
        thread.start()
        thread.join(seconds)
        late = thread.is_alive()
        deadline.expire()  # also closes its copies of the connections of work that has ended
        if late:
            thread.join(_GRACE_SECONDS)
        if thread.is_alive():
            self._abandoned.append(thread)
        error = raised[0] if raised else None
        if late and (error is not None or not raised):
            raise TimeoutError(f"timed out: not delivered within {seconds:g} s") from error
        if error is not None:
            raise error
