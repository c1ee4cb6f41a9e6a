"""A web server that takes notices, and notices."""

import json
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, HTTPServer
from typing import Any

from monitor.text.notices import Notice
from tests.support.monitor.history import change

NOTICE = Notice(kind="alarm", site="bridge", time=5, utc="then", state="alarm", text="200 g", alarm=4)
ALARM = change(10, "alarm", "ALARM: a mass")


class Server:
    """A web server on loopback that keeps its requests and responds as set."""

    def __init__(self) -> None:
        self.got: list[dict[str, Any]] = []
        self.headers: list[dict[str, str]] = []
        self.answer = 200
        self.retry_after = ""  # what it asks for when it refuses
        self.refused = 0
        outer = self

        class Handler(BaseHTTPRequestHandler):
            def do_POST(self) -> None:
                body = self.rfile.read(int(self.headers["Content-Length"]))
                if outer.answer < 300:
                    outer.got.append(json.loads(body))
                    outer.headers.append(dict(self.headers))
                outer.refused += outer.answer >= 300
                self.send_response(outer.answer)
                if outer.retry_after:
                    self.send_header("Retry-After", outer.retry_after)
                self.end_headers()

            def log_message(self, *_: object) -> None:
                """Print nothing."""

        self._server = HTTPServer(("127.0.0.1", 0), Handler)
        self.url = f"http://127.0.0.1:{self._server.server_port}/hook"

    @contextmanager
    def running(self) -> Iterator["Server"]:
        thread = threading.Thread(target=self._server.serve_forever, args=(0.01,))
        thread.start()
        try:
            yield self
        finally:
            self._server.shutdown()
            self._server.server_close()
            thread.join()


def until(condition: Callable[[], object]) -> None:
    end = time.monotonic() + 5.0
    while not condition():
        assert time.monotonic() < end, "nothing happened"
        time.sleep(0.01)
