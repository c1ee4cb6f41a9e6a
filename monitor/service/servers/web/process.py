"""The server in a process of its own: nothing a visitor does can touch the watch."""

import asyncio
import multiprocessing
import os
import socket
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from ipaddress import ip_address
from typing import Any, ClassVar

import uvicorn
from starlette.types import ASGIApp
from uvicorn.protocols.http.h11_impl import H11Protocol

from monitor.errors import StartError
from monitor.service.processes import LastWords, deaf_to_stop_signals, report_end
from monitor.service.servers.web.app import make_app
from monitor.service.servers.web.auth import read_token
from monitor.service.servers.web.source import Source

REQUEST_SECONDS = 10.0  #: time from connecting, or from the previous answer, until a request is complete
ANSWER_SECONDS = 30.0  #: time from then on until its answer has been received
MAX_CONNECTIONS = 512  #: above it, the connection that has waited longest for its request is closed


class BoundedProtocol(H11Protocol):
    """One connection; those that wait for a request are known to all of them, the oldest first.

    uvicorn's `timeout_keep_alive` counts from the last byte, and only between requests; `limit_concurrency` refuses
    requests but closes no connection.
    """

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


@dataclass(frozen=True, eq=False)
class WebServer:
    """A server that runs."""

    url: str
    process: multiprocessing.process.BaseProcess
    last_words: LastWords

    @property
    def problem(self) -> str | None:
        """Why nothing is served any more."""
        return None if self.process.is_alive() else self.last_words.text(self.process)


@contextmanager
def web_process(source: Source, host: str, port: int, token_file: str | None) -> Iterator[WebServer]:
    """Serve for as long as the context lasts.

    Raises
    ------
    StartError
        If the port is taken or the token cannot be used.
    """
    try:
        token = read_token(source.token_path(token_file))
        listener = listen(host, port)
    except (OSError, ValueError) as error:
        raise StartError(f"web: {host}:{port}: {error}") from error
    with listener:
        context = multiprocessing.get_context("spawn")
        last_words = LastWords()
        arguments = (source, listener, token, ip_address(host).is_loopback, os.getpid())
        process = context.Process(
            target=report_end, args=(last_words.sender, _serve, *arguments), name="web", daemon=True
        )
        with deaf_to_stop_signals():
            process.start()
        last_words.started()
    try:
        yield WebServer(page_url(host, port), process, last_words)
    finally:
        process.kill()
        process.join()


def listen(host: str, port: int) -> socket.socket:
    """Return a socket that accepts connections.

    Raises
    ------
    OSError
        If the port is taken.
    """
    return socket.create_server((host, port), family=socket.AF_INET6 if ":" in host else socket.AF_INET)


def page_url(host: str, port: int) -> str:
    """Return the address of a server for browsers."""
    return f"http://{f'[{host}]' if ':' in host else host}:{port}"


def _serve(source: Source, listener: socket.socket, token: str, open_to_look: bool, parent: int) -> None:
    os.nice(10)  # whoever looks waits for those who measure
    sys.setswitchinterval(0.001)  # s: answers wait for the thread that computes the next one
    threading.Thread(target=_end_with, args=(parent,), daemon=True).start()
    bounded_server(make_app(source, token=token, open_to_look=open_to_look)).run(sockets=[listener])


def bounded_server(app: ASGIApp) -> uvicorn.Server:
    """Return a server with the limits of `BoundedProtocol`."""
    config = uvicorn.Config(
        app,
        http=BoundedProtocol,
        ws="none",
        log_level="error",
        access_log=False,
        server_header=False,
        lifespan="off",
    )
    return uvicorn.Server(config)


def _end_with(parent: int) -> None:
    """End when the monitor has been killed."""
    while os.getppid() == parent:
        time.sleep(1.0)
    os._exit(0)
