"""HTTP with limits that uvicorn does not have: a time for every request and answer, and a number of connections.

uvicorn's `timeout_keep_alive` counts from the last byte, and only between requests; `limit_concurrency` refuses
requests but closes no connection.
"""

import asyncio
from typing import Any, ClassVar

from uvicorn.protocols.http.h11_impl import H11Protocol

REQUEST_SECONDS = 10.0  #: time from connecting, or from the previous answer, until a request is complete
ANSWER_SECONDS = 30.0  #: time from then on until its answer has been received
MAX_CONNECTIONS = 512  #: above it, the connection that has waited longest for its request is closed


class BoundedProtocol(H11Protocol):
    """One connection; those that wait for a request are known to all of them, the oldest first."""

    waiting: ClassVar[dict["BoundedProtocol", None]] = {}

    def __init__(self, *args: Any, **kwargs: Any) -> None:  # noqa: ANN401 - as uvicorn makes it
        super().__init__(*args, **kwargs)
        self._deadline: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Begin to wait for a request; make room if there are too many connections."""
        super().connection_made(transport)
        self._wait()
        if len(self.connections) > MAX_CONNECTIONS:
            next(iter(self.waiting)).transport.abort()

    def data_received(self, data: bytes) -> None:
        """Take bytes; a request that is whole no longer waits."""
        super().data_received(data)
        self._look()

    def on_response_complete(self) -> None:
        """Begin to wait for the next request, which may be there already."""
        self._wait()
        super().on_response_complete()
        self._look()

    def connection_lost(self, exc: Exception | None) -> None:
        """Forget the connection."""
        self._end_deadline()
        super().connection_lost(exc)

    def _wait(self) -> None:
        self._end_deadline()
        self.waiting[self] = None
        self._deadline = self.loop.call_later(REQUEST_SECONDS, self.transport.abort)

    def _look(self) -> None:
        if self in self.waiting and self.cycle and not (self.cycle.more_body or self.cycle.response_complete):
            self._end_deadline()
            self._deadline = self.loop.call_later(ANSWER_SECONDS, self.transport.abort)

    def _end_deadline(self) -> None:
        self.waiting.pop(self, None)
        if self._deadline:
            self._deadline.cancel()
